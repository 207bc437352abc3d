"""The exported C in the hands of independent checkers. Each also gets violations that it must find."""

import csv
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import binary

pytestmark = pytest.mark.slow

DRIVER = Path(__file__).parent / "eva_driver.c"
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
DIAGNOSIS = "session boundary decision judge windows models math random".split()

# What cppcheck and its addon for MISRA C:2012 say of the hand-written code, by file, and why it stays.
DEVIATIONS = {
    ("misra-c2012-2.5", "servotwin_twin_sizes.h"): "sizes that a file does not use",
    ("misra-c2012-2.5", "servotwin_sizes.h"): "names that a file does not use",
    ("misra-c2012-2.3", "servotwin_exact.h"): "a type that a compiler refuses if its constants are no doubles",
    ("misra-c2012-8.7", "servotwin_hybrid.c"): "the flight control computer calls it",
    ("misra-c2012-8.7", "servotwin_session.c"): "a flight control computer that has a twin calls it",
    ("misra-c2012-8.7", "servotwin_models.c"): "the proof calls it from another file",
    ("misra-c2012-8.11", "servotwin_tables.h"): "lists of names whose length depends on the system",
    ("misra-c2012-8.11", "servotwin_hybrid.h"): "a list whose length depends on the system",
    ("misra-c2012-8.11", "servotwin_twin.h"): "lists whose length depends on the system",
    ("misra-c2012-10.6", "servotwin_math.c"): "the addon takes 1 and -1 for narrower types than int32_t",
    ("misra-c2012-12.1", "servotwin_judge.c"): "a conditional expression, all of whose parts are in brackets",
    ("misra-c2012-15.5", "servotwin_math.c"): "a series returns early where it is exact",
    ("misra-c2012-15.5", "servotwin_boundary.c"): "nothing is known yet",
    ("misra-c2012-21.15", "servotwin_twin.c"): "the bits of a double are copied",
    ("misra-c2012-19.2", "servotwin_math.c"): "the bits of a double are read through a union",
    ("misra-c2012-8.9", "main.c"): "the demonstration keeps its state out of the stack",
    ("misra-c2012-15.5", "main.c"): "the demonstration returns on an error",
    ("misra-c2012-21.6", "main.c"): "the demonstration reads and prints",
    ("duplicateAssignExpression", "servotwin_decision.c"): "two kinds of evidence begin alike",
    ("objectIndex", "servotwin_decision.c"): "a row of a table is read through a pointer",
}

# Properties that the analysis leaves open, by function, and why they hold.
OPEN = {
    ("servotwin_decide", "mem_access"): "indices of trees are tables: the proof reaches every leaf",
    ("boost", "mem_access"): "as above",
    ("servotwin_exp", "float_to_int"): "its argument is at most 709: a logarithm of a share, or below a largest value",
    ("servotwin_exp", "signed_overflow"): "as above",
    ("is_masked", "index_bound"): "asked for an actuator only where the finding has one",
    ("switches_off", "index_bound"): "asked for an action only where one is raised",
    ("raise_action", "index_bound"): "a candidate has an actuator",
    ("probability_of_actuator", "index_bound"): "asked for an actuator only where the finding has one",
    ("servotwin_margin", "index_bound"): "a claim is a hypothesis",
    ("servotwin_margin", "mem_access"): "a claim is a hypothesis",
    ("tell", "bool_value"): "a judgement is cleared at start",
    ("is_same_action", "bool_value"): "what is raised is cleared at start",
    ("add_sample", "signed_overflow"): "a window is cleared when it has its number of samples",
    ("merge", "signed_overflow"): "the panes of a window have its number of samples together",
    ("take", "index_bound"): "the next pane is taken modulo their number",
}


# Packages of Debian whose name is not that of their program.
PACKAGES = {"frama-c": "frama-c-base"}


def tool(name):
    assert shutil.which(name), f"there is no {name}: apt-get install {PACKAGES.get(name, name)}"
    return name


@pytest.fixture(scope="module")
def exported(learned, tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight_code") / "export"
    command = [binary(), "export", "c", "--model", str(learned)]
    subprocess.run([*command, "--out", str(folder)], check=True, capture_output=True)
    return folder


def changed(exported, folder, *changes):
    """A copy of the export in which texts are replaced, each once: file, old text, new text."""
    copy = folder / "changed"
    shutil.copytree(exported, copy)
    for file, old, new in changes:
        text = (copy / file).read_text()
        assert old in text, old
        (copy / file).write_text(text.replace(old, new, 1))
    return copy


def compiled(compiler, folder, *flags):
    sources = [str(path) for path in folder.glob("*.c")]
    command = [tool(compiler), *flags, *sources, "-lm", "-o", str(folder / "diagnose")]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_compilers_have_no_warning_and_find_a_silent_conversion(compiler, exported, tmp_path):
    assert compiled(compiler, exported, *STRICT).stderr == ""
    # A number that is cut off to an integer.
    begin = "    servotwin_real sum = 0.0;\n"
    sown = ("servotwin_models.c", begin, begin + "    const int32_t cut = values[0];\n    sum = cut;\n")
    broken = compiled(compiler, changed(exported, tmp_path, sown), *STRICT)
    assert "conversion" in broken.stderr, broken.stderr


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_a_build_with_other_arithmetic_is_refused(compiler, exported):
    assert "fast" in compiled(compiler, exported, "-std=c99", "-ffast-math").stderr
    # clang does not declare these, so the start test finds them.
    for flag in ["-funsafe-math-optimizations", "-freciprocal-math"]:
        built = compiled(compiler, exported, "-std=c99", "-O2", "-ffp-contract=off", flag)
        if built.returncode == 0:
            assert subprocess.run([exported / "diagnose"], stdin=subprocess.DEVNULL).returncode == 1, flag
    with open("/proc/cpuinfo") as info:
        if " fma " not in info.read():
            pytest.skip("this processor fuses nothing")
    flags = ["-std=gnu99", "-O2", "-mfma", "-ffp-contract=fast"]
    built = compiled(compiler, exported, *flags)
    assert built.returncode == 0, built.stderr
    run = subprocess.run([exported / "diagnose"], input="", capture_output=True, text=True)
    assert run.returncode == 1 and "fuse" in run.stderr


def found_by_cppcheck(folder, *others):
    files = [f"servotwin_{name}.c" for name in DIAGNOSIS] + [*others]
    flags = ["--quiet", "--std=c99", "--enable=warning,style,performance,portability", "--addon=misra"]
    # Without these the refusals of servotwin_real.h would leave most files unread, and cppcheck silent.
    flags += ["-DFLT_EVAL_METHOD=0", "-DDBL_MANT_DIG=53"]
    silent = ["--suppress=missingIncludeSystem", "--template={id} {file}"]
    run = subprocess.run([tool("cppcheck"), *flags, *silent, *files], cwd=folder, capture_output=True, text=True)
    return {tuple(line.split()) for line in run.stderr.splitlines() if line}


def test_cppcheck_and_misra_find_listed_deviations_only(exported, tmp_path):
    others = ["servotwin_hybrid.c", "servotwin_twin.c", "main.c"]
    assert found_by_cppcheck(exported, *others) == set(DEVIATIONS)
    end = "servotwin_real servotwin_exp("
    recursion = "static int32_t deep(int32_t n) { return (n > 0) ? deep(n - 1) : 0; }\n"
    overrun = "static double beyond(void) { double x[2] = { 0.0, 0.0 }; return x[2]; }\n"
    sown = changed(exported, tmp_path, ("servotwin_math.c", end, recursion + overrun + end))
    new = {name for name, _ in found_by_cppcheck(sown, *others) - set(DEVIATIONS)}
    assert {"misra-c2012-17.2", "arrayIndexOutOfBounds"} <= new, new


def open_properties(folder):
    """What Eva cannot decide, as pairs of function and kind of property."""
    sources = [str(folder / f"servotwin_{name}.c") for name in [*DIAGNOSIS, "features", "tables"]]
    table = folder / "properties.csv"
    flags = ["-quiet", "-no-unicode", "-eva", "-eva-precision", "0", "-eva-auto-loop-unroll", "30"]
    machine = ["-machdep", "gcc_x86_64", "-warn-special-float", "none", f"-cpp-extra-args=-I{folder} -std=c99"]
    command = [tool("frama-c"), *flags, *machine, str(DRIVER), *sources, "-then", "-report-csv", str(table)]
    subprocess.run(command, check=True, capture_output=True)
    with open(table) as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    assert len(rows) > 500, len(rows)
    decided = re.compile("(?<!in)valid$", re.IGNORECASE)
    return {(row["function"], row["property kind"]) for row in rows if not decided.search(row["status"])}


def test_frama_c_leaves_listed_properties_open_only(exported):
    assert open_properties(exported) == set(OPEN)


def test_frama_c_finds_what_is_sown(exported, tmp_path):
    windows = "servotwin_windows.c"
    sown = changed(
        exported,
        tmp_path,
        # So far beyond that it leaves the session: Eva does not tell one array from another within a struct.
        (windows, "ring->panes[(ring->next + i) % span->panes]", "ring->panes[(ring->next + i) * 2]"),
        (windows, "(ring->next + 1) % span->panes", "(ring->next + 1) % (span->panes - ring->ended)"),
        ("servotwin_models.c", "[SERVOTWIN_MOST_CLASSES] = { 0 };", "[SERVOTWIN_MOST_CLASSES];"),
    )
    new = open_properties(sown) - set(OPEN)
    assert {"division_by_zero", "initialization"} <= {kind for _, kind in new}, new
    assert ("absorb", "mem_access") in new, new
