"""Flights as functions, vectorised over time: position, velocity and acceleration in an inertial frame, attitude.

Quaternions are w, x, y, z, and turn from the platform to that frame.
"""
import dataclasses
import functools
import math
import pathlib
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

OMEGA = 7.292115e-5
A, F, GM = 6378137.0, 1 / 298.257223563, 3.986004418e14
E2 = F * (2 - F)
J2 = 1.08262982131e-3  # NGA.STND.0036, of the normal field
G = 9.80665


def normal_gravitation(r):
    """By zonal harmonics to degree 20 (Heiskanen and Moritz, Physical Geodesy, equation 2-92)."""
    radius = np.linalg.norm(r, axis=-1)
    s = r[..., 2] / radius
    p = [np.ones_like(s), s]
    for n in range(2, 22):
        p.append(((2 * n - 1) * s * p[n - 1] - (n - 1) * p[n - 2]) / n)
    along_radius, along_s = np.ones_like(s), np.zeros_like(s)
    for k in range(1, 11):
        n = 2 * k
        j = (-1) ** (k + 1) * 3 * E2**k / ((n + 1) * (n + 3)) * (1 - k + 5 * k * J2 / E2)
        scale = j * (A / radius) ** n
        along_radius -= (n + 1) * scale * p[n]
        along_s -= scale * n * (p[n - 1] - s * p[n]) / (1 - s * s)
    up = r / radius[..., None]
    of_s = (np.array([0, 0, 1.0]) - s[..., None] * up) / radius[..., None]
    return (-GM / radius**2 * along_radius)[..., None] * up + (GM / radius * along_s)[..., None] * of_s


def place(latitude, longitude, height):
    n = A / math.sqrt(1 - E2 * math.sin(latitude) ** 2)
    return np.array([(n + height) * math.cos(latitude) * math.cos(longitude),
                     (n + height) * math.cos(latitude) * math.sin(longitude),
                     ((1 - E2) * n + height) * math.sin(latitude)])


def product(p, q):
    w, x, y, z = np.moveaxis(p, -1, 0)
    a, b, c, d = np.moveaxis(q, -1, 0)
    return np.stack([w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b,
                     w * d + x * c - y * b + z * a], axis=-1)


def inverse(q):
    return q * np.array([1.0, -1, -1, -1])


def turned(q, v):
    """Returns q v q*."""
    vector = q[..., 1:]
    t = 2 * np.cross(vector, v)
    return v + q[..., :1] * t + np.cross(vector, t)


def exponential(phi):
    half = np.linalg.norm(phi, axis=-1, keepdims=True) / 2
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * phi], axis=-1)


def logarithm(q):
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine < 1e-9, 2.0, 2 * half / np.maximum(sine, 1e-30))


def about(axis, angle):
    phi = np.zeros(np.shape(angle) + (3,))
    phi[..., axis] = angle
    return exponential(phi)


def euler(yaw, pitch, roll):
    return product(product(about(2, yaw), about(1, pitch)), about(0, roll))


def sines(t, terms):
    """Returns the sum of size sin(w t + phase) over the terms, and its first two derivatives."""
    sums = [np.zeros_like(t) for _ in range(3)]
    for size, w, phase in terms:
        s, c = np.sin(w * t + phase), np.cos(w * t + phase)
        for total, part in zip(sums, (size * s, size * w * c, -size * w * w * s)):
            total += part
    return sums


def path(t, north, east, down):
    """Returns position, velocity and acceleration by the terms along three axes."""
    return [np.stack(parts, axis=-1) for parts in zip(*(sines(t, terms) for terms in (north, east, down)))]


def aeroplane(t):
    """A figure of eight at 26 m/s to 57 m/s in coordinated turns, above a flat Earth."""
    r, v, a = path(t, [(800, 0.05, 0)], [(400, 0.1, 0)], [(30, 0.07, 1)])
    course2 = v[:, 0] ** 2 + v[:, 1] ** 2
    bank = np.arctan((v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0]) / np.sqrt(course2) / G)
    climb = np.arctan2(-v[:, 2], np.sqrt(course2))
    return r, v, a, euler(np.arctan2(v[:, 1], v[:, 0]), climb + 0.05, bank)


def quadrotor(t):
    """Its thrust is the specific force; it turns about its vertical axis as well."""
    r, v, a = path(t, [(8, 0.5, 0), (2, 1.1, 1)], [(6, 0.7, 1), (1, 1.7, 0)], [(3, 0.4, 2)])
    yaw = 0.3 * t + 0.8 * np.sin(0.4 * t)
    down = turned(inverse(about(2, yaw)), np.array([0, 0, G]) - a)
    down /= np.linalg.norm(down, axis=-1, keepdims=True)
    return r, v, a, euler(yaw, np.arctan2(down[:, 0], down[:, 2]), -np.arcsin(down[:, 1]))


def on_earth(t, d, d1, d2, q_LB, latitude, height):
    """A motion in the axes north, east, down of a place that turns with the Earth."""
    q_EL = product(about(2, np.full_like(t, 0.2)), about(1, np.full_like(t, -math.pi / 2 - latitude)))
    q_NL = product(about(2, OMEGA * t), q_EL)
    spin = np.array([0, 0, OMEGA])
    r = turned(about(2, OMEGA * t), np.broadcast_to(place(latitude, 0.2, height), t.shape + (3,))) + turned(q_NL, d)
    v_of_d, a_of_d = turned(q_NL, d1), turned(q_NL, d2)
    v = v_of_d + np.cross(spin, r)
    a = a_of_d + 2 * np.cross(spin, v_of_d) + np.cross(spin, np.cross(spin, r))
    return r, v, a, product(q_NL, q_LB)


def car(t):
    """A road with bends and hills, at 4 m/s to 31 m/s."""
    d, d1, d2 = path(t, [(60, 0.15, 0), (3, 0.31, 1)], [(90, 0.07, 0)], [(4, 0.11, 0)])
    d[:, 0] += 18 * t
    d1[:, 0] += 18
    level = np.sqrt(d1[:, 0] ** 2 + d1[:, 1] ** 2)
    q_LB = euler(np.arctan2(d1[:, 1], d1[:, 0]), np.arctan2(-d1[:, 2], level), np.zeros_like(t))
    return on_earth(t, d, d1, d2, q_LB, math.radians(48), 500)


def rest(t):
    zero = np.zeros(t.shape + (3,))
    q_LB = euler(np.full_like(t, 1.0), np.full_like(t, 0.1), np.full_like(t, -0.2))
    return on_earth(t, zero, zero, zero, q_LB, math.radians(30), 0)


def orbit(t):
    """A circle at 500 km, inclined by 51.6 degrees, on which thrusters hold the satellite; z points to the Earth."""
    radius = A + 500e3
    w = math.sqrt(GM / radius**3)
    plane = np.broadcast_to(about(0, np.array(math.radians(51.6))), t.shape + (4,))
    q = product(plane, about(2, w * t + 0.5))
    axis = [turned(q, np.broadcast_to(e, t.shape + (3,))) for e in np.eye(3)]
    along = product(q, euler(np.full_like(t, math.pi / 2), np.zeros_like(t), np.full_like(t, -math.pi / 2)))
    return radius * axis[0], radius * w * axis[1], -radius * w * w * axis[0], along


@functools.cache
def cessna_splines():
    captured = pathlib.Path(__file__).parents[1] / "captures" / "jsbsim_c172_59s.csv.gz"
    rows = np.loadtxt(captured, delimiter=",", skiprows=1)
    return CubicSpline(rows[:, 0], rows[:, 1:4]), CubicSpline(rows[:, 0], rows[:, 4:8])


def cessna(t):
    """A Cessna 172 that JSBSim flew: splines through positions and quaternions that were captured each 0.2 s."""
    position, attitude = cessna_splines()
    t, q = t + position.x[0], attitude(t + position.x[0])
    return position(t), position(t, 1), position(t, 2), q / np.linalg.norm(q, axis=-1, keepdims=True)


@dataclasses.dataclass
class Flight:
    motion: Callable
    is_global: bool  # over the Earth; else in constant gravity
    seconds: int
    noise: tuple  # rad/sqrt(s), m/s/sqrt(s), rad/s/sqrt(s), m/s^2/sqrt(s)
    first: list  # standard deviations of the 15 errors at the begin
    position: float = 1.5  # of the aids, m, m/s, rad
    velocity: float = 0.1
    attitude: float = 0.02
    attitude_rows: int = 0  # 1: the azimuth of the x axis, as two antennas measure it
    height: float = 0  # m, of a barometer; 0: none
    # Errors of the aids with a memory: standard deviation and correlation time of the fixes'; standard deviation at the
    # begin and m/sqrt(s) of the random walk of the height's.
    slow_position: tuple = (0, 1)
    slow_velocity: tuple = (0, 1)
    height_offset: tuple = (0, 0)
    scale: tuple = (0, 0)  # standard deviations of the scale factors of gyros and accelerometers
    dt: float = 0.02
    aid_s: float = 1  # between aids
    epoch_s: float = 20  # some correlation times: what noise and aids make of the errors is new

    def aid_errors(self):
        """Returns variances at the begin, rates of decay, and growths of the variances, of the seven errors."""
        (r, r_s), (v, v_s), (height, walk) = self.slow_position, self.slow_velocity, self.height_offset
        return np.array([[r * r, 1 / r_s, 2 * r * r / r_s]] * 3 + [[v * v, 1 / v_s, 2 * v * v / v_s]] * 3 +
                        [[height * height, 0, walk * walk]])

    def gravitation(self, r):
        return normal_gravitation(r) if self.is_global else np.broadcast_to([0, 0, G], r.shape)


def sigmas(*of_vectors):
    return np.concatenate([np.broadcast_to(np.asarray(s, float), 3) for s in of_vectors])


MEMS = (1e-4, 1e-3, 1e-6, 1e-5)
TACTICAL = (1e-5, 3e-4, 1e-7, 1e-6)
FLIGHTS = {
    "aeroplane": Flight(aeroplane, False, 240, MEMS, sigmas([0.02, 0.02, 0.05], 0.2, 2, 1e-3, 0.02)),
    # With a barometer, two antennas, and a receiver whose errors are the same for a minute or ten.
    "aided": Flight(aeroplane, False, 240, MEMS, sigmas([0.02, 0.02, 0.05], 0.2, 2, 1e-3, 0.02), attitude=0.01,
                    attitude_rows=1, position=0.5, velocity=0.05, height=1, slow_position=(1.5, 600),
                    slow_velocity=(0.1, 60), height_offset=(300, 0.13)),
    "quadrotor": Flight(quadrotor, False, 240, MEMS, sigmas([0.02, 0.02, 0.05], 0.2, 2, 2e-3, 0.03), attitude_rows=1),
    "car": Flight(car, True, 240, TACTICAL, sigmas(0.01, 0.2, 2, 1e-4, 0.01)),
    "rest": Flight(rest, True, 240, MEMS, sigmas(0.01, 0.05, 1, 3e-4, 0.01), velocity=0.02),
    # Ten minutes between aids, in which the gradient of the gravitation acts.
    "orbit": Flight(orbit, True, 9600, (1e-5, 1e-5, 1e-8, 1e-8), sigmas(0.002, 0.1, 10, 1e-5, 1e-4), position=5,
                    attitude=1e-3, attitude_rows=3, dt=0.25, aid_s=600, epoch_s=1200),
    "cessna": Flight(cessna, True, 56, MEMS, sigmas([0.02, 0.02, 0.05], 0.2, 2, 1e-3, 0.02), epoch_s=14),
    # As "aided", with scale factors, which the filter estimates.
    "scaled": Flight(aeroplane, False, 240, MEMS, sigmas([0.02, 0.02, 0.05], 0.2, 2, 1e-3, 0.02), attitude=0.01,
                     attitude_rows=1, position=0.5, velocity=0.05, height=1, slow_position=(1.5, 600),
                     slow_velocity=(0.1, 60), height_offset=(300, 0.13), scale=(3e-3, 3e-3)),
}
