"""What the scenarios of tools/scenarios do to a unit's own solution, as tools/scenarios/README.md states it.

A tactical and a MEMS unit hover or fly a figure of eight; each scenario's outcome is the state of the solution and its
errors against the truth. The same seeds give the same numbers, so that bounds are those of the outcome, not of chance.
The effects in the labels are the largest of these errors.

Usage: scenarios_test.py IMUD SCENARIOS
"""
import csv
import dataclasses
import math
import pathlib
import sys
import tempfile

import numpy as np

from flights import FLIGHTS, G, MEMS, Flight, about, euler, inverse, path, sigmas, turned
from unit_runs import AIDED, COASTING, IDEAL, RECEIVER, SIGMAS, STATE, errors, run, write_truth

RATE, SECONDS = 50, 300
UNITS = {"tactical": "hg4930-ca51", "MEMS": "vn-100"}
FIX_S, NOTICED_S, ACCEPT_S = 0.2, 1.2, 10  # between fixes; until a gap counts as coasting; of rejections, until accepted


def hover(t):
    """A rotorcraft in wind, which nods and turns slowly to and fro."""
    r, v, a = path(t, [(0.3, 0.9, 0)], [(0.2, 1.3, 1)], [(0.1, 0.5, 2)])
    yaw = 0.3 + 0.05 * np.sin(0.2 * t)
    down = turned(inverse(about(2, yaw)), np.array([0, 0, G]) - a)
    down /= np.linalg.norm(down, axis=-1, keepdims=True)
    return r, v, a, euler(yaw, np.arctan2(down[:, 0], down[:, 2]), -np.arcsin(down[:, 1]))


FLIGHTS = {"hover": Flight(hover, False, SECONDS, MEMS, sigmas(1)), "eight": FLIGHTS["aeroplane"]}


@dataclasses.dataclass
class Outcome:
    """What units sent, and their errors, units x samples x ..."""
    sent: np.ndarray
    error: np.ndarray
    labels: list

    def between(self, unit, begin, end):
        rows = slice(round(begin * RATE), round(end * RATE))
        return self.sent[list(UNITS).index(unit), rows], self.error[list(UNITS).index(unit), rows]

    def states(self, unit, begin, end):
        return set(self.between(unit, begin, end)[0][:, STATE])

    def heading(self, unit, begin, end):
        """The largest error of the heading, deg."""
        return math.degrees(np.abs(self.between(unit, begin, end)[1][:, 2]).max())

    def attitude(self, unit, begin, end):
        return math.degrees(np.linalg.norm(self.between(unit, begin, end)[1][:, :3], axis=-1).max())

    def velocity(self, unit, begin, end):
        return np.linalg.norm(self.between(unit, begin, end)[1][:, 3:6], axis=-1).max()

    def position(self, unit, begin, end):
        return np.linalg.norm(self.between(unit, begin, end)[1][:, 6:9], axis=-1).max()


class Bench:
    def __init__(self, imud, scenarios, folder):
        self.imud, self.scenarios, self.folder, self.truths = imud, pathlib.Path(scenarios), folder, {}
        for name, flight in FLIGHTS.items():
            (folder / name).mkdir()
            write_truth(folder / name / "truth.csv", flight, SECONDS, RATE)
            self.truths[name] = run(imud, folder / name, flight, [IDEAL], RATE)[0]

    def fly(self, flight, scenario=None, faults=""):
        folder = self.folder / flight
        units = [f'name = "{name}"\nmodel = "{preset}"\n[imu.magnetometer]\nmodel = "rm3100"\n[imu.navigation]\nsolution = "filter"\n'
                 f"{RECEIVER}" for name, preset in UNITS.items()]
        options = ["--labels", folder / "labels.csv"]
        if scenario:
            options += ["--scenario", self.scenarios / f"{scenario}.toml"]
        sent = run(self.imud, folder, FLIGHTS[flight], units, RATE, *options, more=faults)
        with (folder / "labels.csv").open() as file:
            labels = [row for row in csv.DictReader(file) if row["state"] == "acted"]
        return Outcome(sent, errors(sent, self.truths[flight]), labels)


def check(what, value, low, high):
    print(f"  {what}: {value:.3g}, {low:.3g} to {high:.3g}")
    assert low <= value <= high, what


NO_FIX = '[[fault]]\ntarget = "gnss"\nkind = "no_fix"\nat_s = 120\nfor_s = 60\n'


def gnss_lost(bench, grade, acceleration, rate):
    """The biases that change at the last fix make b t^2/2 and g w t^3/6, along the unit's x axis."""
    alone, out = bench.fly("hover", faults=NO_FIX), bench.fly("hover", f"gnss_lost_{grade.lower()}")
    assert out.states(grade, 119, 120) == {AIDED} and out.states(grade, 120 + NOTICED_S, 180) == {COASTING}
    assert out.states(grade, 180 + 2 * FIX_S, SECONDS) == {AIDED}
    drift = out.between(grade, 120, 180)[1] - alone.between(grade, 120, 180)[1]
    along = drift[:, 6:8] @ [math.cos(0.3), math.sin(0.3)]
    for t in (30, 59.9):
        expected = acceleration * t**2 / 2 + G * rate * t**3 / 6
        check(f"drift by the biases after {t} s, m", along[round(t * RATE)], 0.95 * expected, 1.05 * expected)
    sigma = np.linalg.norm(out.between(grade, 179.9, 180)[0][0, SIGMAS][6:9])
    check("error at the end, in units of the reported deviation", out.position(grade, 179.9, 180) / sigma, 0, 3)
    check("error 10 s after the end, m", out.position(grade, 190, SECONDS), 0, 1.5)
    return out


def gnss_walk_off(bench):
    out = bench.fly("eight", "gnss_walk_off")
    for unit in UNITS:
        print(f" {unit}")
        assert out.states(unit, 60, SECONDS) == {AIDED}
        check("error to the north at the end, m", out.between(unit, 179, 180)[1][:, 6].mean(), 5, 6.5)
        check("reported at that time, m", out.between(unit, 179, 180)[0][:, SIGMAS][:, 6].max(), 0.05, 0.3)
        check("error two minutes after the end, m", out.position(unit, 299, SECONDS), 0, 1)
    return out


def gnss_jump(bench):
    out = bench.fly("eight", "gnss_jump")
    for unit in UNITS:
        print(f" {unit}")
        for begin, before, after in ((120, 0, 200), (150, 200, 0)):
            assert out.states(unit, begin + NOTICED_S, begin + ACCEPT_S) == {COASTING}
            assert out.states(unit, begin + ACCEPT_S + 3 * FIX_S, begin + 30) == {AIDED}
            check("error until it is accepted, m", out.position(unit, begin, begin + ACCEPT_S), before, before + 1.5)
            check("and 2 s later, m", out.position(unit, begin + ACCEPT_S + 2, begin + 30), after, after + 3)
        check("attitude meanwhile, deg", out.attitude(unit, 120, 180), 0, 0.6)
    return out


def compass_in_hover(bench):
    out = bench.fly("hover", "compass_in_hover")
    for unit, (least, most) in {"tactical": (0.5, 2.5), "MEMS": (3, 7.7)}.items():
        print(f" {unit}")
        assert out.states(unit, 60, SECONDS) == {AIDED}
        check("heading, 42 uT, deg", out.heading(unit, 90, 150), 0, 0.6)
        check("heading, 2.8 uT, deg", out.heading(unit, 210, 240), least, most)
        check("heading a minute later, deg", out.heading(unit, 299, SECONDS), 0, most / 2)
        check("position, m", out.position(unit, 60, SECONDS), 0, 1.5)
    return out


def gyro_bias_step(bench):
    out = bench.fly("eight", "gyro_bias_step")
    assert out.states("MEMS", 60, 210) == {AIDED} and COASTING in out.states("tactical", 90, 150)
    check(" MEMS: attitude, 180 deg/h, deg", out.attitude("MEMS", 90, 150), 0.3, 1)
    check(" tactical: attitude, 180 deg/h, deg", out.attitude("tactical", 90, 150), 1, 4)
    for unit in UNITS:
        print(f" {unit}")
        check("attitude, 8 deg/s, deg", out.attitude(unit, 210, 218), 40, 70)
        assert COASTING in out.states(unit, 210, 240)
        check("attitude 20 s after the end, deg", out.attitude(unit, 238, SECONDS), 0, 5)
        check("attitude a minute after the end, deg", out.attitude(unit, 278, SECONDS), 0, 2)
        check("position a minute after the end, m", out.position(unit, 278, SECONDS), 0, 2)
    return out


def accelerometer_stuck(bench):
    out = bench.fly("eight", "accelerometer_stuck")
    for unit in UNITS:
        print(f" {unit}")
        assert COASTING in out.states(unit, 120, 140) and out.states(unit, 145, SECONDS) == {AIDED}
        check("velocity, m/s", out.velocity(unit, 120, 135), 15, 20)
        check("position, m", out.position(unit, 120, 135), 50, 200)
        check("attitude, deg", out.attitude(unit, 120, 150), 0, 10)
        check("position 20 s after the end, m", out.position(unit, 150, SECONDS), 0, 2)
        check("attitude 30 s after the end, deg", out.attitude(unit, 160, SECONDS), 0, 1)
    return out


def wrong_heading(bench):
    out = bench.fly("eight", "wrong_heading")
    for unit in UNITS:
        print(f" {unit}")
        check("first heading, deg", out.heading(unit, 1.5, 2), 25, 35)
        assert COASTING in out.states(unit, 2, 20) and out.states(unit, 30, SECONDS) == {AIDED}
        check("heading after half a minute, deg", out.heading(unit, 30, SECONDS), 0, 2)
        check("heading after a minute, deg", out.heading(unit, 60, SECONDS), 0, 0.6)
        check("position after half a minute, m", out.position(unit, 30, SECONDS), 0, 2)
    return out


def check_labels(out):
    """The effects are the largest errors from the begin until a minute after the end."""
    assert out.labels
    for row in out.labels:
        begin, end = float(row["begin_s"]), float(row["end_s"]) + 60 + 1.5 / RATE
        seen = [math.radians(out.attitude(row["imu"], begin, end)), out.velocity(row["imu"], max(begin, 1.1), end),
                out.position(row["imu"], max(begin, 1.1), end)]
        effect = [float(row[key]) for key in ("attitude_error_rad", "velocity_error_m_per_s", "position_error_m")]
        assert np.allclose(effect, seen, rtol=1e-5), (row, seen)


def main():
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(sys.argv[1], sys.argv[2], pathlib.Path(name))
        mg, deg_per_hr = G * 1e-3, math.radians(1) / 3600
        for grade, b, w in (("tactical", 0.1, 0.5), ("MEMS", 1, 10)):
            print(f"gnss_lost_{grade.lower()}")
            check_labels(gnss_lost(bench, grade, b * mg, w * deg_per_hr))
        for scenario in (gnss_walk_off, gnss_jump, compass_in_hover, gyro_bias_step, accelerometer_stuck, wrong_heading):
            print(scenario.__name__)
            check_labels(scenario(bench))


if __name__ == "__main__":
    main()
