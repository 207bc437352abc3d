"""Writes the .mf4 files beside it, which the tests of `log` read.

python3 -m venv /tmp/v && /tmp/v/bin/pip install asammdf==8.8.28 && /tmp/v/bin/python make_recordings.py

asammdf is the oracle: what it wrote it also reads back, and it is compared here with the same formulas as in the tests.
"""

from pathlib import Path

import numpy as np
from asammdf import MDF, Signal

here = Path(__file__).parent
k, slow = np.arange(100), np.arange(10)
invalid = (k >= 10) & (k < 20)


def signal(name, unit, times, samples, **more):
    return Signal(samples=samples, timestamps=times, name=name, unit=unit, **more)


def recording():
    file = MDF(version="4.10")
    times = k / 64
    fast = [
        signal("command", "deg", times, k / 8 - 3),
        signal("p_a", "bar", times, (1000 + 37 * k % 100).astype("u2"), conversion={"a": 0.125, "b": -5.0}),
        signal("x_p", "mm", times, (k / 16).astype("f4"), invalidation_bits=invalid),
        signal("state", "", times, (k % 3 - 1).astype("i1")),
        signal("both", "bar", times, k.astype("i4")),
    ]
    file.append(fast, comment="fast")
    late = [
        signal("temperature", "°C", slow / 8, 20 + slow / 4),
        signal("both", "bar", slow / 8, -slow.astype(">i2")),
        signal("note", "", slow / 8, np.array([b"text"] * 10), encoding="utf-8"),
        signal("formula", "", slow / 8, slow.astype("u1"), conversion={"formula": "2*X"}),
    ]
    file.append(late, comment="slow")
    return file


for name, compression in {"plain": 0, "deflate": 1, "transposed": 2}.items():
    recording().save(here / f"recording_{name}.mf4", overwrite=True, compression=compression)
# Blocks of data in lists, with records that begin in one and end in the next.
parts = recording()
parts.configure(write_fragment_size=1000)
parts.save(here / "recording_parts.mf4", overwrite=True, compression=0)
for name in ["plain", "deflate", "transposed", "parts"]:
    with MDF(here / f"recording_{name}.mf4") as file:
        assert (file.get("p_a").samples == (1000 + 37 * k % 100) * 0.125 - 5).all()
        assert (file.get("x_p", ignore_invalidation_bits=False).samples == (k / 16)[~invalid]).all()
        assert file.get("temperature").unit == "°C"
