"""What several tests need."""

import os
import subprocess
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
def learned(tmp_path_factory):
    """The file of a diagnoser that the command line has learned from a tiny study."""
    folder = tmp_path_factory.mktemp("flights")
    (folder / "tiny.toml").write_text(STUDY)
    command = [binary(), "flights", str(folder / "tiny.toml"), "--out", str(folder / "out")]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "out" / "diagnoser-noise.json"
