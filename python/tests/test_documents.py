"""The README's lines of Python run, and every public name has a numpydoc docstring."""

import inspect
import re

import pytest

import servotwin
from servotwin import distributed, errors, estimators, study


def public():
    """Every public class, function and method with its name."""
    for module in (servotwin, study, errors, estimators, distributed):
        for name, value in vars(module).items():
            home = getattr(value, "__module__", None) or ""
            own = home.startswith("servotwin") and home != "servotwin._progress"
            if name.startswith("_") or not (own or inspect.isbuiltin(value)) or not callable(value):
                continue
            yield name, value
            if inspect.isclass(value):
                for method, member in vars(value).items():
                    if not method.startswith("_") and not isinstance(member, property):
                        if callable(member) or isinstance(member, staticmethod):
                            yield f"{name}.{method}", getattr(value, method)


def test_every_public_name_has_a_docstring_with_its_parameters():
    checked = 0
    for name, value in public():
        doc = inspect.getdoc(value)
        assert doc, name
        try:
            parameters = inspect.signature(value).parameters
        except ValueError:
            continue
        wanted = [p for p in parameters if p not in ("self", "args", "kwargs", "message", "details")]
        if issubclass(value, tuple) if inspect.isclass(value) else name == "Table.keys":
            continue
        for parameter in wanted:
            assert re.search(rf"^[\w, ]*\b{parameter}\b[\w, ]* : ", doc, re.M), f"{name}: {parameter}"
        checked += bool(wanted)
    assert checked > 25, checked


@pytest.mark.parametrize("file", ["README.md", "python/README.md"])
def test_the_lines_of_python_run(root, file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (root / file).read_text(encoding="utf-8"), re.S)
    assert blocks
    known = {}
    for block in blocks:
        if "study.run" in block or "run_suites" in block or "Client" in block:
            compile(block, file, "exec")
            continue
        exec(block, known)
    assert known["leak"].units["p_a_1_pa"] == "Pa"


def test_the_lines_about_a_log_run_beside_a_diagnoser(root, learned, monkeypatch, capsys):
    text = (root / "python/README.md").read_text(encoding="utf-8")
    block = text.split("## A log\n\n```python\n")[1].split("```")[0]
    monkeypatch.chdir(learned.parent.parent)
    study = servotwin.Study("tiny.toml")
    servotwin.simulate(
        study.system,
        inputs={"command": "noise:rms=5deg,bandwidth=1Hz,seed=7"},
        sample_period_s=servotwin.Diagnoser(learned).sample_period_s,
        noise=1,
    ).write("log.csv")
    block = block.replace("Study()", 'Study("tiny.toml")').replace("realistic", "noise")
    exec(re.sub("servotwin.run_suites.*", "", block), {"servotwin": servotwin})
    assert "healthy" in capsys.readouterr().out
