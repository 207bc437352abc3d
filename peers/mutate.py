#!/usr/bin/env python3
"""Mutates every kind of input file and runs the command that reads it.

    python3 peers/mutate.py [--count 1000] [--seed 1] [--binary target/debug/servotwin] [--keep FOLDER] [--only KIND]

The base inputs are made by the binary itself from a tiny study. A mutated file passes if the command ends within
its time and memory limits, without a panic or a signal, and leaves no half-written output: an output is complete, or
as it was before. The exit code of the script is 1 if any file fails. Failing inputs stay in `--keep`.
The same seed gives the same files. Python's standard library is all that is needed.
"""

import argparse
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SECONDS = 60
# A thread has its stack in address space, too, so this is more than what is used.
BYTES = 6 << 30
# How a command may end: done, failed, wrong use, wrong input, missing parts.
EXIT_CODES = {0, 1, 2, 3, 4}

STUDY = """
format = 1
name = "tiny"
title = "tiny"
system = "SYSTEM"
duration_s = 3
sample_hz = 100
intensities = [0.5, 1.0]
actuators = [""]
[command]
input = "command"
signals.slow = "noise:rms=4deg,bandwidth=1Hz,seed=1"
signals.fast = "noise:rms=4deg,bandwidth=2Hz,seed=2"
[load]
input = "supply_pressure"
values.full = 20e6
values.low = 18e6
[sensors]
p_a = { quantity = "pressure_a", actuator = 1 }
p_b = { quantity = "pressure_b", actuator = 1 }
x_p = { quantity = "ram", actuator = 1 }
x_v = { quantity = "spool", actuator = 1, follows = { x_p = 0.1 } }
[[classes]]
detail = "leakage"
action = "stop"
faults = ["leakage_a.leakage", "leakage_b.leakage"]
[[classes]]
detail = "valve"
action = "warn"
faults = ["servo_valve.clogging_pa", "servo_valve.gain_low"]
[reactions]
stop = { switches_off = true }
[realistic]
healthy = 3
tolerances = [{ parameters = ["servo_valve.null_bias"], sigma = 0.0067, absolute = true }]
[training]
duration_s = 2
healthy = 2
draws = [{ count = 1, signal = "noise:rms={3..6}deg,bandwidth=1Hz,seed=1{n}" }]
[flights]
duration_s = 3
onset_s = [1, 1.5]
windows_s = [0.5]
commands = ["noise:rms={2..4}deg,bandwidth={0.5..1}Hz,seed={n}"]
[suites]
learn = { environments = 2, repeats = 1, healthy = 1 }
held_out = { environments = 0 }
judge = { environments = 1, repeats = 1, healthy = 1 }
unseen = { repeats = 1 }
"""

TRACES = """format = 1
window_rows = 20
families = ["moments", "deviation"]
[[sensors]]
name = "x"
measured = "x"
nominal = "n"
scale = 2.0
"""

WORDS = [b"NaN", b"nan", b"inf", b"-inf", b"1e308", b"-1e309", b"1e-320", b"18446744073709551616", b"-1", b"0",
         b"9" * 400, b"null", b"true", b'""', b"[]", b"{}", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n\n",
         b",,,,", b'"', b"'''", b"\xe2\x80\xae", b"\x1b[31m", b"%s%n", b"../../x"]


def deep(rng):
    """Nested far deeper than any reader should follow by recursion."""
    opening, closing = rng.choice([(b"[", b"]"), (b'{"a":', b"}"), (b"a = [", b"]"), (b"(", b")")])
    depth = rng.choice([50, 1000, 100_000])
    return opening * depth + b"1" + closing * depth


def numbers(rng, data):
    """Replaces one number of a text by another one."""
    places = [n for n, byte in enumerate(data) if 48 <= byte <= 57]
    if not places:
        return data
    begin = end = rng.choice(places)
    while begin > 0 and data[begin - 1 : begin] in b"0123456789.eE+-":
        begin -= 1
    while end < len(data) and data[end : end + 1] in b"0123456789.eE+-":
        end += 1
    return data[:begin] + rng.choice(WORDS) + data[end:]


def mutate(rng, data, others):
    """One to four changes of a file."""
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        at = rng.randrange(len(data) + 1)
        kind = rng.randrange(9)
        if kind == 0 and data:
            changed = bytearray(data)
            for _ in range(rng.choice([1, 1, 8, 64])):
                changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            data = bytes(changed)
        elif kind == 1:
            data = data[:at]
        elif kind == 2:
            other = rng.choice(others)
            data = data[:at] + other[rng.randrange(len(other) + 1) :]
        elif kind == 3:
            data = data[:at] + rng.choice(WORDS) + data[at:]
        elif kind == 4:
            data = data[:at] + data[at + rng.choice([1, 4, 16, 200]) :]
        elif kind == 5:
            piece = data[at : at + rng.choice([1, 8, 100])]
            data = data[:at] + piece * rng.choice([2, 50, 1000]) + data[at:]
        elif kind == 6:
            data = data[:at] + deep(rng) + data[at:]
        elif kind == 7:
            lines = data.split(b"\n")
            rng.shuffle(lines) if len(lines) < 200 else lines.insert(rng.randrange(len(lines)), rng.choice(lines))
            data = b"\n".join(lines)
        else:
            data = numbers(rng, data)
    return data


def limits():
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30, 1 << 30))


class Bench:
    """A folder with base inputs, made by the binary."""

    def __init__(self, binary, folder):
        self.binary, self.folder = str(Path(binary).resolve()), folder
        self.environment = {**os.environ, "SERVOTWIN_CC": "", "RUST_BACKTRACE": "0"}
        self.make()

    def must(self, *arguments):
        done = subprocess.run([self.binary, *arguments], cwd=self.folder, env=self.environment, capture_output=True)
        if done.returncode:
            sys.exit(f"base input: servotwin {' '.join(arguments)}: {done.stderr.decode(errors='replace')}")
        return done.stdout

    def write(self, name, text):
        (self.folder / name).write_text(text)

    def make(self):
        systems = ROOT / "systems"
        shutil.copy(systems / "spring_actuator.toml", self.folder / "system.toml")
        self.write("study.toml", STUDY.replace("SYSTEM", "system.toml"))
        self.write("tiny.toml", (ROOT / "crates/servotwin/tests/tiny.toml").read_text()
                   + (ROOT / "crates/servotwin/tests/tiny_classes.toml").read_text())
        self.write("traces.toml", TRACES)
        self.write("x.csv", "x,n\n" + "".join(f"{k % 7},3\n" for k in range(60)))
        signal = "command=noise:rms=4deg,bandwidth=1Hz,seed=1"
        for name in ("log.csv", "log.parquet"):
            self.must("simulate", "system.toml", "--input", signal, "--duration", "6s", "--rate", "100Hz", "--out", name)
        rows = [line.split(",") for line in (self.folder / "log.csv").read_text().splitlines()]
        lines = (dict(zip(rows[0], map(float, row))) for row in rows[1:])
        self.write("log.jsonl", "".join(json.dumps(line) + "\n" for line in lines))
        self.must("study", "study.toml", "--out", "out")
        self.must("study", "study.toml", "--suite", "flights", "--out", "out")
        watch = ["watch", "log.csv", "--study", "study.toml", "--model", "out/diagnoser-realistic.json"]
        self.must(*watch, "--checkpoint", "checkpoint.json")
        self.must("watch", "log.csv", "--study", "study.toml", "--make-map", "map.toml")
        # Where the manifest vouches for a file, a changed one is refused before it is read.
        (self.folder / "out/manifest.json").rename(self.folder / "manifest.json")

    def cases(self):
        """By kind: the file that is mutated, its name beside the mutant, and the commands that read it."""
        study, model = ["--study", "study.toml"], ["--model", "out/diagnoser-realistic.json"]
        watch = lambda log, *more: ["watch", log, *study, *model, "--html", "w.html", "--events", "e.jsonl", *more]
        logs = {f"log {ending}": (f"log.{ending}", [watch("@"), ["fit", "@", *study, "--out", "fitted.toml"]])
                for ending in ("csv", "jsonl", "parquet")}
        stages = lambda *names: [[name, "out"] for name in names]
        part = next(p for p in sorted((self.folder / "out/parts").iterdir())).relative_to(self.folder)
        return {
            "study": ("study.toml", [["check", "@"], ["study", "@", "--suite", "records", "--out", "new"]]),
            "study of two": ("tiny.toml", [["check", "@"]]),
            "system": ("system.toml", [["check", "@"], ["describe", "@"],
                                       ["simulate", "@", "--duration", "0.1s", "--out", "s.csv"]]),
            "study of recordings": ("traces.toml", [["study", "@", "--out", "new"]]),
            "map": ("map.toml", [watch("log.csv", "--map", "@")]),
            **logs,
            "records": ("x.csv", [["study", "traces.toml", "--out", "new"]]),
            "diagnoser": ("out/diagnoser-realistic.json", [["watch", "log.csv", *study, "--model", "@", "--html", "w.html"]]),
            "checkpoint": ("checkpoint.json", [watch("log.csv", "--checkpoint", "@", "--resume")]),
            "data set": ("out/dataset-ideal.parquet", [["run", "cases#0@ideal", "out"]]),
            "part": (str(part), stages("features")),
            "diagnoser of records": ("out/records-ideal.json", [["run", "cases#0@ideal", "out"]]),
            "results": ("out/evaluation.json", stages("report")),
            "flights": ("out/flights.json", stages("report")),
            "manifest": ("manifest.json", stages("report")),
        }

    def run(self, folder, arguments):
        """Why the command fails the test, or None; and its exit code."""
        # A group of its own, so that nothing is left when it hangs.
        process = subprocess.Popen([self.binary, *arguments], cwd=folder, env=self.environment, stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=limits,
                                   start_new_session=True)
        try:
            _, errors = process.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.communicate()
            return f"hangs for {SECONDS} s", None
        code, text = process.returncode, errors.decode(errors="replace")
        if code < 0:
            return f"signal {-code}: {text[-300:]}", code
        if "panicked" in text or code == 101:
            return f"panic: {text[:400]}", code
        if code not in EXIT_CODES:
            return f"exit code {code}: {text[-300:]}", code
        if code and not text.strip():
            return f"exit code {code} without a message", code
        return None, code


def half_written(folder, before, code):
    """An output that is neither as it was nor complete, or a temporary file."""
    for path in folder.rglob("*"):
        if not path.is_file() or path.is_symlink():
            continue
        if path.name.endswith(".tmp"):
            return f"temporary file {path.name} is left"
        if before.get(path) == (path.stat().st_size, path.stat().st_mtime_ns):
            continue
        data = path.read_bytes()
        name = path.name
        if name.endswith(".json") and code == 0:
            # A checkpoint is two lines: its checksum, and what it is of.
            try:
                json.loads(data) if name != "checkpoint.json" else [json.loads(line) for line in data.splitlines()]
            except ValueError:
                return f"{name} is no JSON"
        if name.endswith(".html") and not data.rstrip().endswith(b"</html>"):
            return f"{name} is not complete"
        if name.endswith(".parquet") and not (data[:4] == data[-4:] == b"PAR1"):
            return f"{name} is not complete"
        if name.endswith((".csv", ".jsonl")) and data and not data.endswith(b"\n"):
            return f"{name} ends within a line"
    return None


def stamps(folder):
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path: (path.stat().st_size, path.stat().st_mtime_ns) for path in files}


def check_base(bench, base, work, cases):
    """The files before any mutation must be accepted, or mutants would test nothing but their rejection."""
    refused = []
    for kind, (file, commands) in cases.items():
        for command in commands:
            shutil.rmtree(work, ignore_errors=True)
            shutil.copytree(base, work)
            arguments = [file if word == "@" else word for word in command]
            _, code = bench.run(work, arguments)
            if code != 0:
                refused.append(f"{kind}: servotwin {' '.join(arguments)} ended with {code} before any mutation")
    if refused:
        sys.exit("\n".join(refused))


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=1000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--binary", default=ROOT / "target/debug/servotwin")
    options.add_argument("--keep", type=Path)
    options.add_argument("--only")
    options = options.parse_args()
    failures, codes = [], Counter()
    with tempfile.TemporaryDirectory(prefix="mutate-") as name:
        base = Path(name) / "base"
        base.mkdir()
        bench = Bench(options.binary, base)
        cases = bench.cases()
        kinds = [kind for kind in cases if options.only in (None, kind)]
        if not kinds:
            sys.exit(f"--only {options.only}: the kinds are {', '.join(cases)}")
        check_base(bench, base, Path(name) / "work", {kind: cases[kind] for kind in kinds})
        others = [(base / file).read_bytes() for file, _ in cases.values()]
        work = Path(name) / "work"
        for number in range(options.count):
            rng = random.Random(f"{options.seed} {number}")
            kind = kinds[number % len(kinds)]
            file, commands = cases[kind]
            shutil.rmtree(work, ignore_errors=True)
            shutil.copytree(base, work)
            mutant = mutate(rng, (base / file).read_bytes(), others)
            # It vouches for the other files only where it is mutated itself.
            (work / ("out/manifest.json" if kind == "manifest" else file)).write_bytes(mutant)
            for command in commands:
                arguments = [file if word == "@" else word for word in command]
                before = stamps(work)
                reason, code = bench.run(work, arguments)
                codes[code] += 1
                reason = reason or half_written(work, before, code)
                if reason:
                    failures.append((number, kind, arguments, reason))
                    print(f"{number} {kind}: servotwin {' '.join(arguments)}: {reason}", flush=True)
                    if options.keep:
                        options.keep.mkdir(parents=True, exist_ok=True)
                        kept = options.keep / f"{options.seed}-{number}-{Path(file).name}"
                        kept.write_bytes(mutant)
    ended = ", ".join(f"{count} with {code}" for code, count in sorted(codes.items(), key=str))
    print(f"{options.count} files of {len(kinds)} kinds, seed {options.seed}; commands ended: {ended}")
    print(f"{len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
