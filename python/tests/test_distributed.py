"""Suites on Dask: separate processes, a worker killed, a storage that fails, an S3 server."""

import os
import signal
import socket
import subprocess
import sys

import pytest
from tiny import STUDY, contents, many_parts, with_fitted

import servotwin

from distributed import Client

from servotwin import _servotwin, distributed

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study():
    return servotwin.Study.parse(many_parts())


@pytest.fixture(scope="module")
def whole(study, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    servotwin.run_suites(study, out, ["records"], progress=False)
    return contents(out)


class Cluster:
    """A scheduler and workers, each a command of its own."""

    def __init__(self, workers, *preload):
        self.preload = preload
        self.port = free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.processes = []
        self.scheduler = self.start("scheduler", "--port", str(self.port), "--no-dashboard")
        self.workers = [self.worker() for _ in range(workers)]

    def start(self, what, *arguments):
        code = f"import sys; from distributed.cli.dask_{what} import main; main()"
        command = [sys.executable, "-c", code, "--host", "127.0.0.1", *arguments]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(command, **quiet)
        self.processes.append(process)
        return process

    def worker(self):
        options = ["--nthreads", "1", "--no-dashboard", "--no-nanny"]
        options += [f"--preload={path}" for path in self.preload]
        return self.start("worker", self.address, *options)

    def client(self, workers):
        client = Client(self.address, timeout=60)
        client.wait_for_workers(workers, timeout=60)
        return client

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.wait()


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def assert_same(folder, whole):
    found = contents(folder)
    assert sorted(found) == sorted(whole)
    assert {name for name in whole if found[name] != whole[name]} == set()


def test_there_are_several_tasks_and_none_knows_another(study):
    tasks = _servotwin.tasks_of(study, ["records"])
    files = [file for task in tasks for file in task[3]]
    assert len(tasks) > 4 and len(files) == len(set(files))


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_the_bytes_are_those_of_one_machine(study, whole, tmp_path, workers):
    with Cluster(workers) as cluster, cluster.client(workers) as client:
        distributed.run_suites(study, client, str(tmp_path), ["records"], progress=False)
    assert_same(tmp_path, whole)


def test_a_worker_that_is_killed_is_replaced_by_others(study, whole, tmp_path):
    with Cluster(2) as cluster, cluster.client(2) as client:
        killed = []

        def kill(what, done, all):
            if not killed:
                os.kill(cluster.workers[0].pid, signal.SIGKILL)
                killed.append(done)

        distributed.run_suites(study, client, str(tmp_path), ["records"], progress=kill)
        assert killed
    assert_same(tmp_path, whole)


def test_a_suite_goes_on_with_a_new_scheduler(study, whole, tmp_path):
    class Enough(Exception):
        pass

    def stop(what, done, all):
        if done < all:
            raise Enough

    with Cluster(1) as cluster, cluster.client(1) as client:
        with pytest.raises(Enough):
            distributed.run_suites(study, client, str(tmp_path), ["records"], progress=stop)
    there = {name for name in contents(tmp_path) if name.startswith("parts")}
    assert there
    assert not any(".tmp" in name for name in there)
    with Cluster(1) as cluster, cluster.client(1) as client:
        distributed.run_suites(study, client, str(tmp_path), ["records"], progress=False)
    assert_same(tmp_path, whole)


def test_another_study_in_the_folder_is_refused(study, tmp_path):
    (tmp_path / "study.toml").write_text("name = 'other'")
    with pytest.raises(ValueError, match="another study"):
        distributed.run_suites(study, None, str(tmp_path), ["records"], progress=False)


def test_a_storage_that_fails_one_write_in_ten_gives_the_same_bytes(tmp_path, monkeypatch):
    from fsspec.implementations.local import LocalFileSystem

    real, count = LocalFileSystem.pipe_file, [0]

    def failing(self, path, value, **options):
        count[0] += 1
        if count[0] % 10 == 0:
            real(self, path, value[: len(value) // 2], **options)
            raise OSError("the disk has a bad day")
        return real(self, path, value, **options)

    monkeypatch.setattr(LocalFileSystem, "pipe_file", failing)
    monkeypatch.setattr(distributed.time, "sleep", lambda _: None)
    store = distributed._Store(str(tmp_path / "out"), {})
    for k in range(100):
        path = tmp_path / "file"
        path.write_bytes(bytes([k]) * 100)
        store.put(path, f"parts/{k}")
    written = contents(tmp_path / "out")
    assert count[0] > 100
    assert written == {f"parts/{k}": bytes([k]) * 100 for k in range(100)}
    # A storage that always fails gives an error, and nothing half-written.
    monkeypatch.setattr(LocalFileSystem, "pipe_file", lambda *_, **__: (_ for _ in ()).throw(OSError()))
    with pytest.raises(OSError):
        store.put(path, "parts/never")
    assert contents(tmp_path / "out") == written


def test_a_suite_into_a_storage_that_fails_one_write_in_ten(study, whole, tmp_path, monkeypatch):
    import flaky

    notes, out = tmp_path / "notes", tmp_path / "out"
    notes.mkdir()
    monkeypatch.setenv("FLAKY_NOTES", str(notes))
    with Cluster(2, flaky.__file__) as cluster, cluster.client(2) as client:
        distributed.run_suites(study, client, f"flaky://{out}", ["records"], progress=False)
    assert {note.name.split("-")[0] for note in notes.iterdir()} - {str(os.getpid())}, "in workers"
    assert_same(out, whole)


def test_the_scenario_fitted_has_the_bytes_of_one_machine(tmp_path):
    fitted = servotwin.Study.parse(with_fitted())
    alone, shared = tmp_path / "alone", tmp_path / "shared"
    options = {"suites": ["records"], "scenarios": ["fitted"], "progress": False}
    servotwin.run_suites(fitted, alone, **options)
    with Cluster(2) as cluster, cluster.client(2) as client:
        distributed.run_suites(fitted, client, str(shared), **options)
    assert_same(shared, contents(alone))
    # In shares, without Dask.
    parts = tmp_path / "parts"
    for share in ("2/2", "1/2"):
        servotwin.run_suites(fitted, parts, share=share, **options)
    servotwin.run_suites(fitted, parts, **options)
    assert_same(parts, contents(alone))


FLOWN = ["flights", "healthy"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A study, and what its flights leave on one machine."""
    text = STUDY.replace("unseen = {", "healthy = { environments = 4 }\nunseen = {")
    study = servotwin.Study.parse(text)
    out = tmp_path_factory.mktemp("flown")
    servotwin.run_suites(study, out, ["flights"], progress=False)
    servotwin.run_suites(study, out, FLOWN[1:], progress=False)
    return study, contents(out)


def test_flights_have_the_bytes_of_one_machine_though_a_worker_is_killed(flown, tmp_path):
    study, whole = flown
    with Cluster(2) as cluster, cluster.client(2) as client:
        killed = []

        def kill(what, done, all):
            if not killed:
                os.kill(cluster.workers[0].pid, signal.SIGKILL)
                killed.append(done)

        distributed.run_suites(study, client, str(tmp_path), FLOWN, progress=kill)
        assert killed
    assert_same(tmp_path, whole)


def test_an_s3_server_holds_the_same_bytes(study, whole, flown):
    import fsspec
    from moto import server

    port = free_port()
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    running.start()
    try:
        options = {
            "key": "any",
            "secret": "any",
            "client_kwargs": {"endpoint_url": f"http://127.0.0.1:{port}", "region_name": "eu-central-1"},
        }
        fs = fsspec.filesystem("s3", **options)
        fs.mkdir("studies")
        with Cluster(2) as cluster, cluster.client(2) as client:
            given = {"storage_options": options, "progress": False}
            distributed.run_suites(study, client, "s3://studies/one", ["records"], **given)
            distributed.run_suites(flown[0], client, "s3://studies/flown", FLOWN, **given)
        fs.invalidate_cache()
        for folder, expected in (("one", whole), ("flown", flown[1])):
            paths = fs.find(f"studies/{folder}")
            found = {path.split(f"{folder}/", 1)[1]: fs.cat(path) for path in paths}
            assert sorted(found) == sorted(expected)
            assert {name for name in expected if found[name] != expected[name]} == set()
    finally:
        running.stop()
