"""What Python and Dask cost beside the command line, and a step from Python beside one in Rust.

    python python/benchmarks/overhead.py [rounds]

The two sides take turns, and medians over the rounds are compared: others may use the machine. The records are
those of the command line's test study with runs of 20 s, some 1,600 variants in three scenarios, beside which a start of a
tenth of a second is small.
"""

import statistics
import sys
import tempfile
import time
from pathlib import Path

import servotwin
from studies import binary, many, run

STEPS = 500


def study_text():
    text = many(1600, duration_s=20)
    return text.replace("sample_hz = 20", "sample_hz = 50")


def command_line(study, out):
    return run(binary(), "study", study, "--suite", "records", "--out", out, "--threads", "2", "--quiet")


def python(study, out):
    code = (
        "import sys, servotwin;"
        "servotwin.run_suites(servotwin.Study(sys.argv[1]), sys.argv[2], ['records'], threads=2, progress=False)"
    )
    return run(sys.executable, "-c", code, study, out)


def compare(title, limit, rounds, one, other):
    """Prints the median over rounds of what the other takes more, in wall time and processor time."""
    pairs = []
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        for k in range(rounds):
            sides = [(one, "a"), (other, "b")]
            costs = {
                side: function(Path(name) / f"{side}{k}")
                for function, side in (sides if k % 2 == 0 else sides[::-1])
            }
            pairs.append((costs["a"], costs["b"]))
    for place, what in enumerate(["wall time", "processor time"]):
        a, b = (statistics.median(pair[side][place] for pair in pairs) for side in (0, 1))
        print(f"{title}: {what} {a:.2f} s and {b:.2f} s, {100 * (b / a - 1):+.1f} % (limit {limit} %)")
    sys.stdout.flush()


def dask(rounds, study, text):
    from distributed import Client, LocalCluster

    from servotwin import distributed

    parsed = servotwin.Study.parse(text, str(study))
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with LocalCluster(**options) as cluster, Client(cluster) as client:

        def processor_s():
            times = client.run(lambda: time.process_time())
            return sum(times.values()) + time.process_time()

        def on_dask(out):
            before, begin = processor_s(), time.monotonic()
            distributed.run_suites(parsed, client, str(out), ["records"], progress=False)
            return time.monotonic() - begin, processor_s() - before, 0.0

        compare(
            "Dask over the command line", 10, rounds, lambda out: command_line(study, out), on_dask
        )


def step(rounds):
    """A twin stepped in Python and one that runs whole arrays in Rust, some steps each in turn."""
    system = servotwin.System()
    twins = [servotwin.Twin(system, between={"command": "cubic"}) for _ in range(2)]
    start, place = list(system.inputs["default"]), twins[0].inputs.index("command")
    commands = [0.01 * (k % 50) / 50 for k in range(STEPS)]
    rows = [[*start[:place], value, *start[place + 1 :]] for value in commands]
    for twin in twins:
        twin.step(rows[0])
    in_rust, in_python = [], []
    for _ in range(20 * rounds):
        begin = time.process_time()
        twins[0].run(rows)
        middle = time.process_time()
        for row in rows:
            twins[1].step(row)
        in_rust.append((middle - begin) / STEPS)
        in_python.append((time.process_time() - middle) / STEPS)
    a, b = (1e6 * statistics.median(times) for times in (in_rust, in_python))
    print(
        f"Twin.step: {a:.2f} us of processor in Rust, {b:.2f} us from Python, {b - a:+.2f} us (limit 5 us)",
        flush=True,
    )


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    step(rounds)
    text = study_text()
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        study = Path(name) / "study.toml"
        study.write_text(text, encoding="utf-8")
        compare(
            "Python over the command line",
            3,
            rounds,
            lambda out: command_line(study, out),
            lambda out: python(study, out),
        )
        dask(rounds, study, text)


if __name__ == "__main__":
    main()
