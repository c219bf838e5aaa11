"""The errors of the unit's own solution beside the standard deviations that it reports, by preset: a table.

Units of a preset, each with errors of its own, fly five minutes of closed form in `imud`. Errors are judged from a
minute after the begin, each two seconds: the share within 2 and 3 standard deviations, and the mean of their squares
in units of the variance, which is 1 where the filter is consistent. With --outage the receiver has no fix from 180 s
to 210 s, and errors are judged in the 30 s after it.

Usage: preset_consistency.py IMUD [PRESET...] [--units N] [--outage] [--flight NAME] [--more 'KEY = VALUE']
"""
import argparse
import pathlib
import tempfile

import numpy as np

from flights import FLIGHTS
from unit_runs import AIDED, COASTING, IDEAL, RECEIVER, SIGMAS, STATE, errors, run, write_truth

SECONDS, RATE = 300, 100
GRADES = ["vn-100", "3dm-gx5-25", "bmi088", "adis16505-1", "sbg-ellipse", "mti-630", "adis16495-1", "hg4930-ca51",
          "stim300", "kvh-1775"]
OUTAGE = '[[fault]]\nat_s = 180\nfor_s = 30\ntarget = "gnss"\nkind = "no_fix"\n'


def unit(preset, more):
    return (f'model = "{preset}"\n[imu.magnetometer]\nmodel = "rm3100"\n[imu.navigation]\nsolution = "filter"\n{RECEIVER}' +
            "\n".join(more))


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
        write_truth(folder / "truth.csv", FLIGHTS[options.flight], SECONDS, RATE)
        for preset in options.presets:
            sent = run(options.imud, folder, FLIGHTS[options.flight],
                       [IDEAL] + options.units * [unit(preset, options.more)], RATE, more=OUTAGE if options.outage else "")
            begin, end = (210, 240) if options.outage else (60, SECONDS)
            judged = sent[:, begin * RATE:end * RATE:2 * RATE]
            assert np.isin(judged[1:, :, STATE], (COASTING, AIDED)).all(), f"{preset}: not aligned"
            error = errors(judged[1:], judged[:1])
            square = (error / judged[1:, :, SIGMAS]) ** 2
            cells, sizes = [], []
            for part, factor in ((slice(0, 2), 57.3), (slice(2, 3), 57.3), (slice(3, 6), 1), (slice(6, 9), 1)):
                of = square[..., part]
                cells.append(f"{100 * (of < 4).mean():.1f} {100 * (of < 9).mean():.1f} {of.mean():.2f}")
                sizes.append(f"{factor * np.sqrt((error[..., part] ** 2).mean()):.3g}")
            print(f"| `{preset}` | " + " | ".join(cells) + " | " + " ".join(sizes) + " |", flush=True)


if __name__ == "__main__":
    main()
