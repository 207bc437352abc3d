"""Suites of a study, and the files of its output folder.

`Study.run` runs a study whole. `progress` is True for a bar of tqdm (where it is installed), False for none, or a
function of the task, the amount done and the whole amount.
"""

from __future__ import annotations

import html
import os
from collections.abc import Sequence
from pathlib import Path as _Path
from typing import Any, NamedTuple, Optional, Union

from . import _servotwin as _native
from ._progress import told
from .types import Path, Progress


class Report(NamedTuple):
    """A report, which a notebook shows.

    Attributes
    ----------
    path : pathlib.Path
        The HTML file.
    """

    path: _Path

    def _repr_html_(self) -> str:
        page = html.escape(self.path.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 40em; border: 0"></iframe>'


def _run(
    study: _native.Study,
    out: Path,
    fitted: bool,
    replace: bool,
    threads: Optional[int],
    progress: Union[bool, Progress, None],
) -> _native.Results:
    """`Study.run` with its progress."""
    with told(True if progress is None else progress) as show:
        return _native.run_study(study, os.fspath(out), fitted, replace, threads, show)


def run_suites(
    study: _native.Study,
    out: Path,
    suites: Sequence[str],
    *,
    scenarios: Optional[Sequence[str]] = None,
    share: Optional[str] = None,
    threads: Optional[int] = None,
    progress: Union[bool, Progress] = True,
) -> None:
    """Run some suites of a study into a folder, as `servotwin study --suite` does.

    An interrupted run goes on where it stopped.

    Parameters
    ----------
    study : Study
        The study.
    out : path
        The output folder.
    suites : list of str
        "records" for the data sets, "flights" to learn in flights and to judge, or names of suites of flights, which
        are flown with the diagnosers in the folder.
    scenarios : list of str, optional
        The scenarios; by default "ideal", "noise" and "realistic", as far as a suite has them.
    share : str, optional
        A share such as "3/100". When all shares have ended, the same call without it joins them.
    threads : int, optional
        The number of threads; all processors by default.
    progress : bool or callable
        See the module.
    """
    with told(progress) as show:
        names = None if scenarios is None else list(scenarios)
        _native.run_suites(study, os.fspath(out), list(suites), names, share, threads, show)


def report(out: Path) -> Report:
    """Write the report of an evaluated folder.

    Parameters
    ----------
    out : path
        The folder.

    Returns
    -------
    Report
    """
    return Report(_Path(_native.write_report(os.fspath(out))))


def data_set(out: Path, scenario: str = "noise", *, training: bool = False) -> _native.Table:
    """Read the data set of a scenario: labels and features, one row for each variant.

    Parameters
    ----------
    out : path
        The output folder.
    scenario : str
        The scenario: "ideal", "noise", "fitted" or "realistic".
    training : bool
        Whether to read the variants under the training commands.

    Returns
    -------
    Table
    """
    return _native.data_set(os.fspath(out), scenario, training)


def feature_columns(table: Any) -> list[str]:
    """Return the columns of a data set that a classifier may learn from.

    Labels, intensities (`i:FAULT`), `grade`, numbers of variants and the results of the detection are not
    among them, because they hold the answer.

    Parameters
    ----------
    table : Table or data frame
        A data set, or anything else with `columns`.

    Returns
    -------
    list of str
        The features in all views.
    """
    return _native.feature_columns([str(name) for name in table.columns])


def trees(path: Path) -> dict[str, _native.Tree]:
    """Read the trees of a diagnoser; of several windows, those of the first.

    Parameters
    ----------
    path : path
        A `records-SCENARIO.json` or `diagnoser-SCENARIO.json`.

    Returns
    -------
    dict of Tree
        The trees by the letters of their stages.
    """
    return dict(_native.read_trees(os.fspath(path)))
