"""Types of arguments."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Union

if TYPE_CHECKING:  # a suite needs no numpy, whose start and threads take as long as 3 s of simulation
    import numpy as np
    import numpy.typing as npt

Path = Union[str, "os.PathLike[str]"]
"""A file or folder."""

Signal = Union[str, float, Sequence[float], "npt.NDArray[np.float64]"]
"""An input: a text as on the command line, a constant in SI, or its values at every sample."""

Progress = Callable[[str, int, int], Any]
"""Called with the task, the amount done and the whole amount."""

Method = Literal["rodas3", "rodas4p2", "rodas5p", "rk4"]
"""A method of the solver."""

Between = Literal["hold", "line", "cubic"]
"""How an input moves between two samples."""


class Variant(TypedDict, total=False):
    """A variant of a run; every entry is optional."""

    inputs: dict[str, Signal]
    faults: dict[str, float]
    parameters: dict[str, float]
