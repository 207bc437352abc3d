"""Hybrid twins of electro-hydraulic servo actuators.

>>> import servotwin
>>> system = servotwin.System()
>>> run = servotwin.simulate(system, inputs={"command": "step:size=2deg,at=0.1s"}, duration_s=0.5)
>>> run.units["p_a_1_pa"]
'Pa'

A study simulates every fault, trains the diagnosis, judges it, and writes a report:

>>> results = servotwin.Study().run("out")  # doctest: +SKIP
>>> results.table("noise").to_pandas()  # doctest: +SKIP
>>> results.trees["noise"]["A"]  # doctest: +SKIP
>>> results.report()  # doctest: +SKIP

Numbers are in SI units, and the name of every column ends in its unit. `servotwin.estimators` has
classifiers for scikit-learn, and `servotwin.distributed` runs suites on Dask.
"""

from ._servotwin import (
    Diagnoser,
    Fitted,
    Outcome,
    Results,
    Study,
    System,
    Table,
    Tree,
    Twin,
    __version__,
    fit_record,
    simulate,
    simulate_many,
    watch,
)
from .errors import (
    Error,
    FileError,
    InputError,
    MissingFileError,
    Mistake,
    MistakesError,
    RunError,
    StageError,
    UnknownNameError,
)
from .live_page import Live, live
from .study import Report, data_set, feature_columns, report, run_suites, trees

__all__ = [
    "Diagnoser",
    "Error",
    "FileError",
    "Fitted",
    "InputError",
    "Live",
    "MissingFileError",
    "Mistake",
    "MistakesError",
    "Outcome",
    "Report",
    "Results",
    "RunError",
    "StageError",
    "Study",
    "System",
    "Table",
    "Tree",
    "Twin",
    "UnknownNameError",
    "__version__",
    "data_set",
    "feature_columns",
    "fit_record",
    "live",
    "report",
    "run_suites",
    "simulate",
    "simulate_many",
    "trees",
    "watch",
]
