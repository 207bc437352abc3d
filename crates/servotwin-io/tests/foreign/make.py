"""Makes the Parquet files of other writers that tests/all/table.rs reads.

Made with pyarrow 26.0.1, pandas 3.1.1 and polars 2.1.0: python make.py, in this folder.
"""

from decimal import Decimal

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

pd.DataFrame(
    {
        "x_m": [1.0, 2.5],
        "n": np.array([1, 2], dtype="int8"),
        "u": np.array([1, 2], dtype="uint16"),
        "ok": [True, False],
        "s": ["a", "b"],
        "c": pd.Categorical(["b", "a"]),
    }
).to_parquet("pandas.parquet")

frame = pl.DataFrame(
    {"x_m": [1.0, 2.5], "s": ["a", "b"], "c": pl.Series(["b", "a"], dtype=pl.Categorical)}
)
for codec in ["snappy", "gzip", "lz4", "zstd", "brotli"]:
    frame.write_parquet(f"polars_{codec}.parquet", compression=codec)

when = [1_795_341_600_000 + 10 * k for k in range(3)]  # 2026-11-22, ten o'clock
pq.write_table(
    pa.table(
        {
            "milli": pa.array(when, pa.timestamp("ms")),
            "micro": pa.array([v * 1000 for v in when], pa.timestamp("us", tz="UTC")),
            "nano": pa.array([v * 1000000 for v in when], pa.timestamp("ns")),
            "text": [f"2026-11-22T10:00:00.{10 * k:03d}Z" for k in range(3)],
        }
    ),
    "when.parquet",
)
# Times that are no moments, and moments as older writers store them; the schema of "older" says nanoseconds.
apart = [10 * k for k in range(3)]  # ms
times = {
    "duration_ns": pa.array([v * 1000000 for v in apart], pa.duration("ns")),
    "duration_s": pa.array([0, 1, 2], pa.duration("s")),
    "of_day_ms": pa.array([28_800_000 + v for v in apart], pa.time32("ms")),
    "of_day_us": pa.array([1000 * (28_800_000 + v) for v in apart], pa.time64("us")),
    "day": pa.array([20779, 20780, -1], pa.date32()),
    "nano": pa.array([v * 1000000 for v in when], pa.timestamp("ns")),
}
pq.write_table(pa.table(times), "times.parquet", coerce_timestamps="ms")
older = {"int96": times["nano"]}
pq.write_table(pa.table(older), "int96.parquet", use_deprecated_int96_timestamps=True)
index = pd.to_datetime(when, unit="ms", utc=True).tz_convert("Europe/Berlin")
pd.DataFrame({"x_m": [1.0, 2.0, 3.0]}, index=index).to_parquet("index.parquet")
gaps = {
    "whole": pa.array([1, None, 3], pa.int64()),
    "small": pa.array([1, None, 3], pa.uint8()),
    "real": pa.array([1.5, None, 3.5]),
    "ok": pa.array([True, None, False]),
    "s": pa.array(["a", None, "c"]),
}
pq.write_table(pa.table(gaps), "gaps.parquet")
# A few kilobytes that are 5 GB of text, and 200 MB of it in another encoding; a column beside them.
large = pa.array(["x" * 1_000_000] * 5000)
pq.write_table(
    pa.table({"a": [1.0] * 5000, "comment": large}), "large_text.parquet", compression="zstd"
)
large = pa.array(["x" * 10_000] * 20_000)
pq.write_table(
    pa.table({"a": [1.0] * 20_000, "comment": large}),
    "shared_text.parquet",
    compression="zstd",
    use_dictionary=False,
    column_encoding={"comment": "DELTA_BYTE_ARRAY"},
)
prices = pa.array([Decimal("1.5"), Decimal("2.5")], pa.decimal128(5, 1))
pq.write_table(pa.table({"a": [1.0, 2.0], "price": prices}), "decimal.parquet")
pq.write_table(pa.table({"a": pa.array([1, 2**63], pa.uint64())}), "large.parquet")

# Every type, in several row groups and pages, with what newer writers use.
n = np.arange(600)
every = pa.table(
    {
        "i8": pa.array(n % 256 - 128, pa.int8()),
        "i16": pa.array(n * 100 - 30000, pa.int16()),
        "i32": pa.array(n * 3500000 - 10**9, pa.int32()),
        "i64": pa.array(n * 10**15, pa.int64()),
        "u8": pa.array(n % 256, pa.uint8()),
        "u16": pa.array(n * 100, pa.uint16()),
        "u32": pa.array(n * 7000000, pa.uint32()),
        "u64": pa.array(n * 10**15, pa.uint64()),
        "f16": pa.array((n / 8 - 10).astype("float16")),
        "f32": pa.array(n / 8, pa.float32()),
        "f64": pa.array(n / 3, pa.float64()),
        "ok": pa.array(n % 3 == 0),
        "s": pa.array([f"row {i}" for i in n]),
        "large": pa.array([f"row {i}" for i in n], pa.large_string()),
        "chosen": pa.array([f"{i % 7}" for i in n]).dictionary_encode(),
        "level": pa.array(n % 5, pa.int16()).dictionary_encode(),
    }
)
pq.write_table(every, "every_plain.parquet", compression="gzip", row_group_size=250)
pq.write_table(
    every,
    "every_version_2.parquet",
    compression="zstd",
    row_group_size=220,
    data_page_size=500,
    write_batch_size=100,
    data_page_version="2.0",
    use_dictionary=["chosen", "level"],
    column_encoding={
        "i32": "DELTA_BINARY_PACKED",
        "f64": "BYTE_STREAM_SPLIT",
        "s": "DELTA_BYTE_ARRAY",
        "large": "DELTA_LENGTH_BYTE_ARRAY",
    },
)
