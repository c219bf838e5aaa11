"""Writers of ULog (docs.px4.io, "ULog File Format") and MCAP (mcap.dev/spec) with ROS 2 messages, which share nothing
with imud's."""
import struct
import zlib

from ulog_reader import MAGIC


def message(kind, body):
    return struct.pack("<Hc", len(body), kind) + body


def ulog(formats, subscriptions, data, offset=0):
    """Returns a log: formats by text, subscriptions (instance, number, name), data (number, bytes)."""
    log = MAGIC + b"\x01" + bytes(8) + message(b"B", bytes(8) + bytes([offset > 0]) + bytes(7) + struct.pack("<QQQ", offset, 0, 0))
    log += b"".join(message(b"F", text.encode()) for text in formats)
    log += b"".join(message(b"A", struct.pack("<BH", *ids) + name.encode()) for *ids, name in subscriptions)
    return log + b"".join(message(b"D", struct.pack("<H", number) + body) for number, body in data)


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value):
    value = value if isinstance(value, bytes) else value.encode()
    return struct.pack("<I", len(value)) + value


def ros_header(sec, nanosec, frame, order="<"):
    frame = frame.encode() + b"\0"
    return struct.pack(order + "iII", sec, nanosec, len(frame)) + frame


def mcap(messages, compression="", schema="sensor_msgs/msg/Imu", encoding="cdr", topics=("/imu/data",), crc=None):
    """Returns a file with a chunk. messages: (channel, log time, data); channels are numbered from 0."""
    chunk = record(3, struct.pack("<H", 7) + text(schema) + text("ros2msg") + text("float64 x"))
    for number, topic in enumerate(topics):
        chunk += record(4, struct.pack("<HH", number, 7) + text(topic) + text(encoding) + text(""))
    chunk += b"".join(record(5, struct.pack("<HIQQ", n, 0, time, time) + data) for n, time, data in messages)
    head = struct.pack("<QQQI", 0, 0, len(chunk), zlib.crc32(chunk) if crc is None else crc) + text(compression)
    magic = b"\x89MCAP0\r\n"
    return magic + record(1, text("ros2") + text("test")) + record(6, head + struct.pack("<Q", len(chunk)) + chunk) + \
        record(15, bytes(4)) + record(2, bytes(20)) + magic
