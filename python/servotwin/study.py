"""The stages of the main job over folders: campaign, features, train, evaluate, flights, report.

Each reads what the one before has left in the folder, as the commands of the same names do, and writes
the same bytes. `progress` is True for a bar of tqdm (where it is installed), False for none, or a function
of what is being done, how much is done and how much there is.
"""

from __future__ import annotations

import html
import json
import os
from pathlib import Path as _Path
from typing import Any, NamedTuple, Optional, Union

from . import _servotwin as _native
from ._progress import told
from .types import Path, Progress


class Ran(NamedTuple):
    """What a campaign has done in some settings."""

    settings: list[str]
    training: bool
    variants: int
    resumed: int
    failed: list[tuple[str, int, str]]
    """Variants that could not be finished: setting, variant, reason."""


class Report(NamedTuple):
    """A report's file; a notebook shows it."""

    path: _Path

    def _repr_html_(self) -> str:
        page = html.escape(self.path.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 40em; border: 0"></iframe>'


def campaign(
    study: _native.Study,
    out: Path,
    *,
    settings: Optional[list[str]] = None,
    threads: Optional[int] = None,
    part: Optional[str] = None,
    progress: Union[bool, Progress] = True,
) -> list[Ran]:
    """Simulate every fault in every case into the data sets of a folder.

    A campaign that was interrupted goes on where it was. With `part`, such as "3/100", only that
    part is simulated, and `merge` makes the data sets when all parts have ended.
    """
    with told(progress) as show:
        done = _native.run_campaign(study, os.fspath(out), settings, threads, part, show)
    return [Ran(*one) for one in done]


def merge(
    out: Path,
    *,
    settings: Optional[list[str]] = None,
    progress: Union[bool, Progress] = True,
) -> list[Ran]:
    """Join the parts of a campaign to data sets: the bytes of a campaign in one go."""
    with told(progress) as show:
        return [Ran(*one) for one in _native.merge_shards(os.fspath(out), settings, show)]


def features(out: Path, *, progress: Union[bool, Progress] = True) -> list[_Path]:
    """Compute the features of a folder anew, without simulating; gives the files."""
    with told(progress) as show:
        return [_Path(file) for file in _native.make_features(os.fspath(out), show)]


def train(
    out: Path, *, threads: Optional[int] = None, progress: Union[bool, Progress] = True
) -> dict[str, _Path]:
    """Train trees and committee for every data set of a folder; gives their files."""
    with told(progress) as show:
        trained = _native.train_folder(os.fspath(out), threads, show)
    return {subject: _Path(file) for subject, file in trained}


def evaluate(
    out: Path, *, threads: Optional[int] = None, progress: Union[bool, Progress] = True
) -> dict[str, Any]:
    """Judge what was trained under every protocol; gives what `evaluation.json` holds."""
    with told(progress) as show:
        text = _native.evaluate_folder(os.fspath(out), threads, show)
    results: dict[str, Any] = json.loads(text)
    return results


def flights(
    study: _native.Study,
    out: Path,
    *,
    full: bool = False,
    threads: Optional[int] = None,
    progress: Union[bool, Progress] = True,
) -> dict[str, Any]:
    """Learn and judge in flights in which faults begin; gives what `flights.json` holds.

    Writes a `diagnoser-….json` for every setting. `full` are the full sizes of the study.
    """
    with told(progress) as show:
        text = _native.fly_all(study, os.fspath(out), full, threads, show)
    results: dict[str, Any] = json.loads(text)
    return results


def report(out: Path) -> Report:
    """Write the report of a folder that was evaluated."""
    return Report(_Path(_native.write_report(os.fspath(out))))


def data_set(out: Path, setting: str = "noise", *, training: bool = False) -> _native.Table:
    """The data set of a setting: labels and features, a row for each variant."""
    return _native.data_set(os.fspath(out), setting, training)


def feature_columns(table: Any) -> list[str]:
    """The columns of a data set that a classifier may learn from: its features in all views.

    `table` is a `Table`, a data frame, or anything else with `columns`. Labels, intensities (`i:FAULT`),
    `grade`, numbers of variants and what detection found are not among them, because they hold the answer.
    """
    return _native.feature_columns([str(name) for name in table.columns])


def trees(path: Path) -> dict[str, _native.Tree]:
    """The trees of a `hierarchy-….json`, by the names of their stages."""
    return dict(_native.read_trees(os.fspath(path)))
