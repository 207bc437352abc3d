"""Writes samples for an export: python3 samples.py EXPORT SECONDS > samples.bin

The samples are random: offsets, wrong gains and noise of sensors change every few seconds, and now and then a value is
missing. The numbers of sensors, scales and plausible inputs are read from the C text.
"""

import random
import re
import struct
import sys
from pathlib import Path

PERIOD_S = 0.01


def number(word):
    """A number of the C text: hexadecimal literals, and indices in decimal."""
    return float.fromhex(word) if "x" in word else float(word)


def entries(text, name):
    """The entries of an array of structs, as lists of numbers."""
    body = re.search(rf"\b{name}\[\d+\] = \{{(.*?)\n\}};", text, re.S).group(1)
    rows = re.findall(r"\{([^{}]*)\}", body)
    return [[number(word.strip().rstrip("UF")) for word in row.split(",")] for row in rows]


def plausible(inputs, differences):
    """Inputs that are plausible alone and together. An array without differences has one entry of zeros."""
    differences = [entry for entry in differences if entry[2] < entry[3]]
    while True:
        values = [low + random.uniform(0.1, 0.9) * (high - low) for low, high, _ in inputs]
        pairs = [(values[int(of)] - values[int(minus)], low, high) for of, minus, low, high in differences]
        if all(low < value < high for value, low, high in pairs):
            return values


def write(values):
    sys.stdout.buffer.write(struct.pack(f"<{len(values)}d", *values))


def main():
    text = (Path(sys.argv[1]) / "servotwin_tables.c").read_text()
    random.seed(1)
    sensors, inputs = entries(text, "servotwin_sensors"), entries(text, "servotwin_inputs")
    center = plausible(inputs, entries(text, "servotwin_differences"))
    signals = [0.5] * len(sensors)
    goals = list(signals)
    disturbances, left = [(0.0, 0.0, 0.0)] * len(sensors), 0
    for _ in range(int(float(sys.argv[2]) / PERIOD_S)):
        if left == 0:
            left = random.randrange(100, 1500)
            disturbances = [(0.0, 0.0, 0.0)] * len(sensors)
            size = random.choice([-1, 1]) * 10 ** random.uniform(-2.5, -0.3)
            kind, which = random.randrange(4), random.randrange(len(sensors))
            if kind < 3:
                disturbances[which] = tuple(abs(size) if kind == 2 else size if i == kind else 0.0 for i in range(3))
        left -= 1
        now = [c + 1e-6 * (high - low) * random.random() for c, (low, high, _) in zip(center, inputs)]
        twin, measured = [], []
        for place, (scale, noise, *_) in enumerate(sensors):
            if random.random() < 0.02:
                goals[place] = random.random()
            signals[place] += 0.1 * (goals[place] - signals[place])
            offset, slope, extra = disturbances[place]
            value = signals[place] * (1.0 + slope) + offset + random.gauss(0.0, noise + 0.3 * extra)
            twin.append(scale * signals[place])
            measured.append(float("nan") if random.random() < 2e-5 else scale * value)
        write(now + measured + twin)


if __name__ == "__main__":
    main()
