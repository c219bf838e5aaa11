"""Checks that imud.eds agrees with the device: every object, its type, access, default and mapping, and no others.

Usage: canopen_eds_test.py CANOPEN_SLAVE IMUD_EDS. An SDO client of its own asks the device.
"""
import configparser
import re
import struct
import subprocess
import sys

NODE = 10
# Of the data types in use: the format of struct, or None for a text.
TYPES = {0x03: "<h", 0x04: "<i", 0x05: "<B", 0x06: "<H", 0x07: "<I", 0x08: "<f", 0x09: None, 0x0C: "<IH", 0x1B: "<Q"}
NO_OBJECT, NO_SUBINDEX = 0x06020000, 0x06090011
WRITE_ONLY, READ_ONLY, TOO_LONG, NO_DATA = 0x06010001, 0x06010002, 0x06070012, 0x08000024
# Objects that do not take back what they have: they want a command.
COMMANDS = {0x1010: 0x08000020, 0x1011: 0x08000020}


def require(condition, *what):
    if not condition:  # not `assert`, which PYTHONOPTIMIZE removes
        raise AssertionError(what)


class Aborted(Exception):
    pass


class Client:
    def __init__(self, slave):
        self.process = subprocess.Popen([slave], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def line(self, text):
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().split()

    def request(self, data):
        answers = self.line(f"{0x600 + NODE:03X}#{bytes(data).ljust(8, bytes(1)).hex()}")
        require(len(answers) == 1 and answers[0].startswith(f"{0x580 + NODE:03X}#"), data, answers)
        answer = bytes.fromhex(answers[0][4:])
        require(len(answer) == 8, answers)
        if answer[0] == 0x80:
            raise Aborted(struct.unpack("<I", answer[4:])[0])
        return answer

    def upload(self, index, sub):
        answer = self.request(struct.pack("<BHB", 0x40, index, sub))
        require(struct.unpack("<HB", answer[1:4]) == (index, sub), answer)
        if answer[0] & 2:
            return answer[4:8 - (answer[0] >> 2 & 3)]
        size, data, toggle = struct.unpack("<I", answer[4:])[0], b"", 0
        while True:
            answer = self.request([0x60 | toggle])
            require(answer[0] & 0xF0 == toggle, answer)
            data += answer[1:8 - (answer[0] >> 1 & 7)]
            toggle ^= 0x10
            if answer[0] & 1:
                require(len(data) == size, data)
                return data

    def download(self, index, sub, data):
        if 1 <= len(data) <= 4:
            self.request(struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub) + data)
            return
        self.request(struct.pack("<BHBI", 0x21, index, sub, len(data)))
        toggle = 0
        for begin in range(0, max(len(data), 1), 7):
            part = data[begin:begin + 7]
            self.request(bytes([toggle | (7 - len(part)) << 1 | (begin + 7 >= len(data))]) + part)
            toggle ^= 0x10

    def aborted(self, call, *arguments):
        try:
            call(*arguments)
        except Aborted as abort:
            return abort.args[0]
        return None


def number(text):
    node, _, rest = text.partition("+")
    return NODE + int(rest, 0) if node == "$NODEID" else int(text, 0)


def entries(eds):
    """Yields (index, sub, section) of every object that has a value, by the lists of the file."""
    for kind in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        count = eds.getint(kind, "SupportedObjects")
        require(len(eds[kind]) == count + 1, kind)
        for i in range(1, count + 1):
            index = int(eds[kind][str(i)], 0)
            require((0x2000 <= index < 0x6000) == (kind == "ManufacturerObjects"), hex(index), kind)
            section = eds[f"{index:04X}"]
            if int(section["ObjectType"], 0) == 7:
                yield index, 0, section
                continue
            subs = [name for name in eds.sections() if re.fullmatch(f"{index:04X}sub[0-9A-F]+", name)]
            require(len(subs) == int(section["SubNumber"]), section.name)
            for name in subs:
                yield index, int(name.partition("sub")[2], 16), eds[name]


def is_error(index, sub):
    """Returns True for an entry of the history of errors, which is empty."""
    return index == 0x1003 and sub > 0


def check_value(client, index, sub, section):
    """Returns the value, as it has been uploaded; of an object without a value that can be read: b""."""
    where, layout = (hex(index), sub), TYPES[int(section["DataType"], 0)]
    code = client.aborted(client.upload, index, sub)
    if section["AccessType"] == "wo":
        require(code == WRITE_ONLY, where, code)
        return b""
    if is_error(index, sub):
        require(code == NO_DATA, where, code)
        return b""
    require(code is None, where, code)
    value = client.upload(index, sub)
    require(layout is None or len(value) == struct.calcsize(layout), where, value)
    if "DefaultValue" in section:
        text = section["DefaultValue"]
        if layout is None:
            require(value.decode() == text, where, value)
        elif layout == "<f":
            require(value == struct.pack("<f", float(text)), where, value, text)
        else:
            require(struct.unpack(layout, value)[0] == number(text), where, value, text)
    return value


def check_access(client, index, sub, section, value):
    """Writes the value that the object has."""
    where, access = (hex(index), sub), section["AccessType"]
    code = client.aborted(client.download, index, sub, value or b"\1")
    if access in ("ro", "const"):
        require(code == READ_ONLY, where, code)
    elif 0x1A00 <= index < 0x1A04 and (index < 0x1A02 or sub != 0):
        require(code == 0x08000022, where, code)  # the PDO is valid, or has its mapping
    else:
        require(code == (COMMANDS.get(index) if sub else None), where, code)
    if TYPES[int(section["DataType"], 0)] is not None:
        code = client.aborted(client.download, index, sub, bytes(len(value) + 2))
        require(code in (READ_ONLY, TOO_LONG), where, code)


def check_mapping(client, index, sub, section):
    """Writes an entry of TPDO4, which maps the object."""
    size = 0 if section["AccessType"] == "wo" or is_error(index, sub) else len(client.upload(index, sub))
    entry = struct.pack("<I", index << 16 | sub << 8 | (8 * size & 0xFF))
    code = client.aborted(client.download, 0x1A03, 1, entry)
    require(code == (None if section["PDOMapping"] == "1" else 0x06040041), hex(index), sub, code)


def check_absence(slave, known):
    """No other object exists: asks for subindex 0 of every index, and for every subindex of those that exist."""
    asked = [(index, 0) for index in range(0x10000)] + [(index, sub) for index, _ in known for sub in range(1, 256)]
    lines = "".join("60A#" + struct.pack("<BHBI", 0x40, *one, 0).hex() + "\n" for one in asked)
    run = subprocess.run([slave, "start_up_ms=0"], input=lines, capture_output=True, text=True, check=True)
    answers = run.stdout.splitlines()
    require(len(answers) == len(asked))
    indexes, absent = {index for index, _ in known}, 0
    for (index, sub), answer in zip(asked, answers):
        message = bytes.fromhex(answer.split()[-1][4:])
        code = struct.unpack("<I", message[4:])[0] if message[0] == 0x80 else None
        if (index, sub) in known:
            require(code == NO_DATA if is_error(index, sub) else code in (None, WRITE_ONLY), hex(index), sub, code)
        else:
            absent += 1
            require(code == (NO_SUBINDEX if index in indexes else NO_OBJECT), hex(index), sub, code)
    return absent


def main(slave, path):
    eds = configparser.RawConfigParser(strict=True)
    eds.optionxform = str
    with open(path, encoding="ascii") as file:
        eds.read_file(file)
    known = {}
    for index, sub, section in entries(eds):
        require((index, sub) not in known, hex(index), sub)
        known[index, sub] = section
    sections = {name for name in eds.sections() if re.match("[0-9A-F]{4}", name) and "sub" not in name}
    require(sections == {f"{index:04X}" for index, _ in known}, sections)
    identity = {"VendorNumber": (0x1018, 1), "ProductNumber": (0x1018, 2), "RevisionNumber": (0x1018, 3)}
    for key, place in identity.items():
        require(number(eds["DeviceInfo"][key]) == number(known[place]["DefaultValue"]), key)
    client = Client(slave)
    client.line("+100")
    values = {place: check_value(client, *place, section) for place, section in known.items()}
    for place, section in known.items():
        check_access(client, *place, section, values[place])
    client.download(0x1A03, 0, b"\0")
    for place, section in known.items():
        check_mapping(client, *place, section)
    kinds = [(section["AccessType"], section["PDOMapping"]) for section in known.values()]
    for kind in [("ro", "1"), ("rw", "0"), ("const", "0"), ("wo", "0")]:
        require(kinds.count(kind) > 0, kind)
    require(len(kinds) > 200, len(kinds))
    print(len(kinds), "objects agree;", check_absence(slave, known), "others are absent")


main(*sys.argv[1:])
