"""What a package has to bear: many calls, threads, a fork, and being sent elsewhere."""

import multiprocessing
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from tiny import STUDY, with_fitted

import servotwin

OPTIONS = {"inputs": {"command": "step:size=2deg,at=0.02s"}, "duration_s": 0.1}


def resident_bytes():
    pages = Path("/proc/self/statm").read_text().split()[1]
    return int(pages) * 4096


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("kind", ["step", "step by name", "column", "arrow", "save", "mistake"])
def test_a_hundred_thousand_calls_leave_memory_flat(system, kind):
    run = servotwin.simulate(system, **OPTIONS)
    twin = servotwin.Twin(system, record=["p_a_1"])
    sample = [0.0] * len(twin.inputs)
    twin.step(sample)

    def mistake():
        try:
            twin.step({"comand": 0.0})
        except servotwin.UnknownNameError:
            return
        raise AssertionError("there is no such input")

    call = {
        "step": lambda: twin.step(sample),
        "step by name": lambda: twin.step({"command": 0.0}),
        "column": lambda: run["p_a_1_pa"],
        "arrow": lambda: run.__arrow_c_array__(),
        "save": lambda: twin.save(),
        "mistake": mistake,
    }[kind]
    for _ in range(3_000):
        call()
    before = resident_bytes()
    for _ in range(100_000 if kind != "save" else 10_000):
        call()
    # A leak of one small object, 48 bytes, a call would be 4.8 MB.
    assert resident_bytes() - before < 2_500_000


def test_threads_that_share_objects_get_the_bits_of_one(system):
    run = servotwin.simulate(system, **OPTIONS)
    study = servotwin.Study.parse(STUDY)

    def work(k):
        twin = servotwin.Twin(system, between={"command": "cubic"})
        stepped = [twin.step({"command": 0.001 * n}) for n in range(20)]
        return servotwin.simulate(system, **OPTIONS), stepped, len(study.faults), run["time_s"].sum()

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(work, range(8)))
    assert all(one == found[0] for one in found)
    assert found[0][0] == run


def test_a_twin_that_two_threads_step_at_once_says_so_or_waits(system):
    twin = servotwin.Twin(system)

    def work(_):
        stepped = 0
        for _ in range(200):
            try:
                twin.step({"command": 0.0})
                stepped += 1
            except RuntimeError:
                pass
        return stepped

    with ThreadPoolExecutor(2) as pool:
        stepped = sum(pool.map(work, range(2)))
    assert twin.sample == stepped - 1


def in_child(_):
    system = servotwin.System()
    both = servotwin.simulate_many(system, [OPTIONS_OF_ONE, OPTIONS_OF_ONE], duration_s=0.1, threads=2)
    return [np.asarray(run["p_a_1_pa"]) for run in both]


OPTIONS_OF_ONE = {"inputs": OPTIONS["inputs"]}


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_works_on(system):
    # Threads have worked before the fork, as in a server.
    expected = in_child(0)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        for found in pool.map_async(in_child, range(2)).get(timeout=60):
            assert all(np.array_equal(a, b) for a, b in zip(found, expected))
    assert np.array_equal(in_child(0)[0], expected[0])


def test_everything_that_dask_sends_can_be_pickled():
    from servotwin import distributed

    study = servotwin.Study.parse(with_fitted())
    sent = []

    class Recorder:
        """A client that keeps what it is asked to send."""

        def submit(self, function, *arguments, **options):
            sent.append((function, arguments))
            return object()

        def cancel(self, futures):
            pass

    from servotwin import _servotwin

    for scenarios in (None, ["fitted"]):
        tasks = _servotwin.tasks_of(study, ["records"], scenarios)
        distributed._submitted(study, Recorder(), ("/nowhere", {}), tasks, 1)
    assert {function.__name__ for function, _ in sent} == {"_part"}
    for function, arguments in sent:
        again, values = pickle.loads(pickle.dumps((function, arguments)))
        assert again is function and values == arguments
    # What users send themselves.
    system = study.system
    assert pickle.loads(pickle.dumps(system)).text == system.text
    assert pickle.loads(pickle.dumps(study)).text == study.text
    table = study.faults
    assert pickle.loads(pickle.dumps(table)) == table
    error = servotwin.MistakesError
    with pytest.raises(error) as raised:
        servotwin.Study.parse(STUDY.replace("sample_hz = 50", "sample_hz = -50"), "mine.toml")
    again = pickle.loads(pickle.dumps(raised.value))
    assert (type(again), again.file, again.line) == (error, "mine.toml", raised.value.line)
    assert str(again) == str(raised.value)
