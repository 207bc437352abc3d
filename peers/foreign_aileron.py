"""Records of an aileron that is wrong in a known way, and what `servotwin fit` makes of them.

Run peers/setup.sh once and `cargo build --release`, then:
peers/.venv/bin/python peers/foreign_aileron.py [target/release/servotwin]

SciPy's Radau integrates the equations of radau_aileron.py, written by hand. The plant's valves are 3.3 % wider
and its Coulomb friction is 10 % higher than the twin's: a standard deviation of each tolerance. Then friction
changes its sign in another way than the twin's equations know (v/sqrt(v^2 + w^2) for tanh(v/w), w 3 instead of
5 mm/s), and sensors are slower (100 and 120 Hz instead of 125 and 160). Six sensors are logged, with the
noise that the system declares. Prints, for both unknowns, the bias in standard deviations of the tolerance and
in standard errors of the fit, and what the fit found.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
import radau_aileron as peer

DURATION_S = 30.0
PERIOD_S = 0.01
NOISE = 2e-3
TRUTH = {"servo_valve.width_pa_m": 1.0, "cylinder.coulomb_friction_n": 1.0}


def stribeck(v, smooth):
    return 6e3 * v + 550 * (1 + 0.5 * numpy.exp(-((v / 5e-3) ** 2))) * smooth(v)


def as_the_twin(v):
    return stribeck(v, lambda v: numpy.tanh(v / 5e-3))


def otherwise(v):
    return stribeck(v, lambda v: v / numpy.sqrt(v * v + 3e-3**2))


CASES = {
    "the twin's equations": (as_the_twin, 125, 160),
    "other friction": (otherwise, 125, 160),
    "slower sensors": (as_the_twin, 100, 120),
    "both": (otherwise, 100, 120),
}


def write_record(path):
    rest = peer.at_rest()
    times = numpy.arange(round(DURATION_S / PERIOD_S) + 1) * PERIOD_S
    states = peer.solve(rest, DURATION_S, peer.command_rad, times, 1e-7).y * peer.ALL_SCALES[:, None]
    random = numpy.random.default_rng(1)
    columns = {"time_s": times, "command_rad": [peer.command_rad(t) for t in times]}
    for number in (1, 2):
        row = lambda name: states[(number - 1) * peer.COUNT + peer.NAMES.index(name)]
        shown = {
            f"p_a_{number}_pa": (peer.reading_pa(row("i_a")), peer.FULL_PA),
            f"p_b_{number}_pa": (peer.reading_pa(row("i_b")), peer.FULL_PA),
            f"x_p_{number}_m": (22.2e-3 * 2 * row("y"), 22.2e-3),
        }
        for name, (values, scale) in shown.items():
            columns[name] = values + NOISE * scale * random.standard_normal(len(times))
    table = numpy.column_stack(list(columns.values()))
    numpy.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else "target/release/servotwin"
    peer.WIDTH *= 1.033
    for case, (friction, pressure_hz, ram_hz) in CASES.items():
        peer.friction = friction
        peer.PRESSURE_SENSOR_HZ, peer.RAM_SENSOR_HZ = pressure_hz, ram_hz
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "log.csv"
            write_record(log)
            output = subprocess.run([program, "fit", log, "--json"], capture_output=True, text=True)
        if not output.stdout:
            print(f"{case}: {output.stderr.strip()}")
            continue
        found = json.loads(output.stdout)
        print(f"{case}: {'an update' if found['verdict']['is_update'] else 'findings: ' + '; '.join(found['findings'])}")
        for parameter in found["parameters"]:
            known = [z for name, z in TRUTH.items() if parameter["name"].endswith(name)]
            if known:
                sigma, error = parameter["tolerance_sigma"], parameter["standard_error"]
                z = (parameter["value"] - parameter["nominal"]) / sigma
                bias = z - known[0]
                print(
                    f"  {parameter['name']}: {z:.3f} tolerance deviations, bias {bias:+.3f}"
                    f" = {bias * sigma / error:+.1f} standard errors"
                )


if __name__ == "__main__":
    main()
