"""Records as pcapng (draft-ietf-opsawg-pcapng): packets of several interfaces, with their times."""
import struct
from typing import NamedTuple

SECTION, INTERFACE, SIMPLE, ENHANCED = 0x0A0D0D0A, 1, 3, 6
BYTE_ORDER_MAGIC = 0x1A2B3C4D
IF_NAME, IF_TSRESOL, IF_TSOFFSET = 2, 9, 14
LONGEST_BLOCK = 1 << 28


class Interface(NamedTuple):
    name: str  # empty: it has none
    link_type: int  # LINKTYPE_ number: 147 to 162 USER, 227 SocketCAN
    options: dict  # all options of the block: code -> list of bytes


class Packet(NamedTuple):
    interface: Interface
    time_ns: int  # since the epoch of the record's clock; None for a simple packet block
    data: bytes
    options: dict  # code -> list of bytes; 2 has the direction in its lowest two bits: 1 in, 2 out


class Record(NamedTuple):
    interfaces: list
    packets: list  # in the order of the file
    is_cut_short: bool  # the file ends within a block, as that of a program that was killed

    def of(self, name):
        """Returns the packets of the interface of that name."""
        names = [interface.name for interface in self.interfaces]
        if name not in names:
            raise KeyError(f"there is no interface {name!r}; there are {', '.join(names)}")
        return [packet for packet in self.packets if packet.interface.name == name]


def load_record(path):
    """Returns the Record of a pcapng file. Raises ValueError, which names the fault, if it is none."""
    interfaces, packets = [], []
    order, section = None, []  # the byte order, and the interfaces of this section
    with open(path, "rb") as file:
        while True:
            at = file.tell()
            head = file.read(12)
            if not head:
                return Record(interfaces, packets, False)
            if at == 0 and head[:4] != struct.pack(">I", SECTION)[:len(head)]:
                raise ValueError(f"{path}: is no pcapng file; a pcap becomes one by `editcap -F pcapng IN OUT`")
            if len(head) < 12:
                return Record(interfaces, packets, True)
            if head[:4] == struct.pack(">I", SECTION):
                order = "<" if struct.unpack("<I", head[8:])[0] == BYTE_ORDER_MAGIC else ">"
                if struct.unpack(order + "I", head[8:])[0] != BYTE_ORDER_MAGIC:
                    raise ValueError(f"{path}: the section at byte {at} has no byte-order magic")
                section = []
            kind, size = struct.unpack(order + "II", head[:8])
            if size < 12 or size % 4 or size > LONGEST_BLOCK:
                raise ValueError(f"{path}: the block at byte {at} has the impossible length {size}")
            rest = file.read(size - 12)
            if len(rest) < size - 12:
                return Record(interfaces, packets, True)
            body, trailer = (head[8:] + rest)[:-4], (head[8:] + rest)[-4:]
            if struct.unpack(order + "I", trailer)[0] != size:
                raise ValueError(f"{path}: the block at byte {at} does not end with its length")
            try:
                if kind == INTERFACE:
                    section.append(_interface(body, order))
                    interfaces.append(section[-1][0])
                elif kind == ENHANCED:
                    packets.append(_packet(body, order, section))
                elif kind == SIMPLE:
                    length = min(struct.unpack_from(order + "I", body)[0], len(body) - 4)
                    packets.append(Packet(section[0][0], None, body[4:4 + length], {}))
            except (struct.error, IndexError, UnicodeDecodeError) as error:
                raise ValueError(f"{path}: the block at byte {at} is damaged: {error}") from error


def _options(data, order):
    options = {}
    at = 0
    while at + 4 <= len(data):
        code, length = struct.unpack_from(order + "HH", data, at)
        if code == 0:
            break
        options.setdefault(code, []).append(data[at + 4:at + 4 + length])
        at += 4 + (length + 3) // 4 * 4
    return options


def _interface(body, order):
    """Returns the interface, the number of its time units in a second, and its offset in s."""
    link_type, _, _ = struct.unpack_from(order + "HHI", body)
    options = _options(body[8:], order)
    resolution = options.get(IF_TSRESOL, [b"\x06"])[0][0]
    units = 1 << (resolution & 0x7F) if resolution & 0x80 else 10**resolution
    offset = struct.unpack(order + "q", options[IF_TSOFFSET][0])[0] if IF_TSOFFSET in options else 0
    name = options.get(IF_NAME, [b""])[0].decode().rstrip("\0")
    return Interface(name, link_type, options), units, offset


def _packet(body, order, section):
    number, high, low, captured, _ = struct.unpack_from(order + "IIIII", body)
    if captured > len(body) - 20:
        raise struct.error(f"{captured} captured bytes exceed it")
    interface, units, offset = section[number]
    time_ns = (high << 32 | low) * 1_000_000_000 // units + offset * 1_000_000_000
    return Packet(interface, time_ns, body[20:20 + captured], _options(body[20 + (captured + 3) // 4 * 4:], order))
