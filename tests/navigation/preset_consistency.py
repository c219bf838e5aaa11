"""The errors of the unit's own solution beside the standard deviations that it reports, by preset: a table.

Units of a preset, each with errors of its own, fly five minutes of closed form in `imud`. Errors are judged from a
minute after the begin, each two seconds: the share within 2 and 3 standard deviations, and the mean of their squares
in units of the variance, which is 1 where the filter is consistent. With --outage the receiver has no fix from 180 s
to 210 s, and errors are judged in the 30 s after it.

Usage: preset_consistency.py IMUD [PRESET...] [--units N] [--outage] [--flight NAME] [--more 'KEY = VALUE']
"""
import argparse
import pathlib
import subprocess
import tempfile

import numpy as np

from flights import FLIGHTS, inverse, logarithm, product, turned

SECONDS, RATE = 300, 100
GRADES = ["vn-100", "3dm-gx5-25", "bmi088", "adis16505-1", "sbg-ellipse", "mti-630", "adis16495-1", "hg4930-ca51",
          "stim300", "kvh-1775"]
AXES, VECTORS = ("north", "east", "down"), ("attitude", "velocity", "position")
UNITS = {"attitude": "rad", "velocity": "m_per_s", "position": "m"}
FIELDS = (["q_LP_%s" % i for i in "wxyz"] + ["latitude_rad", "longitude_rad", "height_m"] +
          [f"velocity_{axis}_m_per_s" for axis in AXES] + ["navigation_state"] +
          [f"{vector}_sigma_{axis}_{UNITS[vector]}" for vector in VECTORS for axis in AXES])


def write_truth(path, flight):
    t = np.arange(SECONDS * RATE + 1) / RATE
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
            print(f"{k * 10**9 // RATE}," + ",".join(repr(float(x)) for x in row), file=file)


def run(imud, folder, flight, preset, options):
    """Returns what each unit sent, units x samples x fields, after what a unit without errors sent."""
    layout = ", ".join(['"A5 5A C3 3C"'] + ['"%s:f64"' % field for field in FIELDS])
    (folder / "doubles.toml").write_text(
        'frame_version = 1\nname = "doubles"\nbyte_order = "little"\n[line]\nbaud = 4000000\n[[message]]\nname = "all"\n'
        f"layout = [{layout}]\n")
    earth = 'frame = "inertial"\nangle_deg = 0' if flight.is_global else 'frame = "local"\nlatitude_deg = 48\nlongitude_deg = 11'
    text = (f'clock = "fast"\n[truth]\nport = "file:{folder}/truth.csv"\nformat = "csv"\n[earth]\n{earth}\n')
    for unit in range(options.units + 1):
        text += (f'[[imu]]\nprotocol = "frame"\nport = "file:{folder}/sent{unit}"\nrate_hz = {RATE}\n'
                 f'device.frame_file = "{folder}/doubles.toml"\nmodel = "{preset if unit else "ideal"}"\n')
        if unit == 0:
            text += "[imu.gyro]\nmax_rad_per_s = 100\n[imu.accelerometer]\nmax_m_per_s2 = 1000\n"
        else:
            text += ('[imu.magnetometer]\nmodel = "rm3100"\n'
                     '[imu.navigation]\nsolution = "filter"\nposition_noise_m = [1.5, 1.5, 3]\n'
                     'velocity_noise_m_per_s = [0.05, 0.05, 0.1]\n' + "\n".join(options.more) + "\n")
    if options.outage:
        text += '[[fault]]\nat_s = 180\nfor_s = 30\ntarget = "gnss"\nkind = "no_fix"\n'
    (folder / "config.toml").write_text(text)
    done = subprocess.run([imud, "run", folder / "config.toml"], timeout=3000, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    kind = np.dtype([("head", "<u4"), ("values", "<f8", len(FIELDS))])
    sent = [np.fromfile(folder / f"sent{unit}", dtype=kind)["values"] for unit in range(options.units + 1)]
    return np.stack(sent)


def squares(sent):
    """Returns the squares of the errors in units of the variance: units x samples x 9, and the errors."""
    truth, units = sent[:1], sent[1:]
    attitude = logarithm(product(units[..., :4], inverse(truth[..., :4])))
    place = units[..., 4:7] - truth[..., 4:7]
    latitude = truth[..., 4]
    e2, a = 6.69437999014e-3, 6378137.0
    n = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    place[..., 0] *= n * (1 - e2) / (1 - e2 * np.sin(latitude) ** 2) + truth[..., 6]
    place[..., 1] *= (n + truth[..., 6]) * np.cos(latitude)
    place[..., 2] *= -1
    error = np.concatenate([attitude, units[..., 7:10] - truth[..., 7:10], place], axis=-1)
    return (error / units[..., 11:20]) ** 2, error


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("imud")
    parser.add_argument("presets", nargs="*", default=GRADES)
    parser.add_argument("--units", type=int, default=8)
    parser.add_argument("--outage", action="store_true")
    parser.add_argument("--flight", default="aeroplane", choices=set(FLIGHTS) - {"cessna"})  # it is shorter
    parser.add_argument("--more", action="append", default=[])
    options = parser.parse_args()
    print(f"{options.flight}, {options.units} units; within 2 and 3 sigma, %; mean square; RMS\n")
    print("| preset | tilt | heading | velocity | position | RMS: tilt, heading, deg; velocity, m/s; position, m |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_truth(folder / "truth.csv", FLIGHTS[options.flight])
        for preset in options.presets:
            sent = run(options.imud, folder, FLIGHTS[options.flight], preset, options)
            begin, end = (210, 240) if options.outage else (60, SECONDS)
            judged = sent[:, begin * RATE:end * RATE:2 * RATE]
            assert np.isin(judged[1:, :, 10], (2, 3)).all(), f"{preset}: not aligned"
            square, error = squares(judged)
            cells, sizes = [], []
            for part, factor in ((slice(0, 2), 57.3), (slice(2, 3), 57.3), (slice(3, 6), 1), (slice(6, 9), 1)):
                of = square[..., part]
                cells.append(f"{100 * (of < 4).mean():.1f} {100 * (of < 9).mean():.1f} {of.mean():.2f}")
                sizes.append(f"{factor * np.sqrt((error[..., part] ** 2).mean()):.3g}")
            print(f"| `{preset}` | " + " | ".join(cells) + " | " + " ".join(sizes) + " |", flush=True)


if __name__ == "__main__":
    main()
