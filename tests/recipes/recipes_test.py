"""Each recipe of tools/examples, run as it is written, before a host that sends what the flight computer's driver sends. The file
of the same name beside this one has what that driver requires, and where this is written. Time is the device's own, so that a
slow machine changes nothing. usage: recipes_test.py IMUD IMU_TRUTH"""
import os
import pathlib
import re
import select
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
import tomllib

HERE = pathlib.Path(__file__).parent
RECIPES = HERE.parents[1] / "tools/examples"
SPEEDS = {115200: termios.B115200, 921600: termios.B921600}
PATIENCE = 60.0  # s, for any answer
SECONDS = 3.0    # of the device's time that are examined


class Fault(Exception):
    pass


# --- Framing: generators of (name of the packet as hexadecimal text, its bytes) ---
def mip_packets(data):
    at = 0
    while (at := data.find(b"\x75\x65", at)) >= 0 and at + 4 <= len(data) and at + data[at + 3] + 6 <= len(data):
        end = at + data[at + 3] + 4
        a = c = 0
        for byte in data[at:end]:
            a = a + byte & 0xFF
            c = c + a & 0xFF
        if bytes((a, c)) != data[end:end + 2]:
            at += 1
            continue
        yield f"{data[at + 2]:02X}", data[at + 4:end]
        at = end + 2


def mip_fields(payload):
    at = 0
    while at + 2 <= len(payload) and payload[at] >= 2:
        yield f"{payload[at + 1]:02X}", payload[at + 2:at + payload[at]]
        at += payload[at]


def table_entry(byte):
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


CRC16 = [table_entry(byte) for byte in range(256)]


def crc16(data, crc=0):
    for byte in data:
        crc = crc << 8 & 0xFFFF ^ CRC16[crc >> 8 ^ byte]
    return crc


def vectornav_packets(data, wanted):
    at = 0
    while (at := data.find(b"\xFA", at)) >= 0:
        for match, size in wanted:
            if data.startswith(bytes.fromhex(match), at + 1) and at + size <= len(data) and crc16(data[at + 1:at + size]) == 0:
                yield match, data[at + 1 + len(match) // 2:at + size]
                at += size - 1
                break
        at += 1


def stim300_packets(data, wanted):
    for match, size in wanted:
        at = 0
        while (at := data.find(bytes.fromhex(match), at)) >= 0:
            if at + 2 * size <= len(data) and data[at + size] in (data[at], 0x0D):
                yield match, data[at + 1:at + size]
                at += size
            else:
                at += 1


def dronecan_packets(datagrams):
    """Whole transfers of the messages: DroneCAN specification, CAN bus transport layer."""
    transfers = {}
    for identifier, data in datagrams:
        name, tail = str(identifier >> 8 & 0xFFFF), data[-1]
        if tail & 0x80:
            transfers[name] = b""
        if name in transfers:
            transfers[name] += data[:-1]
            if tail & 0x40:
                payload = transfers.pop(name)
                yield name, payload[2:] if not tail & 0x80 else payload


# --- The flight computer ---
def port_of_truth(log, daemon):
    """The UDP port that the system has chosen for the truth, by the daemon's log, once it is ready."""
    deadline = time.monotonic() + PATIENCE
    while daemon.poll() is None and time.monotonic() < deadline:
        if found := re.search(r" ready, .*truth\.port is udp:127\.0\.0\.1:(\d+)[,\n]", pathlib.Path(log).read_text(errors="replace")):
            return int(found.group(1))
        time.sleep(0.02)
    raise Fault("imud has not begun")


class Host:
    def __init__(self, path):
        deadline = time.monotonic() + PATIENCE
        while not os.path.islink(path):
            if time.monotonic() > deadline:
                raise Fault("the pty is not there")
            time.sleep(0.02)
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.data = b""
        self.is_stopped = False

    def read_until_stopped(self):
        while not self.is_stopped:
            self.read(0.1)

    def set_speed(self, baud):
        attributes = termios.tcgetattr(self.fd)
        attributes[0] = attributes[1] = attributes[3] = 0
        attributes[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        attributes[4] = attributes[5] = SPEEDS[baud]
        termios.tcsetattr(self.fd, termios.TCSANOW, attributes)

    def raw(self):
        attributes = termios.tcgetattr(self.fd)
        attributes[0] = attributes[1] = attributes[3] = 0
        termios.tcsetattr(self.fd, termios.TCSANOW, attributes)

    def read(self, seconds):
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if select.select([self.fd], [], [], left)[0]:
                try:
                    self.data += os.read(self.fd, 65536)
                except OSError:
                    time.sleep(left)  # imud has ended: its log says why
                return

    def ask(self, request, is_answer):
        """Sends a request each 500 ms until its answer comes."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            self.data = b""
            os.write(self.fd, request)
            again = time.monotonic() + 0.5
            while time.monotonic() < again:
                self.read(0.05)
                if is_answer(self.data):
                    return
        raise Fault(f"no answer to {request!r}")


class Bus:
    """ArduPilot's end of its multicast CAN, libraries/AP_HAL_SITL/CAN_Multicast.cpp."""
    def __init__(self, interface):
        group = socket.inet_aton("239.65.82.8")
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(("239.65.82.8", 57732))
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                               struct.pack("=4s4si", group, bytes(4), socket.if_nametoindex(interface)))
        self.data = []
        self.is_stopped = False

    def read(self, seconds):
        if select.select([self.socket], [], [], seconds)[0]:
            datagram = self.socket.recv(80)
            magic, crc, flags, identifier = struct.unpack("<HHHI", datagram[:10])
            if (magic, crc, flags) != (0x2934, crc16(datagram[4:], 0xFFFF), 0) or not identifier & 1 << 31:
                raise Fault(f"datagram {datagram.hex()}")
            if not identifier & 0x80:  # a message
                self.data.append((identifier & 0x1FFFFFFF, datagram[10:]))

    def read_until_stopped(self):
        while not self.is_stopped:
            self.read(0.1)


def mip_request(text):
    octets = bytes.fromhex(text.replace(" ", ""))
    packet = b"\x75\x65" + octets[:1] + bytes((len(octets) - 1,)) + octets[1:]
    a = c = 0
    for byte in packet:
        a = a + byte & 0xFF
        c = c + a & 0xFF
    return packet + bytes((a, c)), octets


def negotiate(host, link, wanted):
    if link == "dronecan":
        return
    speeds = wanted.get("baud", [])
    if speeds:
        host.set_speed(speeds[0])
    else:
        host.raw()
    for text in wanted.get("host", []):
        if link == "vectornav":
            checksum = 0
            for character in text.encode():
                checksum ^= character
            first_two = "$" + ",".join(text.split(",")[:2])
            host.ask(f"${text}*{checksum:02X}\r\n".encode(), lambda data, head=first_two.encode(): head in data)
            changes = text.startswith("VNWRG,05,")
        elif link == "mip":
            request, octets = mip_request(text)
            changes = octets[0] == 0x0C and octets[2] == 0x40

            def acknowledged(data, octets=octets):
                return any(name == f"{octets[0]:02X}" and ("F1", bytes((octets[2], 0))) in list(mip_fields(payload))
                           for name, payload in mip_packets(data))
            host.ask(request, acknowledged)
        else:
            host.ask(text.encode() + b"\r", lambda data: b"\xBC" in data or b"\xBD" in data)
            changes = False
        if changes:
            host.set_speed(speeds[1])


# --- Checks ---
def collect(link, wanted, data):
    """Returns the packets by name: lists of (bytes, device's time in s of the clock before it)."""
    expected = [(packet["match"], packet.get("size", 0)) for packet in wanted["packet"]]
    frames = {"mip": lambda: mip_packets(data), "vectornav": lambda: vectornav_packets(data, expected),
              "stim300": lambda: stim300_packets(data, expected),
              "dronecan": lambda: dronecan_packets(list(data))}[link]()
    packets = {name: [] for name, _ in expected}
    now = None
    counter = None
    for name, payload in frames:
        own = None
        if link == "stim300":
            step = payload[-7] - counter & 0xFF if counter is not None else 0  # 2000 in a second
            counter = payload[-7]
            own = now = (now or 0.0) + step / 2000
        elif name == wanted["clock"]:
            if link == "dronecan":
                own = int.from_bytes(payload[:7], "little") / 1e6
            elif link == "vectornav":
                own = struct.unpack_from("<Q", payload, wanted.get("time_at", 0))[0] / 1e9
            else:
                fields = dict(mip_fields(payload))
                kind = wanted.get("time", "D3")
                own = None
                if kind in fields:
                    own = struct.unpack(">Q", fields[kind][:8])[0] / 1e9 if kind == "D5" else struct.unpack(">d", fields[kind][:8])[0]
            now = own if own is not None else now
        if name in packets:
            packets[name].append((payload, now, own))
    return packets


def median_step(times):
    return sorted(b - a for a, b in zip(times, times[1:]))[(len(times) - 1) // 2]


def count_by_clock(found, clock_times, tick):
    """Returns how many packets came in whole intervals of the clock, and these intervals. A host that is late has gaps."""
    whole = {a for a, b in zip(clock_times, clock_times[1:]) if b - a < 1.5 * tick}
    return sum(now in whole for _, now, _ in found), len(whole)


def examine(link, wanted, packets):
    clock = wanted.get("clock", wanted["packet"][0]["match"])
    clock_times = [own for _, _, own in packets[clock] if own is not None]
    if len(clock_times) < 10:
        raise Fault(f"{len(clock_times)} times in packets {clock}")
    tick = median_step(clock_times)
    for packet in wanted["packet"]:
        name = packet["match"]
        found = [one for one in packets[name] if one[1] is not None]
        if len(found) < 2:
            raise Fault(f"{len(packets[name])} packets {name}")
        if "fields" in packet:
            for payload, _, _ in found:
                has = [field for field, _ in mip_fields(payload)]
                missing = [field for field in packet["fields"] if field not in has]
                if missing:
                    raise Fault(f"packet {name} lacks the fields {missing}")
        if link == "dronecan" and {len(payload) for payload, _, _ in found} != {packet["size"]}:
            raise Fault(f"message {name} has not {packet['size']} bytes")
        if "state" in packet:
            states = {struct.unpack(">H", dict(mip_fields(payload))["10"][:2])[0] for payload, _, _ in found}
            if states != {packet["state"]}:
                raise Fault(f"packet {name}: states {states}, not {packet['state']}")
        times = [one[2] for one in found]
        if None not in times:
            shortest = interval = median_step(times)
            slack = 0.01
        else:  # without a time of its own: by the number of packets of the clock meanwhile
            count, ticks = count_by_clock(found, clock_times, tick)
            interval, shortest = tick * ticks / max(count, 1), tick * ticks / (count + 1)
            slack = 0.1
        if "longest_ms" in packet and 1e3 * shortest > packet["longest_ms"]:
            raise Fault(f"packet {name} each {1e3 * interval:.1f} ms, not within {packet['longest_ms']}")
        if "rate_hz" in packet and abs(interval * packet["rate_hz"] - 1) > slack:
            raise Fault(f"packet {name} at {1 / interval:.1f} Hz, not {packet['rate_hz']}")
        if "rounded_to_ms" in packet:
            step = packet["rounded_to_ms"]
            to_border = abs((1e3 * interval + step / 2) % step)
            if min(to_border, step - to_border) < packet["least_to_border_ms"]:
                raise Fault(f"packet {name} each {1e3 * interval:.1f} ms, which is rounded to {step} ms up and down")


def span(link, wanted, data):
    times = [own for packets in collect(link, wanted, data).values() for _, own, _ in packets if own is not None]
    return max(times) - min(times) if times else 0.0


def run(name, programs, faults):
    wanted = tomllib.loads((HERE / f"{name}.toml").read_text())
    link = wanted["link"]
    processes = []
    with tempfile.TemporaryDirectory() as folder, open(f"{folder}/log", "wb") as log:
        try:
            # An automatic delay is raised when truth is late, and the device's time is a few per cent slower meanwhile.
            changes = ["truth.port=udp:127.0.0.1:0", "truth.delay_ms=500"]
            if link == "dronecan":  # another bus than that of a user, on an interface that is always there
                changes.append(f"imu.0.port=canmcast:8?bitrate=1000000&interface={wanted['interface']}")
            processes.append(subprocess.Popen([programs[0], "run", str(RECIPES / f"{name}.toml")] +
                                              [word for change in changes for word in ("--set", change)], cwd=folder,
                                              stdout=log, stderr=log))
            port = port_of_truth(log.name, processes[0])
            processes.append(subprocess.Popen([programs[1], "turntable", "--to", f"udp:127.0.0.1:{port}", "--rate", "250", "--for",
                                               "1000"], stdout=log, stderr=log))
            host = Bus(wanted["interface"]) if link == "dronecan" else Host(f"{folder}/imu1")
            negotiate(host, link, wanted)
            end = time.monotonic() + wanted["skip"]
            while time.monotonic() < end:
                host.read(0.1)
            host.data = host.data[:0]
            end = time.monotonic() + PATIENCE
            reader = threading.Thread(target=host.read_until_stopped)  # a pty holds 20 kB only
            reader.start()
            try:
                while span(link, wanted, host.data) < SECONDS:
                    if time.monotonic() > end:
                        raise Fault(f"{len(host.data)} bytes, and less than {SECONDS} s of its time")
                    time.sleep(0.5)
            finally:
                host.is_stopped = True
                reader.join()
            examine(link, wanted, collect(link, wanted, host.data))
        except Fault as fault:
            log.flush()
            text = pathlib.Path(f"{folder}/log").read_text(errors="replace")[-600:]
            faults.append(f"{name}: {fault}\n{text}")
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait()


def main():
    programs = [str(pathlib.Path(path).resolve()) for path in sys.argv[1:3]]
    only = sys.argv[3:]
    names = sorted(path.stem for path in RECIPES.glob("*.toml"))
    requirements = sorted(path.stem for path in HERE.glob("*.toml"))
    faults = []
    if names != requirements:
        faults.append(f"recipes {names}, but requirements of {requirements}")
    ran = 0
    for name in only or names:
        # While the machine is held up, the simulator's time and thus the device's is some per cent slow. A rate that is
        # wrong is so each time.
        for _ in range(3):
            found = []
            run(name, programs, found)
            if not any(" Hz, not " in fault for fault in found):
                break
        faults += found
        print(name, flush=True)
        ran += 1
    print("\n".join(faults))
    print(f"{ran} recipes, {len(faults)} faults")
    sys.exit(1 if faults or ran < (len(only) or 9) else 0)


if __name__ == "__main__":
    main()
