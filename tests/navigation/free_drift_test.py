"""The drift of a unit's own solution without aids and with one error term on, through the whole daemon.

A unit stands on the rotating Earth, begins at the true state, and has no aids. Its errors follow b t^2/2, w t and
g w t^3/6 within 5 % up to 60 s; for one of Schuler's periods, 84.4 minutes, the solution of the linear error
equations; and along the vertical cosh(sqrt(2) w t).

Usage: free_drift_test.py IMUD
"""
import math
import pathlib
import sys
import tempfile

import numpy as np

from flights import A as A_EARTH, E2, FLIGHTS, OMEGA, euler, inverse, normal_gravitation, place, turned
from unit_runs import errors, run, write_truth

RATE, SECONDS = 10, 5070
LATITUDE, LONGITUDE = math.radians(30), 0.2  # of the flight "rest"
BIAS, RATE_BIAS = 1e-4, 1e-8  # m/s^2, rad/s: so small that squares of the errors do not count
NORTH, EAST, DOWN = range(3)
TERMS = [("accelerometer", NORTH), ("accelerometer", EAST), ("accelerometer", DOWN), ("gyro", NORTH), ("gyro", EAST),
         ("gyro", DOWN)]
SIZES = {"accelerometer": BIAS, "gyro": RATE_BIAS}
ATTITUDE = euler(np.array(1.0), np.array(0.1), np.array(-0.2))  # of that flight, relative to north, east, down


def unit(sensor=None, direction=NORTH):
    """A unit whose only error is a bias along north, east or down, of one of its sensors."""
    bias = SIZES.get(sensor, 0) * turned(inverse(ATTITUDE), np.eye(3)[direction])
    keys = {"gyro": "max_rad_per_s = 10\nbias_rad_per_s", "accelerometer": "max_m_per_s2 = 100\nbias_m_per_s2"}
    tables = [f"[imu.{name}]\n{key} = {list(map(float, bias if name == sensor else (0, 0, 0)))}\n"
              for name, key in keys.items()]
    return ('model = "ideal"\n' + "".join(tables) + '[imu.navigation]\nsolution = "filter"\nalignment = "truth"\n'
            "gnss_rate_hz = 0\nmagnetic_rate_hz = 0\n")


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def dcm_EL():
    s, c, k, l = math.sin(LATITUDE), math.cos(LATITUDE), math.sin(LONGITUDE), math.cos(LONGITUDE)
    return np.array([[-s * l, -k, -c * l], [-s * k, l, -c * k], [c, 0, -s]])


def radii(latitude):
    """The radii of curvature of the ellipsoid along the meridian and across it."""
    normal = A_EARTH / math.sqrt(1 - E2 * math.sin(latitude) ** 2)
    return normal * (1 - E2) / (1 - E2 * math.sin(latitude) ** 2), normal


def gravity(r):
    """Gravitation and centrifugal acceleration in E."""
    return normal_gravitation(r[None])[0] + OMEGA**2 * r * [1, 1, 0]


def linear_errors(sensor, direction, times):
    """The linear error equations of a platform at rest, in Earth-fixed axes, with the Earth's rate.

    The states are estimated less true: rotation, velocity, position. Returns them north, east, down, the rotation
    relative to the north and the vertical at the estimated place, for each time; these are at equal distances."""
    r, spin, C_EL = place(LATITUDE, LONGITUDE, 0), np.array([0, 0, OMEGA]), dcm_EL()
    gradient = np.stack([(gravity(r + h) - gravity(r - h)) / 200 for h in 100 * np.eye(3)], axis=-1)
    A = np.zeros((9, 9))
    A[0:3, 0:3] = -cross(spin)
    A[3:6, 0:3] = cross(gravity(r))  # the specific force is the opposite of gravity
    A[3:6, 3:6] = -2 * cross(spin)
    A[3:6, 6:9] = gradient
    A[6:9, 3:6] = np.eye(3)
    u = np.zeros(9)
    u[slice(0, 3) if sensor == "gyro" else slice(3, 6)] = SIZES[sensor] * C_EL[:, direction]
    # x' = A x + u by its exact transition over a step (Van Loan's block matrix, a series of order 12).
    step = times[1] - times[0]
    block = np.zeros((10, 10))
    block[:9, :9], block[:9, 9] = A * step, u * step
    transition, power = np.eye(10), np.eye(10)
    for n in range(1, 13):
        power = power @ block / n
        transition = transition + power
    x = np.append(np.zeros(9), 1.0)
    rows = []
    for _ in times:
        rows.append(x[:9])
        x = transition @ x
    rows = (np.array(rows).reshape(-1, 3, 3) @ C_EL).reshape(-1, 9)
    meridian, normal = radii(LATITUDE)
    rows[:, 0] -= rows[:, 7] / normal
    rows[:, 1] += rows[:, 6] / meridian
    rows[:, 2] += rows[:, 7] * math.tan(LATITUDE) / normal
    return rows


def main():
    flight = FLIGHTS["rest"]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_truth(folder / "truth.csv", flight, SECONDS, RATE)
        sent = run(sys.argv[1], folder, flight, [unit(*term) for term in TERMS] + [unit()], RATE)
    ideal = sent[-1]
    # A place on the Earth does not move, nor does the attitude relative to it.
    assert np.abs(errors(ideal, ideal[:1])[:60 * RATE]).max() < 1e-6
    error = dict(zip(TERMS, errors(sent[:-1], ideal[None, :1])))
    g = np.linalg.norm(gravity(place(LATITUDE, LONGITUDE, 0)))
    schuler = math.sqrt(g / np.linalg.norm(place(LATITUDE, LONGITUDE, 0)))  # rad/s
    wrong = []

    def check(what, value, expected, bound):
        largest = np.abs(value - expected).max()
        print(f"{what}: {largest:.2e}, bound {bound:.2e}")
        if not largest <= bound:
            wrong.append(what)

    axes = ("north", "east", "down")
    for (sensor, direction), e in error.items():
        name = f"{sensor}, {axes[direction]}"
        along = np.eye(3)[direction]
        for t in (10, 30, 60):
            row = e[RATE * t]
            if sensor == "accelerometer":
                position = along * BIAS * t**2 / 2
            else:
                position = np.cross(along, [0, 0, -1]) * g * RATE_BIAS * t**3 / 6
                check(f"{name}, attitude at {t} s", row[:3], along * RATE_BIAS * t, 0.05 * RATE_BIAS * t)
            size = np.linalg.norm(position) or g * RATE_BIAS * t**3 / 6
            check(f"{name}, position at {t} s", row[6:], position, 0.05 * size)
    times = np.arange(0, SECONDS + 1, 1.0)
    for (sensor, direction), e in error.items():
        if (sensor, direction) == ("accelerometer", DOWN):
            continue
        expected = linear_errors(sensor, direction, times)
        for part, what in ((slice(0, 3), "attitude"), (slice(3, 5), "velocity"), (slice(6, 8), "position")):
            size = np.linalg.norm(expected[:, part], axis=-1).max()
            check(f"{sensor}, {axes[direction]}, {what} for {SECONDS} s", e[::RATE, part], expected[:, part], 0.02 * size)
    # An accelerometer's bias: twice b/ws^2 after half of Schuler's period, and nearly back at its end, but for the
    # rotation of the plane of the oscillation by the Earth's: 2 sin(pi/ws OMEGA sin(latitude)) b/ws^2.
    period = 2 * math.pi / schuler
    assert abs(period / 60 - 84.4) < 0.15, period
    far = np.linalg.norm(error["accelerometer", NORTH][:, 6:8], axis=-1)
    size = BIAS / schuler**2
    turned_by = period * OMEGA * math.sin(LATITUDE)
    check("half of Schuler's period", far[round(RATE * period / 2)], 2 * math.cos(turned_by / 4) * size, 0.02 * size)
    check("Schuler's period", far[round(RATE * period)], 2 * math.sin(turned_by / 2) * size, 0.04 * size)
    for t in (60, 600, 1800):
        expected = BIAS / (2 * schuler**2) * (math.cosh(math.sqrt(2) * schuler * t) - 1)
        check(f"height after {t} s", error["accelerometer", DOWN][RATE * t, 8], expected, 0.02 * expected)
    assert not wrong, wrong


if __name__ == "__main__":
    main()
