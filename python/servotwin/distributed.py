"""Campaigns, evaluations and flights on Dask, on any storage that fsspec knows.

The files of a piece depend only on the study, so the bytes are those of one machine. If a worker is lost,
others compute its pieces. Pieces that are already in the storage are not computed again. This module needs
`distributed` and `fsspec`.
"""

from __future__ import annotations

import hashlib
import json
import random
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
    scenarios: Optional[list[str]] = None,
    threads: Optional[int] = None,
    storage_options: Optional[dict[str, Any]] = None,
    progress: Union[bool, Progress] = True,
) -> list[Ran]:
    """Simulate every fault in every operating case on the workers of a client.

    An interrupted campaign resumes where it stopped, also with another scheduler.

    Parameters
    ----------
    study : Study
        The study.
    client : distributed.Client
        The client.
    out : str
        A folder, or an address that fsspec knows, such as "s3://bucket/study"; every worker must reach it.
    scenarios : list of str, optional
        The scenarios; "ideal", "noise" and "realistic" by default.
    threads : int, optional
        The threads of each piece; 1 by default, because a worker computes one piece on each of its threads.
    storage_options : dict, optional
        Options for fsspec.
    progress : bool or callable
        As in `servotwin.campaign`.

    Returns
    -------
    list of Ran
    """
    options = storage_options or {}
    tasks = _native.tasks(study, scenarios)
    store = _Store(out, options)
    store.keep("study.toml", study.text)
    store.keep("system.toml", study.system.text)
    calibrations, futures = _submitted(study, client, out, options, tasks, threads or 1)
    try:
        with told(progress) as show:
            _watched("simulating on Dask", futures, [task[4] for task in tasks], show)
        return _merge(store, tasks, scenarios)
    finally:
        client.cancel([*futures, *calibrations])  # type: ignore[no-untyped-call]


def evaluate(
    client: Client,
    out: str,
    *,
    threads: Optional[int] = None,
    storage_options: Optional[dict[str, Any]] = None,
    progress: Union[bool, Progress] = True,
) -> dict[str, Any]:
    """Judge a trained folder, each scenario on a worker of a client.

    Workers read data sets, parts and trained files where `servotwin.campaign` and `servotwin.train` have left
    them; each worker copies them from a storage.

    Parameters
    ----------
    client : distributed.Client
        The client.
    out : str
        The folder or address of a trained campaign.
    threads : int, optional
        The threads of each piece; 1 by default.
    storage_options : dict, optional
        Options for fsspec.
    progress : bool or callable
        As in `servotwin.evaluate`.

    Returns
    -------
    dict
        The content of `evaluation.json`.
    """
    options = storage_options or {}
    store = _Store(out, options)
    with _mirrored(store) as folder:
        mark = _mark((folder / "manifest.json").read_bytes(), out)
        futures = [
            client.submit(
                _judged,
                (mark, out, options),
                subject,
                threads or 1,
                key=_key(f"evaluation {subject}", mark),
                pure=False,
                retries=3,
            )
            for subject in _native.evaluation_subjects(folder)
        ]
        try:
            with told(progress) as show:
                found = _watched("evaluating on Dask", futures, [1] * len(futures), show)
        finally:
            client.cancel(futures)  # type: ignore[no-untyped-call]
        results: dict[str, Any] = json.loads(_native.join_evaluation(folder, found))
        store.put_all(folder, ["evaluation.json", "manifest.json"])
    return results


def flights(
    study: _native.Study,
    client: Client,
    out: str,
    *,
    full: bool = False,
    threads: Optional[int] = None,
    storage_options: Optional[dict[str, Any]] = None,
    progress: Union[bool, Progress] = True,
) -> dict[str, Any]:
    """Train and judge in flights, those of each environment on a worker of a client.

    Parameters
    ----------
    study : Study
        The study.
    client : distributed.Client
        The client.
    out : str
        The output folder or address.
    full : bool
        Whether to fly the full sizes of the study.
    threads : int, optional
        The threads of each piece; 1 by default.
    storage_options : dict, optional
        Options for fsspec.
    progress : bool or callable
        As in `servotwin.flights`.

    Returns
    -------
    dict
        The content of `flights.json`.
    """
    options = storage_options or {}
    store = _Store(out, options)
    store.keep("study.toml", study.text)
    store.keep("system.toml", study.system.text)
    pieces = _native.flight_pieces(study, full)
    where = (_mark(study.text, study.system.text), out, options)
    watched: list[tuple[str, str, list[str]]] = []
    sent: list[Any] = []

    def flown(scenario: str, suite: str, runs: list[int], known: Union[str, tuple[str, str]]) -> list[Any]:
        """What came of every environment of a suite, with the spreads to learn with or the file of the diagnoser."""
        futures = []
        for environment in range(len(runs)):
            key = _key(f"{study.name} {scenario} {suite} {environment}", where[:2], full, known)
            about = (full, scenario, suite, environment, known, threads or 1)
            futures.append(client.submit(_flown, where, *about, key=key, pure=False, retries=3))
        sent.extend(futures)
        return _watched(f"{scenario}: {suite}", futures, runs, show)

    with told(progress) as show, _mirrored(store, parts=False) as folder:
        try:
            diagnosers: dict[str, tuple[str, str]] = {}
            for scenario, suite, runs in pieces:
                # The first suite of a scenario is the one to learn from.
                if scenario in diagnosers:
                    texts = flown(scenario, suite, runs, diagnosers[scenario])
                    watched.append((scenario, suite, texts))
                    continue
                spreads = _native.learn_spreads(study, full, scenario, threads)
                texts = flown(scenario, suite, runs, spreads)
                _native.learn_from_flights(study, folder, full, scenario, spreads, texts, threads)
                file = f"diagnoser-{scenario}.json"
                store.put_all(folder, [file])
                diagnosers[scenario] = (file, _mark((folder / file).read_bytes()))
        finally:
            client.cancel(sent)  # type: ignore[no-untyped-call]
        results: dict[str, Any] = json.loads(_native.join_flights(study, folder, full, watched))
        made = [path.name for name in ("outcomes-*.parquet", "left_out-*.json") for path in folder.glob(name)]
        store.put_all(folder, ["flights.json", *sorted(made), "manifest.json"])
    return results


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
    scenarios, training, part = task[:3]
    role = "training" if training else "judged"
    return _key(f"{name} {'+'.join(scenarios)} {role}-{part}", *about)


def _merge(store: _Store, tasks: Any, scenarios: Optional[list[str]]) -> list[Ran]:
    """Join the parts here, and put what comes of it into the storage."""
    if store.local is not None:
        return merge(store.local, scenarios=scenarios, progress=False)
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        folder = _Path(name)
        (folder / "parts").mkdir()
        calibrations = sorted({task[5] for task in tasks if task[5] is not None})
        parts = [f"parts/{file}" for task in tasks for file in task[3]]
        for file in ["study.toml", "system.toml", *calibrations, *parts]:
            if not store.fetch(file, folder / file):
                raise FileNotFoundError(f"{store.address}/{file} has vanished from the storage")
        ran = merge(folder, scenarios=scenarios, progress=False)
        # The manifest last: where it is, everything is.
        data_sets = sorted(folder.glob("dataset-*.parquet"))
        files = [*data_sets, folder / "data-card.md", folder / "manifest.json"]
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


@contextmanager
def _mirrored(store: _Store, parts: bool = True) -> Iterator[_Path]:
    """The folder itself where it is local, else a copy that is thrown away."""
    if store.local is not None:
        yield store.local
        return
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        store.fetch_all(_Path(name), parts)
        yield _Path(name)


def _judged(where: tuple[str, str, dict[str, Any]], subject: str, threads: int) -> str:
    """Evaluate one subject in a worker."""
    _, out, options = where
    with _mirrored(_Store(out, options)) as folder:
        return _native.evaluate_subject(folder, subject, threads)


def _diagnoser(store: _Store, about: tuple[str, str]) -> str:
    name, mark = about
    text = store.text(name)
    if _mark(text.encode()) != mark:
        raise ValueError(f"{store.address}/{name} is not the diagnoser of these flights")
    return text


def _flown(
    where: tuple[str, str, dict[str, Any]],
    full: bool,
    scenario: str,
    suite: str,
    environment: int,
    about: Union[str, tuple[str, str]],
    threads: int,
) -> str:
    """Fly one environment of a suite in a worker, to learn from with spreads or watched by a diagnoser."""
    mark, out, options = where
    store = _Store(out, options)
    known = about if isinstance(about, str) else _diagnoser(store, about)
    study = _study(store, mark)
    return _native.fly_piece(study, full, scenario, suite, environment, known, threads)


def _piece(
    mark: str,
    out: str,
    options: dict[str, Any],
    task: Any,
    threads: int,
    calibrated: None,
) -> dict[str, float]:
    """Simulate one part in a worker, and put its files into the storage."""
    begin = time.monotonic()
    scenarios, training, part, files, _, needed = task
    store = _Store(out, options)
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        folder = _Path(name)
        (folder / "parts").mkdir()
        if needed is not None:
            store.fetch(needed, folder / needed)
        there = {f for f in files if store.fetch(f"parts/{f}", folder / "parts" / f)}
        before = {f: (folder / "parts" / f).read_bytes() for f in there}
        study = _study(store, mark)
        variants, resumed = _native.run_task(
            study, folder, scenarios, training, part, threads
        )
        for file in files:
            path = folder / "parts" / file
            if before.get(file) != path.read_bytes():
                store.put(path, f"parts/{file}")
        size = sum((folder / "parts" / file).stat().st_size for file in files)
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

    def fetch_all(self, folder: _Path, parts: bool) -> None:
        """Copy what stages have left, with the parts or without."""
        for path in self._again(lambda: self.fs.find(self.root)):
            name = str(path).split(self.root.strip("/") + "/", 1)[1]
            wanted = parts or not name.startswith("parts/")
            if wanted and not name.endswith(".tmp"):
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
