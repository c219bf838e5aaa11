"""Estimates of N and of the minimum from Allan variances at rest, with NumPy alone."""
import numpy as np

SHORT = np.array([0.08, 0.2, 0.4, 0.8])  # s, the averaging times at which N is fitted


def allan_variance(values, m):
    """Of each column, over averages of m samples, which overlap (IEEE Std 952-1997, C.1)."""
    phase = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values - values.mean(axis=0), axis=0)])
    second = phase[2 * m:] - 2 * phase[m:-m] + phase[:-2 * m]
    return np.mean(second**2, axis=0) / (2 * m * m)


def flicker_share(tau):
    """Of the flat part: of exponentially correlated processes an octave apart, of which the first has 1/3.1 s and twice the variance."""
    times = 2.0**np.arange(14) / 3.1
    x = tau / times
    variances = 2 / x * (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x))
    return (variances.sum() + variances[0]) / 2


def short_taus(hz):
    """SHORT as multiples of the period."""
    return np.maximum(1, np.round(SHORT * hz)) / hz


def noise(variances, taus, minimum):
    """N from mean Allan variances at `taus`, beside the Q of digits and less the share of a flicker with that minimum."""
    rest = variances - minimum**2 * np.array([flicker_share(tau) for tau in taus])
    terms = np.stack([1 / taus, 3 / taus**2], axis=1) / rest[:, None]
    squares = np.linalg.lstsq(terms, np.ones(len(taus)), rcond=None)[0]
    return np.sqrt(max(0, squares[0]))


def lowest(variances):
    """The minimum of the curve, from the mean Allan variances."""
    return np.sqrt(np.min(variances))
