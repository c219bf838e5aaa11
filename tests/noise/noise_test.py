"""N of the presets, found in an hour of what a STIM300, a VN-100 and a 3DM-GX5-25 send at rest. usage: noise_test.py IMUD"""
import sys

from allan_fit import allan_variance
from noise_bench import ACCELEROMETER, FLAT, GYRO, PRODUCTS, SENSORS, at_rest, np

# Standard errors of an estimate that a band has to each side: one of the 36 estimates is beyond it with a probability of 2e-5.
BAND = 5.0


def relative_error(n, m):
    """The standard error of N, from the degrees of freedom of an overlapping Allan variance of white noise (NIST SP1065, 5.4.1)."""
    degrees = (1.5 * (n - 1) / m - 2 * (n - 2) / n) * 4 * m * m / (4 * m * m + 5)
    return 1 / np.sqrt(2 * degrees)


def out_of_band(name, values):
    """Returns the axes of the sensors whose N is not the preset's, and prints every estimate."""
    product, faults = PRODUCTS[name], set()
    for sensor in SENSORS:
        # The flicker's share is known to a percent of N at 1 s, where its flat part begins. At one sample it is half a percent at most.
        for m, share, unknown in ((1, 0.0, 0.005), (product.hz, FLAT * product.B[sensor]**2, 0.01)):
            tau = m / product.hz
            found = np.sqrt((allan_variance(values[sensor], m) - share) * tau) / product.N[sensor]
            band = BAND * relative_error(len(values[sensor]), m) + unknown
            print(f"{name:<10} {sensor:<13} N at {tau:5.3f} s: {found.round(4)} of the preset's, band {band:.2%}")
            faults |= {(sensor, axis) for axis, ratio in zip("xyz", found) if not abs(ratio - 1) <= band}
    return faults


def main():
    imud, good = sys.argv[1], True
    injected = {GYRO: (1.2, 0.8, 1), ACCELEROMETER: (1, 1.2, 0.8)}
    wrong = {(sensor, axis) for sensor, factors in injected.items() for axis, f in zip("xyz", factors) if f != 1}
    for name in PRODUCTS:
        if faults := out_of_band(name, at_rest(imud, name, 1)):
            print(f"{name}: out of the band: {sorted(faults)}")
            good = False
        # 20 % in any one of them is found, in a tenth of the time.
        found = out_of_band(name, at_rest(imud, name, 0.1, white=injected))
        if found != wrong:
            print(f"{name}: with errors of 20 % in {sorted(wrong)}, out of the band are {sorted(found)}")
            good = False
    return 0 if good else 1


sys.exit(main())
