"""Units that compute their own solution, run by `imud` on a flight in closed form, and their errors."""
import pathlib
import subprocess

import numpy as np

from flights import inverse, logarithm, product, turned

AXES, VECTORS = ("north", "east", "down"), ("attitude", "velocity", "position")
UNITS = {"attitude": "rad", "velocity": "m_per_s", "position": "m"}
FIELDS = (["q_LP_%s" % i for i in "wxyz"] + ["latitude_rad", "longitude_rad", "height_m"] +
          [f"velocity_{axis}_m_per_s" for axis in AXES] + ["navigation_state"] +
          [f"{vector}_sigma_{axis}_{UNITS[vector]}" for vector in VECTORS for axis in AXES] + ["fix_age_s"])
STATE, SIGMAS, FIX_AGE = 10, slice(11, 20), 20
COASTING, AIDED = 2, 3  # navigation_state


def write_truth(path, flight, seconds, rate):
    """Writes a truth CSV; `flight` is a Flight of flights.py."""
    t = np.arange(seconds * rate + 1) / rate
    r, v, a, q = flight.motion(t)
    h = 1e-3
    omega = logarithm(product(inverse(flight.motion(t - h)[3]), flight.motion(t + h)[3])) / (2 * h)
    force = turned(inverse(q), a - flight.gravitation(r))
    q = np.where(q[:, :1] < 0, -q, q)
    rows = np.concatenate([r, v, q[:, 1:] / (1 + q[:, :1]), omega, force], axis=-1)
    names = [f"{name}_{i}" for name in ("r_BN_N", "v_BN_N") for i in "xyz"] + [f"sigma_BN_{i}" for i in "123"] + [
        f"{name}_{i}" for name in ("omega_BN_B", "nonConservativeAccelpntB_B") for i in "xyz"]
    with path.open("w") as file:
        print(",".join(["time_ns"] + names), file=file)
        for k, row in enumerate(rows):
            print(f"{k * 10**9 // rate}," + ",".join(repr(float(x)) for x in row), file=file)


def run(imud, folder, flight, units, rate, *options, more=""):
    """Runs units on `folder`/truth.csv; returns what each sent, units x samples x FIELDS.

    `units`: of each the rest of its [[imu]] and its tables. `more`: further tables of the configuration."""
    folder = pathlib.Path(folder)
    layout = ", ".join(['"A5 5A C3 3C"'] + ['"%s:f64"' % field for field in FIELDS])
    (folder / "doubles.toml").write_text(
        'frame_version = 1\nname = "doubles"\nbyte_order = "little"\n[line]\nbaud = 4000000\n[[message]]\nname = "all"\n'
        f"layout = [{layout}]\n")
    earth = 'frame = "inertial"\nangle_deg = 0' if flight.is_global else 'frame = "local"\nlatitude_deg = 48\nlongitude_deg = 11'
    text = f'clock = "fast"\n[truth]\nport = "file:{folder}/truth.csv"\nformat = "csv"\n[earth]\n{earth}\n'
    for i, unit in enumerate(units):
        text += (f'[[imu]]\nprotocol = "frame"\nport = "file:{folder}/sent{i}"\nrate_hz = {rate}\n'
                 f'device.frame_file = "{folder}/doubles.toml"\n{unit}\n')
    (folder / "config.toml").write_text(text + more)
    done = subprocess.run([imud, "run", folder / "config.toml", *options], timeout=3000, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:500]
    kind = np.dtype([("head", "<u4"), ("values", "<f8", len(FIELDS))])
    return np.stack([np.fromfile(folder / f"sent{i}", dtype=kind)["values"] for i in range(len(units))])


IDEAL = 'model = "ideal"\n[imu.gyro]\nmax_rad_per_s = 100\n[imu.accelerometer]\nmax_m_per_s2 = 1000\n'
RECEIVER = 'position_noise_m = [1.5, 1.5, 3]\nvelocity_noise_m_per_s = [0.05, 0.05, 0.1]\n'


def errors(units, truth):
    """Returns the errors of solutions: ... x samples x 9: rotations about north, east, down, rad; m/s; m."""
    attitude = logarithm(product(units[..., :4], inverse(truth[..., :4])))
    place = units[..., 4:7] - truth[..., 4:7]
    latitude = truth[..., 4]
    e2, a = 6.69437999014e-3, 6378137.0
    n = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    place[..., 0] *= n * (1 - e2) / (1 - e2 * np.sin(latitude) ** 2) + truth[..., 6]
    place[..., 1] *= (n + truth[..., 6]) * np.cos(latitude)
    place[..., 2] *= -1
    return np.concatenate([attitude, units[..., 7:10] - truth[..., 7:10], place], axis=-1)
