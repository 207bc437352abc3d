"""The live page beside a notebook: it starts, shows itself, is saved, and ends with whoever started it."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest

import servotwin

PATIENCE_S = 60

STARTED = """
import sys, time, servotwin
page = servotwin.live(sys.argv[1], out=sys.argv[2])
print(page.url, flush=True)
if sys.argv[3] == "wait":
    time.sleep(600)
"""


def asked(url):
    """The body and the headers of an answer, without a proxy."""
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(url, timeout=PATIENCE_S) as answer:
        return answer.read(), answer.headers


def until(what):
    """Wait for what is true at some time."""
    end = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < end, "in vain"
        time.sleep(0.05)


def is_gone(url):
    try:
        asked(url)
    except urllib.error.URLError:
        return True
    return False


@pytest.fixture
def study(learned):
    """The arguments of a flight that needs no training."""
    return {"system": learned.parents[1] / "tiny.toml", "out": learned.parent}


@pytest.fixture
def page(study):
    with servotwin.live(**study) as page:
        yield page


def test_a_notebook_shows_the_page_of_the_flight(page):
    about = json.loads(asked(page.url + "about")[0])
    assert any(one["id"] == "position" for one in about["signals"])
    assert page.is_running
    assert f'<iframe src="{page.url}"' in page._repr_html_()
    headers = asked(page.url)[1]
    assert "x-frame-options" not in headers
    ancestors = [policy for policy in headers.get_all("content-security-policy") if "ancestors" in policy]
    assert ancestors[0].split()[1:3] == ["'self'", "http://localhost:*"]


def test_a_stopped_page_is_gone_and_leaves_no_process(page):
    page.stop()
    assert is_gone(page.url)
    assert not page.is_running and page._server.returncode == 0
    assert "iframe" not in page._repr_html_()
    page.stop()
    with pytest.raises(servotwin.StageError, match="has ended"):
        page.save("session.parquet")


def test_a_session_is_saved_and_made_a_page(page, tmp_path):
    until(lambda: json.loads(asked(page.url + "counts")[0])["newest"])
    session = page.save(tmp_path / "session.parquet")
    html = page.to_html(tmp_path / "session.html").read_text(encoding="utf-8")
    assert 'id="record">' in html and "default-src 'none'" in html
    assert session.read_bytes().startswith(b"PAR1")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["session.html", "session.parquet"]
    with pytest.raises(servotwin.FileError, match="folder"):
        page.to_html(tmp_path)
    with pytest.raises(servotwin.FileError, match="nowhere"):
        page.save(tmp_path / "nowhere" / "session.parquet")


def test_a_study_in_memory_flies(study):
    given = servotwin.Study(study["system"])
    with servotwin.live(given, out=study["out"]) as page:
        assert json.loads(asked(page.url + "about")[0])["title"] == given.system.title


def test_a_stream_has_a_page(study, learned, tmp_path):
    system = servotwin.System()
    ids, units = [*system.inputs["id"], *system.sensors["id"]], [*system.inputs["unit"], *system.sensors["unit"]]
    named = [f', unit = "{unit}"' if unit else "" for unit in units]
    lines = [f'"{name}" = {{ column = "{name}"{unit} }}' for name, unit in zip(ids, named)]
    inputs = len(system.inputs["id"])
    text = ["format = 1", "[time]", 'column = "t"', "[inputs]", *lines[:inputs], "[sensors]", *lines[inputs:]]
    (tmp_path / "map.toml").write_text("\n".join(text), encoding="utf-8")
    source = "udp://127.0.0.1:9173"
    with servotwin.live(study["system"], source=source, map=tmp_path / "map.toml", model=learned) as page:
        about = json.loads(asked(page.url + "about")[0])
    assert (about["title"].split(": ")[1], about["kind"]) == (source, "stream")


@pytest.mark.parametrize("how", ["ends", "wait"])
def test_the_page_ends_with_its_interpreter(study, how):
    command = [sys.executable, "-c", STARTED, study["system"], study["out"], how]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    url = program.stdout.readline().strip()
    assert url.startswith("http://127.0.0.1:")
    if how == "wait":
        asked(url)
        program.send_signal(signal.SIGKILL)
    program.communicate(timeout=PATIENCE_S)
    until(lambda: is_gone(url))


def test_without_the_command_the_message_says_how_to_get_it(monkeypatch):
    monkeypatch.delenv("SERVOTWIN_BINARY", raising=False)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(servotwin.MissingFileError, match="cargo install .* --features serve"):
        servotwin.live()


def test_what_cannot_fly_is_refused_with_the_reason(tmp_path, monkeypatch):
    if "SERVOTWIN_BINARY" not in os.environ:
        monkeypatch.setenv("SERVOTWIN_BINARY", sys.executable)
    text = servotwin.System().text
    own = servotwin.System.parse(text.replace("title = ", 'title = "My own" #', 1))
    with pytest.raises(servotwin.InputError, match="give a Study"):
        servotwin.live(own)
    with pytest.raises(servotwin.StageError, match="did not start"):
        servotwin.live(tmp_path / "nothing.toml")


def test_a_built_in_system_stands_for_its_study():
    found = [servotwin.live_page._study(servotwin.System(name), None) for name in ("aileron_dual", "press_axis")]
    assert found == [["paper"], ["press_axis"]]
