"""Hybrid twins of electro-hydraulic servo actuators.

>>> import servotwin
>>> system = servotwin.System()
>>> run = servotwin.simulate(system, inputs={"command": "step:size=2deg,at=0.1s"}, duration_s=0.5)
>>> run.units["p_a_1_pa"]
'Pa'

Numbers are in SI units, and the name of every column ends in its unit.
"""

from ._servotwin import System, Table, Twin, __version__, simulate, simulate_many
from .errors import (
    Error,
    FileError,
    InputError,
    MissingFileError,
    Mistake,
    MistakesError,
    RunError,
    UnknownNameError,
)

__all__ = [
    "Error",
    "FileError",
    "InputError",
    "MissingFileError",
    "Mistake",
    "MistakesError",
    "RunError",
    "System",
    "Table",
    "Twin",
    "UnknownNameError",
    "__version__",
    "simulate",
    "simulate_many",
]
