"""Systems: files, names, mistakes."""

import pickle

import pytest

import servotwin


def test_the_built_in_system_is_that_of_the_file(system, root):
    read = servotwin.System(root / "systems" / "aileron_dual.toml")
    assert read.text == system.text
    assert read.name == "aileron_dual"
    assert set(system.components.columns) == {"id", "kind", "summary"}
    assert "actuator_1.leakage_a.leakage" in list(system.faults["id"])
    assert "command" in list(system.inputs["id"])
    parameters = system.parameters
    assert (parameters["least"] <= parameters["value"]).all()
    assert (parameters["value"] <= parameters["largest"]).all()


def test_a_description_has_states_at_rest_and_stable_eigenvalues(root):
    system = servotwin.System(root / "systems" / "valve_and_cylinder.toml")
    described = system.describe()
    assert described["name"] == system.name
    assert len(described["states"]) == len(described["eigenvalues_per_s"])
    assert max(re for re, _ in described["eigenvalues_per_s"]) < 1e-6
    assert system._repr_svg_().startswith("<svg")


def test_mistakes_have_file_line_column_and_range(tmp_path, root):
    broken = root / "crates/servotwin/tests/broken_systems/05_parameter_out_of_range.toml"
    with pytest.raises(servotwin.MistakesError) as raised:
        servotwin.System(broken)
    error = raised.value
    assert isinstance(error, ValueError)
    assert error.file == str(broken)
    (mistake,) = error.mistakes
    assert (mistake.line, mistake.column) == (error.line, error.column)
    least, largest = error.range
    assert least < largest
    assert f":{mistake.line}:{mistake.column}:" in str(error)
    assert servotwin.System.check(broken) == [mistake]
    again = pickle.loads(pickle.dumps(error))
    assert (again.line, again.range, again.mistakes, str(again)) == (
        error.line,
        error.range,
        error.mistakes,
        str(error),
    )


def test_every_broken_system_is_refused_with_a_place(root):
    files = sorted((root / "crates/servotwin/tests/broken_systems").glob("*.toml"))
    assert len(files) > 70
    for file in files:
        mistakes = servotwin.System.check(file)
        assert mistakes, file
        assert all(m.line >= 1 and m.column >= 1 and m.message for m in mistakes)


def test_a_missing_file_is_a_file_not_found_error(tmp_path):
    with pytest.raises(FileNotFoundError) as raised:
        servotwin.System(tmp_path / "none.toml")
    assert isinstance(raised.value, servotwin.Error)
    assert raised.value.file == str(tmp_path / "none.toml")


def test_systems_can_be_pickled(system):
    again = pickle.loads(pickle.dumps(system))
    assert again.text == system.text and repr(again) == repr(system)
