"""A step of the command in fmi-rs and CasADi beside `servotwin simulate`: compare.py SERVOTWIN FOLDER."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import casadi
import numpy as np

STEP_S, STEPS, AT = 0.01, 200, 10
ANGLE_RAD = float(np.deg2rad(3.0))


def variables(fmu):
    """References of all variables and of the outputs, by name."""
    text = zipfile.ZipFile(fmu).read("modelDescription.xml")
    described = ElementTree.fromstring(text).find("ModelVariables")
    references = {v.get("name"): v.get("valueReference") for v in described}
    outputs = [v.get("name") for v in described if v.get("causality") == "output"]
    return references, outputs


def expected(servotwin, outputs, folder):
    table = folder / "run.csv"
    command = [servotwin, "--quiet", "simulate", "--command", f"step:size=3deg,at={AT * STEP_S}s"]
    options = ["--record", ",".join(outputs), "--duration", f"{STEPS * STEP_S}s", "--tolerance", "1e-8"]
    subprocess.run([*command, *options, "--out", str(table)], check=True)
    return np.loadtxt(table, delimiter=",", skiprows=1)[:, -len(outputs) :]


def as_fmi_rs_knows(fmu):
    """fmi-rs 0.8.0 refuses units and nominal values of variables of FMI 3.0, and the base units kelvin and ampere."""
    changed = fmu.with_suffix(".fmi_rs.fmu")
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(changed, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "modelDescription.xml":
                data = re.sub(rb' (unit|displayUnit|nominal|K|A)="[^"]*"', b"", data)
            target.writestr(name, data)
    return changed


def stepped_by_fmi_rs(fmu, version, folder):
    references, outputs = variables(fmu)
    if version == 3:
        fmu = as_fmi_rs_knows(fmu)
    host = folder / "target" / "debug" / "fmi-rs-host"
    wanted = [references[name] for name in outputs]
    inputs = [references["sensors.noise"], references["command"]]
    command = [host, fmu, str(version), *inputs, str(AT), repr(ANGLE_RAD), *wanted]
    run = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
    return np.loadtxt(run.stdout.splitlines(), delimiter=",")


def integrated_by_casadi(fmu, folder):
    """Outputs after each step, and their names."""
    unpacked = folder / "unpacked"
    zipfile.ZipFile(fmu).extractall(unpacked)
    model = casadi.DaeBuilder("system", str(unpacked))
    model.set("sensors.noise", 0.0)
    rates = model.create("rates", ["x", "u"], ["ode", "y"])
    inputs = np.array(model.start(model.u()))
    state = np.array(model.get(model.x()))
    states, external = casadi.MX.sym("x", model.nx()), casadi.MX.sym("u", model.nu())
    ode = rates(states, external)[0]
    problem = {"x": states, "u": external, "ode": ode}
    options = {"reltol": 1e-8, "abstol": 1e-10, "max_num_steps": 100000}
    step = casadi.integrator("step", "cvodes", problem, 0.0, STEP_S, options)
    rows = []
    for k in range(STEPS):
        if k == AT:
            inputs[list(model.u()).index("command")] = ANGLE_RAD
        state = np.array(step(x0=state, u=inputs)["xf"]).ravel()
        rows.append(np.array(rates(state, inputs)[1]).ravel())
    return np.array(rows), list(model.y())


def main():
    servotwin, folder = sys.argv[1], Path(sys.argv[2])
    is_well = True
    for version in (2, 3):
        fmu = folder / f"system{version}.fmu"
        _, outputs = variables(fmu)
        right = expected(servotwin, outputs, folder)[1:]
        scale = np.abs(right).max(axis=0)
        runs = [("fmi-rs", stepped_by_fmi_rs(fmu, version, folder))]
        if version == 2:
            # CasADi 3.8.2 reads no FMU of version 3 whose initial unknowns depend on everything, the standard's default.
            found, names = integrated_by_casadi(fmu, folder)
            runs.append(("CasADi", found[:, [names.index(name) for name in outputs]]))
        for host, found in runs:
            worst = (np.abs(found - right) / scale).max()
            is_well &= bool(worst < 1e-4)
            print(f"FMI {version}.0 in {host}: largest difference {worst:.1e} of the largest value of an output")
    return 0 if is_well else 1


if __name__ == "__main__":
    sys.exit(main())
