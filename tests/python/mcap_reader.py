"""A strict reader of MCAP files, written from mcap.dev/spec, which shares nothing with imud's writer."""
import ctypes
import json
import struct
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(0x0B, 0x10)


class Fields:
    def __init__(self, data):
        self.data, self.at = data, 0

    def number(self, kind):
        value, = struct.unpack_from("<" + kind, self.data, self.at)
        self.at += struct.calcsize("<" + kind)
        return value

    def bytes(self, kind="I"):
        size = self.number(kind)
        value = self.data[self.at:self.at + size]
        assert len(value) == size, "a field ends behind its record"
        self.at += size
        return value

    def text(self):
        return self.bytes().decode()

    def map(self, key, value):
        entries, result = Fields(self.bytes()), {}
        while entries.at < len(entries.data):
            name = key(entries)
            assert name not in result, name
            result[name] = value(entries)
        return result

    def end(self):
        assert self.at == len(self.data), "a record has more than its fields"


def records(data, begin, end):
    """Yields (opcode, offset, length, Fields)."""
    while begin < end:
        opcode, size = struct.unpack_from("<BQ", data, begin)
        assert begin + 9 + size <= end, "a record ends behind its section"
        yield opcode, begin, 9 + size, Fields(data[begin + 9:begin + 9 + size])
        begin += 9 + size


def decompress(data, size):
    """zstd, by the library itself: Debian's Python has no module for it."""
    zstd = ctypes.CDLL("libzstd.so.1")
    zstd.ZSTD_decompress.restype = ctypes.c_size_t
    out = ctypes.create_string_buffer(size + 1)
    done = zstd.ZSTD_decompress(out, ctypes.c_size_t(size + 1), data, ctypes.c_size_t(len(data)))
    assert done == size, "zstd"
    return out.raw[:size]


class Mcap:
    """schemas, channels, messages ((channel, sequence, log time, publish time, JSON)), metadata, chunks, statistics."""

    def __init__(self, data):
        assert data[:8] == MAGIC and data[-8:] == MAGIC
        footer = len(data) - 8 - 29
        assert data[footer] == FOOTER
        summary, offsets, crc = struct.unpack_from("<QQI", data, footer + 9)
        assert crc == zlib.crc32(data[summary:len(data) - 12]), "summary CRC"
        self.schemas, self.channels, self.metadata, self.messages, self.chunks = {}, {}, {}, [], []
        places, opcodes = {CHUNK: [], METADATA: []}, []
        for opcode, at, length, fields in records(data, 8, summary):
            opcodes.append(opcode)
            if opcode == HEADER:
                self.profile, self.library = fields.text(), fields.text()
            elif opcode == CHUNK:
                self.chunk(fields, at, length)
                continue
            elif opcode == MESSAGE_INDEX:
                assert opcodes[-2] == CHUNK
                assert fields.number("H") == 1
                index = Fields(fields.bytes())
                self.chunks[-1]["index"] = (at, length)
                for time, offset in self.chunks[-1].pop("messages"):
                    assert (index.number("Q"), index.number("Q")) == (time, offset)
                index.end()
            elif opcode == METADATA:
                name = fields.text()
                self.metadata[name] = fields.map(Fields.text, Fields.text)
                places[METADATA].append((at, length, name))
            elif opcode == DATA_END:
                assert fields.number("I") == zlib.crc32(data[:at]), "data section CRC"
                assert at + length == summary
            else:
                self.definition(opcode, fields)
            fields.end()
        assert opcodes[0] == HEADER and opcodes[-1] == DATA_END
        self.summary(data, summary, offsets, footer, places)

    def definition(self, opcode, fields):
        number = fields.number("H")
        if opcode == SCHEMA:
            assert number != 0
            table, value = self.schemas, (fields.text(), fields.text(), json.loads(fields.text()))
        else:
            assert opcode == CHANNEL, opcode
            schema = fields.number("H")
            assert schema in self.schemas
            table, value = self.channels, (schema, fields.text(), fields.text(), fields.map(Fields.text, Fields.text))
        assert table.setdefault(number, value) == value

    def chunk(self, fields, at, length):
        begin, end, size, crc = (fields.number(kind) for kind in "QQQI")
        compression, stored = fields.text(), fields.bytes("Q")
        fields.end()
        content = decompress(stored, size) if compression == "zstd" else stored
        assert compression in ("", "zstd") and len(content) == size and zlib.crc32(content) == crc
        messages = []
        for opcode, offset, _, message in records(content, 0, size):
            if opcode != MESSAGE:
                self.definition(opcode, message)
                continue
            channel, sequence, log_time, publish_time = (message.number(kind) for kind in "HIQQ")
            assert channel in self.channels
            self.messages.append((channel, sequence, log_time, publish_time, json.loads(message.data[message.at:])))
            messages.append((log_time, offset))
        assert (begin, end) == (min(messages)[0], max(time for time, _ in messages))
        self.chunks.append({"time": (begin, end), "place": (at, length), "compression": compression,
                            "sizes": (len(stored), size), "messages": messages})

    def summary(self, data, begin, offsets, footer, places):
        groups, chunks, metadata = {}, [], []
        before = dict(self.schemas), dict(self.channels)
        for opcode, at, length, fields in records(data, begin, offsets):
            assert opcode not in groups or groups[opcode][1] == at, "summary records are grouped by opcode"
            groups[opcode] = (groups.get(opcode, (at, 0))[0], at + length)
            if opcode == CHUNK_INDEX:
                time, place = (fields.number("Q"), fields.number("Q")), (fields.number("Q"), fields.number("Q"))
                index = fields.map(lambda f: f.number("H"), lambda f: f.number("Q"))
                size = fields.number("Q")
                chunks.append({"time": time, "place": place, "compression": fields.text(),
                               "sizes": (fields.number("Q"), fields.number("Q")), "index": (index[1], size)})
            elif opcode == METADATA_INDEX:
                metadata.append((fields.number("Q"), fields.number("Q"), fields.text()))
            elif opcode == STATISTICS:
                self.statistics = [fields.number(kind) for kind in "QHIIIIQQ"]
                self.counts = fields.map(lambda f: f.number("H"), lambda f: f.number("Q"))
            else:
                self.definition(opcode, fields)
            fields.end()
        assert chunks == self.chunks, "chunk indexes"
        assert metadata == places[METADATA]
        assert (self.schemas, self.channels) == before and SCHEMA in groups and CHANNEL in groups
        for opcode, _, _, fields in records(data, offsets, footer):
            assert opcode == SUMMARY_OFFSET
            group, first, length = (fields.number(kind) for kind in "BQQ")
            assert length == 0 or groups.pop(group) == (first, first + length)
        assert not groups
        times = [message[2] for message in self.messages] or [0]
        assert self.statistics == [len(self.messages), 1, 1, 0, len(places[METADATA]), len(chunks), min(times),
                                   max(times)], self.statistics
        assert self.counts == {1: len(self.messages)}
