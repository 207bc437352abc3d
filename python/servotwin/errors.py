"""Exceptions of servotwin. Each keeps the place in the file and the allowed range, where there are any."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional


class Mistake(NamedTuple):
    """A mistake at its place in a file.

    Attributes
    ----------
    file : str
        The file.
    line, column : int
        The place, from 1.
    width : int
        The number of characters that are wrong.
    message : str
        The mistake.
    help : str, optional
        The remedy.
    range : tuple of float, optional
        The least and the largest number allowed, in SI.
    allowed : str, optional
        The allowed values, in words.
    """

    file: str
    line: int
    column: int
    width: int
    message: str
    help: Optional[str]
    range: Optional[tuple[float, float]]
    allowed: Optional[str]


class Error(Exception):
    """The base of all errors of servotwin.

    Attributes
    ----------
    file : str, optional
        The file that is wrong.
    line, column : int, optional
        The place in it, from 1.
    range : tuple of float, optional
        The least and the largest number allowed, in SI.
    allowed : str, optional
        The allowed values, in words.
    """

    file: Optional[str] = None
    line: Optional[int] = None
    column: Optional[int] = None
    range: Optional[tuple[float, float]] = None
    allowed: Optional[str] = None

    def __init__(self, message: str, **details: Any) -> None:
        super().__init__(message)
        self.__dict__.update(details)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_remade, (type(self), str(self), self.__dict__))


class MistakesError(Error, ValueError):
    """A file has mistakes.

    Attributes
    ----------
    mistakes : list of Mistake
        All mistakes, if the file was read to its end.
    """

    mistakes: list[Mistake] = []


class InputError(Error, ValueError):
    """A value is not allowed."""


class UnknownNameError(Error, ValueError, KeyError):
    """The system, or the table, has no such name.

    Attributes
    ----------
    given : str
        The name.
    nearest : str, optional
        A known name that is spelled alike.
    known : list of str
        All known names.
    """

    __str__ = Exception.__str__  # KeyError shows its message in quotes

    given: str = ""
    nearest: Optional[str] = None
    known: list[str] = []


class FileError(Error, OSError):
    """A file cannot be read or written."""


class MissingFileError(FileError, FileNotFoundError):
    """A file or its folder does not exist."""


class RunError(Error, RuntimeError):
    """The solver cannot continue.

    Attributes
    ----------
    time_s : float, optional
        The simulated time at which it stopped, s.
    state : str, optional
        The state that it could not integrate.
    """

    time_s: Optional[float] = None
    state: Optional[str] = None


class StageError(Error, RuntimeError):
    """A stage of a study cannot run: an input is missing or does not fit."""


def _remade(kind: type[Error], message: str, details: dict[str, Any]) -> Error:
    return kind(message, **details)
