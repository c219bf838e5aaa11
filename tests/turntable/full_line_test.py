"""Three products at once, each at its largest load, on ptys paced at 921600 bit/s. The client checks that no frame is torn, and
that none is lost unless the machine delays imud or this client.
usage: full_line_test.py IMUD IMU_TRUTH [SECONDS]"""
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import time
import tty
from pathlib import Path

imud, imu_truth = sys.argv[1:3]
seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 3.0
scratch = tempfile.TemporaryDirectory(prefix="full_line")  # until the test ends
folder = Path(scratch.name)


def crc_msb_first(data, width, polynomial, crc):
    top, mask = 1 << width - 1, (1 << width) - 1
    for byte in data:
        crc ^= byte << width - 8
        for _ in range(8):
            crc = (crc << 1 ^ polynomial if crc & top else crc << 1) & mask
    return crc


def stim300(data, at):
    """Length of the datagram at `at`, and its counter of 2000 Hz: a datagram with everything and PPS has 63 bytes, and CR LF."""
    if data[at] != 0xF7 or data[at + 63:at + 65] != b"\r\n":
        return None
    good = crc_msb_first(data[at:at + 59] + b"\0", 32, 0x04C11DB7, 0xFFFFFFFF) == struct.unpack_from(">I", data, at + 59)[0]
    return (65, data[at + 56]) if good else None


def mip(data, at):
    """Sensor data with reference time, acceleration, rate, delta-angle; the time in ms."""
    if data[at:at + 4] != b"\x75\x65\x80\x34":
        return None
    a = b = 0
    for byte in data[at:at + 56]:
        a = a + byte & 0xFF
        b = b + a & 0xFF
    good = (a, b) == tuple(data[at + 56:at + 58]) and data[at + 4:at + 6] == b"\x0a\xd5"
    return (58, struct.unpack_from(">Q", data, at + 6)[0] // 1000000) if good else None


def vectornav(data, at):
    """Common: time since startup, attitude, rate, acceleration, increments and more: 178 bytes; the time in units of 2.5 ms."""
    if data[at:at + 4] != b"\xfa\x01\x79\x0f":
        return None
    size = 4 + 8 + 12 + 16 + 12 + 24 + 12 + 24 + 20 + 28 + 2
    return (size, struct.unpack_from("<Q", data, at + 4)[0] // 2500000) if crc_msb_first(data[at + 1:at + size], 16, 0x1021, 0) == 0 else None


CLIENTS = {  # name: (parser, step and period of the counter, frames per second, configuration keys)
    "stim300": (stim300, 2, 256, 1000, "pps = true\ncr_lf = true"),
    "mip": (mip, 1, 2**40, 1000, 'model = "3dm-cv7-ahrs"\nbaud = 921600\nsensor_rate_hz = 1000\nfilter_fields = []\n'
            'sensor_fields = ["reference_time", "acceleration", "rate", "delta_angle"]'),
    "vectornav": (vectornav, 1, 2**40, 400, 'baud = 921600\nasync_type = 0\nbinary_1 = "1,2,01,0F79"'),
}


# A pty holds 4 kB, the data of 44 ms; imud drops frames that would wait more than 100 ms for the line.
HELD_UP_CLIENT = 0.03  # s
HELD_UP_IMUD = 0.05


def start():
    """imud, and the port where it receives truth."""
    for _ in range(20):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = f"udp:127.0.0.1:{probe.getsockname()[1]}"
        config = f'clock = "realtime"\n[truth]\nport = "{port}"\n'
        for name, (*_, keys) in CLIENTS.items():
            config += f'[[imu]]\nname = "{name}"\nprotocol = "{name}"\nport = "pty:{folder / name}"\npace = "line"\n[imu.device]\n{keys}\n'
        (folder / "imu.toml").write_text(config)
        daemon = subprocess.Popen([imud, "run", str(folder / "imu.toml"), "--summary", str(folder / "summary.json")],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        while daemon.poll() is None:
            if all((folder / name).is_symlink() for name in CLIENTS):
                return daemon, port
            time.sleep(0.01)
        errors = daemon.communicate()[1]
        if "in use" not in errors:  # another program has taken the port
            sys.exit(errors)
    sys.exit("no UDP port stays free")


def main():
    daemon, port = start()
    truth = subprocess.Popen([imu_truth, "turntable", "--to", port, "--rate", "100", "--for", str(seconds + 60)],
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    received = {}
    for name in CLIENTS:
        line = os.open(folder / name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(line)
        settings = termios.tcgetattr(line)
        settings[4] = settings[5] = termios.B921600
        termios.tcsetattr(line, termios.TCSANOW, settings)
        received[line] = (name, bytearray())
    poller = select.poll()
    for line in received:
        poller.register(line, select.POLLIN)
    begun = last = None
    longest = 0.0  # longest time without data
    while begun is None or last < begun + seconds:
        for line, _ in poller.poll(100):
            received[line][1].extend(os.read(line, 65536))
            begun = begun or time.monotonic()
        now = time.monotonic()
        if begun:
            longest = max(longest, now - (last or now))
        last = now
    truth.terminate()
    daemon.send_signal(signal.SIGTERM)
    errors = daemon.communicate()[1]
    truth.wait()
    imus = {imu["name"]: imu for imu in json.loads((folder / "summary.json").read_text())["imus"]}
    late = max(imu["lateness_us"]["max"] for imu in imus.values()) / 1e6
    held_up = longest > HELD_UP_CLIENT or late > HELD_UP_IMUD
    print(f"held up: the client {longest:.3f} s, imud {late:.6f} s")
    faults = []
    for name, data in received.values():
        parse, step, period, rate, _ = CLIENTS[name]
        data = bytes(data)
        at = next((i for i in range(len(data) - 400) if parse(data, i)), None)
        if at is None:
            faults.append(f"{name}: no frame in {len(data)} bytes")
            continue
        skipped = at  # a STIM300 begins with special datagrams
        count, missing, before = 0, 0, None
        while at + 200 < len(data):
            frame = parse(data, at)
            if frame is None:
                faults.append(f"{name}: {data[at:at + 8].hex(' ')} after {count} frames")
                break
            size, counter = frame
            lost, rest = divmod((counter - before) % period - step, step) if before is not None else (0, 0)
            if rest != 0 or lost < 0 or (lost > 0 and not held_up):
                faults.append(f"{name}: the counter goes from {before} to {counter} after {count} frames")
            missing += lost
            before = counter
            at += size
            count += 1
        print(f"{name}: {count} frames, {10 * len(data) / seconds / 921600:.1%} of the line, {skipped} bytes before the first")
        if missing > imus[name]["dropped"]:
            faults.append(f"{name}: {missing} frames are missing, {imus[name]['dropped']} were dropped")
        if count + missing < 0.8 * rate * (seconds - 1):  # allow a second for the start and delays
            faults.append(f"{name}: {count} frames in {seconds} s")
    for fault in faults[:20]:
        print(fault)
    if faults:
        print(errors)
    sys.exit(1 if faults else 0)


main()
