"""What can go wrong: every exception keeps the place and the allowed range, where there are any."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional


class Mistake(NamedTuple):
    """A mistake at its place in a file; lines and columns count from 1."""

    file: str
    line: int
    column: int
    width: int
    message: str
    help: Optional[str]
    range: Optional[tuple[float, float]]
    allowed: Optional[str]


class Error(Exception):
    """Anything that servotwin refuses."""

    file: Optional[str] = None
    """The file that is wrong."""
    line: Optional[int] = None
    """The line in it, from 1."""
    column: Optional[int] = None
    """The column in the line, from 1."""
    range: Optional[tuple[float, float]] = None
    """The least and the largest number allowed, in SI."""
    allowed: Optional[str] = None
    """What is allowed, in words."""

    def __init__(self, message: str, **details: Any) -> None:
        super().__init__(message)
        self.__dict__.update(details)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_remade, (type(self), str(self), self.__dict__))


class MistakesError(Error, ValueError):
    """A file has mistakes."""

    mistakes: list[Mistake] = []
    """All of them, where the file was read to its end."""


class InputError(Error, ValueError):
    """A value is not as it must be."""


class UnknownNameError(Error, ValueError):
    """A name that the system does not have."""

    given: str = ""
    nearest: Optional[str] = None
    known: list[str] = []


class FileError(Error, OSError):
    """A file cannot be read or written."""


class MissingFileError(FileError, FileNotFoundError):
    """A file or its folder does not exist."""


class RunError(Error, RuntimeError):
    """The solver could not go on."""

    time_s: Optional[float] = None
    state: Optional[str] = None


class StageError(Error, RuntimeError):
    """A stage of a study cannot be done: what it needs is missing or does not fit."""


def _remade(kind: type[Error], message: str, details: dict[str, Any]) -> Error:
    return kind(message, **details)
