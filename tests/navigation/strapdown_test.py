"""The unit's own solution without aids, against a second implementation and the analytic flight.

A flight of ten minutes over the rotating Earth, in closed form, is the truth of `imud`, whose unit has no errors and
begins at the true state. It sends increments and solution as doubles. This program integrates the same increments by
another mechanization: in Earth-fixed axes, with the Coriolis acceleration, rotations by Rodrigues' formula, and normal
gravity by zonal harmonics.

Usage: strapdown_test.py IMUD
"""
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

from flights import OMEGA, normal_gravitation, place

SECONDS, RATE = 600, 100
LATITUDE, LONGITUDE, HEIGHT = math.radians(48), math.radians(11), 500.0


def rotation(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m = np.eye(3)
    m[i, i] = m[j, j] = c
    m[i, j], m[j, i] = -s, s
    return m


def exponential(phi):
    angle = math.sqrt(phi @ phi)
    if angle < 1e-12:
        return np.eye(3) + cross(phi)
    k = cross(phi / angle)
    return np.eye(3) + math.sin(angle) * k + 2 * math.sin(angle / 2) ** 2 * (k @ k)


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


C_EL = rotation(2, LONGITUDE) @ rotation(1, -math.pi / 2 - LATITUDE)  # columns: north, east, down
R0_E = place(LATITUDE, LONGITUDE, HEIGHT)
SPIN = np.array([0, 0, OMEGA])


def flight(t):
    """Position, velocity, acceleration relative to E, in E; attitude of B relative to E; rate of B relative to E, in B."""
    terms = [(4000, 0.02, 0), (2500, 0.031, 0.4), (60, 0.05, 1)]  # m, rad/s, rad: along north, east, down
    d, v, a = np.zeros(3), np.zeros(3), np.zeros(3)
    for i, (size, w, phase) in enumerate(terms):
        d[i] = size * (math.sin(w * t + phase) - math.sin(phase))
        v[i] = size * w * math.cos(w * t + phase)
        a[i] = -size * w * w * math.sin(w * t + phase)
    yaw, yaw_rate = 0.7 + 1.5 * math.sin(0.05 * t), 0.075 * math.cos(0.05 * t)
    pitch, pitch_rate = 0.15 * math.sin(0.4 * t), 0.06 * math.cos(0.4 * t)
    roll, roll_rate = 0.4 * math.sin(0.3 * t + 1), 0.12 * math.cos(0.3 * t + 1)
    c_eb = C_EL @ rotation(2, yaw) @ rotation(1, pitch) @ rotation(0, roll)
    rate = np.array([roll_rate - yaw_rate * math.sin(pitch),
                     pitch_rate * math.cos(roll) + yaw_rate * math.cos(pitch) * math.sin(roll),
                     -pitch_rate * math.sin(roll) + yaw_rate * math.cos(pitch) * math.cos(roll)])
    return R0_E + C_EL @ d, C_EL @ v, C_EL @ a, c_eb, rate


def mrp(c_nb):
    """Modified Rodrigues parameters of B relative to N (Shepperd's quaternion)."""
    trace = np.trace(c_nb)
    squares = [(1 + trace) / 4] + [(1 + 2 * c_nb[i, i] - trace) / 4 for i in range(3)]
    largest = int(np.argmax(squares))
    q = np.zeros(4)
    q[largest] = math.sqrt(squares[largest])
    d = 4 * q[largest]
    if largest == 0:
        q[1:] = [(c_nb[2, 1] - c_nb[1, 2]) / d, (c_nb[0, 2] - c_nb[2, 0]) / d, (c_nb[1, 0] - c_nb[0, 1]) / d]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = (c_nb[k, j] - c_nb[j, k]) / d
        q[1 + j] = (c_nb[j, i] + c_nb[i, j]) / d
        q[1 + k] = (c_nb[k, i] + c_nb[i, k]) / d
    if q[0] < 0:
        q = -q
    return q[1:] / (1 + q[0])


def truth_rows():
    yield ",".join(["time_ns"] + [f"{name}_{i}" for name in ("r_BN_N", "v_BN_N") for i in "xyz"] +
                   [f"sigma_BN_{i}" for i in "123"] +
                   [f"{name}_{i}" for name in ("omega_BN_B", "nonConservativeAccelpntB_B") for i in "xyz"])
    rows = []
    for k in range(SECONDS * RATE + 1):
        t = k / RATE
        r_e, v_e, a_e, c_eb, rate = flight(t)
        turn = rotation(2, OMEGA * t)
        r, v = turn @ r_e, turn @ (v_e + cross(SPIN) @ r_e)
        a = turn @ (a_e + 2 * cross(SPIN) @ v_e + cross(SPIN) @ (cross(SPIN) @ r_e))
        rows.append((r, v, a, turn @ c_eb, rate + c_eb.T @ SPIN))
    gravitation = normal_gravitation(np.array([row[0] for row in rows]))
    for k, ((r, v, a, c_nb, omega), g) in enumerate(zip(rows, gravitation)):
        numbers = np.concatenate([r, v, mrp(c_nb), omega, c_nb.T @ (a - g)])
        yield f"{k * 10**9 // RATE}," + ",".join(repr(float(x)) for x in numbers)


FIELDS = (["delta_angle_%s_rad" % i for i in "xyz"] + ["delta_velocity_%s_m_per_s" % i for i in "xyz"] +
          ["latitude_rad", "longitude_rad", "height_m"] + ["q_LP_%s" % i for i in "wxyz"])


def run(imud, folder):
    """Returns the fields of each sample, in a row."""
    (folder / "truth.csv").write_text("\n".join(truth_rows()) + "\n")
    layout = ['"A5 5A C3 3C"'] + ['"%s:f64"' % field for field in FIELDS]
    (folder / "doubles.toml").write_text(
        'frame_version = 1\nname = "doubles"\nbyte_order = "little"\n[line]\nbaud = 4000000\n[[message]]\nname = "all"\n'
        "layout = [" + ", ".join(layout) + "]\n")
    (folder / "config.toml").write_text(
        f'clock = "fast"\n[truth]\nport = "file:{folder}/truth.csv"\nformat = "csv"\n'
        '[earth]\nframe = "inertial"\nangle_deg = 0\n'
        f'[[imu]]\nprotocol = "frame"\nport = "file:{folder}/sent"\nrate_hz = {RATE}\nmodel = "ideal"\n'
        f'device.frame_file = "{folder}/doubles.toml"\n'
        '[imu.gyro]\nmax_rad_per_s = 10\n[imu.accelerometer]\nmax_m_per_s2 = 100\n'
        '[imu.navigation]\nsolution = "filter"\nalignment = "truth"\ngnss_rate_hz = 0\nmagnetic_rate_hz = 0\n')
    subprocess.run([imud, "run", folder / "config.toml"], check=True, timeout=1500, stdout=subprocess.DEVNULL)
    size = 4 + 8 * len(FIELDS)
    data = (folder / "sent").read_bytes()
    assert len(data) == size * (SECONDS * RATE + 1), len(data)
    return np.frombuffer(data, dtype=np.dtype([("head", "<u4"), ("values", "<f8", len(FIELDS))]))["values"]


def integrate(increments):
    """The motion relative to the Earth by the increments, in E: attitude, velocity, position after the last."""
    dt = 1 / RATE
    r, v, _, c, _ = flight(0)
    half_turn, whole_turn = rotation(2, -OMEGA * dt / 2), rotation(2, -OMEGA * dt)
    last_angle, last_velocity, last_change = None, None, None
    for row in increments:
        angle, velocity = row[:3], row[3:]
        if last_angle is None:
            last_angle, last_velocity = angle, velocity
        # The delta-velocity in the axes at the begin: rotation to second order, and sculling; then in E at the middle.
        w = velocity + cross(angle) @ velocity / 2 + cross(angle) @ (cross(angle) @ velocity) / 6 + (
            cross(last_angle) @ velocity + cross(last_velocity) @ angle) / 12
        dv = half_turn @ c @ w
        middle = r + v * dt / 2
        gravity = normal_gravitation(middle) - cross(SPIN) @ (cross(SPIN) @ middle)
        at_middle = v
        for _ in range(3):
            change = dv + dt * (gravity - 2 * cross(SPIN) @ at_middle)
            at_middle = v + change / 2
        curve = 0 if last_change is None else (change - last_change) / 12
        r = r + dt * (v + change / 2 - curve)
        v = v + change
        c = whole_turn @ c @ exponential(angle)
        last_angle, last_velocity, last_change = angle, velocity, change
    return c, v, r


def main():
    with tempfile.TemporaryDirectory() as name:
        rows = run(sys.argv[1], pathlib.Path(name))
    end = rows[-1]
    position = place(*end[6:9])
    c, _, r = integrate(rows[1:, :6])
    true_r, _, _, true_c, _ = flight(SECONDS)
    second, analytic = np.linalg.norm(position - r), np.linalg.norm(position - true_r)
    travelled = np.linalg.norm(true_r - R0_E)
    print(f"after {SECONDS} s and at {travelled:.0f} m from the begin: {second:.2e} m from the second implementation, "
          f"{analytic:.2e} m from the flight; that implementation is {np.linalg.norm(r - true_r):.2e} m from it")
    assert travelled > 1000
    assert second < 1e-5, second
    # Between the truths of 10 ms the emulator's specific force is linear in body axes: some 1e-6 m/s^2 off.
    assert analytic < 0.5, analytic


if __name__ == "__main__":
    main()
