"""The stages of a study over folders: campaign, train, evaluate, flights, report.

`Study.run` runs them all. Each stage reads what the earlier ones left in the folder, as the command of the
same name does, and writes the same bytes. `progress` is True for a bar of tqdm (where it is installed), False
for none, or a function of the task, the amount done and the whole amount.
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
    """The outcome of a campaign in some scenarios.

    Attributes
    ----------
    scenarios : list of str
        The scenarios.
    training : bool
        Whether these are the training commands.
    variants : int
        The number of variants.
    resumed : int
        The number of variants that an earlier run had simulated.
    failed : list of (str, int, str)
        Scenario, variant and reason of each variant that could not be simulated to its end.
    """

    scenarios: list[str]
    training: bool
    variants: int
    resumed: int
    failed: list[tuple[str, int, str]]


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


def campaign(
    study: _native.Study,
    out: Path,
    *,
    scenarios: Optional[list[str]] = None,
    threads: Optional[int] = None,
    share: Optional[str] = None,
    progress: Union[bool, Progress] = True,
) -> list[Ran]:
    """Simulate every fault in every operating case into the data sets of a folder.

    An interrupted campaign resumes where it stopped.

    Parameters
    ----------
    study : Study
        The study.
    out : path
        The output folder.
    scenarios : list of str, optional
        The scenarios; "ideal", "noise" and "realistic" by default.
    threads : int, optional
        The number of threads; all processors by default.
    share : str, optional
        A share such as "3/100". When all shares have ended, `merge` makes the data sets.
    progress : bool or callable
        See the module.

    Returns
    -------
    list of Ran
    """
    with told(progress) as show:
        done = _native.run_campaign(study, os.fspath(out), scenarios, threads, share, show)
    return [Ran(*one) for one in done]


def merge(
    out: Path,
    *,
    scenarios: Optional[list[str]] = None,
    progress: Union[bool, Progress] = True,
) -> list[Ran]:
    """Join the parts of a campaign to data sets, without simulating, with the bytes of a whole campaign.

    Parameters
    ----------
    out : path
        The folder of all shares.
    scenarios : list of str, optional
        The scenarios; "ideal", "noise" and "realistic" by default.
    progress : bool or callable
        See the module.

    Returns
    -------
    list of Ran
    """
    with told(progress) as show:
        return [Ran(*one) for one in _native.merge_parts(os.fspath(out), scenarios, show)]


def train(
    out: Path, *, threads: Optional[int] = None, progress: Union[bool, Progress] = True
) -> dict[str, _Path]:
    """Train trees and committee for every data set of a folder.

    Parameters
    ----------
    out : path
        The folder of a campaign.
    threads : int, optional
        The number of threads; all processors by default.
    progress : bool or callable
        See the module.

    Returns
    -------
    dict of pathlib.Path
        The file of each scenario.
    """
    with told(progress) as show:
        trained = _native.train_folder(os.fspath(out), threads, show)
    return {subject: _Path(file) for subject, file in trained}


def evaluate(
    out: Path, *, threads: Optional[int] = None, progress: Union[bool, Progress] = True
) -> dict[str, Any]:
    """Judge the trained diagnosis under every protocol.

    Parameters
    ----------
    out : path
        The folder of a trained campaign.
    threads : int, optional
        The number of threads; all processors by default.
    progress : bool or callable
        See the module.

    Returns
    -------
    dict
        The content of `evaluation.json`.
    """
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
    """Train a diagnoser for each scenario in flights, and judge it in other flights.

    Parameters
    ----------
    study : Study
        The study.
    out : path
        The output folder; it receives a `diagnoser-SCENARIO.json` for each scenario.
    full : bool
        Whether to fly the full sizes of the study.
    threads : int, optional
        The number of threads; all processors by default.
    progress : bool or callable
        See the module.

    Returns
    -------
    dict
        The content of `flights.json`.
    """
    with told(progress) as show:
        text = _native.fly_all(study, os.fspath(out), full, threads, show)
    results: dict[str, Any] = json.loads(text)
    return results


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
        The folder of a campaign.
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
