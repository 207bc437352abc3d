"""The live page beside a notebook: `live` starts `servotwin serve`, and the notebook shows its page.

The page comes from the command line, which is a program of its own: a flight goes on while the interpreter
computes, and ends with it.
"""

from __future__ import annotations

import atexit
import html
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import urllib.error
import urllib.request
from collections import deque
from pathlib import Path as _Path
from typing import IO, Optional, Union

from . import _servotwin as _native
from .errors import FileError, InputError, MissingFileError, StageError
from .types import Path

BUILT_IN = ("paper", "spring_actuator", "press_axis")
"""The built-in studies, whose systems fly without a study of their own."""

PATIENCE_S = 10.0
"""How long the server may take to end, s."""

_HOW_TO_GET = (
    "there is no command 'servotwin': install it with "
    "`cargo install --path crates/servotwin-cli --features serve` in a clone of the repository, "
    "or name it in the environment variable SERVOTWIN_BINARY"
)


class Live:
    """A live page, which a notebook shows. `with` stops it at the end of the block.

    Parameters
    ----------
    server : subprocess.Popen
        The running server.
    url : str
        The link of the page.
    height_px : int
        The height in a notebook, px.

    Attributes
    ----------
    url : str
        The link of the page, for a browser on this machine.
    height_px : int
        The height in a notebook, px.
    """

    def __init__(self, server: subprocess.Popen[str], url: str, height_px: int = 800) -> None:
        self._server = server
        self.url = url
        self.height_px = height_px
        atexit.register(self.stop)

    @property
    def is_running(self) -> bool:
        """Whether the page is there."""
        return self._server.poll() is None

    def stop(self) -> None:
        """End the flight and the page. A page that has ended stays so."""
        atexit.unregister(self.stop)
        _end(self._server)

    def save(self, path: Path) -> _Path:
        """Save the flight so far as Parquet: every signal at every sample, events and states.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        pathlib.Path
        """
        return self._saved("session", path)

    def to_html(self, path: Path) -> _Path:
        """Save the flight so far as one HTML file, which any browser shows without a server.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        pathlib.Path
        """
        return self._saved("page.html", path)

    def _saved(self, what: str, path: Path) -> _Path:
        if not self.is_running:
            raise StageError("the live page has ended")
        target = _Path(path)
        if target.is_dir():
            raise FileError(f"{target}: this is a folder, a file is needed", file=str(target))
        # A proxy of the environment does not know this machine.
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        part = target.with_name(f".{target.name}.{os.getpid()}.part")
        try:
            with opener.open(self.url + what) as answer, open(part, "wb") as file:
                shutil.copyfileobj(answer, file)
            os.replace(part, target)
        except urllib.error.HTTPError as error:
            raise StageError(error.read().decode("utf-8", "replace")) from None
        except OSError as error:
            raise FileError(f"{target}: {error}", file=str(target)) from error
        finally:
            part.unlink(missing_ok=True)
        return target

    def _repr_html_(self) -> str:
        if not self.is_running:
            return "<p>The live page has ended.</p>"
        url = html.escape(self.url, quote=True)
        style = f"width: 100%; height: {self.height_px}px; border: 0"
        return f'<iframe src="{url}" title="servotwin" style="{style}"></iframe>'

    def __repr__(self) -> str:
        return f"<Live {self.url}{'' if self.is_running else ', ended'}>"

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def live(
    system: Union[_native.System, _native.Study, Path, None] = None,
    *,
    source: Optional[str] = None,
    map: Optional[Path] = None,
    model: Optional[Path] = None,
    out: Path = "out",
    command: Optional[str] = None,
    specimen: Optional[int] = None,
    height_px: int = 800,
    timeout_s: float = 900.0,
) -> Live:
    """Fly an actuator and its twin in real time, and show both on a page in the notebook.

    The page lets you inject faults and watch residuals, diagnosis and reaction. With `source` it shows a live stream
    instead. The built-in aileron flies with a diagnosis that comes with the program; for anything else,
    the first call trains one if `out` has none, which takes about two minutes. The page ends with `stop`, with the
    interpreter, and with a kernel that is killed.

    Parameters
    ----------
    system : System, Study or path, optional
        A study, its file or name, or a built-in system; the aileron with two actuators by default.
    source : str, optional
        A stream as `servotwin serve --source` takes it.
    map : path, optional
        The map file that assigns the columns of the source to signals; a stream needs one.
    model : path, optional
        A diagnoser of your own.
    out : path
        The folder of the trained diagnosis.
    command : str, optional
        The command signal, as on the command line; noise that moves the surface all the time by default.
    specimen : int, optional
        The number of the specimen that flies; one that equals the twin by default.
    height_px : int
        The height in a notebook, px.
    timeout_s : float
        How long to wait for the page, s.

    Returns
    -------
    Live

    Raises
    ------
    MissingFileError
        There is no command `servotwin`.
    InputError
        The system has no study.
    StageError
        The page did not start; the message is that of the command.
    """
    with tempfile.TemporaryDirectory(prefix="servotwin-live-") as folder:
        arguments = [_binary(), "serve", "--port", "0", "--end-with-stdin"]
        arguments += [*_study(system, _Path(folder)), "--out", os.fspath(out)]
        for option, file in (("--source", source), ("--map", map), ("--model", model)):
            if file is not None:
                arguments += [option, os.fspath(file)]
        if command is not None:
            arguments += ["--command", command]
        if specimen is not None:
            arguments += ["--specimen", str(specimen)]
        # With a session of its own, an interrupted cell does not end the flight.
        server = subprocess.Popen(
            arguments,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        )
        try:
            return Live(server, _link(server, timeout_s), height_px)
        except BaseException:
            _end(server)
            raise


def _binary() -> str:
    """The command line: the one that the environment names, or the one on the path."""
    found = os.environ.get("SERVOTWIN_BINARY") or shutil.which("servotwin")
    if not found:
        raise MissingFileError(_HOW_TO_GET)
    return found


def _study(given: Union[_native.System, _native.Study, Path, None], folder: _Path) -> list[str]:
    """The study as an argument. What is no file yet is written into a folder."""
    if given is None:
        return []
    if isinstance(given, _native.System):
        text = given.text
        for name in BUILT_IN:
            if _native.Study(name).system.text == text:
                return [name]
        raise InputError("a system of your own flies with its study: give a Study, or its file")
    if isinstance(given, _native.Study):
        (folder / "study.toml").write_text(given.text, encoding="utf-8")
        (folder / "system.toml").write_text(given.system.text, encoding="utf-8")
        return [str(folder)]
    return [os.fspath(given)]


def _link(server: subprocess.Popen[str], timeout_s: float) -> str:
    """Wait for the link, which the server prints when the page is there."""
    links: queue.Queue[str] = queue.Queue()
    said: deque[str] = deque(maxlen=20)
    has_begun = threading.Event()

    def read_links(stream: IO[str]) -> None:
        for line in stream:
            links.put(line.strip())
        links.put("")

    def read_notes(stream: IO[str]) -> None:
        for line in stream:
            said.append(line.rstrip())
            if not has_begun.is_set():
                # Training takes minutes, and the command reports it.
                print(line, end="", file=sys.stderr)

    readers = [
        threading.Thread(target=read, args=(stream,), daemon=True)
        for read, stream in ((read_links, server.stdout), (read_notes, server.stderr))
    ]
    for reader in readers:
        reader.start()
    try:
        link = links.get(timeout=timeout_s)
    except queue.Empty:
        raise StageError(f"the live page did not start within {timeout_s:g} s") from None
    if not link:
        readers[1].join(PATIENCE_S)
        raise StageError("the live page did not start: " + "\n".join(said))
    has_begun.set()
    return link


def _end(server: subprocess.Popen[str]) -> None:
    """End a server, by its standard input, by a signal, or by force, and leave no zombie."""
    if server.stdin and not server.stdin.closed:
        try:
            server.stdin.close()
        except OSError:
            pass  # it has ended already
    for stronger in (server.terminate, server.kill):
        try:
            server.wait(PATIENCE_S)
            return
        except subprocess.TimeoutExpired:
            stronger()
    server.wait()
