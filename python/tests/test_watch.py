"""Watching a table has the guards of the command line: what cannot be judged is an error, what is doubtful a warning."""

import warnings

import numpy as np
import pytest

import servotwin


@pytest.fixture(scope="module")
def watched(learned):
    """Study, diagnoser, and the columns of a healthy log with noise."""
    study = servotwin.Study(learned.parent.parent / "tiny.toml")
    diagnoser = servotwin.Diagnoser(learned)
    log = servotwin.simulate(
        study.system,
        inputs={"command": "noise:rms=1deg,bandwidth=1Hz,seed=7"},
        duration_s=6,
        sample_period_s=diagnoser.sample_period_s,
        noise=1,
    )
    return study, diagnoser, {name: np.array(log[name]) for name in log.columns}


def findings(watched, columns):
    study, diagnoser, _ = watched
    return servotwin.watch(study, diagnoser, servotwin.Table(columns))


def test_a_healthy_log_is_healthy(watched):
    columns = dict(watched[2])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = findings(watched, columns)
    assert list(found["state"]) == ["healthy"], list(zip(found["time_s"], found["finding"]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda log: log.pop("command_rad"), "command"),
        (lambda log: log.pop("time_s"), "no column is a time"),
        (lambda log: log.update({k: v[::2] for k, v in log.items()}), "apart|rate|Hz"),
        (lambda log: log.update({k: np.random.default_rng(1).permutation(v) for k, v in log.items()}), "."),
        (lambda log: log.update(p_a_1_pa=1e-5 * log["p_a_1_pa"]), "p_a_1"),
        (lambda log: log.update(p_a_1_pa=log["p_b_1_pa"], p_b_1_pa=log["p_a_1_pa"]), "exchanged"),
        (lambda log: log.update({k: np.full_like(v, np.nan) for k, v in log.items() if k != "time_s"}), "."),
    ],
    ids=["no command", "no time", "half of the rate", "shuffled", "another unit", "exchanged", "empty"],
)
def test_a_log_that_contradicts_itself_is_no_finding(watched, change, words):
    columns = dict(watched[2])
    change(columns)
    with pytest.raises(servotwin.InputError, match=words):
        findings(watched, columns)


def test_missing_sensors_are_told(watched):
    columns = dict(watched[2])
    lost = [name for name in columns if name.startswith("p_")][:5]
    for name in lost:
        del columns[name]
    with pytest.warns(UserWarning, match=lost[0].removesuffix("_pa")):
        findings(watched, columns)
    silent = {**watched[2], "p_b_2_pa": np.full_like(watched[2]["time_s"], np.nan)}
    with pytest.warns(UserWarning, match="does without p_b_2"):
        findings(watched, silent)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda time_s, log: log.update(p_a_1_pa=np.where(time_s > 4, np.nan, log["p_a_1_pa"])), "value: p_a_1 in 100"),
        (lambda time_s, log: log.update({k: v[abs(time_s - 3) > 0.2] for k, v in log.items()}), "without a sample"),
        (lambda time_s, log: log.update(time_s=np.where(time_s > 4, time_s - 3, time_s)), "clock set back"),
    ],
    ids=["a sensor lost midway", "a gap", "a clock set back"],
)
def test_what_the_command_line_tells_of_a_log_is_a_warning(watched, change, words):
    columns = dict(watched[2])
    change(columns["time_s"], columns)
    with pytest.warns(UserWarning, match=words):
        findings(watched, columns)


def test_masked_readings_are_missing_ones(watched):
    columns = dict(watched[2])
    mask = np.arange(len(columns["time_s"])) % 50 > 25
    bad = np.where(mask, 0.0, columns["p_a_1_pa"])
    with pytest.warns(UserWarning, match="samples without a value: p_a_1"):
        masked = findings(watched, {**columns, "p_a_1_pa": np.ma.MaskedArray(bad, mask=mask)})
    with pytest.warns(UserWarning, match="samples without a value: p_a_1"):
        missing = findings(watched, {**columns, "p_a_1_pa": np.where(mask, np.nan, bad)})
    assert masked == missing
