"""The CAN products: every message, signal, sign, axis, unit and scale, decoded by the vendors' documents and by CiA 301, SAE J1939 and
the DSDL of DroneCAN, as far as protocols/*/ and protocols/devices/ name them. usage: can_test.py IMUD"""
import pathlib
import struct
import tempfile

from bench import *  # noqa: F403


def by_id(sent):
    """The frames of each identifier, in order."""
    groups = {}
    for frame in sent:
        groups.setdefault(frame.id, []).append(frame)
    return groups


def expect(what, got, wanted):
    check(what, got == wanted, True, 0)


# --- imud's own frames: protocols/devices/native_can.cpp ---
def native_can(hz=200):
    groups = by_id(frames(f'protocol = "native-can"\nrate_hz = {hz}\ngyro.max_rad_per_s = 30\naccelerometer.max_m_per_s2 = 1000'))
    expect("native-can identifiers", sorted(groups), list(range(0x100, 0x107)))
    count = int(SECONDS * hz) + 1
    for k in range(count):
        t, t1 = k / hz, max(0, k - 1) / hz
        head = groups[0x100][k].data
        counter, time_us, temperature, status = struct.unpack("<BIhB", head)
        check("native-can head", (counter, time_us, temperature / 256, status), (k % 256, round(1e6 * t), TEMPERATURE, 0), 0)
        numbers = []
        for frame in range(1, 7):
            word = int.from_bytes(groups[0x100 + frame][k].data, "little")
            check("native-can counter", word >> 56, k % 256, 0)
            numbers += [(word >> shift & 0xFFFFFFF ^ 0x8000000) - 0x8000000 for shift in (0, 28)]
        for what, lsb, at, wanted in (("rate", 2**-22, 0, rate), ("force", 2**-17, 3, specific_force(t)),
                                      ("angle", 2**-27, 6, delta_angle(t1, t)), ("velocity", 2**-20, 9, delta_velocity(t1, t))):
            check(f"native-can {what}", scale(lsb, numbers[at:at + 3]), wanted, lsb)
    check("native-can samples", [len(group) for group in groups.values()], [count] * 7, 0)


# --- SAE J1939-71, and the high-resolution messages of ACEINNA's OpenIMU335RI: number of the parameter group, bits, LSB, offset ---
J1939 = {
    "ssi2": (0xF029, 24, 1 / 32768, -250), "ari": (0xF02A, 16, 1 / 128, -250), "accs": (0xF02D, 16, 0.01, -320),
    "ssi": (0xF013, 16, 0.002, -64), "ari_hr": (0xFF6B, 19, 1 / 1024, -250), "accs_hr": (0xFF6D, 19, 1 / 800, -320),
}
PRIORITY = {"ssi2": 3, "ari": 3, "accs": 2, "ssi": 3, "ari_hr": 3, "accs_hr": 2}


def j1939(order, signs, divider, address):
    types = ", ".join(f'"{name}"' for name in J1939)
    sent = frames(f"""protocol = "j1939"
[imu.device]
source_address = {address}
packet_types = [{types}]
packet_rate = {divider}
slot_order = "{order}"
axis_signs = "{signs}"
latency_ms = 2.5
""")
    expect("j1939 begins with its address claim", (sent[0].id, sent[0].extended), (0x18EEFF00 | address, True))
    expect("j1939 waits 250 ms after it", all(frame.time >= 0.25 for frame in sent[1:]), True)
    slots = (0, 1, 2) if order == "xyz" else (1, 0, 2)
    sign = (1, 1, 1) if signs == "ned" else (1, -1, -1)
    counts = {}
    for frame in sent[1:]:
        name = next(name for name, (number, *_) in J1939.items() if frame.id & 0x3FFFFFF == number << 8 | address)
        check(f"j1939 {name} priority", frame.id >> 26, PRIORITY[name], 0)
        counts[name] = counts.get(name, 0) + 1
        _, bits, lsb, offset = J1939[name]
        word = int.from_bytes(frame.data, "little")
        got = [(word >> i * bits & (1 << bits) - 1) * lsb + offset for i in range(2 if name == "ssi2" else 3)]
        _, pitch, roll = yaw_pitch_roll(Place(frame.time).dcm_PL)
        if name.startswith("ssi"):
            y, z = sign[1:]
            wanted = [y * pitch / DEG, roll / DEG, y * rate[1] / DEG][:len(got)]
        else:
            vector = scale(1 / DEG, rate) if name.startswith("ari") else specific_force(frame.time)
            wanted = [sign[axis] * vector[axis] for axis in slots]
        check(f"j1939 {name} {order} {signs} at {frame.time}", got, wanted, lsb)
        merits = {"ssi2": (50, 54), "ari": (48, 50, 52), "accs": (48, 50, 52), "ssi": (48, 50, 52)}.get(name, (57, 59, 61))
        check(f"j1939 {name} merits", [word >> bit & 3 for bit in merits], [0] * len(merits), 0)
        if not name.endswith("_hr"):
            check(f"j1939 {name} latency", frame.data[7] / 2, 2.5, 0)
    step = divider / 100
    check("j1939 messages", [counts[name] for name in J1939], [math.floor(SECONDS / step) - math.ceil(0.25 / step - 1e-9) + 1] * len(J1939), 1)


# --- CiA 301; numbers by the object dictionary, protocols/canopen/imud.eds ---
CANOPEN = {"rate": (2**-11, 2**-24), "specific_force": (2**-8, 2**-20), "delta_angle": (2**-17, 2**-30), "delta_velocity": (2**-13, 2**-24)}


def canopen(messages, hz, node):
    """`messages`: what TPDO1 to 4 have."""
    keys = "".join(f"""tpdo{i}_enabled = true
tpdo{i} = [{", ".join(f'"{entry}"' for entry in entries)}]
""" for i, entries in enumerate(messages, 1))
    sent = frames(f"""protocol = "canopen"
rate_hz = {hz}
gyro.max_rad_per_s = 30
accelerometer.max_m_per_s2 = 1000
[imu.device]
self_start = true
start_up_ms = 0
node_id = {node}
heartbeat_ms = 200
{keys}""")
    expect("canopen boots", (sent[0].id, sent[0].data), (0x700 + node, b"\0"))
    groups = by_id(sent[1:])
    expect("canopen identifiers", sorted(groups), [0x180 + 0x100 * i + node for i in range(len(messages))] + [0x700 + node])
    expect("canopen heartbeats", [(round(5 * frame.time), frame.data) for frame in groups[0x700 + node]],
           [(k, b"\x05") for k in range(1, int(5 * SECONDS) + 1)])
    for i, entries in enumerate(messages):
        sent = groups[0x180 + 0x100 * i + node]
        check("canopen samples", len(sent), int(SECONDS * hz) + 1, 1)
        first = round(sent[0].time * hz)
        for k, frame in enumerate(sent, first):
            t, t1 = k / hz, max(0, k - 1) / hz
            check("canopen time", frame.time, t, 1e-6)
            force = specific_force(t)
            data = Bytes(frame.data, "<")
            for entry in entries:
                name, form = entry.split(".")[0].rsplit("_", 1)
                form = {"i16": "h", "i32": "i", "f32": "f", "u8": "B", "u16": "H", "u32": "I", "u64": "Q"}[form]
                what = f"canopen {entry} at {t}"
                if name in CANOPEN:
                    vector = {"rate": rate, "specific_force": force, "delta_angle": delta_angle(t1, t),
                              "delta_velocity": delta_velocity(t1, t)}[name]
                    wanted = (vector["xyz".index(entry[-1])],) if "." in entry else vector
                    if k == first and name.startswith("delta"):  # the increments since the device began to send
                        data.take(form * len(wanted))
                    elif form == "f":
                        got = data.take(form * len(wanted))
                        check_floats(what, got, wanted if len(wanted) > 1 else wanted[0])
                    else:
                        lsb = CANOPEN[name][form == "i"]
                        got = data.take(form * len(wanted))
                        check(what, scale(lsb, got if len(wanted) > 1 else (got,)), wanted, lsb)
                elif name == "counter":
                    check(what, data.take(form), k % 256 ** struct.calcsize(form), 0)
                elif name == "status":
                    check(what, data.take(form), 0, 0)
                elif name == "temperature":
                    check(what, data.take(form) * (0.01 if form == "h" else 1), TEMPERATURE, 0)
                elif name == "time":
                    unit = {"H": 1e4, "I": 1e6, "Q": 1e9}[form]
                    check(what, data.take(form), round(unit * t) % 256 ** struct.calcsize(form), 0)
                elif name == "pressure":
                    check(what, data.take(form) * (0.01 if form == "I" else 1), Place(t).pressure, 0.011)
                else:
                    along = force[0 if name == "slope_long" else 1]
                    slope = math.asin(along / math.hypot(*force)) / DEG
                    check(what, data.take(form) * 0.01, slope, 0.01)
            expect("canopen lengths", data.at, len(frame.data))


# --- DroneCAN: the DSDL of its standard types. Data type id: CRC after the signature; None: always a single frame ---
DRONECAN = {1003: ("raw_imu", 0x4E3E), 1000: ("solution", 0x2055), 1002: ("magnetic_field", None), 1028: ("static_pressure", None),
            1029: ("static_temperature", None), 341: ("NodeStatus", None)}


def crc_ccitt(crc, data):
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def transfers(sent, node, priority):
    """The transfers: time, data type id, payload. Checks tails, transfer ids and CRCs."""
    next_id, open_payload = {}, {}
    for frame in sent:
        kind, tail = frame.id >> 8 & 0xFFFF, frame.data[-1]
        expect("dronecan node", (frame.extended, frame.id & 0xFF), (True, node))
        expect("dronecan priority", kind == 341 or frame.id >> 24 == priority, True)
        begins, ends, toggle = tail >> 7, tail >> 6 & 1, tail >> 5 & 1
        if begins:
            expect(f"dronecan transfer id of {kind}", tail & 31, next_id.get(kind, tail & 31))
            next_id[kind] = (tail + 1) % 32
            expect("dronecan unfinished transfer", kind in open_payload, False)
            open_payload[kind] = (0, b"")
        count, payload = open_payload.pop(kind)
        expect("dronecan toggle", toggle, count % 2)
        payload += frame.data[:-1]
        if not ends:
            expect("dronecan length", len(frame.data), 8)
            open_payload[kind] = (count + 1, payload)
            continue
        if count > 0:
            crc, payload = payload[:2], payload[2:]
            check(f"dronecan CRC of {kind}", int.from_bytes(crc, "little"), crc_ccitt(DRONECAN[kind][1], payload), 0)
        yield frame.time, kind, payload


def check_halves(what, got, wanted):
    """As check(), for float16: to half of the last digit of each."""
    for a, b in zip(got, wanted, strict=True):
        check(what, a, b, max(abs(b) * 2**-11, 3e-8) * 1.0001)


def dronecan(node, priority, rates):
    keys = "".join(f"{name}_hz = {hz}\n" for name, hz in rates.items())
    sent = frames(f"""protocol = "dronecan"
[imu.device]
node_id = {node}
priority = {priority}
sample_rate_hz = 1000
start_up_ms = 0
timestamp = "device"
sensor_id = 7
{keys}""")
    counts = {}
    for t, kind, payload in transfers(sent, node, priority):
        name = DRONECAN[kind][0]
        counts[name] = counts.get(name, 0) + 1
        data = Bytes(payload, "<")
        place = Place(t)
        if name in ("raw_imu", "solution"):
            check(f"dronecan {name} time", int.from_bytes(payload[:7], "little"), 1e6 * t, 0.5)
            data.at = 7
        if name == "raw_imu":
            interval = data.take("f")
            check_floats("dronecan interval", interval, 1 / rates[name] if counts[name] > 1 else interval)
            check_halves("dronecan raw_imu rate", data.take("3e"), rate)
            angle = data.take("3f")
            check_halves("dronecan raw_imu force", data.take("3e"), specific_force(t))
            velocity = data.take("3f")
            if counts[name] > 1:
                check_floats("dronecan raw_imu delta-angle", angle, delta_angle(t - interval, t))
                check_floats("dronecan raw_imu delta-velocity", velocity, delta_velocity(t - interval, t))
        elif name == "solution":
            x, y, z, w = data.take("4e")
            check("dronecan solution attitude", same_rotation((w, x, y, z)), same_rotation(quaternion(place.dcm_PL)), 5e-4)
            check("dronecan no covariance", data.take("B"), 0, 0)
            check_halves("dronecan solution rate", data.take("3e"), rate)
            check("dronecan no covariance", data.take("B"), 0, 0)
            check_halves("dronecan solution force", data.take("3e"), specific_force(t))
        elif name == "magnetic_field":
            check("dronecan sensor", data.take("B"), 7, 0)
            check("dronecan magnetic field", data.take("3e"), scale(1e4, times(place.dcm_PL, place.field_L)), 3e-4)
        elif name == "static_pressure":
            check("dronecan pressure", data.take("f"), place.pressure, 0.01)
            data.take("e")
        elif name == "static_temperature":
            check_halves("dronecan temperature", [data.take("e")], [TEMPERATURE + 273.15])
            data.take("e")
        else:
            uptime, state, _ = data.take("IBH")
            check("dronecan uptime", uptime, math.floor(t), 0)
            check("dronecan state", state & 0xE0, 0, 0)
        check(f"dronecan {name} length", data.at, len(payload), 0)
    for name, hz in rates.items():
        check(f"dronecan {name} messages", counts.get(name, 0), SECONDS * hz, 1)


# --- SBG Systems, sbgECom, doc/canProtocol.md: format, LSB ---
SBG = {0x110: ("<II", 1), 0x111: ("<6BH", 1), 0x120: ("<IHh", 1), 0x121: ("<3h", 0.01), 0x122: ("<3h", 0.001), 0x123: ("<3h", 0.01),
       0x124: ("<3h", 0.001), 0x130: ("<I", 1), 0x131: ("<4h", 1 / 32767), 0x132: ("<3h", 1e-4), 0x134: ("<2i", 1e-7), 0x135: ("<ih", 1e-3),
       0x137: ("<3h", 0.01), 0x139: ("<3h", 0.01)}


def sbg_can(hz):
    names = ("utc_0", "utc_1", "imu_info", "imu_accel", "imu_gyro", "imu_delta_vel", "imu_delta_angle", "ekf_info", "ekf_quat", "ekf_euler",
             "ekf_pos", "ekf_altitude", "ekf_vel_ned", "ekf_vel_body")
    sent = frames(f"""protocol = "sbg-can"
[imu.device]
output_rate_hz = {hz}
messages = [{", ".join(f'"{name}"' for name in names)}]
""")
    groups = by_id(sent)
    expect("sbg-can identifiers", sorted(groups), sorted(SBG))
    for what, group in groups.items():
        form, lsb = SBG[what]
        check(f"sbg-can {what:X} messages", len(group), SECONDS * hz + 1, 0)
        for k, frame in enumerate(group):
            t, t1 = k / hz, max(0, k - 1) / hz
            place, numbers = Place(t), struct.unpack(form, frame.data)
            yaw, pitch, roll = yaw_pitch_roll(place.dcm_PL)
            gps = GPS_START + t
            wanted = {
                0x110: (1e6 * t, 1e3 * (gps % 604800)), 0x111: (25, 1, 4, 4, 26, 22 + int(t), t % 1 * 1e4),
                0x120: (1e6 * t, 0x3FF, 100 * TEMPERATURE), 0x121: specific_force(t), 0x122: rate,
                0x123: scale(hz, delta_velocity(t1, t)), 0x124: rate, 0x130: (1e6 * t,), 0x131: same_rotation(quaternion(place.dcm_PL)),
                0x132: (roll, pitch, yaw), 0x134: (place.latitude / DEG, place.longitude / DEG), 0x135: (place.height, 0),
                0x137: place.v_L, 0x139: times(place.dcm_PL, place.v_L)}[what]
            if k == 0 and what in (0x123, 0x124):
                continue  # the first sample has no increments
            got = scale(lsb, numbers)
            check(f"sbg-can {what:X} at {t}", same_rotation(got) if what == 0x131 else got, wanted, lsb)


# --- Bosch MM7.10: Bosch's ROS 2 receiver ---
def crc_j1850(data):
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ 0xFF


def bosch_mm7(hz):
    sent = frames(f'protocol = "bosch-mm7"\n[imu.device]\noutput_rate_hz = {hz}\n')
    expect("bosch-mm7 order", [frame.id for frame in sent], [0x174, 0x178, 0x17C] * (int(SECONDS * hz) + 1))
    for k, frame in enumerate(sent):
        t, axis = k // 3 / hz, {0x174: (2, 1), 0x178: (0, 0), 0x17C: (1, 2)}[frame.id]
        turn, state, temperature, force, counter, crc = struct.unpack("<HBBHBB", frame.data)
        sign = -1 if frame.id == 0x178 else 1  # which Bosch's receiver negates again
        check("bosch-mm7 rate", turn * 0.005 - 163.84, sign * rate[axis[0]] / DEG, 0.005)
        check("bosch-mm7 acceleration", turn and force * 0.000127465 - 4.1768, specific_force(t)[axis[1]] / G0, 0.000127465)
        check("bosch-mm7 temperature", temperature, round(TEMPERATURE) + 50 if frame.id == 0x174 else 0, 1)
        check("bosch-mm7 status and counter", (state, counter), (0, k // 3 % 16), 0)
        check("bosch-mm7 CRC", crc, crc_j1850(frame.data[:7]), 0)


def bosch_mm5(hz):
    sent = frames(f'protocol = "bosch-mm5"\n[imu.device]\noutput_rate_hz = {hz}\nid_offset = 0x200\n')
    expect("bosch-mm5 order", [frame.id for frame in sent], [0x374, 0x378, 0x37C] * (int(SECONDS * hz) + 1))
    for k, frame in enumerate(sent):
        turn_axis, axis = {0x374: (2, 1), 0x378: (0, 0), 0x37C: (None, 2)}[frame.id]
        turn, reserved, force, also_reserved = struct.unpack("<HHHH", frame.data)
        if turn_axis is None:
            check("bosch-mm5 reserved", turn, 0, 0)
        else:
            check("bosch-mm5 rate", turn * 0.005 - 163.84, rate[turn_axis] / DEG, 0.005)
        check("bosch-mm5 acceleration", force * 0.000127465 - 4.1768, specific_force(k // 3 / hz)[axis] / G0, 0.000127465)
        check("bosch-mm5 reserved", (reserved, also_reserved), (0, 0), 0)


# --- Xsens MTi-600: the vendor's ROS driver; format, LSB ---
XSENS = {0x05: (">I", 1), 0x06: (">H", 1), 0x07: (">6BH", 1), 0x11: (">I", 1), 0x21: (">4h", 2**-15), 0x22: (">3h", 2**-7), 0x31: (">3hB", 1),
         0x32: (">3h", 2**-9), 0x33: (">4h", 1 / 32767), 0x34: (">3h", 2**-8), 0x35: (">3h", 2**-8), 0x51: (">h", 2**-8), 0x52: (">I", 2**-15),
         0x61: (">3h", 2**-9), 0x62: (">3h", 2**-8), 0x76: (">3h", 2**-6)}


def xsens_can(hz, ned):
    names = ["sample_time", "group_counter", "utc", "status_word", *(name + "_ned" * ned for name in ("quaternion", "euler")), "delta_v",
             "rate_of_turn", "delta_q", "acceleration", "free_acceleration", "temperature", "pressure", "rate_of_turn_hr", "acceleration_hr",
             "velocity"]
    groups = by_id(frames(f"""protocol = "xsens-can"
[imu.device]
output_rate_hz = {hz}
messages = [{", ".join(f'"{name}"' for name in names)}]
"""))
    expect("xsens-can identifiers", sorted(groups), sorted(XSENS))
    to_enu = ((0, 1, 0), (1, 0, 0), (0, 0, -1))
    case = ((1, 0, 0), (0, -1, 0), (0, 0, -1))  # forward, left, up
    for what, group in groups.items():
        form, lsb = XSENS[what]
        check(f"xsens-can {what:X} messages", len(group), SECONDS * hz + 1, 0)
        for k, frame in enumerate(group):
            if k == 0 and what in (0x31, 0x33):
                continue  # the first sample has no increments
            t, t1 = k / hz, max(0, k - 1) / hz
            place, numbers = Place(t), struct.unpack(form, frame.data)
            dcm = product(case, place.dcm_PL if ned else product(place.dcm_PL, to_enu))
            yaw, pitch, roll = yaw_pitch_roll(dcm)
            turned_by = RATE * (t - t1)
            turn, force = times(case, rate), times(case, specific_force(t))
            velocity_L, force_L = place.v_L, place.to_L(specific_force(t))
            wanted = {
                0x05: (1e4 * t,), 0x06: (k,), 0x07: (25, 1, 4, 4, 26, 22 + int(t), t % 1 * 1e4), 0x11: (7,),
                0x21: same_rotation(quaternion(dcm)), 0x22: scale(1 / DEG, (roll, pitch, yaw)), 0x31: times(case, delta_velocity(t1, t)),
                0x32: turn, 0x33: (math.cos(turned_by / 2), *scale(math.sin(turned_by / 2), times(case, AXIS))), 0x34: force,
                0x35: times(to_enu, (force_L[0], force_L[1], force_L[2] + G0)), 0x51: (TEMPERATURE,), 0x52: (place.pressure,), 0x61: turn,
                0x62: force, 0x76: times(to_enu, velocity_L)}[what]
            if what == 0x31:
                got, lsb = scale(2.0**-numbers[3], numbers[:3]), 2.0**-numbers[3]
            else:
                got = scale(lsb, numbers)
            tolerance = 0.02 if what == 0x35 else 0.01 if what == 0x52 else lsb  # gravity; the atmosphere
            check(f"xsens-can {what:X} at {t}", same_rotation(got) if what == 0x21 else got, wanted, tolerance)


# --- NASA NOS3 generic_imu: fsw/shared/generic_imu_device.c ---
def nos3_imu(hz):
    sent = frames(f'protocol = "nos3-imu"\n[imu.device]\nsample_rate_hz = {hz}\nwith_requests = true\nreply_id = 0x20\n')
    check("nos3-imu frames", len(sent), 6 * (SECONDS * hz + 1), 0)
    for k, (request, reply) in enumerate(zip(sent[::2], sent[1::2])):
        axis = k % 3
        expect("nos3-imu request", (request.id, request.data), (0x0F, bytes((0x80, 2 + axis))))
        expect("nos3-imu reply", reply.id, 0x20)
        force, turn = struct.unpack(">II", reply.data)
        check("nos3-imu acceleration", force / 214748364 - 10, specific_force(k // 3 / hz)[axis] / G0, 1 / 214748364)
        check("nos3-imu rate", turn / 5368709 - 400, rate[axis] / DEG, 1 / 5368709)


# --- A user's DBC file ---
scratch = tempfile.TemporaryDirectory(prefix="turntable")  # until the test ends


def dbc(hz):
    path = pathlib.Path(scratch.name) / "vehicle.dbc"
    path.write_text("""VERSION ""
BU_: imu host
BO_ 1536 Rates: 8 imu
 SG_ YawRate : 7|16@0- (0.01,0) [0|0] "deg/s" host
 SG_ RollRate : 20|12@1- (0.1,0) [0|0] "deg/s" host
 SG_ Alive : 35|4@1+ (1,0) [0|0] "" host
 SG_ Fixed : 40|8@1+ (1,0) [0|0] "" host
 SG_ Crc : 56|8@1+ (1,0) [0|0] "" host
BO_ 2566844928 Force: 8 imu
 SG_ Page M : 0|2@1+ (1,0) [0|0] "" host
 SG_ Ax m0 : 8|32@1- (1,0) [0|0] "m/s2" host
 SG_ Ay m1 : 15|24@0- (0.0001,0) [0|0] "g" host
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_ SG_ "GenSigStartValue" FLOAT 0 255;
BA_ "GenMsgCycleTime" BO_ 1536 20;
BA_ "GenSigStartValue" SG_ 1536 Fixed 165;
SIG_VALTYPE_ 2566844928 Ax : 1;
""")
    groups = by_id(frames(f"""protocol = "dbc"
rate_hz = {hz}
gyro.max_rad_per_s = 30
accelerometer.max_m_per_s2 = 1000
[imu.device]
dbc_file = "{path}"
signals = ["YawRate=rate_z_deg_per_s", "RollRate=-rate_x_deg_per_s", "Alive=alive_counter", "Ax=specific_force_x_m_per_s2",
           "Ay=specific_force_y_g"]
checksums = ["Crc=j1850"]
"""))
    expect("dbc identifiers", sorted(groups), [0x600, 0x18FEF200])
    check("dbc messages", [len(groups[0x600]), len(groups[0x18FEF200])], [SECONDS * 50 + 1, SECONDS * hz + 1], 1)
    for k, frame in enumerate(groups[0x600]):
        word = int.from_bytes(frame.data, "little")
        check("dbc yaw rate", struct.unpack(">h", frame.data[:2])[0] * 0.01, rate[2] / DEG, 0.01)
        check("dbc roll rate", ((word >> 20 & 0xFFF ^ 0x800) - 0x800) * 0.1, -rate[0] / DEG, 0.1)
        check("dbc alive counter, start value", (word >> 35 & 15, frame.data[5]), (k % 16, 165), 0)
        check("dbc CRC", frame.data[7], crc_j1850(frame.data[:7]), 0)
    for k, frame in enumerate(groups[0x18FEF200]):
        expect("dbc extended", frame.extended, True)
        force = specific_force(frame.time)
        check("dbc page", frame.data[0] & 3, k % 2, 0)
        if k % 2 == 0:
            check_floats("dbc Ax", struct.unpack("<f", frame.data[1:5])[0], force[0])
        else:
            check("dbc Ay", int.from_bytes(frame.data[1:4], "big", signed=True) * 1e-4, force[1] / G0, 1e-4)


native_can()
nos3_imu(100)
bosch_mm5(100)
xsens_can(100, True)
xsens_can(50, False)
dbc(100)
dronecan(42, 16, {"raw_imu": 100, "solution": 50, "magnetic_field": 20, "static_pressure": 10, "static_temperature": 5})
dronecan(125, 3, {"raw_imu": 500})
sbg_can(100)
bosch_mm7(100)
bosch_mm7(200)
canopen([("specific_force_i16", "counter_u16"), ("rate_i16", "counter_u8", "status_u8"), ("delta_angle_i16", "counter_u16"),
         ("delta_velocity_i16", "counter_u16")], 200, 10)
canopen([("rate_f32.x", "rate_f32.y"), ("rate_f32.z", "specific_force_f32.x"), ("specific_force_f32.y", "specific_force_f32.z"),
         ("temperature_i16", "time_u16", "time_u32")], 100, 127)
canopen([("rate_i32.x", "rate_i32.y"), ("rate_i32.z", "specific_force_i32.z"), ("specific_force_i32.x", "specific_force_i32.y"),
         ("slope_long_i16", "slope_lateral_i16", "pressure_u32")], 100, 1)
canopen([("delta_angle_i32.z", "delta_angle_i32.y"), ("delta_angle_i32.x", "delta_velocity_i32.x"),
         ("delta_velocity_i32.y", "delta_velocity_i32.z"), ("time_u64",)], 100, 64)
canopen([("delta_angle_f32.x", "delta_velocity_f32.y"), ("slope_long_i32", "slope_lateral_i32"), ("temperature_f32", "pressure_f32"),
         ("counter_u64",)], 100, 64)
for settings in (("xyz", "ned", 1, 128), ("j1939", "ned", 2, 200), ("xyz", "enu", 5, 129), ("j1939", "enu", 1, 130)):
    j1939(*settings)
finish()
