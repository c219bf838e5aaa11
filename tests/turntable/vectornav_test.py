"""VectorNav: every binary field (sizes and types: vnproglib 1.2, packet.cpp and types.h) and every text message (as vnproglib
parses it). usage: vectornav_test.py IMUD"""
from datetime import datetime, timedelta

from bench import *  # noqa: F403

GAUSS = 1e-4
LEAP = 18


def crc16(data):
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def utc(t):
    at = datetime(1980, 1, 6) + timedelta(seconds=GPS_START - LEAP) + timedelta(milliseconds=round(1000 * t))
    return (at.year - 2000, at.month, at.day, at.hour, at.minute, at.second, at.microsecond // 1000)


def lla(place):
    return (place.latitude / DEG, place.longitude / DEG, place.height)


def check_lla(what, got, place):
    check(what, got[:2], lla(place)[:2], 1e-9)
    check(what + " height", got[2], place.height, 1e-6)


def check_quaternion(what, got, place):
    x, y, z, w = got
    check_floats(what, same_rotation((w, x, y, z)), same_rotation(quaternion(place.dcm_PL)))


def check_deltas(b, t1, t, fields):
    if "angle" in fields:
        check_floats("delta time", b.take("f"), t - t1 if t > 0 else 1 / 800)
        check_floats("delta angle", b.take("3f"), scale(1 / DEG, delta_angle(t1, t)))
    if "velocity" in fields:
        check_floats("delta velocity", b.take("3f"), delta_velocity(t1, t))


def common(b, t, t1, p):
    ns = round(t * 1e9)
    check("TimeStartup", b.take("Q"), ns, 1)
    check("TimeGps", b.take("Q"), GPS_START * 10**9 + ns, 1)
    check("TimeSyncIn", b.take("Q"), 0, 0)
    check_floats("YawPitchRoll", b.take("3f"), scale(1 / DEG, yaw_pitch_roll(p.dcm_PL)), 90)
    check_quaternion("Quaternion", b.take("4f"), p)
    check_floats("AngularRate", b.take("3f"), rate)
    check_lla("Position", b.take("3d"), p)
    check_floats("Velocity", b.take("3f"), p.v_L)
    check_floats("Accel", b.take("3f"), specific_force(t))
    check_floats("Imu", b.take("3f"), specific_force(t))
    check_floats("Imu rate", b.take("3f"), rate)
    check_floats("MagPres", b.take("3f"), scale(1 / GAUSS, times(p.dcm_PL, p.field_L)))
    check_floats("MagPres temperature", b.take("f"), TEMPERATURE)
    check_floats("MagPres pressure", b.take("f"), p.pressure / 1000)
    check_deltas(b, t1, t, "angle velocity")
    check("InsStatus", b.take("H"), 6, 0)
    check("SyncInCnt, TimeGpsPps", b.take("IQ"), (0, since_pulse(t)), 1)


def since_pulse(t):
    """Time since the receiver's pulse per second, ns; the first one is that of the second after the first sample."""
    return round(t * 1e9) % 10**9 if t >= 1 else 0


def time_group(b, t, _t1, _p):
    ns = round(t * 1e9)
    week, tow = divmod(GPS_START * 10**9 + ns, 604800 * 10**9)
    check("TimeStartup", b.take("Q"), ns, 1)
    check("TimeGps", b.take("Q"), GPS_START * 10**9 + ns, 1)
    check("GpsTow", b.take("Q"), tow, 1)
    check("GpsWeek", b.take("H"), week, 0)
    check("TimeSyncIn, TimeGpsPps", b.take("QQ"), (0, since_pulse(t)), 1)
    check("TimeUtc", b.take("bBBBBBH"), utc(t), 0)
    check("SyncInCnt, SyncOutCnt, TimeStatus", b.take("IIB"), (0, int(t), 7), 0)  # SyncOut sends the receiver's pulses


def imu(b, t, t1, p):
    field = scale(1 / GAUSS, times(p.dcm_PL, p.field_L))
    check("ImuStatus", b.take("H"), 0, 0)
    check_floats("UncompMag", b.take("3f"), field)
    check_floats("UncompAccel", b.take("3f"), specific_force(t))
    check_floats("UncompGyro", b.take("3f"), rate)
    check_floats("Temp, Pres", b.take("2f"), (TEMPERATURE, p.pressure / 1000))
    check_deltas(b, t1, t, "angle")
    check_deltas(b, t1, t, "velocity")
    check_floats("Mag", b.take("3f"), field)
    check_floats("Accel", b.take("3f"), specific_force(t))
    check_floats("AngularRate", b.take("3f"), rate)
    check("SensSat", b.take("H"), 0, 0)
    check_floats("Raw", b.take("10f"), (*field, *specific_force(t), *rate, TEMPERATURE))


def gnss(b, t, _t1, p):
    week, tow = divmod(GPS_START * 10**9 + round(t * 1e9), 604800 * 10**9)
    check("Utc", b.take("bBBBBBH"), utc(t), 0)
    check("Tow, Week", b.take("QH"), (tow, week), 1)
    check("Fix", b.take("BB")[1], 3, 0)
    check_lla("PosLla", b.take("3d"), p)
    check("PosEcef", b.take("3d"), p.r_E, 1e-6)
    check_floats("VelNed", b.take("3f"), p.v_L)
    check_floats("VelEcef", b.take("3f"), p.v_E)
    accuracies = b.take("5f")
    check("accuracies are there", [a > 0 for a in accuracies], [True] * 5, 0)
    check("TimeInfo", b.take("Bb"), (7, LEAP), 0)
    check("DOP are there", [a > 0 for a in b.take("7f")], [True] * 7, 0)


def attitude(b, t, _t1, p):
    force_L = p.to_L(specific_force(t))
    linear_L = (force_L[0], force_L[1], force_L[2] + G0)
    check("VpeStatus", b.take("H"), 0, 0)
    check_floats("YawPitchRoll", b.take("3f"), scale(1 / DEG, yaw_pitch_roll(p.dcm_PL)), 90)
    check_quaternion("Quaternion", b.take("4f"), p)
    for column in transpose(p.dcm_PL):
        check_floats("DCM", b.take("3f"), column, 1)
    check_floats("MagNed", b.take("3f"), scale(1 / GAUSS, p.field_L))
    check_floats("AccelNed", b.take("3f"), force_L)
    check_floats("LinearAccelBody", b.take("3f"), times(p.dcm_PL, linear_L), 10)
    check_floats("LinearAccelNed", b.take("3f"), linear_L, 10)
    check("YprU is there", [a > 0 for a in b.take("3f")], [True] * 3, 0)
    b.at += 12 + 28 + 24 + 12  # not known


def ins(b, t, _t1, p):
    force_L = p.to_L(specific_force(t))
    check("InsStatus", b.take("H"), 6, 0)
    check_lla("PosLla", b.take("3d"), p)
    check("PosEcef", b.take("3d"), p.r_E, 1e-6)
    check_floats("VelBody", b.take("3f"), times(p.dcm_PL, p.v_L))
    check_floats("VelNed", b.take("3f"), p.v_L)
    check_floats("VelEcef", b.take("3f"), p.v_E)
    to_E = transpose(p.dcm_LE)
    check_floats("MagEcef", b.take("3f"), scale(1 / GAUSS, times(to_E, p.field_L)))
    check_floats("AccelEcef", b.take("3f"), times(to_E, force_L))
    check_floats("LinearAccelEcef", b.take("3f"), times(to_E, (force_L[0], force_L[1], force_L[2] + G0)), 10)
    check("PosU, VelU are there", [a > 0 for a in b.take("2f")], [True] * 2, 0)
    b.at += 68 + 64  # not known


GROUPS = {1: common, 2: time_group, 4: imu, 8: gnss, 16: attitude, 32: ins}
OUTPUTS = {"binary_1": ("07", ("7FFF", "03FF", "1FFF")), "binary_2": ("18", ("3FFF", "1FFF")), "binary_3": ("20", ("1FFF",))}


def test_binary():
    keys = "\n".join(f'device.{key} = "1,16,{groups},{",".join(masks)}"' for key, (groups, masks) in OUTPUTS.items())
    data = replay(f'protocol = "vectornav"\ndevice.model = "vn-200"\ndevice.async_type = 0\ndevice.baud = 921600\n{keys}')
    number = dict.fromkeys(OUTPUTS, 0)
    while data:
        key = next(k for k, (groups, _) in OUTPUTS.items() if data[:2] == bytes((0xFA, int(groups, 16))))
        groups, masks = OUTPUTS[key]
        b = Bytes(data, "<")
        b.at = 2
        check("masks", [b.take("H") for _ in masks], [int(m, 16) for m in masks], 0)
        k, number[key] = number[key], number[key] + 1
        t, t1 = k * 0.02, max(0, k - 1) * 0.02
        for bit, group in GROUPS.items():
            if int(groups, 16) & bit:
                group(b, t, t1, Place(t))
        check("CRC", crc16(data[1:b.at + 2]), 0, 0)
        data = data[b.at + 2:]
    check("frames", tuple(number.values()), (76, 76, 76), 0)


def test_text():
    t2 = 1 / 200
    wanted = {
        1: ("VNYPR", lambda t, p: ("ypr",)), 2: ("VNQTN", lambda t, p: ("q",)), 8: ("VNQMR", lambda t, p: ("q", "mag", "f", "w")),
        10: ("VNMAG", lambda t, p: ("mag",)), 11: ("VNACC", lambda t, p: ("f",)), 12: ("VNGYR", lambda t, p: ("w",)),
        13: ("VNMAR", lambda t, p: ("mag", "f", "w")), 14: ("VNYMR", lambda t, p: ("ypr", "mag", "f", "w")),
        16: ("VNYBA", lambda t, p: ("ypr", "body", "w")), 17: ("VNYIA", lambda t, p: ("ypr", "ned", "w")),
        19: ("VNIMU", lambda t, p: ("mag", "f", "w", "temperature", "pressure")),
        20: ("VNGPS", lambda t, p: ("time", "week", None, None, "lla", "v", None, None, None, None, None)),
        21: ("VNGPE", lambda t, p: ("time", "week", None, None, "r_E", "v_E", None, None, None, None, None)),
        22: ("VNINS", lambda t, p: ("time", "week", "status", "ypr", "lla", "v", None, None, None)),
        23: ("VNINE", lambda t, p: ("time", "week", "status", "ypr", "r_E", "v_E", None, None, None)),
        28: ("VNISL", lambda t, p: ("ypr", "lla", "v", "f", "w")), 29: ("VNISE", lambda t, p: ("ypr", "r_E", "v_E", "f", "w")),
        30: ("VNDTV", lambda t, p: ("dt", "dtheta", "dvel")),
    }
    for kind, (name, layout) in wanted.items():
        data = replay(f'protocol = "vectornav"\ndevice.model = "vn-200"\ndevice.async_type = {kind}\ndevice.async_hz = 200\ndevice.baud = 921600')
        lines = data.decode().split("\r\n")
        check(f"{name} lines", len(lines), 302, 0)
        for k, line in enumerate(lines[:-1]):
            body, star, checksum = line[1:].partition("*")
            xor = 0
            for c in body.encode():
                xor ^= c
            check("checksum", int(checksum, 16), xor, 0)
            t, t1 = k * t2, max(0, k - 1) * t2
            p = Place(t)
            force_L = p.to_L(specific_force(t))
            linear_L = (force_L[0], force_L[1], force_L[2] + G0)
            q = quaternion(p.dcm_PL)
            week, tow = divmod(GPS_START + t, 604800)
            values = {
                "ypr": scale(1 / DEG, yaw_pitch_roll(p.dcm_PL)), "q": (*q[1:], q[0]), "w": rate, "f": specific_force(t),
                "mag": scale(1 / GAUSS, times(p.dcm_PL, p.field_L)), "body": times(p.dcm_PL, linear_L), "ned": linear_L,
                "temperature": (TEMPERATURE,), "pressure": (p.pressure / 1000,), "time": (tow,), "week": (week,),
                "status": (6,), "lla": lla(p), "v": p.v_L, "r_E": p.r_E, "v_E": p.v_E,
                "dt": (t - t1 if k else 1 / 800,), "dtheta": scale(1 / DEG, delta_angle(t1, t)), "dvel": delta_velocity(t1, t),
            }
            words = body.split(",")
            check("name", words[0] == name, True, 0)
            flip = 1
            if "q" in layout(t, p):
                flip = 1 if dot([float(w) for w in words[1:5]], values["q"]) > 0 else -1
            at = 1
            for quantity in layout(t, p):
                if quantity is None:
                    at += 1
                    continue
                for number in values[quantity]:
                    word = words[at]
                    digits = len(word.partition(".")[2]) if quantity != "status" else 0
                    got = int(word, 16) if quantity == "status" else float(word)
                    check(f"{name} {quantity}", got, flip * number if quantity == "q" else number, 0.51 * 10**-digits + 2e-9)
                    at += 1


test_binary()
test_text()
finish()
