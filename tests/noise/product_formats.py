"""The bytes of products, decoded with NumPy by the vendors' documents. Nothing here is of imud's code.

A decoder reads whole frames of one size, a row for each, and returns {kind: (gyro, accelerometer)}: VALUES in rad/s and m/s^2 and
INCREMENTS in rad and m/s over their period, n x 3; None for what the product does not send. Signs of axes stay as they are sent.
"""
import numpy as np

G0 = 9.80665
FOOT = 0.3048
DEG = np.pi / 180
VALUES, INCREMENTS = "values", "increments"


def rows_of(data, begin, size):
    """Frames of one size, a row for each. The last may be cut off."""
    if not data.startswith(begin):
        raise ValueError(f"the output begins with {data[:8].hex()}, not with {begin.hex()}")
    frames = np.frombuffer(data[:len(data) // size * size], np.uint8).reshape(-1, size)
    if (frames[:, :len(begin)] != np.frombuffer(begin, np.uint8)).any():
        raise ValueError("a frame has another header than the first")
    return frames


def crc_rows(rows, bits, polynomial, start):
    """A CRC without reflection over each row."""
    top, mask = np.uint32(1 << bits - 1), np.uint32((1 << bits) - 1)
    table = np.arange(256, dtype=np.uint32) << np.uint32(bits - 8)
    for _ in range(8):
        table = np.where(table & top, table << np.uint32(1) ^ np.uint32(polynomial), table << np.uint32(1)) & mask
    crc = np.full(len(rows), start, np.uint32)
    for column in np.ascontiguousarray(rows.T):
        crc = (crc << np.uint32(8) & mask) ^ table[(crc >> np.uint32(bits - 8)) ^ column]
    return crc


def require(what, holds):
    if not np.all(holds):
        raise ValueError(f"{what} is wrong in {np.count_nonzero(~holds)} of {holds.size} frames")


def numbers(rows, first, dtype, count=3):
    dtype = np.dtype(dtype)
    return rows[:, first:first + count * dtype.itemsize].copy().view(dtype).astype(float)


def stim300(data, hz, gyro=INCREMENTS, accelerometer=INCREMENTS):
    """TS1524 revision 31: datagram 0x91, 24 bits of 2^-14 deg/s or 2^-21 deg, of 2^-19 g or 2^-22 m/s (10 g), a counter of samples
    at 2 kHz."""
    frames = rows_of(data, b"\x91", 28)
    require("the CRC", crc_rows(frames[:, :24], 32, 0x04C11DB7, 0xFFFFFFFF) == frames[:, 24:].copy().view(">u4")[:, 0])
    require("a status", (frames[:, 10] == 0) & (frames[:, 20] == 0))
    require("the counter", np.diff(frames[:, 21]) == np.uint8(2000 // hz))

    def three(first):
        bytes_ = frames[:, first:first + 9].reshape(-1, 3, 3).astype(np.int32)
        raw = bytes_[:, :, 0] << 16 | bytes_[:, :, 1] << 8 | bytes_[:, :, 2]
        return (raw ^ 0x800000) - 0x800000
    made = {VALUES: [None, None], INCREMENTS: [None, None]}
    made[gyro][0] = three(1) * (DEG / (2**14 if gyro == VALUES else 2**21))
    made[accelerometer][1] = three(11) * (G0 / 2**19 if accelerometer == VALUES else 2.0**-22)
    return made


def vectornav(data, hz):
    """Binary output of the IMU group's DeltaTheta (s, then deg), DeltaVel (m/s), Accel (m/s^2) and AngularRate (rad/s), as floats."""
    frames = rows_of(data, bytes((0xFA, 0x04, 0xC0, 0x06)), 58)
    require("the CRC", crc_rows(frames[:, 1:], 16, 0x1021, 0) == 0)
    found = numbers(frames, 4, "<f4", 13)
    require("the time step", abs(found[1:, 0] - 1 / hz) < 1e-6)
    return {VALUES: (found[:, 10:13], found[:, 7:10]), INCREMENTS: (found[:, 1:4] * DEG, found[:, 4:7])}


def vectornav_text(data, _):
    """VNYMR: yaw, pitch, roll, magnetic field, acceleration (m/s^2, 0.001), rate (rad/s, 1e-6), each number of a fixed width."""
    rows = rows_of(data, b"$VNYMR,", 122)
    hexadecimal = np.frombuffer(b"0123456789ABCDEF", np.uint8)
    checksum = np.bitwise_xor.reduce(rows[:, 1:117], axis=1)
    require("the checksum", (rows[:, 118] == hexadecimal[checksum >> 4]) & (rows[:, 119] == hexadecimal[checksum & 15]))

    def three(first, width):
        return np.stack([rows[:, at:at + width].copy().view(f"S{width}")[:, 0].astype(float)
                         for at in range(first, first + 3 * (width + 1), width + 1)], axis=1)
    return {VALUES: (three(85, 10), three(61, 7)), INCREMENTS: (None, None)}


def mip(data, _):
    """Sensor data (0x80) of four fields: acceleration (0x04, g), rate (0x05, rad/s), delta angle (0x07, rad) and delta velocity (0x08,
    g s), of 14 bytes each."""
    frames = rows_of(data, bytes((0x75, 0x65, 0x80, 56, 14, 0x04)), 62)
    require("a field", (frames[:, [18, 32, 46]] == 14).all(axis=1) & (frames[:, [19, 33, 47]] == (5, 7, 8)).all(axis=1))
    a = np.cumsum(frames[:, :60], axis=1, dtype=np.uint32)
    require("the checksum", (a[:, -1] % 256 == frames[:, 60]) & (np.sum(a, axis=1) % 256 == frames[:, 61]))
    return {VALUES: (numbers(frames, 20, ">f4"), numbers(frames, 6, ">f4") * G0),
            INCREMENTS: (numbers(frames, 34, ">f4"), numbers(frames, 48, ">f4") * G0)}


def hg4930(data, _):
    """Performance and Installation Manual: five control messages (0E 01, 20 bytes), then an inertial message (0E 02, 44 bytes) with the
    increments since the last one; rates in 600 * 2^-20 rad/s, 600 * 2^-14 ft/s^2, increments in 2^-33 rad and 2^-27 ft/s."""
    rows = rows_of(data, b"\x0E\x01", 144)
    messages = [rows[:, 20 * i:20 * i + 20] for i in range(5)] + [rows[:, 100:]]
    for i, message in enumerate(messages):
        require("a header", (message[:, 0] == 0x0E) & (message[:, 1] == (2 if i == 5 else 1)))
        words = message.copy().view("<u2")
        require("the checksum", words[:, :-1].sum(axis=1, dtype=np.uint16) == words[:, -1])

    def values(first, lsb):
        return np.stack([numbers(message, first, "<i2") for message in messages], axis=1).reshape(-1, 3) * lsb
    return {VALUES: (values(2, 600 / 2**20), values(8, 600 / 2**14 * FOOT)),
            INCREMENTS: (numbers(rows, 118, "<i4") * 2.0**-33, numbers(rows, 130, "<i4") * (2.0**-27 * FOOT))}


def kvh1750(data, _, gyro=INCREMENTS):
    """Format A: increments of angle (rad) or rates (rad/s), and specific forces in g, as floats; a status of good sensors."""
    frames = rows_of(data, bytes((0xFE, 0x81, 0xFF, 0x55)), 36)
    require("the CRC", crc_rows(frames[:, :32], 32, 0x04C11DB7, 0xFFFFFFFF) == frames[:, 32:].copy().view(">u4")[:, 0])
    require("the status", frames[:, 28] == 0x77)
    turn, force = numbers(frames, 4, ">f4"), numbers(frames, 16, ">f4") * G0
    return {VALUES: (turn if gyro == VALUES else None, force), INCREMENTS: (turn if gyro == INCREMENTS else None, None)}


def novatel_raw(data, _):
    """RAWIMUSX of a STIM300: increments in 2^-22 m/s and 2^-21 deg. The CRC-32 is not computed."""
    frames = rows_of(data, bytes((0xAA, 0x44, 0x13, 40, 0xB6, 0x05)), 56)
    require("the status", (frames[:, 24:28] == 0).all(axis=1))
    return {VALUES: (None, None), INCREMENTS: (numbers(frames, 40, "<i4") * (DEG / 2**21), numbers(frames, 28, "<i4") * 2.0**-22)}


def xsens(data, _):
    """MTData2 with counter, time, acceleration (m/s^2), rate (rad/s) and status, floats; the sum of all bytes but the first is 0."""
    frames = rows_of(data, bytes((0xFA, 0xFF, 0x36, 49)), 54)
    require("the checksum", frames[:, 1:].sum(axis=1, dtype=np.uint8) == 0)
    require("a field", (frames[:, 16:19] == (0x40, 0x20, 12)).all(axis=1) & (frames[:, 31:34] == (0x80, 0x20, 12)).all(axis=1))
    return {VALUES: (numbers(frames, 34, ">f4"), numbers(frames, 19, ">f4")), INCREMENTS: (None, None)}


def sbg(data, _):
    """sbgECom's IMU_SHORT: specific forces in 2^-20 m/s^2, rates in 2^-26 rad/s. The CRC is not computed."""
    frames = rows_of(data, bytes((0xFF, 0x5A, 0x2C, 0x00, 32, 0)), 41)
    require("the status", frames[:, 10:12].copy().view("<u2")[:, 0] == 0x3FF)
    require("the end", frames[:, 40] == 0x33)
    return {VALUES: (numbers(frames, 24, "<i4") * 2.0**-26, numbers(frames, 12, "<i4") * 2.0**-20), INCREMENTS: (None, None)}
