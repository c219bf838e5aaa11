"""A reader of ULog files, written from PX4's guide ("ULog File Format"), which shares nothing with imud's writer."""
import struct

import numpy

MAGIC = b"ULog\x01\x12\x35"
TYPES = {"int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
         "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "u1", "char": "S1"}


def field(text):
    """Returns the dtype of "float[3] gyro_rad"."""
    kind, name = text.split(" ")
    kind, _, size = kind.partition("[")
    return (name, TYPES[kind], (int(size[:-1]),)) if size else (name, TYPES[kind])


class Ulog:
    """start_us, info (by key), arrays (by message name): structured arrays. Raises AssertionError at any fault."""

    def __init__(self, data):
        assert data[:7] == MAGIC and data[7] <= 1, data[:8]
        self.start_us, = struct.unpack_from("<Q", data, 8)
        self.info, formats, names, rows, kinds = {}, {}, {}, {}, ""
        at = 16
        while at < len(data):
            size, kind = struct.unpack_from("<Hc", data, at)
            body = data[at + 3:at + 3 + size]
            assert len(body) == size, "the file ends within a message"
            at += 3 + size
            kinds += kind.decode() if kind.decode() != kinds[-1:] else ""
            if kind == b"B":
                assert kinds == "B", "flag bits are the first message"
                assert size >= 40 and not any(body), body
            elif kind in b"IM":
                is_continued, body = (body[0], body[1:]) if kind == b"M" else (0, body)
                key, value = body[1:1 + body[0]].decode(), body[1 + body[0]:]
                typed, name = key.split(" ")
                if typed.startswith("char["):
                    assert typed == f"char[{len(value)}]", typed
                    before = self.info[name] if is_continued else b""
                    self.info[name] = before + value
                else:
                    self.info[name] = numpy.frombuffer(value, TYPES[typed])[0]
            elif kind == b"F":
                name, fields = body.decode().split(":")
                assert fields.endswith(";") and fields.startswith("uint64_t timestamp;"), fields
                formats[name] = numpy.dtype([field(text) for text in fields[:-1].split(";")
                                             if not text.split(" ")[1].startswith("_padding")])
            elif kind == b"A":
                instance, number = struct.unpack_from("<BH", body)
                name = body[3:].decode()
                assert instance == 0 and number not in names and name in formats, name
                names[number], rows[number] = name, []
            elif kind == b"D":
                number, = struct.unpack_from("<H", body)
                assert formats[names[number]].itemsize <= size - 2, names[number]
                rows[number].append(body[2:2 + formats[names[number]].itemsize])
            else:
                raise AssertionError(f"a message {kind}")
        assert not any(kind in kinds[kinds.find("A"):] for kind in "BFIM" if "A" in kinds), kinds
        self.info = {name: value.decode() if isinstance(value, bytes) else value for name, value in self.info.items()}
        self.arrays = {name: numpy.frombuffer(b"".join(rows[n]), formats[name]) for n, name in names.items()}
