"""Memory of the parts of records, of the merge and of all records in one go, by the number of variants.

    python python/benchmarks/memory.py [variants ...]

Eight sensors, runs of 0.1 s (the length of runs with a fault takes no memory), three scenarios, twenty parts.
"""

import shutil
import sys
import tempfile
from pathlib import Path

from studies import binary, many, run

PARTS = 20
RECORDS = ("--suite", "records")


def measure(variants, folder):
    study = folder / "study.toml"
    study.write_text(many(variants), encoding="utf-8")
    parts, whole = folder / "parts", folder / "whole"
    costs = [
        run(binary(), "study", study, *RECORDS, "--out", parts, "--share", f"{k}/{PARTS}", "--quiet")
        for k in range(1, PARTS + 1)
    ]
    merge = run(binary(), "study", parts, *RECORDS, "--quiet")
    shutil.rmtree(parts)
    all_at_once = run(binary(), "study", study, *RECORDS, "--out", whole, "--quiet")
    shutil.rmtree(whole)
    return max(cost.memory_mb for cost in costs), merge, all_at_once


def main():
    print("variants  a part MB  merge MB  merge s of processor  in one go MB")
    for variants in [int(text) for text in sys.argv[1:]] or [20_000, 60_000, 200_000]:
        with tempfile.TemporaryDirectory(prefix="servotwin-") as name:
            part, merge, whole = measure(variants, Path(name))
        print(
            f"{variants:8}  {part:9.0f}  {merge.memory_mb:8.0f}"
            f"  {merge.processor_s:20.1f}  {whole.memory_mb:12.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
