"""A storage that breaks off every tenth write half-way; workers of Dask load it (`--preload`)."""

import os
from pathlib import Path

import fsspec
from fsspec.implementations.local import LocalFileSystem


class Flaky(LocalFileSystem):
    """A local folder behind "flaky://"; each failure leaves a file in the folder FLAKY_NOTES."""

    protocol = ("flaky", "file")
    writes = 0

    @classmethod
    def _strip_protocol(cls, path):
        return super()._strip_protocol(str(path).removeprefix("flaky://"))

    def pipe_file(self, path, value, **options):
        Flaky.writes += 1
        if Flaky.writes % 10 == 3:
            super().pipe_file(path, value[: len(value) // 2], **options)
            (Path(os.environ["FLAKY_NOTES"]) / f"{os.getpid()}-{Flaky.writes}").touch()
            raise OSError("the disk has a bad day")
        super().pipe_file(path, value, **options)


fsspec.register_implementation("flaky", Flaky, clobber=True)
