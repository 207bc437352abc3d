"""The stages of a study, beside the command line where that is there."""

import json
import pickle
import shutil
import subprocess

import numpy as np
import pytest
from conftest import binary
from tiny import STUDY, contents

import servotwin


@pytest.fixture(scope="module")
def study():
    return servotwin.Study.parse(STUDY)


def test_no_feature_column_holds_the_answer(results, study):
    for training in (False, True):
        table = servotwin.data_set(results, "noise", training=training)
        features = servotwin.feature_columns(table)
        assert features == servotwin.feature_columns(table.to_pandas())
        assert len(features) > 50
        answers = {"variant", "case", "flown", "seed", "fault", "kind", "intensity", "grade"}
        answers |= {"actuator", "action", "detail", "detectable", "deviates", "failure"}
        assert not answers & set(features)
        assert not [name for name in features if name.startswith(("i:", "largest"))]
        assert [name for name in table.columns if name.startswith("i:")], "they are in the table"


def test_a_study_knows_its_faults_and_can_be_pickled(study):
    assert len(study.faults) == 8 * 4 * 2
    again = pickle.loads(pickle.dumps(study))
    assert (again.text, again.system.text) == (study.text, study.system.text)
    assert repr(again) == repr(study)
    assert servotwin.Study().name == "paper"


def test_mistakes_of_a_study_have_their_places():
    broken = STUDY.replace("sample_hz = 50", "sample_hz = -50")
    with pytest.raises(servotwin.MistakesError) as raised:
        servotwin.Study.parse(broken, "mine.toml")
    assert raised.value.file == "mine.toml"
    line = broken.splitlines()[raised.value.line - 1]
    assert line == "sample_hz = -50"


def test_the_data_set_has_labels_and_features(results, study):
    table = servotwin.data_set(results, "noise")
    assert {"actuator", "action", "detail"} <= set(table.columns) and len(table.columns) > 50
    assert len(table) == len(study.faults) + 4
    training = servotwin.data_set(results, "noise", training=True)
    assert len(training) > len(table)
    with pytest.raises(servotwin.InputError):
        servotwin.data_set(results, "nois")


def test_the_results_of_a_whole_run_are_in_its_folder(study, results):
    found = servotwin.Results(results)
    assert found.evaluation == json.loads((results / "evaluation.json").read_text())
    assert found.flights == json.loads((results / "flights.json").read_text())
    assert found.data_card == (results / "data-card.md").read_text()
    field = found.table("noise").to_arrow().schema.field("first_excursion_s")
    assert field.metadata[b"unit"] == b"s" and field.metadata[b"description"]
    assert found.table("noise").to_arrow() == servotwin.data_set(results, "noise").to_arrow()
    assert list(found.trees) == ["ideal", "noise", "realistic"]
    written = servotwin.trees(results / "records-noise.json")
    assert str(found.trees["noise"]["A"]) == str(written["A"])
    diagnoser = found.diagnoser("noise")
    assert diagnoser.to_json() == servotwin.Diagnoser(results / "diagnoser-noise.json").to_json()
    log = servotwin.simulate(
        study.system,
        inputs={"command": "noise:rms=3deg,bandwidth=1Hz,seed=9"},
        sample_period_s=diagnoser.sample_period_s,
        duration_s=3,
    )
    watched = servotwin.watch(study, diagnoser, log)
    assert watched.columns[:3] == ["time_s", "state", "phase"]
    # The first finding comes with the first whole window of 0.5 s at 50 Hz, once the twin has settled for a second.
    assert watched["time_s"][0] == 1.48 and watched["state"][0] != "no data"
    assert found.report().path == results / "report.html"
    assert "<iframe" in found.report()._repr_html_()
    again = pickle.loads(pickle.dumps(found))
    assert (again.folder, repr(again)) == (results, repr(found))
    with pytest.raises(servotwin.InputError, match="no scenario 'nois'"):
        found.table("nois")


@pytest.mark.slow
def test_records_alone_have_the_bytes_of_a_whole_run(study, results, tmp_path):
    told = []
    servotwin.run_suites(study, tmp_path, ["records"], progress=lambda *now: told.append(now))
    assert told
    alone, whole = contents(tmp_path), contents(results)
    same = [name for name in alone if name.startswith(("dataset", "parts"))]
    assert same and all(alone[name] == whole[name] for name in same)


def test_a_record_is_fitted():
    study = servotwin.Study("spring_actuator")
    options = {"inputs": {"command": "noise:rms=4deg,bandwidth=1Hz,seed=5"}, "duration_s": 10}
    true_n = 540.0
    record = servotwin.simulate(
        study.system, parameters={"cylinder.coulomb_friction_n": true_n}, **options
    )
    fitted = servotwin.fit_record(study, record)
    table = fitted.parameters
    place = list(table["name"]).index("cylinder.coulomb_friction_n")
    assert abs(table["value"][place] - true_n) < 3 * table["standard_error"][place]
    assert fitted.is_update and fitted.verdict.startswith("healthy") and not fitted.findings
    assert "coulomb_friction_n" in fitted.system_text
    short = servotwin.simulate(study.system, duration_s=1)
    with pytest.raises(servotwin.InputError):
        servotwin.fit_record(study, short)


def test_a_folder_without_results_is_refused(study, tmp_path):
    with pytest.raises(servotwin.StageError):
        servotwin.Results(tmp_path)


def test_records_run_again_give_the_same_bytes(study, results, tmp_path):
    folder = tmp_path / "out"
    shutil.copytree(results, folder)
    before = contents(folder)
    assert {"evaluation.json", "report.html", "manifest.json"} <= set(before)
    servotwin.run_suites(study, folder, ["records"], threads=1, progress=False)
    after = contents(folder)
    assert {name for name in before if before[name] != after[name]} == set()


@pytest.mark.slow
def test_the_command_line_gives_the_same_bytes(results, tmp_path):
    study = results.parent / "tiny.toml"
    subprocess.run([binary(), "study", str(study), "--out", str(tmp_path)], check=True, capture_output=True)
    assert contents(tmp_path) == contents(results)


def test_parts_are_joined_to_the_same_bytes(results, study, tmp_path):
    for share in ("2/3", "1/3", "3/3"):
        servotwin.run_suites(study, tmp_path, ["records"], share=share, progress=False)
        assert not list(tmp_path.glob("dataset*"))
    servotwin.run_suites(study, tmp_path, ["records"], progress=False)
    joined, whole = contents(tmp_path), contents(results)
    for name in joined:
        if name != "manifest.json":
            assert joined[name] == whole[name], name
    assert any(name.startswith("dataset") for name in joined)


def test_another_study_and_wrong_choices_are_refused(study, tmp_path):
    def run(study=study, suites=("records",), **options):
        servotwin.run_suites(study, tmp_path, suites, progress=False, **options)

    run(share="1/99")
    with pytest.raises(servotwin.StageError, match="another study") as raised:
        run(servotwin.Study.parse(STUDY.replace('"tiny"', '"other"')), share="1/2")
    assert raised.value.file == str(tmp_path)
    wrong = [{"share": share} for share in ("0/2", "3/2", "x")]
    for options in [*wrong, {"scenarios": []}, {"scenarios": ["nois"]}]:
        with pytest.raises(servotwin.InputError):
            run(**options)
    with pytest.raises(servotwin.StageError, match=r"the study lacks \[fitted\]"):
        run(scenarios=["fitted"])
    with pytest.raises(servotwin.StageError, match="there is no suite 'judges'; there are records, flights"):
        run(suites=["judges"])
    with pytest.raises(servotwin.StageError, match="diagnoser-noise.json: no such file"):
        run(suites=["judge"])


def test_trees_are_data_and_drawn(results):
    trees = servotwin.trees(results / "records-noise.json")
    top = trees["A"]
    nodes = top.nodes
    leaves = nodes["left"] < 0
    assert leaves.sum() == (~leaves).sum() + 1
    assert set(nodes["feature"][~leaves]) <= set(top.features)
    assert set(nodes["class"]) <= set(top.classes)
    assert top._repr_svg_().startswith("<svg") and "<=" in str(top)
    again = pickle.loads(pickle.dumps(top))
    assert str(again) == str(top)


def test_reports_show_themselves(results):
    report = servotwin.Report(results / "report.html")
    assert report._repr_html_().startswith("<iframe")
    results = json.loads((results / "evaluation.json").read_text())
    assert results


def test_a_bar_of_tqdm_shows_progress(study, tmp_path, capsys):
    servotwin.run_suites(study, tmp_path, ["records"], scenarios=["ideal"])
    assert "simulating ideal" in capsys.readouterr().err
    assert np.isfinite(len(servotwin.data_set(tmp_path, "ideal")))
