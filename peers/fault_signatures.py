#!/usr/bin/env python3
"""Writes the measured tables of docs/faults.md. Standard library only.

    cargo build --release -p servotwin-cli
    python3 peers/fault_signatures.py [target/release/servotwin]

A table belongs to a mark like

    <!-- measured aileron_dual actuator_1.servo_valve.jam actuator_1.servo_valve.damping_loss -->

which names a built-in system and its faults. Every fault is simulated beside the healthy system with the same
inputs. The residual of a sensor is the faulty reading less the healthy one; its rms over the run is given in
percent of the sensor's scale. A table lists the sensors whose rms exceeds 3 %.
With --check the page is compared and not written (exit code 1 where it differs).
"""

import csv
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent
PAGE = REPOSITORY / "docs" / "faults.md"
THRESHOLD_PERCENT = 3.0
MARK = re.compile(r"(<!-- measured (\S+) (.+?) -->\n).*?(<!-- end -->)", re.S)

AILERON_NOISE = "noise:rms=5deg,bandwidth=1Hz,seed=7"
# What drives each system: the signal of the moving command, and the other inputs of every run.
MOVING = {
    "aileron_dual": AILERON_NOISE,
    "aileron_relief": AILERON_NOISE,
    "spring_actuator": AILERON_NOISE,
    "press_axis": "noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed=1",
}
# The mode valve acts when its actuator is switched off.
SWITCHED_OFF = ["--input", "actuator_1.mode=1 + step:size=-1,at=5s"]


class Bench:
    """Runs the program and compares its runs."""

    def __init__(self, program):
        self.program = program
        self.folder = tempfile.TemporaryDirectory()
        self.sensors = {}
        self.healthy = {}

    def run(self, *arguments):
        """What the program prints."""
        done = subprocess.run([self.program, *arguments], capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{' '.join(arguments)}: {done.stderr}")
        return done.stdout

    def scales(self, system):
        """The sensors of a system: column, label and scale."""
        if system not in self.sensors:
            described = json.loads(self.run("describe", system, "--json"))
            self.sensors[system] = [(s["id"], s["label"], s["scale"]) for s in described["sensors"]]
        return self.sensors[system]

    def simulate(self, system, command, extra):
        """The readings of one run by the ids of the sensors."""
        path = pathlib.Path(self.folder.name) / "run.csv"
        self.run("simulate", system, "--command", command, "--duration", "20s", "--quiet", "--out", str(path), *extra)
        with open(path, newline="") as file:
            head, *rows = csv.reader(file)
        ids = [sensor for sensor, _, _ in self.scales(system)]
        places = {}
        for sensor in ids:
            # The column of a sensor is its id with its SI unit.
            places[sensor] = next(i for i, name in enumerate(head) if name == sensor or name.startswith(sensor + "_"))
        return {sensor: [float(row[place]) for row in rows] for sensor, place in places.items()}

    def signature(self, system, fault, intensity, command, extra=()):
        """The sensors beyond the threshold, the largest residual first."""
        key = (system, command, tuple(extra))
        if key not in self.healthy:
            self.healthy[key] = self.simulate(system, command, extra)
        faulty = self.simulate(system, command, [*extra, "--fault", f"{fault}={intensity}"])
        moved = []
        for sensor, label, scale in self.scales(system):
            residuals = [a - b for a, b in zip(faulty[sensor], self.healthy[key][sensor])]
            percent = 100 * math.sqrt(sum(r * r for r in residuals) / len(residuals)) / scale
            if percent > THRESHOLD_PERCENT:
                moved.append((percent, label))
        moved.sort(key=lambda one: (-one[0], one[1]))
        return ", ".join(f"{label} {rounded(percent)}" for percent, label in moved) or "none"


def rounded(percent):
    """Two digits are enough to tell what moves."""
    return f"{percent:.1f}" if percent < 9.95 else f"{percent:.0f}"


def table(bench, system, faults):
    """The rows of a mark's faults."""
    is_switched = any(".mode_valve." in fault for fault in faults)
    head = ["fault", "moving, 0.5", "moving, 0.1", "at rest, 0.5"] + ["switched off at 5 s, 0.5"] * is_switched
    lines = [f"| {' | '.join(head)} |", "| --- " * len(head) + "|"]
    for fault in faults:
        moving, still = MOVING[system], "constant:value=0"
        cells = [
            bench.signature(system, fault, 0.5, moving),
            bench.signature(system, fault, 0.1, moving),
            bench.signature(system, fault, 0.5, still),
        ]
        if is_switched:
            cells.append(bench.signature(system, fault, 0.5, moving, SWITCHED_OFF))
        lines.append(f"| `{fault}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main():
    arguments = [one for one in sys.argv[1:] if one != "--check"]
    bench = Bench(arguments[0] if arguments else str(REPOSITORY / "target" / "release" / "servotwin"))
    found = PAGE.read_text()

    def filled(match):
        begin, system, faults, end = match.groups()
        return f"{begin}{table(bench, system, faults.split())}{end}"

    wanted = MARK.sub(filled, found)
    if "--check" in sys.argv[1:]:
        sys.exit(0 if wanted == found else f"{PAGE} differs: run peers/fault_signatures.py")
    PAGE.write_text(wanted)


if __name__ == "__main__":
    main()
