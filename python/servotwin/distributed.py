"""Campaigns on Dask: pieces of shards are tasks, on any storage that fsspec knows.

A piece's files depend on nothing but the study, so whoever computes them, and however often, the bytes are
those of one machine. A worker that is lost loses the pieces that it was working on, and others do them; what
is in the storage already is taken over. Needs `distributed` and `fsspec`.
"""

from __future__ import annotations

import hashlib
import random
import tempfile
import time
from collections.abc import Callable
from pathlib import Path as _Path
from typing import Any, Optional, TypeVar, Union

import fsspec  # type: ignore[import-untyped, unused-ignore]
from distributed import Client, as_completed

from . import _servotwin as _native
from ._progress import told
from .study import Ran, merge
from .types import Progress

T = TypeVar("T")

ATTEMPTS = 8
"""How often an access to the storage is tried before it counts as failed."""


def campaign(
    study: _native.Study,
    client: Client,
    out: str,
    *,
    settings: Optional[list[str]] = None,
    threads: Optional[int] = None,
    storage_options: Optional[dict[str, Any]] = None,
    progress: Union[bool, Progress] = True,
) -> list[Ran]:
    """Simulate every fault in every case on the workers of `client`, into the folder `out`.

    `out` is a folder or an address that fsspec knows, such as "s3://bucket/study", and every worker
    must reach it. `threads` is for each piece, 1 without it, as a worker has as many pieces at a time
    as it has threads. A campaign that was interrupted, scheduler and all, goes on when it is called again.
    """
    options = storage_options or {}
    tasks = _native.tasks(study, settings)
    store = _Store(out, options)
    store.keep("study.toml", study.text)
    store.keep("system.toml", study.system.text)
    calibrations, futures = _submitted(study, client, out, options, tasks, threads or 1)
    variants = {future.key: task[4] for future, task in zip(futures, tasks)}
    all_variants, done = sum(variants.values()), 0
    try:
        with told(progress) as show:
            for future in as_completed(futures):  # type: ignore[no-untyped-call]
                future.result()
                done += variants[future.key]
                if show is not None:
                    show("simulating on Dask", done, all_variants)
        return _merge(store, tasks, settings)
    finally:
        client.cancel([*futures, *calibrations])  # type: ignore[no-untyped-call]


def _submitted(
    study: _native.Study, client: Any, out: str, options: dict[str, Any], tasks: Any, threads: int
) -> tuple[list[Any], list[Any]]:
    """What computes the specimens that pieces need, and the pieces."""
    # Texts stay in the storage: there may be tens of thousands of pieces.
    mark = _mark(study.text, study.system.text)
    where = (mark, out, options)
    # What pieces need that is computed once for all of them.
    needed = {task[5]: task for task in tasks if task[5] is not None}
    calibrations = {
        file: client.submit(
            _calibration,
            *where,
            file,
            task[1],
            threads,
            key=_key(f"{study.name} {file}", out, mark),
            pure=False,
            retries=3,
        )
        for file, task in needed.items()
    }
    futures = [
        client.submit(
            _piece,
            *where,
            task,
            threads,
            calibrations.get(task[5]),
            key=_piece_key(study.name, task, out, mark),
            pure=False,
            retries=3,
        )
        for task in tasks
    ]
    return list(calibrations.values()), futures


def _mark(*about: Any) -> str:
    return hashlib.sha256(repr(about).encode()).hexdigest()[:16]


def _key(name: str, *about: Any) -> str:
    """A task's name on the dashboard: the same work on the same study in the same place has one."""
    return f"servotwin {name}-{_mark(*about)}"


def _piece_key(name: str, task: Any, *about: Any) -> str:
    settings, training, shards = task[:3]
    role = "training" if training else "judged"
    return _key(f"{name} {'+'.join(settings)} {role}-{shards[0]}", *about)


def _merge(store: _Store, tasks: Any, settings: Optional[list[str]]) -> list[Ran]:
    """Join the shards here, and put what comes of it into the storage."""
    if store.local is not None:
        return merge(store.local, settings=settings, progress=False)
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        folder = _Path(name)
        (folder / "shards").mkdir()
        calibrations = sorted({task[5] for task in tasks if task[5] is not None})
        shards = [f"shards/{file}" for task in tasks for file in task[3]]
        for file in ["study.toml", "system.toml", *calibrations, *shards]:
            if not store.fetch(file, folder / file):
                raise FileNotFoundError(f"{store.address}/{file} has vanished from the storage")
        ran = merge(folder, settings=settings, progress=False)
        # The manifest last: where it is, everything is.
        files = sorted(folder.glob("dataset-*.parquet")) + [folder / "manifest.json"]
        for path in files:
            store.put(path, path.name)
        return ran


_STUDIES: dict[str, _native.Study] = {}
"""The study that this process works on, with its plans; by its mark."""


def _study(store: _Store, mark: str) -> _native.Study:
    known = _STUDIES.get(mark)
    if known is None:
        texts = [store.text(name) for name in ("study.toml", "system.toml")]
        if _mark(*texts) != mark:
            raise ValueError(f"the study in {store.address} is not that of this campaign")
        known = _native.Study.parse(texts[0], "study.toml", texts[1])
        _STUDIES.clear()
        _STUDIES[mark] = known
    return known


def _calibration(
    mark: str,
    out: str,
    options: dict[str, Any],
    file: str,
    training: bool,
    threads: int,
) -> None:
    """Fit the specimens that all pieces fly with, and put them into the storage."""
    store = _Store(out, options)
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        path = _Path(name) / file
        before = path.read_bytes() if store.fetch(file, path) else None
        _native.run_calibration(_study(store, mark), name, training, threads)
        if before != path.read_bytes():
            store.put(path, file)


def _piece(
    mark: str,
    out: str,
    options: dict[str, Any],
    task: Any,
    threads: int,
    calibrated: None,
) -> dict[str, float]:
    """Simulate one piece in a worker, and put its shards into the storage."""
    begin = time.monotonic()
    settings, training, shards, files, _, needed = task
    store = _Store(out, options)
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        folder = _Path(name)
        (folder / "shards").mkdir()
        if needed is not None:
            store.fetch(needed, folder / needed)
        there = {f for f in files if store.fetch(f"shards/{f}", folder / "shards" / f)}
        before = {f: (folder / "shards" / f).read_bytes() for f in there}
        study = _study(store, mark)
        variants, resumed = _native.run_task(
            study, folder, settings, training, shards, threads
        )
        for file in files:
            path = folder / "shards" / file
            if before.get(file) != path.read_bytes():
                store.put(path, f"shards/{file}")
        size = sum((folder / "shards" / file).stat().st_size for file in files)
    return {
        "variants": variants,
        "resumed": resumed,
        "bytes": size,
        "seconds": time.monotonic() - begin,
    }


class _Store:
    """A folder in a storage; what fails is tried again, and files appear whole or not at all."""

    def __init__(self, address: str, options: dict[str, Any]) -> None:
        self.address = str(address).rstrip("/")
        self.fs, self.root = fsspec.core.url_to_fs(self.address, **options)
        protocol = self.fs.protocol
        is_local = "file" in ((protocol,) if isinstance(protocol, str) else protocol)
        self.local = _Path(self.root) if is_local else None

    def keep(self, name: str, text: str) -> None:
        """Write a text that must be the same where it is there already."""
        known = self._again(lambda: self._read(name))
        if known is not None and known != text.encode():
            raise ValueError(
                f"{self.address}/{name} is of another study; choose another folder"
            )
        if known is None:
            with tempfile.TemporaryDirectory(prefix="servotwin-") as folder:
                path = _Path(folder) / name
                path.write_bytes(text.encode())
                self.put(path, name)

    def text(self, name: str) -> str:
        """A text that must be there."""
        content = self._again(lambda: self._read(name))
        if content is None:
            raise FileNotFoundError(f"{self.address}/{name} has vanished from the storage")
        return content.decode()

    def _read(self, name: str) -> Optional[bytes]:
        try:
            with self.fs.open(f"{self.root}/{name}", "rb") as file:
                content: bytes = file.read()
                return content
        except FileNotFoundError:
            return None

    def fetch(self, name: str, path: _Path) -> bool:
        """Copy a file here; whether it was there."""
        content = self._again(lambda: self._read(name))
        if content is not None:
            path.write_bytes(content)
        return content is not None

    def put(self, path: _Path, name: str) -> None:
        """Copy a file there, whole or not at all."""
        target = f"{self.root}/{name}"

        def write() -> None:
            if self.local is None:
                # An object appears when all of it is there.
                self.fs.pipe_file(target, path.read_bytes())
                return
            folder = target.rsplit("/", 1)[0]
            self.fs.makedirs(folder, exist_ok=True)
            temporary = f"{folder}/.servotwin-{random.SystemRandom().getrandbits(64):016x}.tmp"
            try:
                self.fs.pipe_file(temporary, path.read_bytes())
                self.fs.mv(temporary, target)
            finally:
                if self.fs.exists(temporary):
                    self.fs.rm(temporary)

        self._again(write)

    def _again(self, access: Callable[[], T]) -> T:
        for attempt in range(ATTEMPTS):
            try:
                return access()
            except OSError:
                self.fs.invalidate_cache()
                if attempt == ATTEMPTS - 1:
                    raise
                time.sleep(min(0.05 * 2**attempt, 2.0))
        raise AssertionError("not reached")
