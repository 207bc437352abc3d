"""Studies, and what a command takes, for the benchmarks in this folder."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "crates/servotwin/tests"


class Cost(NamedTuple):
    """What a process took."""

    wall_s: float
    processor_s: float
    memory_mb: float


def binary():
    """The command line: SERVOTWIN_BINARY, or the one that is built for release."""
    path = os.environ.get("SERVOTWIN_BINARY", ROOT / "target/release/servotwin")
    if not Path(path).exists():
        sys.exit(f"{path} is not there: cargo build --release -p servotwin-cli")
    return str(path)


def run(*command):
    """Runs a command to its end."""
    begin = time.monotonic()
    with subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{command} ended with {process.returncode}")
    wall_s = time.monotonic() - begin
    return Cost(wall_s, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def many(variants, duration_s=0.1):
    """A study of 320 faults in so many cases of 0.1 s that there are about so many variants."""
    text = (TESTS / "tiny.toml").read_text(encoding="utf-8")
    intensities = ", ".join(f"{k / 20:.2f}" for k in range(1, 21))
    text = text.replace("[0.4, 0.6, 0.8, 1.0]", f"[{intensities}]")
    text = text.replace("duration_s = 2\nsample_hz = 50", f"duration_s = {duration_s}\nsample_hz = 20")
    signal = 'signals.S{0} = "noise:rms=5deg,bandwidth=1Hz,seed={0}"'
    signals = "\n".join(signal.format(k) for k in range(1, variants // 320 + 1))
    text = text.replace(signal.format(1), signals)
    classes = (TESTS / "tiny_classes.toml").read_text(encoding="utf-8")
    return f"{text}{classes}[realistic]\nhealthy = 1\n"
