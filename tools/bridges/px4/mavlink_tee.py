#!/usr/bin/env python3
"""Sits between PX4 and its simulator (MAVLink over TCP), and copies the true motion to imud by UDP.

    mavlink_tee.py --px4 4560 --simulator 127.0.0.1:4561 --imud 127.0.0.1:9810

Both directions pass unchanged. Whole frames of HIL_STATE_QUATERNION, HIL_STATE, SIM_STATE and SYSTEM_TIME go to imud,
a datagram each. Python's standard library only. See README.md.
"""
import argparse
import select
import socket
import sys
import time

TRUTH = {115, 90, 108, 2}  # messages of the MAVLink common set


def frames(buffer):
    """Takes whole frames (version 1 and 2) off the front of a bytearray. Yields the message's number and the frame."""
    while True:
        starts = [i for i in (buffer.find(0xFD), buffer.find(0xFE)) if i >= 0]
        del buffer[:min(starts, default=len(buffer))]
        if len(buffer) < 10:
            return
        is_2 = buffer[0] == 0xFD
        size = buffer[1] + (12 + 13 * (buffer[2] & 1) if is_2 else 8)
        if len(buffer) < size:
            return
        frame = bytes(buffer[:size])
        del buffer[:size]
        yield (int.from_bytes(frame[7:10], "little") if is_2 else frame[5]), frame


def address(text):
    host, _, port = text.rpartition(":")
    return host, int(port)


def connect(where):
    while True:
        try:
            return socket.create_connection(where)
        except ConnectionRefusedError:
            time.sleep(0.2)


def main():
    parser = argparse.ArgumentParser(description="Copies the simulator's truth on its way to PX4 to imud.")
    parser.add_argument("--px4", type=int, default=4560,
                        help="TCP port at which PX4 expects its simulator (%(default)s)")
    parser.add_argument("--simulator", type=address, default="127.0.0.1:4561", help="TCP address (%(default)s)")
    parser.add_argument("--imud", type=address, default="127.0.0.1:9810",
                        help="UDP address of truth.port (%(default)s)")
    options = parser.parse_args()
    with socket.create_server(("127.0.0.1", options.px4)) as server:
        px4, _ = server.accept()
    simulator = connect(options.simulator)
    for line in (px4, simulator):
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    imud = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    held, copied = bytearray(), 0
    try:
        while True:
            for line in select.select([px4, simulator], [], [])[0]:
                data = line.recv(65536)
                if not data:
                    return 0
                (px4 if line is simulator else simulator).sendall(data)
                if line is simulator:
                    held += data
                    for message, frame in frames(held):
                        if message in TRUTH:
                            imud.sendto(frame, options.imud)
                            copied += 1
    except (ConnectionError, KeyboardInterrupt):
        return 0
    finally:
        print(f"mavlink_tee.py: {copied} frames copied to imud", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
