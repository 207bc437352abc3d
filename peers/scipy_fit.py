"""How long SciPy's least_squares and `servotwin fit` take for twelve parameters of the aileron in a minute of record.

Run peers/setup.sh once and `cargo build --release` with `cargo build --release --example write_fit_peer -p servotwin`,
then: peers/.venv/bin/python peers/scipy_fit.py [target/release/servotwin] [TURNS]

Both have the same record (every sensor of the paper's study at 100 Hz with the noise that the system declares), the
same start (the nominal twin), the same unknowns with the same priors and bounds, the same tolerance of the solver
(4e-6 of each state's scale), differences of the same width, and end where a step would lower half of the squared
residuals by less than 0.005. SciPy integrates the C source that servotwin writes, compiled with -O3, by LSODA
(odeint); the command and its interpolation are C too, so that Python only passes pointers on. `servotwin fit` is the
whole command: it also reads the file, looks at whether the record can be of the system, and compares 82 faults.
Prints the seconds of both, with one thread and with all, and their ratio; the same in processor time, which a busy
machine does not change as much; and how far the results are apart.
"""

import ctypes
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy
from scipy.integrate import odeint
from scipy.optimize import least_squares

NAMES = (
    "servo_valve.width_pa_m",
    "servo_valve.null_bias",
    "servo_valve.natural_frequency_hz",
    "cylinder.coulomb_friction_n",
    "cylinder.viscous_friction_n_s_m",
    "attachment.stiffness_n_m",
)
# What the plant has instead of the twin's numbers: about a standard deviation of each tolerance.
PLANT = {
    "coulomb_friction_n = 500": "coulomb_friction_n = 545",
    "viscous_friction_n_s_m = 6.0e3": "viscous_friction_n_s_m = 5.5e3",
    "stiffness_n_m = 2.0e7": "stiffness_n_m = 2.1e7",
    "natural_frequency_hz = 100": "natural_frequency_hz = 96",
}
COMMAND = "noise:rms=4deg,bandwidth=1Hz,seed=77"
DURATION_S, PERIOD_S, WARM_UP_S = 60.0, 0.01, 1.0
SOLVER_TOLERANCE = 4e-6
LEAST_GAIN = 0.005

WRAPPER = r"""
#include "aileron.c"
static double constants[AILERON_CONSTANTS], held[AILERON_HELD + 1], inputs[AILERON_INPUTS];
static const double *values, *slopes;
static double period_s;
static int samples, command;
void peer_flight(const double *all, int which, const double *v, const double *m, int count, double period)
{
    memcpy(inputs, all, sizeof inputs);
    command = which, values = v, slopes = m, samples = count, period_s = period;
}
void peer_parameters(const double *parameters)
{
    aileron_constants(parameters, constants);
    aileron_held(parameters, held);
}
/* Cubics between samples, with the slopes of (FI1). */
static void enter(double time_s)
{
    int k = (int)(time_s / period_s);
    if (k > samples - 2) k = samples - 2;
    if (k < 0) k = 0;
    double u = time_s / period_s - k, d = values[k + 1] - values[k];
    double a = slopes[k] * period_s - d, b = d - slopes[k + 1] * period_s;
    inputs[command] = values[k] + u * d + u * (1 - u) * (a * (1 - u) + b * u);
}
void peer_rates(double time_s, const double *states, double *rates)
{
    enter(time_s);
    aileron_derivatives(constants, states, inputs, held, rates);
}
void peer_outputs(const double *states, double *outputs)
{
    for (int k = 0; k < samples; k++) {
        enter(k * period_s);
        aileron_outputs(constants, states + k * AILERON_STATES, inputs, held, outputs + k * AILERON_OUTPUTS);
    }
}
"""


def pointer(array):
    return array.ctypes.data


class Peer:
    """The generated C, integrated by SciPy beside a record."""

    def __init__(self, folder, known, unknowns, table):
        (folder / "peer.c").write_text(WRAPPER)
        library = folder / "peer.so"
        flags = ["-std=c11", "-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run(["cc", *flags, "-o", library, folder / "peer.c", "-lm"], check=True)
        self.library = ctypes.CDLL(str(library))
        double, integer, place = ctypes.c_double, ctypes.c_int, ctypes.c_void_p
        self.library.peer_flight.argtypes = [place, integer, place, place, integer, double]
        self.library.peer_parameters.argtypes = [place]
        self.library.peer_rates.argtypes = [double, place, place]
        self.library.peer_outputs.argtypes = [place, place]
        self.known, self.unknowns = known, unknowns
        self.scales = numpy.array(known["state_scales"])
        self.inputs = numpy.array(known["inputs"])
        self.command = numpy.ascontiguousarray(table["command_rad"])
        self.slopes = slopes(self.command)
        self.times = numpy.arange(len(self.command)) * PERIOD_S
        self.measured = numpy.stack([table[name] for name in known["columns"]], axis=1)
        self.deviations = numpy.array(known["deviations"])
        flight = (pointer(self.inputs), known["command"], pointer(self.command), pointer(self.slopes))
        self.library.peer_flight(*flight, len(self.command), PERIOD_S)
        self.start = numpy.array(known["start"])
        self.runs = 0

    def rates(self, time_s, states):
        rates = numpy.empty_like(states)
        self.library.peer_rates(time_s, pointer(states), pointer(rates))
        return rates

    def residuals(self, z):
        parameters = numpy.array(self.known["parameters"])
        for unknown, value in zip(self.unknowns, z):
            for place, nominal in zip(unknown["places"], unknown["nominal"]):
                per_sigma = unknown["sigma"] * (1.0 if unknown["absolute"] else nominal)
                parameters[place] = nominal + value * per_sigma
        self.library.peer_parameters(pointer(parameters))
        tolerance = {"rtol": SOLVER_TOLERANCE, "atol": SOLVER_TOLERANCE * self.scales}
        states = odeint(self.rates, self.start, self.times, tfirst=True, mxstep=100_000, **tolerance)
        states = numpy.ascontiguousarray(states)
        shown = numpy.empty_like(self.measured)
        self.library.peer_outputs(pointer(states), pointer(shown))
        self.runs += 1
        first = round(WARM_UP_S / PERIOD_S)
        return numpy.append(((self.measured - shown) / self.deviations)[first:].ravel(), z)

    def jacobian(self, z):
        here = self.residuals(z)
        columns = []
        for k, unknown in enumerate(self.unknowns):
            moved = z.copy()
            step = unknown["step"] if z[k] + unknown["step"] <= unknown["range"][1] else -unknown["step"]
            moved[k] += step
            columns.append((self.residuals(moved) - here) / step)
        return numpy.array(columns).T

    def fit(self):
        bounds = numpy.array([unknown["range"] for unknown in self.unknowns]).T
        cost = 0.5 * self.measured.size
        start = numpy.zeros(len(self.unknowns))
        ends = {"ftol": LEAST_GAIN / cost, "xtol": None, "gtol": None}
        return least_squares(self.residuals, start, self.jacobian, bounds=tuple(bounds), **ends)


def slopes(values):
    """(FI1) of crates/servotwin/src/fit/record.rs, for a command that is smooth."""
    padded = numpy.concatenate([[values[0]] * 2, values, [values[-1]] * 2])
    return (padded[:-4] - 8 * padded[1:-3] + 8 * padded[3:-1] - padded[4:]) / (12 * PERIOD_S)


def record(servotwin, folder, known):
    text = Path("systems/aileron_dual.toml").read_text()
    for old, new in PLANT.items():
        assert old in text, old
        text = text.replace(old, new)
    (folder / "plant.toml").write_text(text)
    log = folder / "log.csv"
    flight = ["--command", COMMAND, "--duration", f"{DURATION_S}s", "--out", log, "-q"]
    subprocess.run([servotwin, "simulate", folder / "plant.toml", *flight], check=True)
    table = numpy.genfromtxt(log, delimiter=",", names=True)
    random = numpy.random.default_rng(1)
    columns = {"time_s": table["time_s"], "command_rad": table["command_rad"]}
    for name, deviation in zip(known["columns"], known["deviations"]):
        columns[name] = table[name] + deviation * random.standard_normal(len(table))
    content = numpy.array(list(columns.values())).T
    numpy.savetxt(log, content, "%.17g", ",", header=",".join(columns), comments="")
    return log, columns


def fitted(servotwin, log, *more):
    begin, before = time.perf_counter(), children_s()
    command = [servotwin, "fit", log, "--parameters", ",".join(NAMES), "--json", *more]
    output = subprocess.run(command, capture_output=True, text=True)
    seconds = time.perf_counter() - begin
    assert output.returncode in (0, 1), output.stderr
    return seconds, children_s() - before, json.loads(output.stdout)


def children_s():
    """The processor time of all commands that were run."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main():
    servotwin = Path(sys.argv[1] if len(sys.argv) > 1 else "target/release/servotwin").resolve()
    turns = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([servotwin.parent / "examples" / "write_fit_peer", folder], check=True)
        known = json.loads((folder / "fit.json").read_text())
        log, columns = record(servotwin, folder, known)
        unknowns = [u for u in known["unknowns"] if u["name"].endswith(NAMES)]
        assert len(unknowns) == 12, len(unknowns)
        peer = Peer(folder, known, unknowns, columns)
        for _ in range(turns):
            begin, before = time.perf_counter(), time.process_time()
            found = peer.fit()
            scipy_s, scipy_cpu_s = time.perf_counter() - begin, time.process_time() - before
            one_s, one_cpu_s, _ = fitted(servotwin, log, "--threads", "1")
            all_s, all_cpu_s, own = fitted(servotwin, log)
            print(
                f"SciPy {scipy_s:.1f} s ({peer.runs} runs), servotwin {one_s:.2f} s with one thread (ratio"
                f" {scipy_s / one_s:.1f}), {all_s:.2f} s with all (ratio {scipy_s / all_s:.1f})"
            )
            print(
                f"processor time: SciPy {scipy_cpu_s:.1f} s, servotwin {one_cpu_s:.2f} s with one thread (ratio"
                f" {scipy_cpu_s / one_cpu_s:.1f}), {all_cpu_s:.2f} s with all",
                flush=True,
            )
            peer.runs = 0
    apart = 0.0
    for parameter in own["parameters"]:
        place = [u["name"] for u in unknowns].index(parameter["name"])
        z = (parameter["value"] - parameter["nominal"]) / parameter["tolerance_sigma"]
        error = parameter["standard_error"] / parameter["tolerance_sigma"]
        apart = max(apart, abs(z - found.x[place]) / error)
    print(f"largest difference of a parameter: {apart:.2f} standard errors; update: {own['verdict']['is_update']}")


if __name__ == "__main__":
    main()
