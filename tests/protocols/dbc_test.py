"""Checks that canmatrix decodes the frames that imud sends, by the DBC files beside the devices, to the same numbers: those of
native-can to the decoder's, those of products whose messages are tables to the encoded sample's, within half an LSB.

Usage: dbc_test.py DUMP_CAN_FRAMES FOLDER_OF_THE_DBC_FILES. Needs python3-canmatrix.
"""
import json
import math
import pathlib
import subprocess
import sys
from decimal import Decimal

import canmatrix
import canmatrix.formats

# SI = factor * number + offset
UNITS = {"": (1, 0), "1": (1, 0), "bits": (1, 0), "s": (1, 0), "ms": (1e-3, 0), "us": (1e-6, 0), "100us": (1e-4, 0), "0.1ms": (1e-4, 0),
         "rad": (1, 0), "deg": (math.pi / 180, 0), "rad/s": (1, 0), "deg/s": (math.pi / 180, 0), "m": (1, 0), "m/s": (1, 0),
         "m/s^2": (1, 0), "g": (9.80665, 0), "degC": (1, 0), "Pa": (1, 0), "a.u.": (50e-6, 0), "a": (1, 0), "month": (1, 0),
         "d": (1, 0), "h": (1, 0), "min": (1, 0)}


def vector(pattern, quantity, axes="XYZ"):
    return {pattern.format(axis): f"{quantity}_{axis.lower()}" for axis in axes}


def negative(quantity):
    return lambda sample, _: -sample[quantity]


def forward_left_up(pattern, quantity):
    """The signals X, Y, Z in the axes of a case whose y points to the left and whose z points up."""
    return {pattern.format("X"): f"{quantity}_x", **{pattern.format(axis): negative(f"{quantity}_{axis.lower()}") for axis in "YZ"}}


def gyro_out_of_range(axis):
    return lambda sample, _: sample["status"] >> "xyz".index(axis) & 1


def accelerometer_out_of_range(axis):
    return lambda sample, _: sample["status"] >> 3 + "xyz".index(axis) & 1


def mm7_failure(out_of_range):
    return lambda sample, data: 2 * out_of_range(sample, data)


def mm7_temperature(sample, _):
    """The codes C9 and FF stand for 151 and 205 degrees."""
    return 151 if sample["temperature"] > 150 else 205 if sample["temperature"] < -50 else sample["temperature"]


def crc8_j1850(sample, data):
    crc = 0xFF
    for byte in data[:7]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ 0xFF


def sbg_imu_status(sample, _):
    return 0xFF | (sample["status"] & 0x38 == 0) << 8 | (sample["status"] & 0x07 == 0) << 9


ALIGNING, COASTING, AIDED, LEVELLED = 1, 2, 3, 4  # navigation_state; 0 is the truth


def deviations(sample, quantity):
    return [float(sample[f"{quantity}_sigma_{axis}"]) for axis in ("north", "east", "down")]


def has_place(sample):
    return sample["navigation_state"] in (0, COASTING, AIDED)


def has_magnetometer(sample):
    return any(sample[f"magnetic_field_{axis}"] for axis in "xyz")


def sbg_clock(sample, _):
    fixed = sample["gnss_fix"] == 1
    return (0b100111 if fixed else 0b10) | (0x80 if fixed or has_place(sample) else 0)


def sbg_aiding(sample, _):
    return (0x0B if sample["gnss_fix"] else 0) | (4 if sample["gnss_has_heading"] else 0) | has_magnetometer(sample) << 8 | 1 << 13


def sbg_solution(sample, _):
    state = sample["navigation_state"]
    if state == 0:
        return 0x08000CF4 | int(sample["gnss_has_heading"]) << 13
    north, east, down = deviations(sample, "attitude")
    valid = (max(north, east) < math.radians(0.5)) | (down < math.radians(1)) << 1
    if has_place(sample):
        valid |= (max(deviations(sample, "velocity")) < 1.5) << 2 | (max(deviations(sample, "position")) < 10) << 3
    word = (4 if has_place(sample) else 2 if has_magnetometer(sample) else 1) | valid << 4 | (valid == 15) << 27
    if state == ALIGNING:
        return word | 1 << 8 | has_magnetometer(sample) << 9
    receiver = has_place(sample) and sample["fix_age"] < 3
    return word | int(sample["aid_magnetic_used"]) << 9 | (0xC00 if receiver else 0) | int(sample["aid_antennas_used"]) << 13 | (
        int(sample["aid_pressure_used"]) << 25)


def sbg_angle(index):
    """The deviation of 0 roll, 1 pitch, 2 yaw, by numerical differentiation of the angles."""
    def accuracy(sample, _):
        q = tuple(float(sample[f"q_LP_{c}"]) for c in "wxyz")

        def angles(axis, phi):  # of the attitude turned by phi about north, east or down
            v = [0.0, 0.0, 0.0]
            v[axis] = math.sin(phi / 2)
            w, x, y, z = times((math.cos(phi / 2), *v), q)
            return (math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(max(-1, min(1, 2 * (w * y - z * x)))),
                    math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        step = 1e-6
        slopes = [math.remainder(angles(axis, step)[index] - angles(axis, -step)[index], 2 * math.pi) / (2 * step) for axis in range(3)]
        return min(math.hypot(*(s * d for s, d in zip(slopes, deviations(sample, "attitude")))), math.pi / (2 if index == 1 else 1))
    return accuracy


def times(p, q):
    """The product of two quaternions w, x, y, z."""
    (a, b, c, d), (w, x, y, z) = p, q
    return (a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w)


def sbg_accuracy(quantity, axis, unknown):
    return lambda sample, _: deviations(sample, quantity)[axis] if has_place(sample) else unknown


def sbg_gps_sigma(quantity, axis, unknown):
    """The accuracy that the receiver reports, at most the number `unknown`, which stands where there is no fix."""
    return lambda sample, _: min(float(sample[f"gnss_{quantity}_sigma_{axis}"]), unknown) if sample["gnss_fix"] else unknown


def sbg_gps_course_sigma(sample, _):
    """By numerical differentiation of the course by the two velocities."""
    if not sample["gnss_fix"]:
        return math.pi
    north, east = float(sample["gnss_velocity_north"]), float(sample["gnss_velocity_east"])
    sigmas = [sbg_gps_sigma("velocity", axis, 327.67)(sample, _) for axis in ("north", "east")]
    step = 1e-6 * math.hypot(north, east)
    slopes = [math.remainder(math.atan2(east + de, north + dn) - math.atan2(east - de, north - dn), 2 * math.pi) / (2 * step)
              for dn, de in ((step, 0), (0, step))]
    return min(math.pi, math.hypot(*(slope * sigma for slope, sigma in zip(slopes, sigmas))))


def standard_altitude(pressure):
    """Of ISO 2533 and the U.S. Standard Atmosphere 1976, up to 20 km."""
    if pressure <= 0:
        return 0
    k = 9.80665 * 28.9644e-3 / 8.31432  # K/m
    exponent = k / 0.0065
    tropopause = 101325 * (1 - 0.0065 * 11000 / 288.15) ** exponent
    if pressure > tropopause:
        return 288.15 / 0.0065 * (1 - (pressure / 101325) ** (1 / exponent))
    return 11000 + 216.65 / k * math.log(tropopause / pressure)


def xsens_status(sample, _):
    clipped = (sample["status"] >> 3 & 7) << 8 | (sample["status"] & 7) << 11
    state = sample["navigation_state"]
    return 1 | (state != ALIGNING) << 1 | int(sample["gnss_fix"]) << 2 | clipped | bool(clipped) << 19 | {COASTING: 1, AIDED: 3}.get(state, 0) << 23


def xsens_delta_v(axis):
    sign = 1 if axis == "x" else -1  # forward, left, up
    return lambda sample, data: sign * float(sample[f"delta_velocity_{axis}"]) * 2.0 ** (data[6] - 17)


def xsens_exponent(sample, _):
    """The largest with which all three components fit, at most 17."""
    largest = max(abs(float(sample[f"delta_velocity_{axis}"])) for axis in "xyz")
    return max((e for e in range(18) if largest * 2**e < 32767.5), default=0)


def east_north_up(sample):
    """The quaternion w, x, y, z of the case, whose axes are forward, left, up, relative to east-north-up."""
    w, x, y, z = (float(sample[f"q_LP_{c}"]) for c in "wxyz")
    h = math.sqrt(0.5)  # (0, h, h, 0) times q_LP times (0, 1, 0, 0)
    q = (-h * w - h * z, -h * x - h * y, h * y - h * x, h * z - h * w)
    return q if q[0] >= 0 else tuple(-c for c in q)


def xsens_quaternion(index):
    return lambda sample, _: east_north_up(sample)[index]


def xsens_euler(index):
    """0 roll, 1 pitch, 2 yaw, in rad."""
    def angle(sample, _):
        w, x, y, z = east_north_up(sample)
        return (math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(2 * (w * y - z * x)),
                math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))[index]
    return angle


# For each DBC file the number that each signal has: a quantity of the sample, a function of sample and data, or a constant.
# A name is that of a signal, or MESSAGE.SIGNAL.
EXPECTED = {
    "sbg_can.dbc": {
        "TIME_STAMP": lambda sample, _: sample["time_ns"] * Decimal("1e-9") % (2**32 / Decimal(10**6)),
        "GPS_TOW": "gps_time_of_week", "YEAR": "utc_year", "MONTH": "utc_month", "DAY": "utc_day", "HOUR": "utc_hour",
        "MIN": "utc_minute", "SEC": "utc_second", "MICRO_SEC": "utc_subsecond", "IMU_INFO.STATUS": sbg_imu_status,
        "TEMPERATURE": "temperature", **vector("ACCEL_{}", "specific_force"), **vector("GYRO_{}", "rate"),
        **vector("DELTA_VEL_{}", "mean_specific_force"), **vector("DELTA_ANGLE_{}", "mean_rate"),
        "Q0": "q_LP_w", "Q1": "q_LP_x", "Q2": "q_LP_y", "Q3": "q_LP_z", "ROLL": "roll", "PITCH": "pitch", "YAW": "yaw",
        "LATITUDE": "latitude", "LONGITUDE": "longitude", "ALTITUDE": "height", "UNDULATION": 0,
        "VELOCITY_N": "velocity_north", "VELOCITY_E": "velocity_east", "VELOCITY_D": "velocity_down",
        "GENERAL": 0x7F, "COM": 0x2E007FFF, "HEAVE_STATUS": 0, "CLOCK": sbg_clock, "AIDING": sbg_aiding, "SOLUTION": sbg_solution,
        "ROLL_ACC": sbg_angle(0), "PITCH_ACC": sbg_angle(1), "YAW_ACC": sbg_angle(2),
        **{f"{name}_ACC": sbg_accuracy("position", i, 655.35) for i, name in enumerate(("LATITUDE", "LONGITUDE", "ALTITUDE"))},
        **{f"VELOCITY_ACC_{name}": sbg_accuracy("velocity", i, 327.67) for i, name in enumerate("NED")},
        **vector("VELOCITY_{}", "velocity"), "MAG_0.STATUS": 0xFF, **vector("MAG_{}", "magnetic_field"),
        "AIR_DATA_STATUS": lambda sample, _: 6 if sample["pressure"] > 0 else 0, "AIR_TEMPERATURE": 0, "PRESSURE_ABS": "pressure",
        "AIR_DATA_ALTITUDE.ALTITUDE": lambda sample, _: standard_altitude(float(sample["pressure"])),
        "GPS_VEL_STATUS": lambda sample, _: 0x80 if sample["gnss_fix"] else 1,
        "GPS_POS_STATUS": lambda sample, _: 0x1080 if sample["gnss_fix"] else 1,
        **{f"VEL_{axis[0].upper()}": f"gnss_velocity_{axis}" for axis in ("north", "east", "down")},
        **{f"VEL_ACC_{axis[0].upper()}": sbg_gps_sigma("velocity", axis, 327.67) for axis in ("north", "east", "down")},
        "COURSE": lambda sample, _: float(sample["gnss_track"]) % (2 * math.pi), "COURSE_ACC": sbg_gps_course_sigma,
        "GPS1_POS.LATITUDE": "gnss_latitude", "GPS1_POS.LONGITUDE": "gnss_longitude", "GPS1_POS_ALT.ALTITUDE": "gnss_height",
        "GPS_HDT_STATUS": lambda sample, _: 0 if sample["gnss_has_heading"] else 1,
        "TRUE_HEADING": lambda sample, _: float(sample["gnss_heading"]) % (2 * math.pi),
        "TRUE_HEADING_ACC": lambda sample, _: float(sample["gnss_heading_sigma"]) if sample["gnss_has_heading"] else math.pi,
        "GPS1_HDT.PITCH": 0, "GPS1_HDT.PITCH_ACC": math.pi / 2,
        "NUM_SV": "gnss_satellites", "DIFF_CORR_AGE": 0xFF, "BASE_STATION_ID": 0xFFFF,
        **{f"{name}_ACC": sbg_gps_sigma("position", axis, 655.35)
           for name, axis in (("LAT", "north"), ("LONG", "east"), ("ALT", "down"))}},
    "xsens_can.dbc": {
        "Timestamp": lambda sample, _: sample["time_ns"] * Decimal("1e-9"), "Counter": lambda sample, _: sample["counter"],
        "year": "utc_year", "month": "utc_month", "day": "utc_day", "hour": "utc_hour", "minute": "utc_minute",
        "second": "utc_second", "tenthms": "utc_subsecond", "StatusWord": xsens_status,
        **{f"Q{i + 1}": xsens_quaternion(i) for i in range(4)}, "roll": xsens_euler(0), "pitch": xsens_euler(1),
        "yaw": xsens_euler(2), "Exponent": xsens_exponent, **{axis: xsens_delta_v(axis.lower()) for axis in "XYZ"},
        **forward_left_up("gyr{}", "rate"), **forward_left_up("HrGyr{}", "rate"), **forward_left_up("acc{}", "specific_force"),
        **forward_left_up("HrAcc{}", "specific_force"), "DeltaQ1": "rotation_w", "DeltaQ2": "rotation_x",
        "DeltaQ3": negative("rotation_y"), "DeltaQ4": negative("rotation_z"), "FreeAccX": "free_acceleration_east",
        "FreeAccY": "free_acceleration_north", "FreeAccZ": negative("free_acceleration_down"), **forward_left_up("mag{}", "magnetic_field"),
        "Temperature": "temperature", "Pressure": "pressure", "latitude": "latitude", "longitude": "longitude",
        "altEllipsoid": "height", "velX": "velocity_east", "velY": "velocity_north",
        "velZ": negative("velocity_down")},
    "bosch_mm5.dbc": {"YawRate": "rate_z", "RollRate": "rate_x", "AX": "specific_force_x", "AY": "specific_force_y",
                      "AZ": "specific_force_z"},
    "bosch_mm7.dbc": {
        "YawRate": "rate_z", "RollRate": lambda sample, _: -sample["rate_x"], "PitchRate": "rate_y", "AX": "specific_force_x",
        "AY": "specific_force_y", "AZ": "specific_force_z", "Temperature": mm7_temperature, "HardwareIndex": 0, "CRC": crc8_j1850,
        "Counter": lambda sample, _: sample["counter"] % 16,
        "MM7_YawAy.RateStatus": mm7_failure(gyro_out_of_range("z")), "MM7_RollAx.RateStatus": mm7_failure(gyro_out_of_range("x")),
        "MM7_PitchAz.RateStatus": mm7_failure(gyro_out_of_range("y")), "MM7_YawAy.AccelerationStatus": mm7_failure(accelerometer_out_of_range("y")),
        "MM7_RollAx.AccelerationStatus": mm7_failure(accelerometer_out_of_range("x")),
        "MM7_PitchAz.AccelerationStatus": mm7_failure(accelerometer_out_of_range("z"))},
}


def require(condition, *what):
    if not condition:  # not `assert`, which PYTHONOPTIMIZE removes
        raise AssertionError(what)


def check_native(record, signals, is_fd):
    wanted = record["values"]
    for name, signal in signals.items():
        got = Decimal(signal.phys_value)
        if name == "time":
            # The classic frame carries microseconds modulo 2^32.
            modulus = Decimal(2) ** 64 if is_fd else Decimal(2) ** 32 * 1000
            require(got * 10**9 == wanted["time_ns"] % modulus, name, got, record)
        else:
            require(float(got) == float(wanted[name]), name, got, record)
        yield name, got


def saturated(wanted, signal, factor, offset):
    """The end of the signal's field where the value is beyond it."""
    bits = signal.size - 1 if signal.is_signed else signal.size
    ends = sorted((float(signal.factor * raw + signal.offset) * factor + offset) for raw in (-2**bits if signal.is_signed else 0, 2**bits - 1))
    return min(max(wanted, ends[0]), ends[1])


def check_table(record, frame, signals, data):
    sample, expected = record["sample"], EXPECTED[record["dbc"]]
    for name, signal in signals.items():
        wanted = expected.get(f"{frame.name}.{name}", expected.get(name))
        require(wanted is not None, "which number has", frame.name, name)
        if callable(wanted):
            wanted = wanted(sample, data)
        elif isinstance(wanted, str):
            wanted = sample[wanted]
        factor, offset = UNITS[signal.signal.unit]
        got = float(signal.phys_value) * factor + offset
        lsb = abs(float(signal.signal.factor)) * factor
        wanted = saturated(float(wanted), signal.signal, factor, offset)
        require(abs(got - float(wanted)) <= 0.5 * lsb * (1 + 1e-6) + 1e-12 * abs(got), frame.name, name, got, wanted, record)
        yield f"{frame.name}.{name}", got


def main(dump, folder):
    matrices = {path.name: canmatrix.formats.loadp_flat(str(path)) for path in sorted(pathlib.Path(folder).glob("*.dbc"))}
    products = {path.stem for path in pathlib.Path(folder).glob("*.cpp") if "signal_protocol<" in path.read_text()}
    require(len(products) >= 4, products)
    require(not (lacking := {f"{stem}.dbc" for stem in products} - matrices.keys()), "products without their file", lacking)
    seen = {}
    for line in subprocess.run([dump], check=True, capture_output=True, text=True).stdout.splitlines():
        record = json.loads(line, parse_float=Decimal)
        identifier, _, data = record["frame"].partition("#")
        is_fd = data.startswith("#")
        data = bytes.fromhex(data[2:] if is_fd else data)
        frame = matrices[record["dbc"]].frame_by_id(canmatrix.ArbitrationId(int(identifier, 16), extended=False))
        require(frame.is_fd == is_fd and frame.size == len(data), record)
        signals = frame.decode(data)
        checked = check_native(record, signals, is_fd) if "values" in record else check_table(record, frame, signals, data)
        for name, got in checked:
            seen.setdefault(record["dbc"], {}).setdefault(name, set()).add(got)
    require(seen.keys() == matrices.keys(), "no frames for", matrices.keys() - seen.keys())
    native = {"time", "counter", "temperature", "status"} | {
        f"{quantity}_{axis}" for quantity in ("gyro", "accel", "dtheta", "dvel") for axis in "xyz"}
    for name, matrix in matrices.items():
        if name in EXPECTED:
            require(seen[name].keys() == {f"{frame.name}.{signal.name}" for frame in matrix.frames for signal in frame.signals},
                    name, seen[name].keys())
        else:
            require(seen[name].keys() == native, name, seen[name].keys())
            require(all(len(values) > 50 for values in seen[name].values()), name)
        for frame in matrix.frames:
            for signal in frame.signals:
                require(signal.comment, name, signal.name)
                require(signal.unit or signal.name in ("counter", "status"), name, signal.name)
    print("decoded alike:", {name: len(values) for name, values in seen.items()}, "signals")


main(*sys.argv[1:])
