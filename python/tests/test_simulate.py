"""Runs: names, units, equality with the command line, the lanes and the twin."""

import pickle
import signal
import threading
import time

import numpy as np
import pytest

import servotwin

FAULT = "actuator_1.leakage_a.leakage"


def test_a_run_has_time_driven_inputs_and_sensors_with_units(system):
    run = servotwin.simulate(system, inputs={"command": "step:size=2deg,at=0.1s"}, duration_s=0.3)
    assert run.columns[:2] == ["time_s", "command_rad"]
    assert run.units["command_rad"] == "rad" and run.units["time_s"] == "s"
    assert len(run) == 31 and len(run["time_s"]) == 31
    assert np.isclose(run["command_rad"][-1], np.deg2rad(2))
    assert run._repr_svg_().startswith("<svg")


def test_lanes_and_threads_give_the_bits_of_one_run(system):
    inputs = {"command": "noise:rms=2deg,bandwidth=1Hz,seed=3"}
    variants = [{"inputs": inputs, "faults": {FAULT: k / 10}} for k in range(11)]
    options = {"duration_s": 0.2, "sample_period_s": 0.02}
    both = [servotwin.simulate_many(system, variants, threads=n, **options) for n in (1, 2)]
    assert both[0] == both[1]
    alone = servotwin.simulate(system, inputs=inputs, faults={FAULT: 0.7}, **options)
    assert alone == both[0][7]
    assert not np.array_equal(both[0][0]["p_a_1_pa"], both[0][10]["p_a_1_pa"])


def test_a_twin_gives_the_bits_of_a_run_with_the_same_samples(system):
    rng = np.random.default_rng(1)
    command = np.cumsum(rng.normal(0, 0.002, 40))
    options = {"faults": {FAULT: 0.3}, "record": ["p_a_1", "actuator_1.cylinder.position_m"]}
    run = servotwin.simulate(
        system, inputs={"command": command}, duration_s=0.39, tolerance=4e-6, **options
    )
    twin = servotwin.Twin(system, between={"command": "cubic"}, **options)
    stepped = np.array([twin.step({"command": value}) for value in command])
    assert twin.record == run.columns[1:]
    for place, name in enumerate(twin.record):
        assert np.array_equal(stepped[:, place], run[name]), name
    assert (twin.sample, twin.time_s) == (39, pytest.approx(0.39))


def test_a_twin_that_was_saved_goes_on_with_the_same_bits(system):
    commands = [0.001 * k for k in range(20)]
    straight = servotwin.Twin(system, between={"command": "cubic"})
    expected = [straight.step({"command": c}) for c in commands]
    first = servotwin.Twin(system, between={"command": "cubic"})
    for command in commands[:10]:
        first.step({"command": command})
    saved = pickle.loads(pickle.dumps(first.save()))
    other = servotwin.Twin(system, between={"command": "cubic"})
    other.restore(saved)
    assert other.values == expected[9]
    assert [other.step({"command": c}) for c in commands[10:]] == expected[10:]


def test_rows_of_an_array_are_steps(system):
    rows = np.tile(system.inputs["default"], (15, 1))
    rows[:, list(system.inputs["id"]).index("command")] = np.arange(15) * 0.001
    by_row = servotwin.Twin(system).run(rows)
    twin = servotwin.Twin(system)
    steps = [twin.step(list(row)) for row in rows]
    assert by_row.columns == ["time_s", *twin.record]
    assert np.array_equal(np.array(steps)[:, 0], by_row[twin.record[0]])


def test_parameters_change_a_run_and_have_a_range(system):
    name = list(system.parameters["id"])[0]
    row = {c: system.parameters[c][0] for c in ("value", "least", "largest")}
    with pytest.raises(servotwin.InputError) as raised:
        too_large = row["largest"] * 2 + 1
        servotwin.simulate(system, parameters={name: too_large}, duration_s=0.1)
    assert raised.value.range == (row["least"], row["largest"])


@pytest.mark.parametrize(
    "options, word",
    [
        ({"faults": {"actuator_1.leakage_a.leakag": 0.5}}, FAULT),
        ({"inputs": {"comand": 0.1}}, "command"),
        ({"record": ["p_a_11"]}, "p_a_1"),
        ({"parameters": {"actuator_1.nothing": 1.0}}, None),
    ],
)
def test_slips_in_names_are_told_with_the_nearest(system, options, word):
    with pytest.raises(servotwin.UnknownNameError) as raised:
        servotwin.simulate(system, duration_s=0.1, **options)
    assert word is None or raised.value.nearest == word
    assert raised.value.given and raised.value.known


@pytest.mark.parametrize(
    "options",
    [
        {"faults": {FAULT: 1.5}},
        {"faults": {FAULT: float("nan")}},
        {"inputs": {"command": "step:size=2bar"}},
        {"inputs": {"command": float("nan")}},
        {"inputs": {"command": [[0.0]]}},
        {"inputs": {"command": []}},
        {"inputs": {"command": [0.0, float("nan"), 0.0]}},
        {"duration_s": -1},
        {"duration_s": float("inf")},
        {"sample_period_s": 0},
        {"method": "euler"},
        {"method": "rk4"},
        {"tolerance": 0},
    ],
)
def test_bad_values_are_refused(system, options):
    with pytest.raises(servotwin.InputError):
        servotwin.simulate(system, **{"duration_s": 0.1, **options})


def test_a_run_that_fails_says_when_and_where(system):
    with pytest.raises(servotwin.RunError) as raised:
        servotwin.simulate(system, method="rk4", step_s=5e-3, duration_s=1)
    assert raised.value.time_s is not None and raised.value.state


def test_other_threads_go_on_during_a_long_run_and_ctrl_c_ends_it(system):
    main = threading.main_thread().ident
    # A shell starts what it leaves in the background with interrupts ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    counted = []

    def count_and_press():
        for k in range(200):
            counted.append(k)
            time.sleep(1e-3)
        signal.pthread_kill(main, signal.SIGINT)

    # It would take hours.
    variants = [{"inputs": {"command": "noise:rms=2deg,bandwidth=1Hz,seed=3"}}] * 10_000
    thread = threading.Thread(target=count_and_press)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        servotwin.simulate_many(system, variants, duration_s=90, sample_period_s=10)
    thread.join()
    assert len(counted) == 200
    # And all is well afterwards.
    assert len(servotwin.simulate(system, duration_s=0.1)) == 11


def test_progress_is_told_and_what_it_raises_stops_the_run(system):
    told = []
    variants = [{"faults": {FAULT: 0.5}}] * 4
    servotwin.simulate_many(
        system, variants, duration_s=0.1, progress=lambda *told_now: told.append(told_now)
    )
    assert told[-1] == ("simulating", 4, 4)

    def refuse(what, done, all):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        servotwin.simulate_many(system, variants, duration_s=0.1, progress=refuse)


def test_threads_simulate_at_the_same_time(system):
    results = {}

    def work(k):
        results[k] = servotwin.simulate(system, faults={FAULT: k / 4}, duration_s=0.1)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k in range(5):
        assert results[k] == servotwin.simulate(system, faults={FAULT: k / 4}, duration_s=0.1)


def test_sensors_read_with_their_noise_from_a_seed(system):
    runs = [servotwin.simulate(system, duration_s=0.5, noise=seed) for seed in (None, 1, 1, 2)]
    quiet, one, again, other = [run["p_a_1_pa"] for run in runs]
    assert np.ptp(quiet) < np.ptp(one)
    assert np.array_equal(one, again) and not np.array_equal(one, other)


def test_a_sensor_has_one_name_for_all(system):
    for name in ("p_a_1", "p_a_1_pa", "p_A1"):
        assert servotwin.Twin(system, record=[name]).record == ["p_a_1_pa"]
