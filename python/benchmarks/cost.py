"""What variants of the paper's study cost, and from that the plan for ten million of them.

    python python/benchmarks/cost.py

Simulates the whole setting `realistic`: a part of it says little, because some variants cost twenty times as much as
others. The merge is measured with runs of 0.1 s, whose windows are as large. Plans are measured with ten million variants, the study's faults in 12,196 cases of 0.1 s, of
which one shard is run.
"""

import math
import re
import tempfile
from pathlib import Path

from studies import ROOT, binary, run

SHARD = 205
MANY = 10_000_000
SETTING = ("--setting", "realistic")


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


def part(folder, study, shards, *settings):
    """Cost of a part, its variants, and the bytes of its shards."""
    out = folder / f"out-{shards.replace('/', '-')}"
    cost = run(binary(), "campaign", study, "--out", out, "--shards", shards, "--quiet", *settings)
    files = len(list(out.glob("shards/*.parquet")))
    return cost, files * SHARD, size(out, "shards/*.parquet")


def main():
    with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
        folder = Path(name)
        study = folder / "paper.toml"
        study.write_text(paper(), encoding="utf-8")
        cost, variants, shards_size = part(folder, study, "1/1", *SETTING)
        seconds, shard_bytes = cost.processor_s / variants, shards_size / variants
        print(f"{variants} variants: {cost.wall_s:.0f} s, {cost.processor_s:.0f} s of processor, {cost.memory_mb:.0f} MB")
        print(f"a variant: {1e3 * seconds:.1f} ms of processor, {shard_bytes:.0f} bytes in its shard")
        print(f"a shard of {SHARD}: {SHARD * seconds:.1f} s, {SHARD * shard_bytes / 1e3:.0f} kB")

        brief = folder / "short.toml"
        brief.write_text(short(paper()), encoding="utf-8")
        out = folder / "short"
        run(binary(), "campaign", brief, "--out", out, "--shards", "1/1", "--quiet", *SETTING)
        merge = run(binary(), "merge", out, "--quiet", *SETTING)
        rows = len(list(out.glob("shards/*.parquet"))) * SHARD
        table = size(out, "dataset-*.parquet") / rows
        merged = merge.processor_s / rows
        print(f"merge of {rows}: {1e3 * merged:.2f} ms a variant, {merge.memory_mb:.0f} MB; {table:.0f} bytes a row")

        long = folder / "long.toml"
        long.write_text(many_cases(short(paper())), encoding="utf-8")
        tiny, found, _ = part(folder, long, "1/100000", *SETTING)
        assert found == SHARD
        print(f"one shard of ten million variants: {tiny.processor_s:.0f} s, {tiny.memory_mb:.0f} MB")

    shards = math.ceil(MANY / SHARD)
    parts = 1000
    print(f"ten million variants: {MANY * seconds / 3600:.0f} hours of a core in {shards} shards;")
    print(f"  in {parts} parts {MANY / parts * seconds / 3600:.2f} h each, {parts * tiny.processor_s / 3600:.1f} h of all for plans;")
    print(f"  {MANY * shard_bytes / 1e9:.0f} GB of shards, {MANY * table / 1e9:.0f} GB of data set;")
    print(f"  merge {MANY * merged / 3600:.1f} h of a core")


if __name__ == "__main__":
    main()
