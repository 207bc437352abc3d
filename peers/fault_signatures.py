#!/usr/bin/env python3
"""Writes the measured tables of docs/faults.md. Standard library only.

    cargo build --release --features full -p servotwin-cli
    python3 peers/fault_signatures.py [PROGRAM] [--check]

PROGRAM is target/release/servotwin unless another one is given. A table belongs to a mark such as

    <!-- measured aileron_dual -->

which names its system; `bench` is peers/fault_bench.toml. The first cells of its rows name the faults, so a new row
needs no more than its first cell. The script simulates every fault and the healthy system with the same inputs, and
subtracts the readings of the sensors. The table lists the sensors whose difference has an rms of more than 3 % of the
sensor's scale, with this rms in percent. If no sensor exceeds 3 %, it gives the largest one in parentheses. With
--check the script compares the page instead of writing it, and ends with exit code 1 if the page differs.
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
MARK = re.compile(r"(<!-- measured (\S+) -->\n)(.*?)(<!-- end -->)", re.S)
ROW = re.compile(r"^\| `(\S+)`", re.M)

LISTED_SENSORS = 3

AILERON = ["--command", "noise:rms=5deg,bandwidth=1Hz,seed=7"]
# The inputs of the moving run of each system. The run at rest takes the defaults of all inputs.
MOVING = {
    "aileron_dual": AILERON,
    "spring_actuator": AILERON,
    "press_axis": ["--command", "noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed=1"],
    "bench": ["--input", "setpoint=noise:rms=0.25,bandwidth=1Hz,limit=0.8,seed=7"],
}
FILES = {"bench": "peers/fault_bench.toml"}
# The faults of a mode valve act when its actuator is switched off.
SWITCHED_OFF = ["--input", "actuator_1.mode=1 + step:size=-1,at=5s"]


class Bench:
    """Runs the program and compares its runs."""

    def __init__(self, program):
        self.program = program
        self.folder = tempfile.TemporaryDirectory()
        self.described = {}
        self.healthy = {}

    def run(self, *arguments):
        """What the program prints."""
        done = subprocess.run([self.program, *arguments], capture_output=True, text=True, cwd=REPOSITORY)
        if done.returncode != 0:
            sys.exit(f"{' '.join(arguments)}: {done.stderr}")
        return done.stdout

    def describe(self, system):
        """What the program reports about a system."""
        if system not in self.described:
            self.described[system] = json.loads(self.run("describe", FILES.get(system, system), "--json"))
        return self.described[system]

    def scales(self, system):
        """The sensors of a system: id, label and scale."""
        return [(s["id"], s["label"], s["scale"]) for s in self.describe(system)["sensors"]]

    def simulate(self, system, inputs):
        """The readings of one run by the ids of the sensors."""
        path = pathlib.Path(self.folder.name) / "run.csv"
        self.run("simulate", FILES.get(system, system), "--duration", "20s", "--quiet", "--out", str(path), *inputs)
        with open(path, newline="") as file:
            head, *rows = csv.reader(file)

        def column(sensor):
            # The column of a sensor is its id with its SI unit.
            return next(i for i, name in enumerate(head) if name == sensor or name.startswith(sensor + "_"))

        return {sensor: [float(row[column(sensor)]) for row in rows] for sensor, _, _ in self.scales(system)}

    def signature(self, system, fault, intensity, inputs):
        """The sensors beyond the threshold, the largest rms first."""
        key = (system, *inputs)
        if key not in self.healthy:
            self.healthy[key] = self.simulate(system, inputs)
        faulty = self.simulate(system, [*inputs, "--fault", f"{fault}={intensity}"])
        sizes = []
        for sensor, label, scale in self.scales(system):
            residuals = [a - b for a, b in zip(faulty[sensor], self.healthy[key][sensor])]
            sizes.append((100 * math.sqrt(sum(r * r for r in residuals) / len(residuals)) / scale, label))
        sizes.sort(key=lambda one: (-one[0], one[1]))
        moved = [f"{label} {rounded(percent)}" for percent, label in sizes if percent > THRESHOLD_PERCENT]
        if not moved:
            percent, label = sizes[0]
            return f"({label} {rounded(percent)})" if percent >= 0.05 else "–"
        if len(moved) > LISTED_SENSORS:
            moved[LISTED_SENSORS:] = [f"{len(moved) - LISTED_SENSORS} more"]
        return ", ".join(moved)


def rounded(percent):
    """Two digits are enough to tell what moves."""
    return f"{percent:.1f}" if percent < 9.95 else f"{percent:.0f}"


def table(bench, system, faults):
    """The rows of a mark's faults."""
    moving = MOVING[system]
    columns = [
        ("moving, 0.5", 0.5, moving),
        ("moving, 1", 1, moving),
        ("at rest, 0.5", 0.5, []),
    ]
    if any(".mode_valve." in fault for fault in faults):
        columns.append(("switched off, 0.5", 0.5, [*moving, *SWITCHED_OFF]))
    heads = " | ".join(head for head, _, _ in columns)
    lines = [f"| fault of {system} | {heads} |", "|---" * (len(columns) + 1) + "|"]
    for fault in faults:
        cells = [bench.signature(system, fault, intensity, inputs) for _, intensity, inputs in columns]
        lines.append(f"| `{fault}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main():
    arguments = [one for one in sys.argv[1:] if one != "--check"]
    program = arguments[0] if arguments else REPOSITORY / "target" / "release" / "servotwin"
    bench = Bench(str(pathlib.Path(program).resolve()))
    found = PAGE.read_text()

    def filled(match):
        begin, system, rows, end = match.groups()
        return f"{begin}\n{table(bench, system, ROW.findall(rows))}{end}"

    wanted = MARK.sub(filled, found)
    if "--check" in sys.argv[1:]:
        sys.exit(0 if wanted == found else f"{PAGE} differs: run peers/fault_signatures.py")
    PAGE.write_text(wanted)


if __name__ == "__main__":
    main()
