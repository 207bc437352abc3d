"""Makes the Parquet files of other writers that tests/all/table.rs reads.

Made with pyarrow 26.0.1, pandas 3.1.1 and polars 2.1.0: python make.py, in this folder.
"""

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
for codec in ["snappy", "gzip", "lz4", "zstd"]:
    frame.write_parquet(f"polars_{codec}.parquet", compression=codec)

pq.write_table(pa.table({"a": [1.0, None]}), "null.parquet")
pq.write_table(
    pa.table({"a": [1.0, 2.0], "when": pa.array([1, 2], pa.timestamp("ms"))}), "when.parquet"
)
pq.write_table(pa.table({"a": pa.array([1, 2**63], pa.uint64())}), "large.parquet")
