"""What variants of the paper's study cost, and from that the plan for ten million of them.

    python python/benchmarks/cost.py

Simulates the whole scenario `realistic`: a part of it says little, because some variants cost twenty times as much as
others. The merge is measured with runs of 0.1 s, whose windows are as large. Plans are measured with ten million
variants, the study's faults in 12,196 cases of 0.1 s, of which one share is run.
"""

import math
import re
import tempfile
from pathlib import Path

import polars
from studies import ROOT, binary, run

MANY = 10_000_000
RECORDS = ("--suite", "records")
SCENARIO = ("--scenario", "realistic")


def paper():
    """The paper's study without training commands."""
    text = (ROOT / "studies/paper.toml").read_text(encoding="utf-8")
    begin = text.index("[training]")
    end = re.search(r"^\[flights\]", text, re.MULTILINE).start()
    return text[:begin] + text[end:]


def short(text):
    """The same study with runs of 0.1 s."""
    return re.sub(r"(?m)^duration_s = .*", "duration_s = 0.1", text, count=1)


def many_cases(text):
    """The same study with so many commands that it has ten million variants."""
    commands = math.ceil(MANY / 820 / 2)
    signal = 'signals.S{0} = "noise:rms=3deg,bandwidth=1Hz,seed={0}"'
    signals = "\n".join(signal.format(k) for k in range(1, commands + 1))
    return re.sub(r"(?ms)^signals\.S1 = .*?\n\n", signals + "\n\n", text, count=1)


def size(folder, pattern):
    return sum(path.stat().st_size for path in folder.glob(pattern))


def share(folder, study, number, *scenarios):
    """Cost of a share of the parts, and the folder of its files."""
    out = folder / f"out-{number.replace('/', '-')}"
    cost = run(binary(), "study", study, *RECORDS, "--out", out, "--share", number, "--quiet", *scenarios)
    return cost, out


def rows_of(out):
    return sum(polars.scan_parquet(path).select(polars.len()).collect().item() for path in out.glob("parts/*.parquet"))


def main():
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        folder = Path(name)
        study = folder / "paper.toml"
        study.write_text(paper(), encoding="utf-8")
        cost, out = share(folder, study, "1/1", *SCENARIO)
        variants = rows_of(out)
        seconds, stored = cost.processor_s / variants, size(out, "parts/*.parquet") / variants
        print(f"{variants} variants: {cost.wall_s:.0f} s, {cost.processor_s:.0f} s of processor, {cost.memory_mb:.0f} MB")
        print(f"a variant: {1e3 * seconds:.1f} ms of processor, {stored:.0f} bytes in its part")

        brief = folder / "short.toml"
        brief.write_text(short(paper()), encoding="utf-8")
        _, out = share(folder / "short", brief, "1/1", *SCENARIO)
        merge = run(binary(), "study", out, *RECORDS, "--quiet", *SCENARIO)
        rows = rows_of(out)
        table = size(out, "dataset-*.parquet") / rows
        merged = merge.processor_s / rows
        print(f"merge of {rows}: {1e3 * merged:.2f} ms a variant, {merge.memory_mb:.0f} MB; {table:.0f} bytes a row")

        long = folder / "long.toml"
        long.write_text(many_cases(short(paper())), encoding="utf-8")
        tiny, out = share(folder, long, "1/100000", *SCENARIO)
        print(f"{rows_of(out)} of ten million variants: {tiny.processor_s:.0f} s, {tiny.memory_mb:.0f} MB")

    shares = 1000
    print(f"ten million variants: {MANY * seconds / 3600:.0f} hours of a core;")
    print(f"  in {shares} shares {MANY / shares * seconds / 3600:.2f} h each, {shares * tiny.processor_s / 3600:.1f} h of all for plans;")
    print(f"  {MANY * stored / 1e9:.0f} GB of parts, {MANY * table / 1e9:.0f} GB of data set;")
    print(f"  merge {MANY * merged / 3600:.1f} h of a core")


if __name__ == "__main__":
    main()
