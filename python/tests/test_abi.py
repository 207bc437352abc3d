"""The compiled module is of the oldest supported Python's stable interface, and loads in every newer one."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from servotwin import _servotwin

LOAD = """
import importlib.machinery, importlib.util, sys
loader = importlib.machinery.ExtensionFileLoader("_servotwin", sys.argv[1])
spec = importlib.util.spec_from_file_location("_servotwin", sys.argv[1], loader=loader)
module = importlib.util.module_from_spec(spec)
loader.exec_module(module)
twin = module.Twin(module.System(), record=["p_a_1"])
print(twin.step([0.0] * len(twin.inputs)))
"""


def interpreters():
    """Those on the path and those of pyenv that are as new as the oldest supported one."""
    named = [shutil.which(f"python3.{minor}") for minor in range(9, 30)]
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    named += sorted(map(str, root.glob("versions/*/bin/python")))
    for path in filter(None, named):
        asked = subprocess.run([path, "--version"], capture_output=True, text=True)
        version = re.match(r"Python 3\.(\d+)", asked.stdout)
        if version and int(version[1]) >= 9:
            yield path


@pytest.mark.slow
def test_every_python_here_loads_the_module_and_steps_to_the_same_bits():
    path = _servotwin.__file__
    assert ".abi3." in path
    found = [sys.executable, *interpreters()]
    assert len(found) > 1, "there is no other Python: apt-get install python3"
    said = {
        python: subprocess.run([python, "-I", "-c", LOAD, path], capture_output=True, text=True)
        for python in found
    }
    assert all(one.returncode == 0 for one in said.values()), said
    assert len({one.stdout for one in said.values()}) == 1
