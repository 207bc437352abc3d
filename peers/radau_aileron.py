"""Writes golden/scipy_radau_aileron.csv, with which the test val_scipy_radau_aileron compares.

Run peers/setup.sh once, then: peers/.venv/bin/python peers/radau_aileron.py

The healthy aileron with two active actuators under full air load, ten seconds of a smooth
command, by SciPy's Radau. The equations are written here by hand from the documentation
(the heads of crates/servotwin-model/src/components/*.rs, whose numbers stand in the comments);
nothing is generated. What does not act in this case is left out: end stops (out of reach), the
mode valve (m = 1 for ever), leaks and sensors that no controller reads.
"""

import platform
from math import cos, exp, log10, pi, radians, sin, sqrt, tanh
from pathlib import Path

import numpy
import scipy
from scipy.integrate import solve_ivp

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "scipy_radau_aileron.csv"
DURATION_S = 10.0
PERIOD_S = 0.1
TOLERANCE = 1e-9


def command_rad(t):
    return (
        radians(3.0) * (1 - cos(2 * pi * 0.4 * t))
        - radians(2.5) * (1 - cos(2 * pi * 1.1 * t))
        + radians(1.0) * (1 - cos(2 * pi * 2.3 * t))
    )


# Fluid: phosphate ester at 40 °C, with air and walls (F1)-(F3).
CELSIUS = 40.0
DENSITY = (1015.4 - 0.85 * CELSIUS) * (1 + 20 / 8000)
L = log10(CELSIUS + 51)
VISCOSITY = 1e-6 * 10 ** (0.3829 * L**4 - 1.8481 * L**3 + 2.2079 * L**2 - 1.1052 * L + 2.9544)


def bulk_modulus_pa(p):
    liquid = 1.48e9 + 10 * p
    gas = 0.005 * (101325 / p) ** (1 / 1.4)
    mixture = liquid * (1 + gas) / (1 + gas * liquid / (1.4 * p))
    return 1 / (1 / mixture + 1 / 10e9)


# Restrictions (O1)-(O3).
DISCHARGE = 0.65
REYNOLDS = 50.0
K = DENSITY / (2 * DISCHARGE**2)


def hole_flow(drop, area, series=0.0):
    diameter = sqrt(4 * area / pi)
    r = REYNOLDS * DENSITY * VISCOSITY / (2 * DISCHARGE**2 * diameter) + series * area
    return area * 2 * drop / (r + sqrt(r * r + 4 * K * abs(drop)))


# Servo valve (W1)-(W7).
STROKE = 1e-3
WIDTH = 2.38e-3
OVERLAP = -2e-6
CLEARANCE = 4e-6
EDGE_RADIUS = 2e-6
SMOOTHING = 1.5e-6
VALVE_OMEGA = 2 * pi * 100
VALVE_DAMPING = 0.7
SLEW = 0.15


def pilot_speed(drop):
    """(W2), with a flow that is laminar below 1000 Pa."""
    laminar = sqrt(1e3)
    return (sqrt(max(drop, 0.0) + 1e3) - laminar) / (sqrt(20e6 + 1e3) - laminar)


def edge_flow(opening_travel, drop):
    """The flow through an edge whose spool has moved so far in its opening direction."""
    xi = opening_travel - OVERLAP
    plus = (xi + sqrt(xi * xi + SMOOTHING**2)) / 2
    lap = plus - xi
    gap = sqrt((plus + 2 * EDGE_RADIUS) ** 2 + (CLEARANCE + 2 * EDGE_RADIUS) ** 2) - 2 * EDGE_RADIUS
    lap *= lap / (plus + lap)
    area = WIDTH * gap
    resistance = REYNOLDS * DENSITY * VISCOSITY / (2 * DISCHARGE**2 * 2 * gap * area)
    resistance += 12 * DENSITY * VISCOSITY * lap / (WIDTH * CLEARANCE**3)
    quadratic = K / area**2
    return 2 * drop / (resistance + sqrt(resistance**2 + 4 * quadratic * abs(drop)))


# Air (H1)-(H3), standard atmosphere at 3000 m.
SPEED = 150.0
INCIDENCE = 0.05236
AREA_CHORD = 1.93 * 0.58
AIR_K = 288.15 - 0.0065 * 3000
AIR_PA = 101325 * (AIR_K / 288.15) ** (9.80665 / (287.05287 * 0.0065))
AIR_DENSITY = AIR_PA / (287.05287 * AIR_K)
MACH_2 = SPEED**2 / (1.4 * 287.05287 * AIR_K)
AIR_SCALE = AIR_DENSITY * SPEED**2 / 2 * AREA_CHORD / sqrt(1 - MACH_2)


def air_moment(angle, rate):
    coefficient = -0.01 - 0.25 * INCIDENCE - 0.60 * angle - 1.5 * rate * 0.58 / (2 * SPEED)
    return AIR_SCALE * coefficient


def friction(v_p, p_a, p_b):
    """(Y5) at 40 °C"""
    load = 1 + 0.5 * ((p_a + p_b) / (2 * 1.06e7) - 1)
    return 6e3 * v_p + load * 500 * (1 + 0.5 * exp(-((v_p / 5e-3) ** 2))) * tanh(v_p / 5e-3)


PRESSURE_SENSOR_HZ = 125
RAM_SENSOR_HZ = 160
ARM = 0.0525
AREA = 2.2723e-3
FULL_PA = 344.74e5
STIFFNESS = 2.0e7
DAMPING = 2.0e3

# Per actuator: manifolds, spool, chambers, ram, currents of the two pressure
# sensors, ratio of the ram's sensor and its rate, washout of the controller.
NAMES = ["p_s", "p_t", "x_v", "v_v", "p_a", "p_b", "x_p", "v_p", "i_a", "i_b", "y", "z", "d"]
COUNT = len(NAMES)
SCALES = [2e7, 1e6, 1e-3, 0.1, 2e7, 2e7, 2e-2, 0.05, 0.01, 0.01, 0.5, 0.5, 2e7]
ALL_SCALES = numpy.array(SCALES * 2 + [2e7, 0.4, 1.0])


def reading_pa(current):
    return FULL_PA * (current - 4e-3) / 16e-3


def actuator(s, command, correction, angle, rate):
    """The rates of one actuator's states, and its force on the lever."""
    p_s, p_t, x_v, v_v, p_a, p_b, x_p, v_p, i_a, i_b, y, z, d = s
    # (K1)-(K3), with the sensors' readings.
    difference = reading_pa(i_a) - reading_pa(i_b)
    error = ARM * sin(command) - 22.2e-3 * 2 * y + correction
    current = min(max(272 * error - 0.45 * (difference - d) / 20.684e6, -1.0), 1.0)
    d_d = (difference - d) / 0.10
    # (W1)-(W3)
    speed = pilot_speed(p_s - p_t)
    d_x_v = speed * SLEW * tanh(v_v / SLEW)
    d_v_v = VALVE_OMEGA**2 * (STROKE * current - x_v) - 2 * VALVE_DAMPING * VALVE_OMEGA * v_v
    d_v_v -= 20 * VALVE_OMEGA * (v_v - min(max(v_v, -2 * SLEW), 2 * SLEW))
    d_v_v *= speed
    q_pa = edge_flow(x_v, p_s - p_a)
    q_pb = edge_flow(-x_v, p_s - p_b)
    q_at = edge_flow(-x_v, p_a - p_t)
    q_bt = edge_flow(x_v, p_b - p_t)
    q_pilot = hole_flow(p_s - p_t, 4e-8)
    # (S1), (S2), (V1)
    q_supply = hole_flow(20.684e6 - p_s, 1.6e-5, 3.84e9)
    q_return = hole_flow(p_t - 0.6e6, 1.6e-5, 1.92e9)
    d_p_s = bulk_modulus_pa(p_s) / 30e-6 * (q_supply - q_pa - q_pb - q_pilot)
    d_p_t = bulk_modulus_pa(p_t) / 30e-6 * (q_at + q_bt + q_pilot - q_return)
    # (Y1)-(Y5)
    q_seal = 2e-14 * (p_a - p_b)
    d_p_a = bulk_modulus_pa(p_a) / (65e-6 + AREA * x_p) * (q_pa - q_at - q_seal - AREA * v_p)
    d_p_b = bulk_modulus_pa(p_b) / (65e-6 - AREA * x_p) * (q_pb - q_bt + q_seal + AREA * v_p)
    # (T3), (L1)
    force = STIFFNESS * (x_p - ARM * sin(angle)) + DAMPING * (v_p - ARM * cos(angle) * rate)
    d_v_p = (AREA * (p_a - p_b) - force - friction(v_p, p_a, p_b)) / 2.0
    # (PS1), (D1), (D2)
    omega = 2 * pi * PRESSURE_SENSOR_HZ
    d_i_a = omega * (4e-3 + 16e-3 * min(max(p_a / FULL_PA, 0.0), 1.0) - i_a)
    d_i_b = omega * (4e-3 + 16e-3 * min(max(p_b / FULL_PA, 0.0), 1.0) - i_b)
    omega = 2 * pi * RAM_SENSOR_HZ
    ratio = 0.5 * min(max(x_p / 22.2e-3, -1.25), 1.25)
    rates = [d_p_s, d_p_t, d_x_v, d_v_v, d_p_a, d_p_b, v_p, d_v_p, d_i_a, d_i_b]
    rates += [omega * z, omega * (ratio - y - 2 * 0.6 * z), d_d]
    return rates, force


def rates(t, scaled, command):
    s = scaled * ALL_SCALES
    first, second = s[:COUNT].tolist(), s[COUNT : 2 * COUNT].tolist()
    fight, angle, rate = s[2 * COUNT :].tolist()
    # (Q1), (Q2)
    correction = min(max(2.5e-10 * fight / 2, -0.8e-3), 0.8e-3)
    d_1, force_1 = actuator(first, command(t), -correction, angle, rate)
    d_2, force_2 = actuator(second, command(t), correction, angle, rate)
    i_a, i_b = NAMES.index("i_a"), NAMES.index("i_b")
    difference_1 = reading_pa(first[i_a]) - reading_pa(first[i_b])
    difference_2 = reading_pa(second[i_a]) - reading_pa(second[i_b])
    d_fight = (difference_1 - difference_2 - fight) / 0.3
    # (L2), (J1)
    moment = ARM * cos(angle) * (force_1 + force_2) + air_moment(angle, rate)
    d_rate = (moment - 5 * rate - 5 * tanh(rate / 0.05)) / 2.8
    return numpy.array(d_1 + d_2 + [d_fight, rate, d_rate]) / ALL_SCALES


def solve(start, duration, command, samples=None, tolerance=TOLERANCE):
    result = solve_ivp(
        rates, (0.0, duration), start, method="Radau", t_eval=samples, args=(command,),
        rtol=tolerance, atol=tolerance, max_step=0.01 if samples is not None else numpy.inf,
    )
    assert result.success, result.message
    return result


def at_rest():
    one = [2.06e7, 6.1e5, 0, 0, 1.06e7, 1.06e7, 0, 0, 12e-3, 12e-3, 0, 0, 0]
    start = numpy.array(one * 2 + [0, 0, 0]) / ALL_SCALES
    return solve(start, 120.0, lambda t: 0.0).y[:, -1]


def main():
    rest = at_rest()
    times = numpy.arange(round(DURATION_S / PERIOD_S) + 1) * PERIOD_S
    result = solve(rest, DURATION_S, command_rad, times)
    states = result.y * ALL_SCALES[:, None]
    shown = {"p_a": "cylinder.pressure_a_pa", "p_b": "cylinder.pressure_b_pa"}
    shown |= {"x_p": "cylinder.position_m", "x_v": "servo_valve.spool_position_m"}
    columns = {}
    for number in (1, 2):
        for name, column in shown.items():
            row = (number - 1) * COUNT + NAMES.index(name)
            columns[f"actuator_{number}.{column}"] = states[row]
    columns["aileron.angle_rad"] = states[2 * COUNT + 1]
    with GOLDEN.open("w") as file:
        version = f"scipy {scipy.__version__}, numpy {numpy.__version__}"
        file.write(f"# peer: Radau of {version}, Python {platform.python_version()}, {TOLERANCE}\n")
        file.write("# written by peers/radau_aileron.py\n")
        file.write(",".join(["case", "time_s", *columns]) + "\n")
        for k, time in enumerate(times):
            numbers = [f"{values[k]:.10g}" for values in columns.values()]
            file.write(",".join(["healthy", f"{time:.1f}", *numbers]) + "\n")
    print(f"{result.nfev} evaluations, {result.njev} Jacobians")


if __name__ == "__main__":
    main()
