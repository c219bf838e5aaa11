#!/usr/bin/env python3
"""The dissector for Wireshark, by tshark, against imu-decode: every packet has its name, and products their numbers."""
import math
import struct
import subprocess
import sys
import unittest

from support import FLIGHT, SOURCE, RunTest, run

# The frames of each imu by the dissector are compared with imu-decode's rows: column of the CSV, field, unit.
DEGREE, GRAVITY = math.pi / 180, 9.80665
VECTORS = {"gyro": "rate", "accel": "specific_force", "dtheta": "delta_angle", "dvel": "delta_velocity"}
UNITS = {
    "native": {"gyro": 1, "accel": 1, "dtheta": 1, "dvel": 1},
    "stim300": {"gyro": DEGREE, "accel": GRAVITY},
    "mip": {"gyro": 1, "accel": GRAVITY, "dtheta": 1, "dvel": GRAVITY},
    "vectornav": {"gyro": 1, "accel": 1, "dtheta": DEGREE, "dvel": 1},
}
# The least number of frames in a second.
FRAMES = {"native": 101, "stim300": 850, "mip": 90, "vectornav": 90}
KEYS = {
    "native": "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100",
    "stim300": "",
    "mip": "device.sensor_rate_hz = 100\ndevice.sensor_fields = ['acceleration', 'rate', 'delta_angle', 'delta_velocity']",
    "vectornav": "device.async_type = 0\ndevice.binary_1 = '1,8,01,0921'",
}


class Dissector(RunTest):
    def record(self, *imus):
        config = self.config(*imus)
        run("imud", "replay", config, FLIGHT, "--fast", "-q", "--for", "1", "--record", self.folder / "r.pcapng",
            exit_code=3)  # the capture goes on
        return self.folder / "r.pcapng"

    def tshark(self, record, *arguments):
        done = subprocess.run(["tshark", "-n", "-X", f"lua_script:{SOURCE}/tools/wireshark/imud.lua", "-r", record,
                               *arguments], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("Lua", done.stderr)
        return done.stdout

    def imu(self, protocol):
        return f"name = '{protocol}'\nprotocol = '{protocol}'\nport = 'file:{self.folder / protocol}'\n{KEYS[protocol]}"

    def test_products_have_the_numbers_that_imu_decode_has(self):
        record = self.record(*(self.imu(protocol) for protocol in UNITS))
        for protocol, units in UNITS.items():
            text, _ = run("imu-decode", protocol, f"file:{self.folder / protocol}")
            names, *rows = [line.split(",") for line in text.splitlines()]
            fields = [f"imud.{VECTORS[vector]}_{axis}" for vector in units for axis in "xyz"]
            columns = [names.index(f"{vector}_{axis}") for vector in units for axis in "xyz"]
            scales = [unit for unit in units.values() for _ in "xyz"]
            seen = self.tshark(record, "-Y", f'frame.interface_name == "{protocol}" && imud.rate_x', "-T", "fields",
                               *(word for field in fields for word in ("-e", field))).splitlines()
            self.assertGreaterEqual(len(rows), FRAMES[protocol])
            self.assertEqual(len(seen), len(rows), protocol)
            for row, packet in zip(rows, seen):
                for column, text, scale in zip(columns, packet.split("\t"), scales):
                    self.assertTrue(math.isclose(float(row[column]), float(text) * scale, rel_tol=1e-5, abs_tol=1e-9),
                                    f"{protocol} {names[column]}: {row[column]}, by the dissector {text}")

    def test_every_packet_has_a_name(self):
        record = self.record(*(self.imu(protocol) for protocol in UNITS))
        rows = [line.split("\t") for line in self.tshark(
            record, "-T", "fields", "-e", "frame.interface_name", "-e", "_ws.col.Protocol", "-e", "_ws.col.Info").splitlines()]
        self.assertGreater(len(rows), 1000)
        for row in rows:
            self.assertTrue(row[1] and len(row) > 2 and row[2], row)
        by_interface = {row[0]: row[1] for row in rows}
        self.assertEqual({name: by_interface[name] for name in ("imud config", "imud", "native", "stim300", "mip", "vectornav")},
                         {"imud config": "imud", "imud": "imud", "native": "native", "stim300": "STIM300", "mip": "MIP",
                          "vectornav": "VectorNav"})
        samples = [row[2] for row in rows if row[0] == "imud" and row[2].startswith("sample ")]
        self.assertIn("interpolated", samples[0])
        self.assertGreater(len(samples), 2000)
        self.assertTrue(any(row[2] == "end" for row in rows))

    def test_the_configuration_is_its_text(self):
        record = self.record(self.imu("native"))
        text = self.tshark(record, "-Y", "imud.config", "-T", "fields", "-e", "imud.config")
        self.assertIn("max_rad_per_s", text)
        self.assertIn('protocol = "native"', text.replace("'", '"'))

    def test_truth_has_its_stamp(self):
        sys.path.insert(0, str(SOURCE / "tools"))
        from lockstep_client import Truth, crc32c, encode
        capture = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101)  # a pcap of IP
        datagrams = [encode(Truth(5, stamp=stamp), 1, 2, True) for stamp in (None, ("monotonic", 1_795_852_159_370_295_924))]
        for datagram in datagrams:
            udp = struct.pack(">HHHH", 1000, 9810, 8 + len(datagram), 0) + datagram
            packet = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, bytes([127, 0, 0, 1]), bytes([127, 0, 0, 1])) + udp
            capture += struct.pack("<IIII", 1, 0, len(packet), len(packet)) + packet
        (self.folder / "truth.pcap").write_bytes(capture)
        names = ("version", "time_ns", "stamp_ns", "stamp_clock", "checksum")
        text = self.tshark(self.folder / "truth.pcap", "-T", "fields", *(word for name in names for word in ("-e", f"imud_truth.{name}")))
        self.assertEqual([line.split("\t") for line in text.splitlines()],
                         [["1", "5", "", "", f"0x{crc32c(datagrams[0][:196]):08x}"],
                          ["2", "5", "1795852159370295924", "3", f"0x{crc32c(datagrams[1][:204]):08x}"]])


if __name__ == "__main__":
    unittest.main()
