"""The stubs say what the module has, and a program that uses them is clean."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import numpy as np
import servotwin

system = servotwin.System()
run: servotwin.Table = servotwin.simulate(system, inputs={"command": 0.1}, faults={"a": 0.5})
twin = servotwin.Twin(system, between={"command": "cubic"})
first: float = twin.step([0.0])[0]
names: list[str] = [mistake.message for mistake in servotwin.System.check("a.toml")]
"""


def mypy(*arguments):
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull, *arguments]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.mark.slow
def test_the_package_is_clean():
    done = mypy("-p", "servotwin")
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_a_program_is_clean_and_slips_are_found(tmp_path):
    file = tmp_path / "program.py"
    file.write_text(PROGRAM)
    done = mypy(str(file))
    assert done.returncode == 0, done.stdout
    other = tmp_path / "slip.py"
    other.write_text(PROGRAM.replace('"cubic"', '"cubik"'))
    assert mypy(str(other)).returncode != 0


@pytest.mark.slow
def test_stubs_and_module_agree():
    command = [sys.executable, "-m", "mypy.stubtest", "servotwin._servotwin", "--ignore-disjoint-bases"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
