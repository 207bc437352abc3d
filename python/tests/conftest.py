"""What several tests need."""

import fcntl
import os
from pathlib import Path

import pytest
from tiny import STUDY

import servotwin

ROOT = Path(__file__).resolve().parents[2]


def binary():
    """The command line beside which the package is tested."""
    name = os.environ.get("SERVOTWIN_BINARY")
    assert name, "SERVOTWIN_BINARY names no command line; ./check sets it"
    return name


@pytest.fixture(scope="session")
def system():
    return servotwin.System()


@pytest.fixture(scope="session")
def root():
    return ROOT


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """The folder of a whole tiny study, run once for all processes of pytest; its file is beside it."""
    base = tmp_path_factory.getbasetemp()
    home = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "tiny-study"
    home.mkdir(exist_ok=True)
    out = home / "out"
    with open(home / "lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not out.exists():
            (home / "tiny.toml").write_text(STUDY)
            servotwin.Study.parse(STUDY).run(home / "unfinished", progress=False)
            (home / "unfinished").rename(out)
    return out


@pytest.fixture(scope="session")
def learned(results):
    """The file of a diagnoser of the tiny study."""
    return results / "diagnoser-noise.json"
