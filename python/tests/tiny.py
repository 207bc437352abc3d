"""Studies that are small enough for a test."""

from pathlib import Path

_TESTS = Path(__file__).resolve().parents[2] / "crates/servotwin/tests"

CLASSES = (_TESTS / "tiny_classes.toml").read_text(encoding="utf-8")
STUDY = (_TESTS / "tiny.toml").read_text(encoding="utf-8") + CLASSES + """
[realistic]
healthy = 4
[training]
duration_s = 2
healthy = 3
load = [0.5, 1.0]
intensity_spread = 0.05
draws = [{ count = 3, signal = "noise:rms={3..6}deg,bandwidth=1Hz,seed=1{n}" }]
signals.step = "step:size=5deg,at=0.5s"
[flights]
duration_s = 4
onset_s = [1.5, 2]
windows_s = [0.5]
commands = ["noise:rms={2..4}deg,bandwidth={0.5..1}Hz,seed={n}"]
inputs.load_factor = [0.5, 1]
[suites]
learn = { environments = 3, repeats = 3, healthy = 2 }
held_out = { environments = 0 }
judge = { environments = 2, repeats = 1, healthy = 1 }
unseen = { repeats = 1 }
[reactions]
shut_down = { switches_off = true, actuator_inputs = { mode = 0 } }
"""


def many_parts():
    """The same with very short runs and many cases, so that there are several parts."""
    text = STUDY.replace("duration_s = 2\nsample_hz = 50", "duration_s = 0.1\nsample_hz = 50")
    text = text.replace(
        'signals.S1 = "noise:rms=5deg,bandwidth=1Hz,seed=1"',
        "\n".join(
            f'signals.S{k} = "noise:rms=5deg,bandwidth=1Hz,seed={k}"' for k in range(1, 9)
        ),
    )
    text = text.replace("values.100 = 1.0", "values.50 = 0.5\nvalues.100 = 1.0")
    begin, end = text.index("[training]"), text.index("[flights]")
    text = text[:begin] + text[end:]
    return text[: text.index("[flights]")] + text[text.index("[reactions]") :]


def with_fitted():
    """Several parts of specimens beside twins that are fitted to them."""
    return many_parts().replace(
        "[reactions]",
        'tolerances = [{ parameters = ["servo_valve.null_bias"], sigma = 0.0067, absolute = true }]\n'
        "[fitted]\n"
        'command = "noise:rms=4deg,bandwidth=1Hz,seed=9"\n'
        "duration_s = 5\njudge = 4\nlearn = 4\nin_each_case = 2\n"
        "[reactions]",
    )


def contents(folder):
    """Every file of a folder and what is in it; what a storage has no use for, the lock of who works there, is none."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != ".servotwin.lock")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}
