"""A flight of the built-in aileron, as an actuator's sensors show it and as its twin expects it."""

import numpy as np

import servotwin


def flight(diagnoser, fault=None, samples=300):
    """Inputs, what the plant's sensors show and what its twin expects."""
    system = servotwin.System()
    period = diagnoser.sample_period_s
    command = 0.05 * np.sin(2 * np.pi * 0.5 * period * np.arange(samples))
    inputs = np.tile(system.inputs["default"], (samples, 1))
    inputs[:, list(system.inputs["id"]).index("command")] = command
    options = {"record": diagnoser.sensors, "sample_period_s": period, "between": {"command": "cubic"}}
    tables = [
        servotwin.Twin(system, faults=faults, **options).run(inputs) for faults in (fault, None)
    ]
    return [inputs, *(np.column_stack([t[c] for c in t.columns[1:]]) for t in tables)]
