"""Sensonor STIM300: every cluster, unit and accelerometer range (Datasheet TS1524 rev. 31, Table 5-20 to 5-23, Equations 1 to
7), the CRC with its dummy bytes for every kind of datagram. usage: stim300_test.py IMUD"""
import itertools

from bench import *  # noqa: F403

# Identifier: clusters of three axes (gyro, accelerometer, inclinometer), temperatures, PPS or AUX.
KINDS = {
    0x90: ("g", 0, 0), 0x91: ("ga", 0, 0), 0x92: ("gi", 0, 0), 0x93: ("gai", 0, 0),
    0x94: ("g", 1, 0), 0xA5: ("ga", 1, 0), 0xA6: ("gi", 1, 0), 0xA7: ("gai", 1, 0),
    0xF0: ("g", 0, 1), 0xF1: ("ga", 0, 1), 0xF2: ("gi", 0, 1), 0xF3: ("gai", 0, 1),
    0xF4: ("g", 1, 1), 0xF5: ("ga", 1, 1), 0xF6: ("gi", 1, 1), 0xF7: ("gai", 1, 1),
    0x98: ("g", 0, 1), 0x99: ("ga", 0, 1), 0x9A: ("gi", 0, 1), 0x9B: ("gai", 0, 1),
    0x9C: ("g", 1, 1), 0xAD: ("ga", 1, 1), 0xAE: ("gi", 1, 1), 0xAF: ("gai", 1, 1),
}
# LSB of a value, and of its integral over time.
LSB = {"g": (2**-14, 2**-21), "a5": (2**-20, 2**-23), "a10": (2**-19, 2**-22), "a30": (2**-18, 2**-21), "a80": (2**-16, 2**-19),
       "i": (2**-22, 2**-25)}
INTERNAL = 2000


def crc32(data):
    """Section 5.5.7: from 0xFFFFFFFF, polynomial 0x04C11DB7, zeros appended to a multiple of four bytes."""
    crc = 0xFFFFFFFF
    for byte in data + bytes(-len(data) % 4):
        crc = crc << 8 & 0xFFFFFFFF ^ CRC_OF_BYTE[crc >> 24 ^ byte]
    return crc


def crc_of_byte(byte):
    crc = byte << 24
    for _ in range(8):
        crc = (crc << 1 ^ 0x04C11DB7 if crc & 0x80000000 else crc << 1) & 0xFFFFFFFF
    return crc


CRC_OF_BYTE = [crc_of_byte(byte) for byte in range(256)]


# Sums over time of what an inclinometer senses at the internal samples.
SUMS = list(itertools.accumulate((scale(1 / INTERNAL, specific_force(k / INTERNAL)) for k in range(int(SECONDS * INTERNAL) + 1)),
                                 lambda a, b: tuple(x + y for x, y in zip(a, b))))


def check_axes(what, got, wanted, lsb):
    """Checks 24-bit numbers in two's complement, which may have wrapped."""
    for raw, value in zip(got, wanted, strict=True):
        off = (raw * lsb - value + 2**23 * lsb) % (2**24 * lsb) - 2**23 * lsb
        check(what, off, 0, lsb)


def wanted(cluster, unit, t1, t):
    """The output by the formulas of the motion, in one of the units: value, increment, average, integrated (in g s), integrated in m/s."""
    if cluster == "g":
        turn = scale(1 / DEG, delta_angle(t1, t))
        return {"rate": scale(1 / DEG, rate), "increment": turn, "average": scale(1 / DEG, rate if t == 0 else scale(1 / (t - t1), delta_angle(t1, t))),
                "integrated": scale(1 / DEG, delta_angle(0, t))}[unit]
    if cluster == "a":
        change, all_change = delta_velocity(t1, t), delta_velocity(0, t)
        mean = specific_force(t) if t == 0 else scale(1 / (t - t1), change)
    else:  # what it senses at the internal samples
        all_change, before = SUMS[round(t * INTERNAL)], SUMS[round(t1 * INTERNAL)]
        change = tuple(x - y for x, y in zip(all_change, before))
        mean = specific_force(t) if t == 0 else scale(1 / (t - t1), change)
    return {"acceleration": scale(1 / G0, specific_force(t)), "increment": change, "average": scale(1 / G0, mean),
            "integrated_g_s": scale(1 / G0, all_change), "integrated_m_per_s": all_change}[unit]


def test(hz, clusters, temperature, pps, *, aux=False, g="rate", a="acceleration", i="acceleration", g_range=10, cr_lf=False):
    def flag(value):
        return str(bool(value)).lower()
    data = replay(f"""protocol = "stim300"
[imu.device]
start_up = false
sample_rate = {hz}
bit_rate = 1843200
acceleration = {flag("a" in clusters)}
inclination = {flag("i" in clusters)}
temperature = {flag(temperature)}
pps = {flag(pps)}
aux_input = {flag(aux)}
cr_lf = {flag(cr_lf)}
gyro_unit = "{g}"
accelerometer_unit = "{a}"
inclinometer_unit = "{i}"
accelerometer_range_g = {g_range}
""")
    identifier = next(k for k, kind in KINDS.items() if kind == (clusters, temperature, pps) and (0x98 <= k <= 0x9F or k >= 0xA8) | (not pps)
                      and (not pps or (k < 0xF0) == aux))
    units = {"g": g, "a": a, "i": i}
    at = count = 0
    while at < len(data):
        t, t1 = count / hz, max(0, count - 1) / hz
        begin = at
        check("identifier", data[at], identifier, 0)
        at += 1
        for cluster in clusters:
            raw = [int.from_bytes(data[at + 3 * axis:at + 3 * axis + 3], "big", signed=True) for axis in range(3)]
            plain = units[cluster] in ("rate", "acceleration", "average")
            lsb = LSB[cluster if cluster != "a" else f"a{g_range}"][0 if plain else 1]
            if t > 0 or units[cluster] in ("rate", "acceleration"):  # the first has no increments
                value = wanted(cluster, units[cluster], t1, t)
                check_axes(f"{identifier:X} {cluster} {units[cluster]} {g_range} g", raw, value, lsb)
            check("status", data[at + 9], 0, 0)
            at += 10
        if temperature:
            for cluster in clusters:
                check("temperature", [x / 256 for x in struct.unpack_from(">3h", data, at)], [TEMPERATURE] * 3, 1 / 256)
                check("status", data[at + 6], 0, 0)
                at += 7
        if pps:
            at += 4  # nothing is connected
        check("counter", data[at], count * INTERNAL // hz % 256, 0)
        check("latency is at most 1 ms", struct.unpack_from(">H", data, at + 1)[0] <= 1000, True, 0)
        at += 3
        check("CRC", int.from_bytes(data[at:at + 4], "big"), crc32(data[begin:at]), 0)
        at += 4
        if cr_lf:
            check("CR LF", data[at:at + 2] == b"\r\n", True, 0)
            at += 2
        count += 1
    check("datagrams", count, int(SECONDS * hz) + 1, 0)


for aux in (False, True):
    for clusters in ("g", "ga", "gi", "gai"):
        for temperature in (0, 1):
            for pps in (0, 1):
                if pps or not aux:
                    test(125, clusters, temperature, pps, aux=aux, cr_lf=bool(temperature))
for hz in (125, 2000):
    for unit in ("increment", "average", "integrated"):
        test(hz, "g", 0, 0, g=unit)
    for unit in ("increment", "average", "integrated_g_s", "integrated_m_per_s"):
        test(hz, "gi", 0, 0, i=unit)
for g_range in (5, 10, 30, 80):
    for unit in ("acceleration", "increment", "average", "integrated_g_s", "integrated_m_per_s"):
        test(500, "ga", 0, 0, a=unit, g_range=g_range)
finish()
