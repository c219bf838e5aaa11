"""Tilt, heading, velocity and position errors of units with their own filter, beside their makers' figures: a table.

Units of a product, each with errors of its own, drive a road and fly a figure of eight of closed form for six
minutes; RMS over units and time from a minute to five minutes after the begin. Then the receiver has no fix, and the
drift is the RMS over units of the change of the horizontal position's error since. A maker's velocity and position are
the unit's output, so the receiver's errors are those by which the output has about these figures: a Gauss-Markov
process, with white noise of half its size. The heading is by one antenna and
motion, without a magnetometer. A figure is reached if the RMS over both motions, like the maker's a single number, is
within a factor of 1.5 of it. Figures that no document was found to state are left out and counted, as are figures of two
antennas and of RTK. Exits with 1 unless every figure is reached, and by each motion alone within a factor of 1.6.

A second table has the times in motion after which the heading errors stay within a degree, of half and of 95 % of the units.
No document that could be read states such a time.

Usage: data_sheets.py IMUD [--units N]
"""
import argparse
import dataclasses
import math
import pathlib
import sys
import tempfile

import numpy as np

from flights import FLIGHTS
from unit_runs import AIDED, COASTING, IDEAL, STATE, errors, run, write_truth

SECONDS, RATE, BATCH = 360, 50, 25
FACTOR, FACTOR_OF_ONE_MOTION = 1.5, 1.6
BEGIN, LOST = 60, 300  # s, where the judged errors begin, and where the receiver loses its fix
STATED = 14  # as core/README.md has them
MOTIONS = ["car", "aeroplane"]
DRIFTS = {"drift in 10 s": 10, "drift in 60 s": 60}  # s
WHAT = {"tilt": "deg", "heading": "deg", "velocity": "m/s", "horizontal position": "m", "height": "m"} | dict.fromkeys(DRIFTS, "m")
OUTAGE = f'[[fault]]\nat_s = {LOST}\nfor_s = {SECONDS}\ntarget = "gnss"\nkind = "no_fix"\n'


@dataclasses.dataclass
class Product:
    preset: str
    sensors: str  # tables of the constant errors that its figures state beside the preset's
    figures: dict  # by WHAT, RMS
    velocity: float  # m/s, of the receiver's error in each axis
    position: tuple  # m, of the receiver, horizontal (of both axes together), vertical


def constant_errors(gyro_deg_per_s, gyro_ppm, accelerometer_mg, accelerometer_ppm):
    """Tables of biases and scale factors, with axes that are off by 0.05 deg."""
    return f"""[imu.gyro]
turn_on_bias_deg_per_s = {gyro_deg_per_s}
unit_sigma.scale_factor_ppm = {gyro_ppm}
unit_sigma.misalignment_mrad = 0.87
[imu.accelerometer]
turn_on_bias_mg = {accelerometer_mg}
unit_sigma.scale_factor_ppm = {accelerometer_ppm}
unit_sigma.misalignment_mrad = 0.87
"""


ELLIPSE = constant_errors(0.2, 500, 5, 1000)
# Of older units of the same maker. The biases are a 3DM-CX5-AHRS's, by a program that names its data sheet. The others
# are unconfirmed: a 3DM-GX5's, from memory: 500 ppm, 300 ppm, 0.05 deg.
OLDER_MICROSTRAIN = constant_errors(0.04, 500, 2, 300)
# The preset has the limit of the gyros' in-run bias, 10 deg/h; accuracies are a typical unit's, whose bias is 5 deg/h to
# 7 deg/h.
TYPICAL_VECTORNAV = "[imu.gyro]\nbias_minimum_deg_per_hr = 7\n"
PRODUCTS = {
    # SBG Systems, Ellipse series leaflet: accuracy (RMS), of Ellipse-N and -D, single point; sensors.
    "SBG Ellipse-N": Product("sbg-ellipse", ELLIPSE, {"tilt": 0.1, "heading": 0.2, "velocity": 0.03, "horizontal position": 1.2},
                             0.0375, (1.55, 2.3)),
    # Rob Fisher, MicroStrain by HBK, in Nav2's documentation; Clearpath Robotics' page of the GQ7. The heading is of two
    # antennas. Its velocity is chosen.
    "3DM-GQ7": Product("3dm-cv7", OLDER_MICROSTRAIN, {"tilt": 0.05, "horizontal position": 1.25, "height": 2.0}, 0.05,
                       (1.5, 2.4)),
    # The figures of a VN-200, as open-rdc/aiformula, issue 58, quotes them; tilt, height and drift as
    # dr-paradox-design/AUV_Control, vn200_hardware.md, quotes search results for VectorNav's product brief, which also have
    # the other three; the brief was not read. A project's page of a VN-300 (core/README.md) has all of them, and the typical
    # bias. "The typical rate of growth in error of position estimates is 3.0 cm/s^2" is taken to be the acceleration a of an
    # error a t^2/2.
    "VN-200": Product("vn-100", TYPICAL_VECTORNAV, {"tilt": 0.03, "heading": 0.2, "velocity": 0.05,
                                                    "horizontal position": 1.0, "height": 1.5} |
                      {what: 0.03 / 2 * t**2 for what, t in DRIFTS.items()}, 0.075, (1.2, 1.8)),
}


def unit(product):
    across, down = product.position[0] * math.sqrt(0.5), product.position[1]
    large, small = math.sqrt(0.8), math.sqrt(0.2)  # of the slow and of the white part
    position, velocity = np.array([across, across, down]), np.full(3, product.velocity)
    return (f'model = "{product.preset}"\n{product.sensors}[imu.navigation]\nsolution = "filter"\nmagnetic_rate_hz = 0\n'
            f"position_m = {list(map(float, large * position))}\nposition_noise_m = {list(map(float, small * position))}\n"
            f"position_correlation_s = 60\nvelocity_m_per_s = {list(map(float, large * velocity))}\n"
            f"velocity_noise_m_per_s = {list(map(float, small * velocity))}\nvelocity_correlation_s = 10\n")


def rms(x):
    return float(np.sqrt((x**2).mean()))


def is_within(ratio, factor):
    return 1 / factor <= ratio <= factor


def sizes(error):
    """The RMS of each of WHAT, of errors from BEGIN on, one each second."""
    lost = error[:, LOST - BEGIN, 6:8]
    drifts = {what: math.sqrt(2) * rms(error[:, LOST - BEGIN + t, 6:8] - lost) for what, t in DRIFTS.items()}
    error = error[:, :LOST - BEGIN]
    return drifts | {"tilt": math.degrees(rms(error[..., :2])), "heading": math.degrees(rms(error[..., 2])),
            "velocity": rms(error[..., 3:6]), "horizontal position": math.sqrt(2) * rms(error[..., 6:8]),
            "height": rms(error[..., 8])}


def heading_times(sent, error):
    """When the heading of each unit is known to a degree for good, s from the begin of the motion."""
    is_known = np.isin(sent[:, :LOST * RATE, STATE], (COASTING, AIDED)) & (np.abs(error[:, :LOST * RATE, 2]) < math.radians(1))
    assert is_known[:, -1].all(), "a heading that never settles"
    return (LOST * RATE - np.argmin(is_known[:, ::-1], axis=1)) / RATE


def measured(imud, folder, flight, truth, product, units):
    judged, times = [], []
    for first in range(0, units, BATCH):
        texts = [f'name = "unit{first + i}"\n{unit(product)}' for i in range(min(BATCH, units - first))]
        sent = run(imud, folder, flight, texts, RATE, more=OUTAGE)
        assert np.isin(sent[:, BEGIN * RATE:, STATE], (COASTING, AIDED)).all(), "not aligned"
        assert (sent[:, (LOST + 2) * RATE:, STATE] == COASTING).all(), "still aided"
        error = errors(sent, truth)
        judged.append(error[:, BEGIN * RATE::RATE])
        times.append(heading_times(sent, error))
    return sizes(np.concatenate(judged)), np.percentile(np.concatenate(times), (50, 95))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("imud")
    parser.add_argument("--units", type=int, default=200)
    options = parser.parse_args()
    all_sizes, all_times = ({of: [] for of in PRODUCTS} for _ in range(2))
    for flight in MOTIONS:
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            write_truth(folder / "truth.csv", FLIGHTS[flight], SECONDS, RATE)
            truth = run(options.imud, folder, FLIGHTS[flight], [IDEAL], RATE)
            for of, product in PRODUCTS.items():
                of_sizes, of_times = measured(options.imud, folder, FLIGHTS[flight], truth, product, options.units)
                all_sizes[of].append(of_sizes)
                all_times[of].append(of_times)
    columns = MOTIONS + ["both"]
    print(f"| product | figure | its maker's | {' | '.join(columns)} | ratios |\n|---|---|---|" + "---|" * (len(columns) + 1))
    reached = stated = 0
    for of, product in PRODUCTS.items():
        for what, figure in product.figures.items():
            values = [size[what] for size in all_sizes[of]]
            values.append(rms(np.array(values)))
            *ratios, ratio = (value / figure for value in values)
            stated += 1
            reached += is_within(ratio, FACTOR) and all(is_within(one, FACTOR_OF_ONE_MOTION) for one in ratios)
            print(f"| {of} | {what} | {figure:g} {WHAT[what]} | " + " | ".join(f"{value:.2g}" for value in values) +
                  f" | {', '.join(f'{one:.2f}' for one in (*ratios, ratio))} |")
    print(f"\n| product | {' | '.join(f'{motion}, 50 % and 95 %' for motion in MOTIONS)} |\n|---|" + "---|" * len(MOTIONS))
    for of, times in all_times.items():
        print(f"| {of} | " + " | ".join(f"{half:.0f} s, {most:.0f} s" for half, most in times) + " |")
    print(f"\n{options.units} units: {reached} of {stated} figures within a factor of {FACTOR}; "
          f"{len(WHAT) * len(PRODUCTS) - stated} others are stated by no document that was found, or are not of one antenna")
    if (reached, stated) != (STATED, STATED):
        sys.exit(f"data_sheets: core/README.md has {STATED} of {STATED}")


if __name__ == "__main__":
    main()
