"""Rotations as unit quaternions q_NB = (w, x, y, z), scalar first: v_N = rotate(q_NB, v_B). N is north-east-down."""
import math


def product(a, b):
    """q_AC from q_AB and q_BC."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw)


def inverse(q):
    return (q[0], -q[1], -q[2], -q[3])


def rotate(q, v):
    return product(product(q, (0.0, *v)), inverse(q))[1:]


def normalised(q):
    norm = math.sqrt(sum(x * x for x in q))
    return tuple(x / norm for x in q)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def from_rotation_vector(v):
    """The rotation about v by |v|, rad."""
    angle = math.sqrt(sum(x * x for x in v))
    half_sinc = 0.5 if angle < 1e-8 else math.sin(angle / 2) / angle
    return (math.cos(angle / 2), *(half_sinc * x for x in v))


def from_euler(roll, pitch, yaw):
    """From the angles of yaw, pitch, roll (3-2-1), rad."""
    return product(product(from_rotation_vector((0, 0, yaw)), from_rotation_vector((0, pitch, 0))),
                   from_rotation_vector((roll, 0, 0)))


def euler(q):
    """Roll, pitch, yaw, rad."""
    w, x, y, z = q
    return (math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            math.asin(max(-1.0, min(1.0, 2 * (w * y - x * z)))),
            math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def angle_between(a, b):
    """The angle by which two attitudes differ, rad."""
    w, *v = product(inverse(a), b)
    return 2 * math.atan2(math.sqrt(sum(x * x for x in v)), abs(w))
