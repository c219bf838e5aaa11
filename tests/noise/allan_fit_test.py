"""The estimator of preset_table.py, on noise that NumPy makes and whose Allan variance is known in closed form. usage: allan_fit_test.py

White noise of density N^2, and flicker noise B^2 / (2 pi f) by Kasdin's filter, have the Allan variance N^2/tau + 2 ln 2/pi B^2; digits
finer than the noise add LSB^2/12 to each value. Of 24 axes, the standard errors are about 0.3 % of N and 3 % of the minimum.
"""
import sys

from allan_fit import SHORT, allan_variance, flicker_share, lowest, noise, np, short_taus

HZ, AXES, HOURS = 25, 24, 1
FLAT = np.sqrt(2 * np.log(2) / np.pi)


def flicker(random, n):
    """Of B = 1: each white number goes on as (1 - z^-1)^(-1/2), (Kasdin, Proceedings of the IEEE 83, 1995, equation 104)."""
    k = np.arange(1, n)
    weights = np.cumprod(np.concatenate([[1.0], (k - 0.5) / k]))
    length = 2 * n
    return np.fft.irfft(np.fft.rfft(weights, length)[:, None] * np.fft.rfft(random.normal(size=(n, AXES)), length, axis=0), axis=0)[:n]


def estimates(random, N, minimum, lsb=0.0):
    """Returns N and the minimum as the table has them."""
    n = HOURS * 3600 * HZ
    series = random.normal(0, N * HZ**0.5, (n, AXES)) + minimum / FLAT * flicker(random, n)
    if lsb:
        series = lsb * np.round(series / lsb)
    taus = 2.0**np.arange(9)
    short, long = ([allan_variance(series, round(tau * HZ)).mean() for tau in at] for at in (SHORT, taus))
    return noise(np.array(short), SHORT, minimum), lowest(np.array(long))


def main():
    good = True

    def check(what, found, wanted, tolerance):
        nonlocal good
        holds = abs(found / wanted - 1) <= tolerance
        good = good and holds
        print(f"{what}: {found:.4f}, {wanted:.4f} expected: {'good' if holds else 'WRONG'}")
    random = np.random.default_rng(7)
    # The flicker rules the long averages, white noise the short ones: at 256 s it is a tenth of the variance.
    for N in (1.0, 1.2):
        found, low = estimates(random, N, 0.2)
        check(f"N = {N}", found, N, 0.02)
        check("the minimum", low, np.sqrt(0.2**2 + N**2 / 256), 0.1)
    found, _ = estimates(random, 1.0, 0.0, lsb=10.0)
    check("N with digits", found, np.sqrt(1 + 10.0**2 / 12 / HZ), 0.02)
    # A quantisation of the integral, Q, is not taken for N.
    n = 3600 * HZ
    integral = np.cumsum(random.normal(0, HZ**0.5, (n, AXES)), axis=0) / HZ
    series = np.diff(0.5 * np.round(integral / 0.5), axis=0) * HZ
    variances = np.array([allan_variance(series, round(tau * HZ)).mean() for tau in SHORT])
    check("N with Q", noise(variances, SHORT, 0.0), 1.0, 0.02)
    check("N with Q, without its term", np.sqrt(variances[0] * SHORT[0]), np.sqrt(1 + 3 * 0.5**2 / 12 / SHORT[0]), 0.02)
    # By allan_fit.py, imud's flicker is flat from some seconds on; it is less below.
    check("the share of the flicker at 100 s", flicker_share(100), 1.0, 0.03)
    check("averaging times of a product at 45 Hz", short_taus(45)[0], 4 / 45, 1e-9)
    return 0 if good else 1


sys.exit(main())
