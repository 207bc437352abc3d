"""Exported FMUs in FMPy: valid, the same trajectories, states restored to the bit, faults as parameters, no leaks; and the
hybrid twin with the same diagnosis."""

import glob
import gzip
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from conftest import binary
from flown import flight
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import servotwin

FAULT = "actuator_1.leakage_a.leakage"
STEP_S = 0.01


class Fmu:
    """An exported FMU, unpacked."""

    def __init__(self, version, folder, options=()):
        self.version = version
        self.path = str(folder / f"system{version}.fmu")
        command = [binary(), "export", "fmu", "--fmi", str(version)]
        subprocess.run([*command, *options, "--out", self.path], check=True, capture_output=True)
        self.description = read_model_description(self.path)
        self.folder = str(folder / f"unpacked{version}")
        with zipfile.ZipFile(self.path) as archive:
            archive.extractall(self.folder)
        self.outputs = [v for v in self.description.modelVariables if v.causality == "output"]
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}

    def _instance(self, kind, identifier):
        return kind(
            guid=self.description.guid or self.description.instantiationToken,
            unzipDirectory=self.folder,
            modelIdentifier=identifier,
        )

    def slave(self, noise=0.0, seed=0.0, initialized=True):
        """An instance for co-simulation before its first step; that of a system has `noise` or not."""
        identifier = self.description.coSimulation.modelIdentifier
        slave = self._instance(FMU2Slave if self.version == 2 else FMU3Slave, identifier)
        slave.instantiate()
        if self.version == 2:
            slave.setupExperiment(startTime=0.0)
        if "sensors.noise" in self.references:
            self.set_all(slave, ["sensors.noise", "sensors.noise_seed"], [noise, seed])
        if initialized:
            slave.enterInitializationMode()
            slave.exitInitializationMode()
        return slave

    def model(self):
        """An instance of version 2 for model exchange in continuous time."""
        model = self._instance(FMU2Model, self.description.modelExchange.modelIdentifier)
        model.instantiate()
        model.setupExperiment(startTime=0.0)
        model.enterInitializationMode()
        model.exitInitializationMode()
        model.newDiscreteStates()
        model.enterContinuousTimeMode()
        return model

    def set(self, slave, name, value):
        self.set_all(slave, [name], [value])

    def set_all(self, slave, names, values):
        setter = slave.setReal if self.version == 2 else slave.setFloat64
        setter([self.references[name] for name in names], list(values))

    def read(self, slave):
        getter = slave.getReal if self.version == 2 else slave.getFloat64
        return np.array(getter([variable.valueReference for variable in self.outputs]))

    def run(self, slave, first, steps, changes=()):
        """Steps on; `changes` are (step, name, value) before that step. Returns the outputs after each step."""
        rows = []
        for step in range(first, first + steps):
            for at, name, value in changes:
                if at == step:
                    self.set(slave, name, value)
            slave.doStep(currentCommunicationPoint=step * STEP_S, communicationStepSize=STEP_S)
            rows.append(self.read(slave))
        return np.array(rows)


# The code of both versions is one but for its interface.
VERSIONS = [pytest.param(2, marks=pytest.mark.slow), 3]


@pytest.fixture(scope="module", params=VERSIONS)
def hybrid(request, tmp_path_factory, learned):
    return Fmu(request.param, tmp_path_factory.mktemp("hybrid"), ["--model", str(learned)])


@pytest.fixture(scope="module", params=VERSIONS)
def fmu(request, tmp_path_factory):
    return Fmu(request.param, tmp_path_factory.mktemp("fmu"))


def expected(fmu, fault, folder):
    """The run of the command line with a step of the command after 0.1 s."""
    table = folder / "run.csv"
    names = ",".join(variable.name for variable in fmu.outputs)
    command = [binary(), "simulate", "--command", "step:size=3deg,at=0.1s"]
    options = ["--fault", fault, "--record", names, "--duration", "2s", "--tolerance", "1e-8"]
    run = subprocess.run([*command, *options, "--out", table], capture_output=True, check=True)
    assert run.returncode == 0
    return np.loadtxt(table, delimiter=",", skiprows=1)[:, -len(fmu.outputs) :]


def assert_near(found, right):
    scale = np.abs(right).max(axis=0)
    worst = (np.abs(found - right) / scale).max(axis=0)
    assert (worst < 1e-4).all(), worst


@pytest.mark.slow
def test_there_is_no_finding_and_no_need_of_another_library(fmu):
    assert validate_fmu(fmu.path) == []
    folders = os.path.join(fmu.folder, "binaries", "linux64" if fmu.version == 2 else "x86_64-linux")
    library = os.path.join(folders, os.listdir(folders)[0])
    needed = subprocess.run(["readelf", "-d", library], capture_output=True, text=True, check=True)
    names = [line.split("[")[1].rstrip("]") for line in needed.stdout.splitlines() if "NEEDED" in line]
    assert names == ["libc.so.6"]


def test_co_simulation_has_the_trajectories_of_the_toolkit(fmu, tmp_path):
    changes = [(10, "command", np.deg2rad(3)), (100, f"fault.{FAULT}", 0.5)]
    found = fmu.run(fmu.slave(), 0, 200, changes)
    assert_near(found, expected(fmu, f"{FAULT}=0.5@1s", tmp_path)[1:])


def test_model_exchange_with_the_solver_of_another_tool_has_them_too(fmu, tmp_path):
    times = [0.0, 0.1, 0.1, 2.0]
    command = np.array(
        list(zip(times, [0.0, 0.0, np.deg2rad(3), np.deg2rad(3)])),
        dtype=[("time", float), ("command", float)],
    )
    run = simulate_fmu(
        fmu.path,
        fmi_type="ModelExchange",
        stop_time=2.0,
        output_interval=STEP_S,
        input=command,
        output=[variable.name for variable in fmu.outputs],
        start_values={f"fault.{FAULT}": 0.5, "sensors.noise": 0.0},
        relative_tolerance=1e-8,
    )
    at = np.searchsorted(run["time"], np.arange(201) * STEP_S - 1e-9)
    at[10] = np.searchsorted(run["time"], 0.1 + 1e-9) - 1
    found = np.array([run[variable.name][at] for variable in fmu.outputs]).T
    assert_near(found, expected(fmu, f"{FAULT}=0.5", tmp_path))


def test_a_state_is_restored_to_the_bit_in_another_instance(fmu):
    first = fmu.slave(noise=1.0)
    fmu.run(first, 0, 30, [(5, "command", 0.05)])
    two = fmu.version == 2
    saved = first.serializeFMUstate(first.getFMUstate()) if two else first.serializeFMUState(first.getFMUState())
    right = fmu.run(first, 30, 30)
    other = fmu.slave()
    restore = other.deSerializeFMUstate if two else other.deserializeFMUState
    (other.setFMUstate if two else other.setFMUState)(restore(saved))
    assert np.array_equal(fmu.run(other, 30, 30), right)
    for place in [0, 7, 8, len(saved) // 2, len(saved) - 1]:
        damaged = bytearray(saved)
        damaged[place] ^= 1
        with pytest.raises(FMICallException):
            restore(bytes(damaged))
    with pytest.raises(FMICallException):
        restore(bytes(saved)[:-1])


def test_outputs_have_the_noise_of_their_sensors_unless_it_is_off(fmu):
    quiet = fmu.run(fmu.slave(), 0, 400)
    noisy = fmu.run(fmu.slave(noise=1.0), 0, 400)
    names = [variable.name for variable in fmu.outputs]
    started = {v.name: v.start for v in fmu.description.modelVariables if v.start is not None}
    for sensor in ("actuator_1.sensor_pressure_a", "actuator_1.sensor_ram"):
        place = names.index(f"{sensor}.reading")
        scale = next(float(v) for n, v in started.items() if n.startswith(f"parameter.{sensor}.full_scale"))
        declared = float(started[f"parameter.{sensor}.noise_sigma"]) * scale
        found = (noisy[:, place] - quiet[:, place]).std()
        assert 0.8 * declared < found < 1.2 * declared, (sensor, found, declared)
    assert np.array_equal(fmu.run(fmu.slave(noise=1.0), 0, 20), noisy[:20])
    assert not np.array_equal(fmu.run(fmu.slave(noise=1.0, seed=1.0), 0, 20), noisy[:20])
    # Noise belongs to the sample, not to the steps of the host.
    slave = fmu.slave(noise=1.0)
    for step in range(40):
        slave.doStep(currentCommunicationPoint=step * STEP_S / 2, communicationStepSize=STEP_S / 2)
    assert np.allclose(fmu.read(slave), noisy[19], rtol=1e-3, atol=1e-6)


def assert_refuses_impossible_steps(slave, time):
    infinite, not_a_number = float("inf"), float("nan")
    steps = [(time, infinite), (time, not_a_number), (time, -0.01), (time, 1e300), (infinite, 0.01)]
    for at, length in [*steps, (time + 1.0, 0.01), (time - 0.01, 0.01), (not_a_number, 0.01)]:
        with pytest.raises(FMICallException):
            slave.doStep(currentCommunicationPoint=at, communicationStepSize=length)
    slave.doStep(currentCommunicationPoint=time, communicationStepSize=0.01)


def test_a_step_before_the_initialization_is_refused_for_that_reason(fmu, hybrid, capfd):
    for exported in (fmu, hybrid):
        slave = exported.slave(initialized=False)
        with pytest.raises(FMICallException):
            slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=STEP_S)
        assert "the simulation has not begun" in capfd.readouterr().out


def test_a_step_from_another_time_or_without_an_end_is_refused(fmu):
    slave = fmu.slave()
    fmu.run(slave, 0, 5)
    assert_refuses_impossible_steps(slave, 0.05)


def test_every_output_and_input_is_described_in_a_unit_that_people_read(fmu, hybrid):
    for one in (fmu, hybrid):
        for variable in one.description.modelVariables:
            assert variable.description or variable.causality == "independent", variable.name
    units = {v.name: v.displayUnit for v in fmu.description.modelVariables}
    assert units.get("altitude") != "mm"
    assert units["actuator_1.cylinder.position_m"] == "mm"


def test_ten_instances_at_once_and_a_second_run_give_the_same_bits(fmu):
    changes = [(3, "command", 0.03)]
    right = fmu.run(fmu.slave(), 0, 20, changes)
    many = [fmu.slave() for _ in range(10)]
    for step in range(20):
        for slave in many:
            row = fmu.run(slave, step, 1, changes)
            assert np.array_equal(row[0], right[step])
    first = many[0]
    first.reset()
    if fmu.version == 2:
        first.setupExperiment(startTime=0.0)
    fmu.set(first, "sensors.noise", 0.0)
    first.enterInitializationMode()
    first.exitInitializationMode()
    assert np.array_equal(fmu.run(first, 0, 20, changes), right)


@pytest.mark.parametrize("fmu", VERSIONS[:1], indirect=True)
def test_directional_derivatives_are_the_slopes_of_the_derivatives(fmu):
    model = fmu.model()
    count = fmu.description.numberOfContinuousStates
    derivatives = [unknown.variable for unknown in fmu.description.derivatives]
    states = [variable.derivative for variable in derivatives]
    start, nominals = np.zeros(count), np.zeros(count)

    def buffer(array):
        return array.ctypes.data_as(fmpy.fmi2.POINTER(fmpy.fmi2.c_double))

    model.getContinuousStates(buffer(start), count)
    model.getNominalsOfContinuousStates(buffer(nominals), count)
    rng = np.random.default_rng(1)
    start += 1e-3 * nominals * rng.normal(size=count)

    def rates(at):
        into = np.zeros(count)
        model.setContinuousStates(buffer(at.copy()), count)
        model.getDerivatives(buffer(into), count)
        return into

    along = nominals * rng.normal(size=count)
    h = 1e-7
    slope = (rates(start + h * along) - rates(start - h * along)) / (2 * h)
    rates(start)
    found = model.getDirectionalDerivative(
        vUnknown_ref=[variable.valueReference for variable in derivatives],
        vKnown_ref=[variable.valueReference for variable in states],
        dvKnown=along.tolist(),
    )
    scale = np.abs(slope).max()
    assert np.abs(np.array(found) - slope).max() < 1e-5 * scale
    # Every state that moves a derivative is among its dependencies.
    known = {unknown.variable.name: unknown.dependencies for unknown in fmu.description.derivatives}
    for place, state in enumerate(states):
        moved = start.copy()
        moved[place] += 1e-4 * nominals[place]
        changed = np.flatnonzero(rates(moved) != rates(start))
        for derivative in changed:
            assert state in known[derivatives[derivative].name], (state.name, derivative)


@pytest.mark.slow
def test_two_thousand_instances_leave_no_memory_and_no_handle(fmu):
    def held():
        with open("/proc/self/statm") as file:
            pages = int(file.read().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE"), len(os.listdir("/proc/self/fd"))

    def once():
        slave = fmu.slave()
        slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=STEP_S)
        slave.terminate()
        slave.freeInstance()

    for _ in range(100):
        once()
    memory, handles = held()
    for _ in range(1900):
        once()
    after, handles_after = held()
    assert handles_after == handles
    assert after - memory < 20e6, (memory, after)


def test_what_cannot_be_set_is_refused_with_a_reason(fmu):
    slave = fmu.slave()
    refused = [(f"fault.{FAULT}", 2.0), ("command", float("nan")), (fmu.outputs[0].name, 1.0)]
    refused += [("sensors.noise", 0.5), ("sensors.noise_seed", 0.5), ("sensors.noise_seed", -1.0)]
    for variable in fmu.description.modelVariables:
        if variable.causality in ("input", "parameter"):
            for limit, beyond in [(variable.min, -1.0), (variable.max, 1.0)]:
                if limit is not None:
                    refused.append((variable.name, float(limit) + beyond * max(1e-9, abs(float(limit)))))
    assert len(refused) > 1000
    for name, value in refused:
        with pytest.raises(FMICallException):
            fmu.set(slave, name, value)
    slave.guid = "another"
    with pytest.raises(Exception):
        slave.instantiate()


STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-fsyntax-only"]
ALARMS = ["normal", "pending", "raised", "recovering", "no_data", "error"]


def test_a_hybrid_twin_says_what_the_diagnosis_says(hybrid, learned):
    assert validate_fmu(hybrid.path) == []
    diagnoser = servotwin.Diagnoser(learned)
    period = diagnoser.sample_period_s
    inputs, measured, nominal = flight(diagnoser, {"actuator_1.servo_valve.bias_positive": 1.0})
    measured[150:160, 3] = np.nan
    known = [*diagnoser.inputs, *(f"measured.{name}" for name in diagnoser.sensors)]
    slave = hybrid.slave()
    names = [variable.name for variable in hybrid.outputs]
    expected = [names.index(f"expected.{name}") for name in diagnoser.sensors]
    rows = []
    for k in range(len(inputs)):
        hybrid.set_all(slave, known, [*inputs[k], *measured[k]])
        slave.doStep(currentCommunicationPoint=k * period, communicationStepSize=period)
        rows.append(hybrid.read(slave))
        said = diagnoser.push(inputs[k], measured[k], rows[-1][expected])
        shown = dict(zip(names, rows[-1]))
        assert ALARMS[int(shown["diagnosis.alarm"])] == said.alarm
        assert shown["diagnosis.confidence"] == said.confidence
        assert shown["diagnosis.lost_sensors"] == len(said.lost)
    assert said.alarm != "normal", said
    raised = names.index("diagnosis.raised_action")
    assert rows[-1][raised] > 0.0
    # Without a value nothing is raised again.
    missing = [f"measured.{name}" for name in diagnoser.sensors]
    hybrid.set_all(slave, ["reset_alarm", *missing], [1.0] + [np.nan] * len(missing))
    slave.doStep(currentCommunicationPoint=len(inputs) * period, communicationStepSize=period)
    assert hybrid.read(slave)[raised] == 0.0
    # The last inputs of a flight have slopes that the future decides; before, the twin is that of the toolkit.
    assert_near(np.array(rows)[:, expected], nominal)


@pytest.mark.slow
def test_a_hybrid_twin_finds_the_system_healthy_that_takes_its_command_every_millisecond(fmu, tmp_path):
    shipped = Path(__file__).parents[2] / "crates/servotwin-watch/shipped/aileron.json.gz"
    model = tmp_path / "diagnoser-noise.json"
    model.write_bytes(gzip.decompress(shipped.read_bytes()))
    twin = Fmu(fmu.version, tmp_path, ["--model", str(model)])
    own = dict(p_a="pressure_a", p_b="pressure_b", x_p="ram", x_v="spool", p_s="supply", p_t="tank")
    sensors = [name.removeprefix("measured.") for name in twin.references if name.startswith("measured.")]
    readings = [f"actuator_{name[-1]}.sensor_{own[name[:3]]}.reading" for name in sensors]
    places = [[variable.name for variable in fmu.outputs].index(name) for name in readings]
    finding = [variable.name for variable in twin.outputs].index("diagnosis.finding")
    plant, beside = fmu.slave(noise=1.0), twin.slave()
    findings = []
    for k in range(10_000):
        time, command = 0.001 * k, 0.02 * np.sin(0.01 * np.pi * k)
        if k % 10 == 0:
            measured = fmu.read(plant)[places]
            twin.set_all(beside, ["command", *(f"measured.{name}" for name in sensors)], [command, *measured])
            beside.doStep(currentCommunicationPoint=time, communicationStepSize=0.01)
            findings.append(twin.read(beside)[finding])
        fmu.set(plant, "command", command)
        plant.doStep(currentCommunicationPoint=time, communicationStepSize=0.001)
    # Not judged at first, healthy then.
    assert set(findings) == {0.0, 1.0} and set(findings[200:]) == {1.0}


@pytest.mark.parametrize("compiler", ["gcc", pytest.param("clang", marks=pytest.mark.slow)])
def test_the_sources_compile_without_a_warning(compiler, fmu, hybrid):
    assert shutil.which(compiler), f"there is no {compiler}: apt-get install {compiler}"
    for folder in (fmu.folder, hybrid.folder):
        sources = glob.glob(os.path.join(folder, "sources", "*.c"))
        subprocess.run([compiler, *STRICT, *sources], check=True)
    # Names for programs that link several FMUs.
    interface = os.path.join(fmu.folder, "sources", f"fmi{fmu.version}.c")
    prefix = f"-DFMI{fmu.version}_FUNCTION_PREFIX=own_"
    found = subprocess.run([compiler, "-E", prefix, interface], check=True, capture_output=True, text=True)
    assert f"own_fmi{fmu.version}DoStep(" in found.stdout


def test_steps_of_any_length_take_each_sample_once(hybrid):
    # The period of the samples is 20 ms.
    ends = []
    for steps in ([0.1] * 6, [0.004] * 150, [0.013] * 46 + [0.002]):
        slave = hybrid.slave()
        time = 0.0
        for step in steps:
            slave.doStep(currentCommunicationPoint=time, communicationStepSize=step)
            time += step
        ends.append(hybrid.read(slave))
    assert np.array_equal(ends[0], ends[1]) and np.array_equal(ends[0], ends[2])


def test_steps_longer_than_a_sample_draw_one_warning(hybrid, capfd):
    slave = hybrid.slave()
    assert_refuses_impossible_steps(slave, 0.0)
    slave.doStep(currentCommunicationPoint=0.01, communicationStepSize=0.02)
    assert "longer" not in capfd.readouterr().out
    for step in range(3):
        slave.doStep(currentCommunicationPoint=0.03 + 0.04 * step, communicationStepSize=0.04)
    assert capfd.readouterr().out.count("a step is longer than the time between samples") == 1


def test_a_hybrid_twin_refuses_what_is_no_value_of_a_variable(hybrid):
    slave = hybrid.slave()
    actuator = next(name for name in hybrid.references if name.startswith("switched_off."))
    parameter = next(name for name in hybrid.references if name.startswith("parameter."))
    for name, value in [(actuator, 0.5), (parameter, float("nan")), (parameter, 1e300), ("diagnosis.alarm", 1.0)]:
        with pytest.raises(FMICallException):
            hybrid.set(slave, name, value)
    hybrid.set(slave, actuator, 1.0)
    hybrid.set(slave, actuator, 0.0)
