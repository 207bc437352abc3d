"""What several tests need."""

from pathlib import Path

import pytest

import servotwin

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def system():
    return servotwin.System()


@pytest.fixture(scope="session")
def root():
    return ROOT
