"""MicroStrain MIP: every field of sensor, filter and GNSS data (layouts and units: mip_sdk e5a847d, src/c/mip/definitions,
data_sensor.h, data_filter.h, data_gnss.h, data_shared.h). usage: mip_test.py IMUD"""
from datetime import datetime, timedelta

from bench import *  # noqa: F403

GAUSS = 1e-4
LEAP = 18
WEEK = 604800
HZ = 100  # of sensor and filter data
GNSS_HZ = 4


def gravity(place):
    """Gravity of the WGS 84 ellipsoid, m/s^2: Somigliana's formula, and its change with height."""
    s2 = math.sin(place.latitude) ** 2
    surface = 9.7803253359 * (1 + 0.00193185265241 * s2) / math.sqrt(1 - 6.69437999014e-3 * s2)
    f, m, h = 1 / 298.257223563, 0.00344978650684, place.height / 6378137
    return surface * (1 - 2 * (1 + f + m - 2 * f * s2) * h + 3 * h * h)


def roll_pitch_yaw(place):
    yaw, pitch, roll = yaw_pitch_roll(place.dcm_PL)
    return (roll, pitch, yaw)


def check_quaternion(what, got, place):
    check_floats(what, same_rotation(got), same_rotation(quaternion(place.dcm_PL)))


def check_time(what, b, t, flags):
    week, tow = divmod(GPS_START + t, WEEK)
    check(what, b.take("d"), tow, 1e-6)
    check(what + " week", b.take("H"), week, 0)
    check(what + " flags", b.take("H") & flags, flags, 0)


def shared(descriptor, b, t, before, k):
    if descriptor == 0xD0:
        check("event source", b.take("B"), 0, 0)
    elif descriptor == 0xD1:
        check("ticks", b.take("I"), round(t * 1000), 0)
    elif descriptor == 0xD2:
        check("delta ticks", b.take("I"), round(1000 * (t - before)), 0)
    elif descriptor == 0xD3:
        check_time("shared GPS time", b, t, 3)
    elif descriptor == 0xD4:
        check("delta time", b.take("d"), t - before, 1e-12)
    elif descriptor == 0xD5:
        check("reference time", b.take("Q"), round(t * 1e9), 0)
    elif descriptor == 0xD7:
        check("external time", b.take("Q"), round((GPS_START + t) * 1e9), 1000)  # seconds as a double
        check("external time is not synchronized", b.take("H"), 0, 0)
    elif descriptor == 0xD8:
        check("external time delta", b.take("Q"), round((t - before) * 1e9), 0)
        check("external time delta is not synchronized", b.take("H"), 0, 0)
    else:
        check("reference time delta", b.take("Q"), round((t - before) * 1e9), 0)


def sensor(descriptor, b, t, before, k):
    p = Place(t)
    if descriptor == 0x04:
        check_floats("acceleration", b.take("3f"), scale(1 / G0, specific_force(t)))
    elif descriptor == 0x05:
        check_floats("rate", b.take("3f"), rate)
    elif descriptor == 0x06:
        check_floats("magnetic field", b.take("3f"), scale(1 / GAUSS, times(p.dcm_PL, p.field_L)))
    elif descriptor == 0x07:
        check_floats("delta angle", b.take("3f"), delta_angle(before, t))
    elif descriptor == 0x08:
        check_floats("delta velocity", b.take("3f"), scale(1 / G0, delta_velocity(before, t)))
    elif descriptor == 0x0A:
        check_quaternion("quaternion", b.take("4f"), p)
    elif descriptor == 0x0C:
        check_floats("euler", b.take("3f"), roll_pitch_yaw(p))
    elif descriptor == 0x12:
        check_time("GPS time", b, t, 0)
    elif descriptor == 0x14:
        check_floats("temperature", b.take("3f"), (TEMPERATURE,) * 3)
    elif descriptor == 0x17:
        check_floats("pressure", b.take("f"), p.pressure / 100)
    elif descriptor == 0x18:
        check("overrange", b.take("H"), 0, 0)
    else:
        return False
    return True


def position(b, p):
    latitude, longitude, height = b.take("3d")
    check("position", (latitude, longitude), (p.latitude / DEG, p.longitude / DEG), 1e-9)
    check("height", height, p.height, 1e-6)


def filtered(descriptor, b, t, before, k):
    p = Place(t)
    force = specific_force(t)
    down = scale(gravity(p), times(p.dcm_PL, (0, 0, 1)))
    if descriptor == 0x01:
        position(b, p)
    elif descriptor == 0x02:
        check_floats("velocity", b.take("3f"), p.v_L)
    elif descriptor == 0x03:
        check_quaternion("filter quaternion", b.take("4f"), p)
    elif descriptor == 0x04:
        for row in p.dcm_PL:
            check_floats("filter matrix", b.take("3f"), row, 1)
    elif descriptor == 0x05:
        check_floats("filter euler", b.take("3f"), roll_pitch_yaw(p))
    elif descriptor == 0x0D:
        check_floats("linear acceleration", b.take("3f"), tuple(f + g for f, g in zip(force, down)), 10)
    elif descriptor == 0x0E:
        check_floats("filter rate", b.take("3f"), rate)
    elif descriptor == 0x06:
        check_floats("gyro bias", b.take("3f"), (0, 0, 0))
    elif descriptor in (0x08, 0x09, 0x0A, 0x0B):
        check(f"uncertainty {descriptor:X} is there", [0 < u < 1 for u in b.take("3f")], [True] * 3, 0)
    elif descriptor == 0x12:
        check("uncertainty of the quaternion is there", [0 < u < 1 for u in b.take("4f")], [True] * 4, 0)
    elif descriptor == 0x49:
        check("antennas' second of the week", b.take("f"), (GPS_START + t) % WEEK, 0.05)
        check_floats("antennas' heading", b.take("f"), roll_pitch_yaw(p)[2])
        check("antennas' uncertainty is there", 0 < b.take("f") < 0.1, True, 0)
        check("antennas' state", b.take("BHH"), (2, 7, 1), 0)
        return True
    elif descriptor == 0x10:
        b.take("HH")
    elif descriptor == 0x11:
        check_time("filter GPS time", b, t, 1)
        return True
    elif descriptor == 0x13:
        check_floats("gravity", b.take("3f"), down)
    elif descriptor == 0x1C:
        check_floats("filter acceleration", b.take("3f"), force)
    elif descriptor == 0x40:
        check("filter ECEF", b.take("3d"), p.r_E, 1e-6)
    else:
        return False
    flags = b.take("H")
    if descriptor != 0x10:
        check(f"filter {descriptor:X} valid", flags, 1, 0)
    return True


def gnss(descriptor, b, t, before, k):
    p = Place(t)
    speed = math.hypot(p.v_L[0], p.v_L[1])
    if descriptor == 0x03:
        position(b, p)
        b.at += 8
        check("GNSS position accuracies are there", [0 < a < 10 for a in b.take("2f")], [True] * 2, 0)
        check("GNSS position valid", b.take("H"), 0x1B, 0)
    elif descriptor == 0x04:
        check("GNSS ECEF", b.take("3d"), p.r_E, 1e-6)
        check("GNSS ECEF accuracy is there", 0 < b.take("f") < 10, True, 0)
        check("GNSS ECEF valid", b.take("H"), 3, 0)
    elif descriptor == 0x05:
        check_floats("GNSS velocity", b.take("3f"), p.v_L)
        check_floats("GNSS speeds", b.take("2f"), (math.hypot(speed, p.v_L[2]), speed))
        check_floats("GNSS course", b.take("f") % 360, math.atan2(p.v_L[1], p.v_L[0]) / DEG % 360)
        check("GNSS velocity accuracies are there", [0 < a < 1 for a in b.take("2f")], [True] * 2, 0)
        check("GNSS velocity valid", b.take("H"), 0x3F, 0)
    elif descriptor == 0x07:
        check("DOP are there", [0 < dop < 5 for dop in b.take("7f")], [True] * 7, 0)
        b.take("H")
    elif descriptor == 0x08:
        at = datetime(1980, 1, 6) + timedelta(seconds=GPS_START - LEAP) + timedelta(milliseconds=round(1000 * t))
        check("UTC", b.take("HBBBBBI"), (at.year, at.month, at.day, at.hour, at.minute, at.second, at.microsecond // 1000), 0)
        check("UTC valid", b.take("H"), 3, 0)
    elif descriptor == 0x09:
        check_time("GNSS time", b, t, 3)
    elif descriptor == 0x0B:
        check("fix is 3D", b.take("B"), 0, 0)
        b.at += 5
    elif descriptor == 0x0D:
        b.at += 5
    elif descriptor == 0x11:
        check("leap seconds", b.take("BH"), (LEAP, 2), 0)
    else:
        return False
    return True


SETS = {0x80: (sensor, HZ), 0x81: (gnss, GNSS_HZ), 0x82: (filtered, HZ), 0x91: (gnss, 2), 0x92: (gnss, 2)}
# All fields, as `imud list` names them.
SENSOR = "acceleration rate magnetic_field delta_angle delta_velocity quaternion euler gps_time temperature pressure overrange"
FILTER = "filter_position filter_velocity filter_quaternion filter_matrix filter_euler filter_linear_acceleration filter_rate"
GNSS = "gnss_position gnss_position_ecef gnss_velocity gnss_dop gnss_utc gnss_gps_time gnss_fix"
SHARED = " event_source ticks delta_ticks shared_gps_time delta_time reference_time"
MORE = "filter_status filter_gps_time filter_gravity filter_acceleration filter_position_ecef filter_shared_gps_time "
UNCERTAINTIES = ("filter_gyro_bias filter_position_uncertainty filter_velocity_uncertainty filter_euler_uncertainty "
                 "filter_gyro_bias_uncertainty filter_quaternion_uncertainty")
TIMES = ("shared_gps_time", "reference_time", "reference_delta")


def test(model, wanted):
    keys = "\n".join(f"device.{kind}_fields = {names.split()}".replace("'", '"') for kind, names in wanted.items())
    data = replay(f'protocol = "mip"\ndevice.model = "{model}"\ndevice.baud = 921600\ndevice.sensor_rate_hz = {HZ}\n'
                  f"device.filter_rate_hz = {HZ}\n{keys}")
    count = dict.fromkeys(SETS, 0)
    seen = set()
    while data:
        check("sync", data[:2] == b"ue", True, 0)
        kind, size = data[2], data[3]
        a = c = 0
        for byte in data[:size + 4]:
            a = a + byte & 0xFF
            c = c + a & 0xFF
        check("checksum", tuple(data[size + 4:size + 6]), (a, c), 0)
        decode, hz = SETS[kind]
        k, count[kind] = count[kind], count[kind] + 1
        t, before = k / hz, max(0, k - 1) / hz
        b = Bytes(data, ">")
        b.at = 4
        while b.at < size + 4:
            end = b.at + data[b.at]
            descriptor = data[b.at + 1]
            seen.add((kind, descriptor))
            b.at += 2
            if k == 0 and descriptor in (0xD2, 0xD4, 0xD6, 0xD8):
                b.at = end  # counts from an unknown start
            elif not decode(descriptor, b, t, before, k):
                shared(descriptor, b, t, before, k)
            check(f"{kind:X}:{descriptor:X} length", b.at, end, 0)
            b.at = end
        data = data[size + 6:]
    for kind, (_, hz) in SETS.items():
        if count[kind]:
            check(f"{kind:X} packets", count[kind], int(SECONDS * hz) + 1, 0)
    return len(seen)


def expect(model, **wanted):
    """All of these fields of a model are sent, and right."""
    fields = sum(len(names.split()) for names in wanted.values())
    receivers = 2 if model == "3dm-gq7" else 1
    check(f"fields of {model}", test(model, wanted), fields + (receivers - 1) * len(wanted.get("gnss", "").split()), 0)


expect("3dm-gx5-45", sensor=SENSOR, filter=FILTER, gnss=GNSS + " gnss_hardware")
expect("3dm-gx5-45", sensor="rate", filter=MORE, gnss="gnss_shared_gps_time")
expect("3dm-gx5-45", sensor="rate", filter=UNCERTAINTIES, gnss="gnss_fix")
for ahrs in ("3dm-gx5-25", "3dm-cv7-ahrs"):
    expect(ahrs, sensor=SENSOR, filter="filter_quaternion filter_euler")
expect("3dm-cv7-ins", sensor=SENSOR + SHARED, filter=FILTER)
expect("3dm-cv7-ins", sensor="reference_delta external_time external_delta rate",
       filter=MORE + " filter_reference_time filter_reference_delta filter_event_source filter_external_time")
expect("3dm-gq7", sensor="rate", filter="filter_dual_antenna", gnss=GNSS)
expect("3dm-gq7", sensor="rate", filter="filter_gps_time", gnss="gnss_leap_seconds " + " ".join("gnss_" + time for time in TIMES))
finish()
