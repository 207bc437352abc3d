"""Progress: a bar of tqdm where it is installed and wanted."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Optional, Union

from .types import Progress


@contextmanager
def told(progress: Union[bool, Progress]) -> Iterator[Optional[Progress]]:
    """What the compiled part calls: a function is used as it is, True means a bar."""
    if callable(progress):
        yield progress
        return
    if not progress:
        yield None
        return
    try:
        from tqdm.auto import tqdm  # type: ignore[import-untyped, unused-ignore]
    except ImportError:
        yield None
        return
    bars: list[Any] = []

    def show(what: str, done: int, all: int) -> None:
        if not bars or bars[-1].desc != what:
            if bars:
                bars[-1].close()
            bars.append(tqdm(desc=what, total=all))
        bars[-1].total = all
        bars[-1].update(done - bars[-1].n)

    try:
        yield show
    finally:
        if bars:
            bars[-1].close()
