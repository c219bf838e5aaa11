"""Whether the filter's covariance is the one of its errors, and its innovations are white, by another program.

Flights in closed form, and a captured one, whose noise, random walks, aids and first errors have the distributions for which the filter is
tuned. Increments and aids are made here, and the squares of the errors in units of the covariance (NEES) are judged
here; `filter_rows` runs the filter alone. Each judged number has a probability of a false alarm of 1e-6; the seeds are
fixed. Then sensors and aids are worse than the filter expects, which must be seen.

Usage: consistency_test.py FILTER_ROWS [SEEDS]
"""
import dataclasses
import math
import subprocess
import sys

import numpy as np

from flights import FLIGHTS, exponential, inverse, logarithm, product, turned

STATES, ERRORS = 15, 7  # of the aids
ADDED = ERRORS + 6  # the scale factors of gyros and accelerometers
SCALE_GROWTH = 0.01 / 3600  # 1/s, of the variance of a scale factor in units of the first one (InertialFilter)
ALARM_DEVIATIONS, ALARM = 4.8916, 1e-6  # of a normal distribution, both sides
LAGS, BATCH = 5, 50


def chi_square_mean(count, degrees, deviations):
    """Returns the bounds of the mean of `count` chi-squares (Wilson and Hilferty)."""
    n = count * degrees
    return [degrees * (1 - 2 / (9 * n) + sign * deviations * math.sqrt(2 / (9 * n))) ** 3 for sign in (-1, 1)]


def most_outside(count, probability):
    """Returns the number of `count` events that is exceeded with a probability of ALARM at most."""
    tail = 0.0
    for k in range(count, -1, -1):
        tail += math.comb(count, k) * probability**k * (1 - probability) ** (count - k)
        if tail > ALARM:
            return k
    return 0


def true_increments(flight, steps):
    """Returns the rotation vectors and the integrals of the specific force of each step, by a quadrature of order 10."""
    t = flight.dt * np.arange(steps + 1)
    r, v, _, q = flight.motion(t)
    angle = logarithm(product(inverse(q[:-1]), q[1:]))
    velocity = np.zeros((steps, 3))
    for node, weight in zip(*np.polynomial.legendre.leggauss(5)):
        r_i, _, a_i, q_i = flight.motion(t[:-1] + flight.dt * (1 + node) / 2)
        velocity += flight.dt * weight / 2 * turned(inverse(q_i), a_i - flight.gravitation(r_i))
    return r, v, q, angle, velocity


@dataclasses.dataclass
class Worse:
    """Factors by which the flights differ from the distributions that the filter expects."""
    gyro: float = 1
    accelerometer: float = 1
    position: float = 1
    velocity: float = 1
    attitude: float = 1
    height: float = 1
    scale: float = 1


def run(program, flight, seeds, worse, random):
    """Returns errors and covariances at the epochs, seeds x epochs x ..., and whitened innovations, seeds x aids x ..."""
    dt, steps = flight.dt, round(flight.seconds / flight.dt)
    steps_of_aid, steps_of_epoch = round(flight.aid_s / dt), round(flight.epoch_s / dt)
    aids, epochs = steps // steps_of_aid, steps // steps_of_epoch
    gyro, accelerometer, gyro_walk, accelerometer_walk = flight.noise
    r, v, q, angle, velocity = true_increments(flight, steps)

    first = flight.first * random.standard_normal((seeds, STATES))  # true less estimated
    normal = random.standard_normal
    shape = (seeds, steps, 3)
    gyro_bias = first[:, None, 9:12] + np.cumsum(gyro_walk * math.sqrt(dt) * normal(shape), axis=1)
    bias = first[:, None, 12:] + np.cumsum(accelerometer_walk * math.sqrt(dt) * normal(shape), axis=1)
    scale = scale_factors(flight, seeds, steps, worse.scale, random)
    angles = angle * (1 + scale[..., :3]) + dt * gyro_bias + worse.gyro * gyro * math.sqrt(dt) * normal(shape)
    velocities = velocity * (1 + scale[..., 3:]) + dt * bias + worse.accelerometer * accelerometer * math.sqrt(dt) * normal(shape)

    at = steps_of_aid * np.arange(1, aids + 1)
    shape = (seeds, aids, 3)
    of_aids = flight.aid_errors()
    slow = slow_errors(of_aids, flight.aid_s, seeds, aids, random)
    turn = normal(shape) * ([0, 0, 1] if flight.attitude_rows == 1 else [1, 1, 1])
    height = -r[at, 2, None] + slow[..., 6:] + worse.height * flight.height * normal((seeds, aids, 1))
    measured = np.concatenate([r[at] + slow[..., :3] + worse.position * flight.position * normal(shape),
                               v[at] + slow[..., 3:6] + worse.velocity * flight.velocity * normal(shape),
                               product(exponential(worse.attitude * flight.attitude * turn), q[at]), height], axis=-1)
    rows = np.concatenate([angles, velocities], axis=-1).reshape(seeds, aids, 6 * steps_of_aid)
    rows = np.concatenate([rows, measured], axis=-1).reshape(seeds, -1)
    zero = np.zeros((seeds, 6))
    begin = np.concatenate([product(exponential(-first[:, :3]), q[0]), v[0] - first[:, 3:6], r[0] - first[:, 6:9], zero,
                            np.broadcast_to(flight.first, (seeds, STATES))], axis=-1)
    kind = 3 if flight.is_global else 1
    head = np.concatenate([[kind, *flight.noise, dt, seeds, steps, steps_of_aid, steps_of_epoch, flight.attitude_rows],
                           np.full(3, flight.position), np.full(3, flight.velocity), [flight.attitude, flight.height],
                           of_aids.ravel(), flight.scale])
    sent = head.tobytes() + np.concatenate([begin, rows], axis=-1).tobytes()
    output = subprocess.run([program], input=sent, check=True, timeout=1500, stdout=subprocess.PIPE).stdout

    of_state = 16 + ADDED + STATES**2 + STATES * ADDED + ADDED**2
    of_aid = of_state + 12 + 4
    per_epoch = steps_of_epoch // steps_of_aid
    # The scale factors follow the errors of the aids, if there are such errors.
    assert of_aids[:, 0].all() or not any(flight.scale)
    added = np.concatenate([slow, scale[:, steps_of_aid - 1::steps_of_aid]], axis=-1)
    blocks = np.frombuffer(output).reshape(seeds, epochs, per_epoch * of_aid + of_state)
    state = blocks[:, :, -of_state:]
    at = steps_of_epoch * np.arange(1, epochs + 1)
    error = np.concatenate([logarithm(product(q[at], inverse(state[:, :, :4]))), v[at] - state[:, :, 4:7],
                            r[at] - state[:, :, 7:10], gyro_bias[:, at - 1] - state[:, :, 10:13],
                            bias[:, at - 1] - state[:, :, 13:16],
                            added[:, per_epoch - 1::per_epoch] - state[:, :, 16:16 + ADDED]], axis=-1)
    variance = np.concatenate([of_aids[:, 0], np.repeat(flight.scale, 3)])
    used = np.concatenate([np.arange(STATES), STATES + np.flatnonzero(variance)])
    P = whole(state[:, :, 16:])
    before = blocks[:, :, :-of_state].reshape(seeds, aids, of_aid)
    return error[..., used], P[..., used[:, None], used], whitened(flight, measured[..., 6:10], before)


def scale_factors(flight, seeds, steps, worse, random):
    """Returns the scale factors, less 1, of gyros and accelerometers at each step: random walks."""
    if not any(flight.scale):
        return np.zeros((seeds, steps, 6))
    normal = random.standard_normal((seeds, steps + 1, 6))
    normal[:, 1:] *= math.sqrt(SCALE_GROWTH * flight.dt)
    return worse * np.repeat(flight.scale, 3) * np.cumsum(normal, axis=1)[:, 1:]


def slow_errors(of_aids, aid_s, seeds, aids, random):
    """Returns the errors of the aids that have a memory, at each aid."""
    variance, rate, growth = of_aids.T
    kept = np.exp(-rate * aid_s)
    moving = rate > 0
    added = np.where(moving, growth / (2 * np.where(moving, rate, 1)) * (1 - kept**2), growth * aid_s)
    errors = np.zeros((seeds, aids + 1, ERRORS))
    errors[:, 0] = np.sqrt(variance) * random.standard_normal((seeds, ERRORS))
    for k in range(aids):
        errors[:, k + 1] = kept * errors[:, k] + np.sqrt(added) * random.standard_normal((seeds, ERRORS))
    return errors[:, 1:]


def whole(sent):
    """Returns the covariance of the states and the added ones together."""
    parts = np.split(sent[..., ADDED:], [STATES**2, STATES**2 + STATES * ADDED], axis=-1)
    P = parts[0].reshape(sent.shape[:-1] + (STATES, STATES))
    C = parts[1].reshape(sent.shape[:-1] + (ADDED, STATES))  # by columns
    D = parts[2].reshape(sent.shape[:-1] + (ADDED, ADDED))
    return np.concatenate([np.concatenate([P, C.swapaxes(-1, -2)], axis=-1), np.concatenate([C, D], axis=-1)], axis=-2)


def whitened(flight, q, aids):
    """Returns the innovations by their covariance: the blocks of Cholesky's factor, as the aids follow one another."""
    rows = 6 + flight.attitude_rows + (1 if flight.height else 0)
    H = np.zeros(aids.shape[:2] + (rows, STATES + ADDED))
    H[..., range(6), [6, 7, 8, 3, 4, 5]] = 1
    H[..., range(6), range(STATES, STATES + 6)] = 1
    columns, sigmas = list(range(6 + flight.attitude_rows)), [flight.position] * 3 + [flight.velocity] * 3
    sigmas += [flight.attitude] * flight.attitude_rows
    if flight.attitude_rows == 1:  # the azimuth of the x axis, by a small rotation
        x = turned(q, np.broadcast_to([1.0, 0, 0], q.shape[:-1] + (3,)))
        for axis in range(3):
            moved = np.cross(np.eye(3)[axis], x)
            H[..., 6, axis] = (x[..., 0] * moved[..., 1] - x[..., 1] * moved[..., 0]) / (x[..., :2]**2).sum(axis=-1)
    elif flight.attitude_rows == 3:
        H[..., [6, 7, 8], [0, 1, 2]] = 1
    if flight.height:
        H[..., -1, 8], H[..., -1, STATES + 6] = -1, 1
        columns.append(9)
        sigmas.append(flight.height)
    factor = np.linalg.cholesky(H @ whole(aids[..., 16:-16]) @ H.swapaxes(-1, -2) + np.diag(np.square(sigmas)))
    innovation, squares = aids[..., -16:-4][..., columns], aids[..., -4:]
    z = np.zeros(innovation.shape)
    ends = np.cumsum([0, 3, 3, flight.attitude_rows, rows - 6 - flight.attitude_rows])
    for number, part in enumerate(slice(*pair) for pair in zip(ends[:-1], ends[1:])):
        if part.start < part.stop:
            z[..., part] = np.linalg.solve(factor[..., part, part], innovation[..., part, None])[..., 0]
            assert np.allclose((z[..., part] ** 2).sum(axis=-1), squares[..., number], rtol=1e-6, atol=1e-9)
    return z


def judge(name, error, covariance, z):
    """Returns what is wrong, and prints the figures."""
    seeds, epochs, degrees = error.shape
    assert np.array_equal(covariance, covariance.swapaxes(-1, -2))
    nees = (error * np.linalg.solve(covariance, error[..., None])[..., 0]).sum(axis=-1)
    mean = nees.mean(axis=0)
    wrong = []

    def check(what, value, bounds):
        if not bounds[0] <= value <= bounds[1]:
            wrong.append(f"{name}: {what} is {value:.4g}, not in {bounds[0]:.4g} to {bounds[1]:.4g}")

    low, high = chi_square_mean(seeds, degrees, 1.96)
    outside = int(((mean < low) | (mean > high)).sum())
    check(f"epochs outside {low:.2f} to {high:.2f}", outside, (0, most_outside(epochs, 0.05)))
    for k in range(epochs):
        check(f"NEES of epoch {k + 1}", mean[k], chi_square_mean(seeds, degrees, ALARM_DEVIATIONS))
    # The errors of a state that is not observed are the same at all epochs: as many independent squares as seeds.
    check("mean NEES", nees.mean(), chi_square_mean(seeds, degrees, ALARM_DEVIATIONS))
    count = z.size
    square = (z**2).mean()
    check("mean square of the innovations", square, chi_square_mean(count, 1, ALARM_DEVIATIONS))
    lags = [(z[:, lag:] * z[:, :-lag]).mean(axis=(0, 1)) for lag in range(1, LAGS + 1)]
    for lag, values in enumerate(lags, 1):
        bound = ALARM_DEVIATIONS / math.sqrt(seeds * (z.shape[1] - lag))
        for row, value in enumerate(values):
            check(f"autocorrelation of innovation {row} at lag {lag}", value, (-bound, bound))
    print(f"{name:<10} NEES {nees.mean():6.2f} (epochs {mean.min():.2f} to {mean.max():.2f}, {outside} of {epochs} outside "
          f"{low:.2f} to {high:.2f}); innovations: {square:.3f}, autocorrelation at most {np.abs(lags).max():.4f}")
    return wrong


def judged(name, program, seeds, worse, number):
    random = np.random.default_rng(number)
    batches = [run(program, FLIGHTS[name], min(BATCH, seeds - i), worse, random) for i in range(0, seeds, BATCH)]
    return judge(name, *(np.concatenate(parts) for parts in zip(*batches)))


def main():
    program, seeds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 50
    wrong = []
    for number, name in enumerate(FLIGHTS):
        wrong += judged(name, program, seeds, Worse(), number)
    print("\n".join(wrong))
    assert not wrong
    print("and where sensors or aids are worse than the filter expects:")
    for worse in (Worse(gyro=2), Worse(accelerometer=4), Worse(position=math.sqrt(2)), Worse(velocity=math.sqrt(2))):
        assert judged("aeroplane", program, min(seeds, 50), worse, 9), worse
    for worse in (Worse(attitude=2), Worse(height=2)):
        assert judged("aided", program, min(seeds, 50), worse, 9), worse
    assert judged("scaled", program, min(seeds, 50), Worse(scale=2), 9)


if __name__ == "__main__":
    main()
