"""Suites on Dask, on any storage that fsspec knows.

The files of a part depend only on the study, so the bytes are those of one machine. If a worker is lost,
others compute its parts. Parts that are already in the storage are not computed again. This module needs
`distributed` and `fsspec`.
"""

from __future__ import annotations

import hashlib
import itertools
import random
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path as _Path
from typing import Any, Optional, TypeVar, Union

import fsspec  # type: ignore[import-untyped, unused-ignore]
from distributed import Client, as_completed

from . import _servotwin as _native
from ._progress import told
from .types import Progress

T = TypeVar("T")

ATTEMPTS = 8
"""How often an access to the storage is tried before it counts as failed."""


def run_suites(
    study: _native.Study,
    client: Client,
    out: str,
    suites: Sequence[str],
    *,
    scenarios: Optional[Sequence[str]] = None,
    threads: Optional[int] = None,
    storage_options: Optional[dict[str, Any]] = None,
    progress: Union[bool, Progress] = True,
) -> None:
    """Run suites on the workers of a client; the caller trains, and joins what they have computed.

    An interrupted run goes on where it stopped, also with another scheduler.

    Parameters
    ----------
    study : Study
        The study.
    client : distributed.Client
        The client.
    out : str
        A folder, or an address that fsspec knows, such as "s3://bucket/study"; every worker must reach it.
    suites : list of str
        As in `servotwin.run_suites`.
    scenarios : list of str, optional
        As in `servotwin.run_suites`.
    threads : int, optional
        The threads of each task; 1 by default, because a worker computes one on each of its threads.
    storage_options : dict, optional
        Options for fsspec.
    progress : bool or callable
        As in `servotwin.run_suites`.
    """
    options = storage_options or {}
    names = None if scenarios is None else list(scenarios)
    tasks = _native.tasks_of(study, list(suites), names)
    store = _Store(out, options)
    store.keep("study.toml", study.text)
    store.keep("system.toml", study.system.text)
    sent: list[Any] = []
    try:
        with told(progress) as show:
            # Tasks with the same needs come one after the other.
            for needs, group in itertools.groupby(tasks, key=lambda task: task[5]):
                for file in needs:
                    _prepare(study, store, file)
                own = list(group)
                futures = _submitted(study, client, (out, options), own, threads or 1)
                sent.extend(futures)
                _watched(f"{own[0][0]} on Dask", futures, [task[4] for task in own], show)
        with _mirrored(store) as folder:
            before = _written(folder)
            _native.join_suites(study, folder, list(suites), names)
            # The manifest last: where it is, everything is.
            made = sorted(_written(folder) - before - {"manifest.json"})
            store.put_all(folder, [*made, "manifest.json"])
    finally:
        client.cancel(sent)  # type: ignore[no-untyped-call]


def _written(folder: _Path) -> set[str]:
    """The files of an output folder beside its parts."""
    return {path.name for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")}


def _prepare(study: _native.Study, store: _Store, file: str) -> None:
    """Compute here what tasks need, and put it into the storage."""
    with _mirrored(store) as folder:
        before = _written(folder)
        _native.prepare_file(study, folder, file)
        store.put_all(folder, [file, *sorted(_written(folder) - before - {file})])


def _watched(what: str, futures: list[Any], weights: list[int], show: Optional[Progress]) -> list[Any]:
    """The results of futures in their order, with progress by their weights."""
    weight = {future.key: one for future, one in zip(futures, weights)}
    done = 0
    for future in as_completed(futures):  # type: ignore[no-untyped-call]
        future.result()
        done += weight[future.key]
        if show is not None:
            show(what, done, sum(weights))
    return [future.result() for future in futures]


def _submitted(
    study: _native.Study,
    client: Any,
    where: tuple[str, dict[str, Any]],
    tasks: list[Any],
    threads: int,
) -> list[Any]:
    """The tasks as Dask's. Texts stay in the storage: there may be tens of thousands of tasks."""
    mark = _mark(study.text, study.system.text)

    def submit(task: Any) -> Any:
        suite, scenarios, part = task[:3]
        name = f"{study.name} {suite} {'+'.join(scenarios)} {part}"
        key = f"servotwin {name}-{_mark(where[0], mark)}"
        return client.submit(_part, mark, *where, task, threads, key=key, pure=False, retries=3)

    return [submit(task) for task in tasks]


def _mark(*about: Any) -> str:
    return hashlib.sha256(repr(about).encode()).hexdigest()[:16]


_STUDIES: dict[str, _native.Study] = {}
"""The study that this process works on, by its mark."""


def _study(store: _Store, mark: str) -> _native.Study:
    known = _STUDIES.get(mark)
    if known is None:
        texts = [store.text(name) for name in ("study.toml", "system.toml")]
        if _mark(*texts) != mark:
            raise ValueError(f"the study in {store.address} is another one")
        known = _native.Study.parse(texts[0], "study.toml", texts[1])
        _STUDIES.clear()
        _STUDIES[mark] = known
    return known


@contextmanager
def _mirrored(store: _Store) -> Iterator[_Path]:
    """The folder itself where it is local, else a copy that is thrown away."""
    if store.local is not None:
        yield store.local
        return
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        store.fetch_all(_Path(name))
        yield _Path(name)


def _part(
    mark: str, out: str, options: dict[str, Any], task: Any, threads: int
) -> dict[str, float]:
    """Compute one part in a worker, and put its files into the storage."""
    begin = time.monotonic()
    files, runs, needs = task[3:6]
    store = _Store(out, options)
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        folder = _Path(name)
        (folder / "parts").mkdir()
        for file in needs:
            store.fetch(file, folder / file)
        there = [file for file in files if store.fetch(file, folder / file)]
        before = {file: (folder / file).read_bytes() for file in there}
        _native.run_task(_study(store, mark), folder, task, threads)
        for file in files:
            path = folder / file
            if before.get(file) != path.read_bytes():
                store.put(path, file)
        size = sum((folder / file).stat().st_size for file in files)
    return {"runs": runs, "bytes": size, "seconds": time.monotonic() - begin}


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

    def fetch_all(self, folder: _Path) -> None:
        """Copy all that is there."""
        for path in self._again(lambda: self.fs.find(self.root)):
            name = str(path).split(self.root.strip("/") + "/", 1)[1]
            if not name.endswith(".tmp"):
                (folder / name).parent.mkdir(exist_ok=True)
                self.fetch(name, folder / name)

    def put_all(self, folder: _Path, names: list[str]) -> None:
        """Copy files there, unless the folder is the storage itself."""
        if self.local is None:
            for name in names:
                self.put(folder / name, name)

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
