"""B of the presets, found within 7 % in as many hours and seeds as that needs: minutes for each product, of which the STIM300, whose
gyros' white noise covers their flicker up to 700 s, takes the most. usage: noise_bands.py IMUD [PRODUCT...] [--factor F]

--factor multiplies every B in imud, but not in the data sheet: with 1.2 or 0.8 every line must be out of the band. No preset of
these products has a K.
"""
import argparse
import sys

from allan_fit import allan_variance
from noise_bench import FLAT, PRODUCTS, SENSORS, at_rest, np

BAND = 0.07
# The mean over axes and seeds is taken when its standard error is this: the band is 3.5 of it to each side, and a line is beyond
# it without cause with a probability of 5e-4.
STANDARD_ERROR = 0.02
HOURS = 8.0
FACTORS = 2 ** np.arange(0, 11)  # averaging times in s, where the preset's flicker is flat


def squares(values, hz, N, B):
    """Estimates B^2 of each axis, in units of the preset's, by least squares over the averaging times, N being known."""
    seconds = values[:len(values) // hz * hz].reshape(-1, hz, 3).mean(axis=1)
    share, flat = N**2 / FACTORS, FLAT * B**2
    # The variance of an Allan variance is that of its square over the number of averages.
    weights = 1 / ((share + flat)**2 * FACTORS)
    measured = np.array([allan_variance(seconds, m) for m in FACTORS])
    return weights @ (measured - share[:, None]) / (weights.sum() * flat)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("imud")
    parser.add_argument("products", nargs="*")
    parser.add_argument("--factor", type=float)
    options = parser.parse_args()
    good = True
    for name in options.products or PRODUCTS:
        product = PRODUCTS[name]
        estimates = {sensor: [] for sensor in SENSORS}
        seed = 0
        while True:
            seed += 1
            values = at_rest(options.imud, name, HOURS, seed, flicker=options.factor)
            for sensor in SENSORS:
                estimates[sensor].extend(squares(values[sensor], product.hz, product.N[sensor], product.B[sensor]))
            # Half the relative error of B^2 is that of B.
            errors = {s: np.std(e, ddof=1) / np.sqrt(len(e)) / (2 * np.mean(e)) for s, e in estimates.items()}
            print(f"{name}: seed {seed}, standard errors {', '.join(f'{abs(e):.3f}' for e in errors.values())}", file=sys.stderr)
            if seed >= 3 and all(abs(error) < STANDARD_ERROR for error in errors.values()):
                break
        for sensor in SENSORS:
            found = np.sqrt(max(0, np.mean(estimates[sensor])))
            holds = abs(found - 1) <= BAND
            good = good and holds
            print(f"{name:<10} {sensor:<13} B is {found:.3f} +- {errors[sensor]:.3f} of the preset's, by {seed} seeds of {HOURS:g} h: "
                  f"{'in' if holds else 'OUT OF'} the band of {BAND:.0%}", flush=True)
    return 0 if good else 1


sys.exit(main())
