"""Tables: NumPy, Arrow, files, pickles."""

import gc
import os
import pickle
import sys

import numpy as np
import pytest

import servotwin


def mixed():
    columns = {
        "float": np.array([1.5, np.nan, -0.0]),
        "whole": np.array([1, -2, 3]),
        "count": np.array([1, 2, 2**32 - 1], dtype=np.uint32),
        "flag": np.array([True, False, True]),
        "text": ["ä", "", "c,\"d\""],
    }
    return servotwin.Table(columns, units={"float": "Pa"}, metadata={"made": "here"})


def test_columns_are_shown_without_a_copy_and_cannot_be_written():
    table = mixed()
    first, second = table["float"], table["float"]
    assert first.ctypes.data == second.ctypes.data
    with pytest.raises(ValueError):
        first[0] = 2
    del table
    gc.collect()
    assert first[0] == 1.5
    with pytest.raises(KeyError):
        mixed()["none"]


def test_pyarrow_reads_types_units_and_values_without_a_copy():
    import pyarrow as pa

    table = mixed()
    arrow = pa.table(table)
    arrow.validate(full=True)
    assert [str(f.type) for f in arrow.schema] == [
        "double", "int64", "uint32", "bool", "large_string",
    ]
    assert arrow.schema.field("float").metadata == {b"unit": b"Pa"}
    assert arrow.schema.metadata == {b"made": b"here"}
    assert arrow["text"].to_pylist() == ["ä", "", 'c,"d"']
    assert arrow["flag"].to_pylist() == [True, False, True]
    assert arrow["count"].to_pylist() == [1, 2, 2**32 - 1]
    buffer = arrow["float"].chunk(0).buffers()[1]
    assert buffer.address == table["float"].ctypes.data
    # The batch and the schema alone, and a stream that nobody reads.
    assert pa.record_batch(table).num_rows == 3
    assert pa.schema(table).names == table.columns
    table.__arrow_c_stream__(), table.__arrow_c_array__(), table.__arrow_c_schema__()


def test_pandas_polars_and_duckdb_take_a_table():
    import duckdb
    import pandas
    import polars

    table = mixed()
    frame = table.to_pandas()
    assert list(frame.columns) == table.columns and list(frame["whole"]) == [1, -2, 3]
    assert isinstance(frame, pandas.DataFrame)
    assert polars.DataFrame(table)["text"].to_list() == ["ä", "", 'c,"d"']
    connection = duckdb.connect()
    connection.register("mine", table.to_arrow())
    assert connection.execute("select sum(whole) from mine").fetchall() == [(2,)]
    assert servotwin.Table(frame)["whole"].tolist() == [1, -2, 3]


@pytest.mark.parametrize("rows", [0, 1, 7, 8, 9, 1000])
def test_any_number_of_rows(rows):
    import pyarrow as pa

    flags = np.arange(rows) % 3 == 0
    texts = [str(k) for k in range(rows)]
    table = servotwin.Table({"flag": flags, "number": np.arange(rows) * 0.5})
    assert len(table) == rows
    arrow = pa.table(table)
    arrow.validate(full=True)
    assert arrow["flag"].to_pylist() == flags.tolist()
    if rows:
        assert pa.table(servotwin.Table({"t": texts}))["t"].to_pylist() == texts


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_files_give_the_table_back(tmp_path, ending):
    table = servotwin.Table({"x": [1.5, 2.5], "t": ["a", "b"]})
    path = tmp_path / f"table.{ending}"
    table.write(path)
    again = servotwin.Table.read(path)
    assert again.columns == ["x", "t"] and list(again["x"]) == [1.5, 2.5]
    with pytest.raises(servotwin.FileError):
        table.write(tmp_path / "none" / f"table.{ending}")
    with pytest.raises(servotwin.InputError):
        table.write(tmp_path / "table.xlsx")


def test_a_broken_file_is_refused_with_its_line(tmp_path):
    path = tmp_path / "broken.csv"
    path.write_text("a,b\n1,2\n3\n")
    with pytest.raises(servotwin.MistakesError) as raised:
        servotwin.Table.read(path)
    assert (raised.value.file, raised.value.line) == (str(path), 3)


def test_tables_can_be_pickled():
    table = mixed()
    again = pickle.loads(pickle.dumps(table))
    assert pickle.dumps(again) == pickle.dumps(table)
    assert again.units == table.units and again.metadata == table.metadata
    assert again["count"].dtype == np.uint32
    empty = servotwin.Table({"x": np.zeros(0)})
    assert pickle.loads(pickle.dumps(empty)) == empty


def test_a_masked_number_is_missing_and_nothing_else_can_be_masked():
    mask = [False, True, False]
    for values in ([1.0, 2.0, 3.0], [1, 999_999, 3], np.array([1, 2, 3], "u2")):
        column = servotwin.Table({"x": np.ma.MaskedArray(values, mask=mask)})["x"]
        assert column.tolist()[::2] == [1.0, 3.0] and np.isnan(column[1])
    whole = servotwin.Table({"x": np.ma.MaskedArray([1, 2], mask=[False, False])})["x"]
    assert whole.dtype == np.int64
    for values in (["a", "b", "c"], [True, False, True]):
        with pytest.raises(servotwin.InputError, match="only numbers can be masked"):
            servotwin.Table({"x": np.ma.MaskedArray(values, mask=mask)})


def test_a_number_that_does_not_fit_is_refused():
    largest = servotwin.Table({"x": np.array([2**63 - 1, 1], "u8")})["x"]
    assert largest.tolist() == [2**63 - 1, 1]
    wrong = [np.array([1, 2**64 - 1], "u8"), [2**63], [2**70], [10**400], np.array([1 + 2j])]
    if np.finfo(np.longdouble).max > np.finfo(np.float64).max:
        wrong.append(np.array([1.0, np.longdouble("1e400")]))
    for values in wrong:
        with pytest.raises(servotwin.InputError):
            servotwin.Table({"x": values})
    for dates in (np.array(["2026-11-21"], "M8[ms]"), np.array([10], "m8[ms]")):
        with pytest.raises(servotwin.InputError, match="dates or durations"):
            servotwin.Table({"time_s": dates})


def test_every_data_frame_becomes_a_table_and_no_table_becomes_its_names():
    import pandas
    import polars
    import pyarrow as pa

    columns = {"x": [1.5, 2.5], "n": [1, 2], "t": ["a", "b"]}
    plain = servotwin.Table(columns)
    for frame in (pandas.DataFrame(columns), polars.DataFrame(columns), pa.table(columns), plain):
        table = servotwin.Table(frame)
        assert table.columns == ["x", "n", "t"]
        assert [table[name].tolist() for name in table] == list(columns.values())
    assert dict(plain)["n"].tolist() == [1, 2]
    for wrong in (pandas.DataFrame, np.asarray):
        with pytest.raises(servotwin.InputError, match="to_pandas"):
            wrong(plain)
    with pytest.raises(servotwin.InputError, match="made of arrays by name"):
        servotwin.Table(3.0)


def test_every_error_is_of_the_package(system):
    with pytest.raises(servotwin.UnknownNameError, match="did you mean 'float'") as raised:
        mixed()["flot"]
    assert isinstance(raised.value, KeyError) and str(raised.value).startswith("the table has")
    for options in ({"duration_s": 10**400}, {"noise": -1}, {"faults": {"a": 10**400}}):
        with pytest.raises(servotwin.Error):
            servotwin.simulate(system, **options)
    with pytest.raises(servotwin.Error):
        servotwin.simulate_many(system, [{}], threads=-1)
    with pytest.raises(servotwin.Error):
        servotwin.Twin(system).step({"command": 10**400})


def test_columns_that_do_not_fit_are_refused():
    with pytest.raises(servotwin.InputError):
        servotwin.Table({"a": [1.0, 2.0], "b": [1.0]})
    with pytest.raises(servotwin.InputError):
        servotwin.Table({"a": np.zeros((2, 2))})
    with pytest.raises(servotwin.InputError):
        servotwin.Table({"a": [object()]})


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_stays_flat_over_many_calls(system):
    import pyarrow as pa


    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    table = servotwin.Table({"x": np.zeros(2000), "t": ["text"] * 2000})
    twin = servotwin.Twin(system)
    defaults = list(system.inputs["default"])

    def calls(count):
        for k in range(count):
            table["x"]
            table.units
            twin.values
            table.__arrow_c_stream__()
            if k % 20 == 0:
                pa.table(table)
            if k % 50 == 0:
                twin.step(defaults)
            if k % 100 == 0:
                with pytest.raises(servotwin.UnknownNameError):
                    servotwin.simulate(system, record=["nothing"])
        gc.collect()

    calls(5_000)
    before = resident()
    calls(100_000)
    assert resident() - before < 4e6


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_child_after_a_fork_simulates_the_same(system):
    expected = servotwin.simulate(system, duration_s=0.1)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        same = servotwin.simulate(system, duration_s=0.1) == expected
        os.write(write, b"same" if same else b"else")
        os._exit(0)
    os.waitpid(child, 0)
    assert os.read(read, 4) == b"same"
