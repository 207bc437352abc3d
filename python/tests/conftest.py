"""What several tests need."""

import os
import subprocess
from pathlib import Path

import pytest
from tiny import STUDY

import servotwin

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def system():
    return servotwin.System()


@pytest.fixture(scope="session")
def root():
    return ROOT


@pytest.fixture(scope="session")
def learned(tmp_path_factory):
    """The file of a diagnoser that the command line has learned from a tiny study."""
    binary = os.environ.get("SERVOTWIN_BINARY")
    if not binary:
        pytest.skip("SERVOTWIN_BINARY names no command line")
    folder = tmp_path_factory.mktemp("flights")
    (folder / "tiny.toml").write_text(STUDY)
    command = [binary, "flights", str(folder / "tiny.toml"), "--out", str(folder / "out")]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "out" / "diagnoser-noise.json"
