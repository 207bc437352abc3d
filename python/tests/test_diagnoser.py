"""The diagnosis beside an actuator, with a diagnoser that the command line has learned."""

import pickle

import numpy as np
import pytest
from flown import flight

import servotwin


def test_a_whole_table_says_what_one_sample_after_the_other_does(learned):
    diagnoser = servotwin.Diagnoser(learned)
    rows = flight(diagnoser, {"actuator_1.servo_valve.bias_positive": 1.0})
    whole = diagnoser.run(*rows)
    fresh = pickle.loads(pickle.dumps(diagnoser))
    said = [fresh.push(*(part[k] for part in rows)) for k in range(len(rows[0]))]
    assert [one.finding for one in said] == list(whole["finding"])
    assert [one.alarm for one in said] == list(whole["alarm"])
    assert [one.confidence for one in said] == list(whole["confidence"])
    assert said[-1].alarm != "normal", said[-1]


def test_a_healthy_actuator_raises_nothing(learned):
    diagnoser = servotwin.Diagnoser(learned)
    said = diagnoser.run(*flight(diagnoser))
    assert set(said["raised_actuator"]) == {""}


def test_a_sensor_that_goes_silent_is_named(learned):
    diagnoser = servotwin.Diagnoser(learned)
    inputs, measured, expected = flight(diagnoser)
    measured[150:, 2] = np.nan
    for row in zip(inputs, measured, expected):
        said = diagnoser.push(*row)
    assert said.lost == [diagnoser.sensors[2]]
    assert said.alarm == "normal" and said.raised is None


def test_whatever_comes_is_no_crash(learned):
    diagnoser = servotwin.Diagnoser(learned)
    width = len(diagnoser.sensors)
    inputs = [0.0] * len(diagnoser.inputs)
    for measured in ([float("nan")] * width, [float("inf")] * width, [1e300] * width):
        outcome = diagnoser.push(inputs, measured, [0.0] * width)
    assert outcome.sample == 2
    # Other lengths are refused with both numbers, and no sample is counted.
    with pytest.raises(ValueError, match=f"measured values: expected {width}, found 0"):
        diagnoser.push(inputs, [], [0.0] * width)
    with pytest.raises(ValueError, match=f"inputs: expected {len(inputs)}, found"):
        diagnoser.push([*inputs, 0.0], [0.0] * width, [0.0] * width)
    assert diagnoser.push(inputs, [0.0] * width, [0.0] * width).sample == 3
    with pytest.raises(servotwin.InputError):
        diagnoser.switched_off("actuator_7")
    with pytest.raises(servotwin.MissingFileError):
        servotwin.Diagnoser(learned.parent / "none.json")
