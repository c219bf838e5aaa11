#!/usr/bin/env python3
"""The MCAP files that imu-decode writes, by a reader of their own."""
import base64
import subprocess
import unittest

import numpy

from mcap_reader import Mcap
from support import FLIGHT, PROGRAMS, RunTest, run

IDEAL = "rate_hz = 1000\nprotocol = 'native'\nport = 'file:{file}'\ngyro.max_rad_per_s = 10\n" \
        "accelerometer.max_m_per_s2 = 200\n"
HEADER = "time_ns,counter," + ",".join(f"{n}_{a}" for n in ("gyro", "accel", "dtheta", "dvel") for a in "xyz") + \
         ",temperature,status\n"

# What the reference writer (foxglove/mcap 95d067356, python/mcap, compression ZSTD, enable_data_crcs) wrote for
# start("", "x"), add_metadata("imud", {"a": "b"}), register_schema("S", "jsonschema", b"{}"), register_channel("/t",
# "json", 1), add_message(1, 9, b'{"x":1}', 9, 7), add_message(1, 5, b'{"x":2}', 5, 8), finish().
REFERENCE = """
iU1DQVAwDQoBCQAAAAAAAAAAAAAAAQAAAHgMFgAAAAAAAAAEAAAAaW11ZAoAAAABAAAAYQEAAABiBpIAAAAAAAAABQAAAAAAAAAJAAAAAAAAAI8A
AAAAAAAA+JyPIAQAAAB6c3RkZgAAAAAAAAAotS/9II/tAgDkAwMbAAEAAQAAAFMKAAAAanNvbnNjaGVtYQIAAAB7fQQWAC90BAUdBwAAAAl7Ingi
OjF9CAAAAAV7IngiOjJ9DACAAJB1UsZWFrw0LZSiThuUyrFpcJQFguEGMAQHJgAAAAAAAAABACAAAAAJAAAAAAAAAEMAAAAAAAAABQAAAAAAAABp
AAAAAAAAAA8EAAAAAAAAAB+dNHADGwAAAAAAAAABAAEAAABTCgAAAGpzb25zY2hlbWECAAAAe30EFgAAAAAAAAABAAEAAgAAAC90BAAAAGpzb24A
AAAACzgAAAAAAAAAAgAAAAAAAAABAAEAAAAAAAAAAQAAAAEAAAAFAAAAAAAAAAkAAAAAAAAACgAAAAEAAgAAAAAAAAAITgAAAAAAAAAFAAAAAAAA
AAkAAAAAAAAAOQAAAAAAAACbAAAAAAAAAAoAAAABANQAAAAAAAAALwAAAAAAAAAEAAAAenN0ZGYAAAAAAAAAjwAAAAAAAAANGAAAAAAAAAAaAAAA
AAAAAB8AAAAAAAAABAAAAGltdWQOEQAAAAAAAAADEAEAAAAAAAAkAAAAAAAAAA4RAAAAAAAAAAQ0AQAAAAAAAB8AAAAAAAAADhEAAAAAAAAAC1MB
AAAAAAAAQQAAAAAAAAAOEQAAAAAAAAAIlAEAAAAAAABXAAAAAAAAAA4RAAAAAAAAAArrAQAAAAAAAAAAAAAAAAAADhEAAAAAAAAADesBAAAAAAAA
IQAAAAAAAAACFAAAAAAAAAAQAQAAAAAAAAwCAAAAAAAAitu57IlNQ0FQMA0K
"""


class McapFiles(RunTest):
    def flight(self):
        file = self.folder / "imu.bin"
        config = self.config("name = 'left'\n" + IDEAL.format(file=file))
        run("imud", "replay", config, FLIGHT, "-q")
        return file, config

    def decode(self, *arguments, exit_code=0, **options):
        _, errors = run("imu-decode", *arguments, "--quiet", "--npy", self.folder / "a.npy", "--mcap",
                        self.folder / "a.mcap", exit_code=exit_code, **options)
        return numpy.load(self.folder / "a.npy"), Mcap((self.folder / "a.mcap").read_bytes()), errors

    def test_it_has_the_values_of_the_array(self):
        file, config = self.flight()
        array, mcap, _ = self.decode("native", f"file:{file}", "--truth", config, FLIGHT, "--imu", "left")
        self.assertEqual(len(mcap.messages), 10001)
        self.assertGreater(len(mcap.chunks), 3)
        for key, values in zip(("time", "publish"), zip(*((m[2], m[3]) for m in mcap.messages))):
            self.assertEqual(list(values), array["time_ns"].tolist(), key)
        self.assertEqual([message[1] for message in mcap.messages], array["counter"].tolist())
        rows = [message[4] for message in mcap.messages]
        for name in array.dtype.names:
            if array[name].ndim == 2:
                values = [[row.get(name, {}).get(axis, numpy.nan) for axis in "xyz"] for row in rows]
            else:
                values = [row.get(name, numpy.nan) for row in rows]
            numpy.testing.assert_array_equal(numpy.array(values, array[name].dtype), array[name])
        self.assertEqual(mcap.channels, {1: (1, "/left", "json", {})})
        name, encoding, schema = mcap.schemas[1]
        self.assertEqual((name, encoding, schema["type"]), ("imud.Measurement", "jsonschema", "object"))
        self.assertEqual(list(schema["properties"]), list(array.dtype.names))
        self.assertEqual(schema["properties"]["gyro"]["properties"]["z"], {"type": "number"})
        about = mcap.metadata["imud"]
        self.assertEqual((about["protocol"], about["seed"]), ("native", "7"))
        self.assertIn("max_rad_per_s = 10.0", about["config"])
        self.assertEqual(mcap.library, "imud " + about["imud_version"])

    def test_what_is_not_carried_is_left_out(self):
        _, mcap, _ = self.decode("csv", "-", stdin=HEADER + "9,7,1,-2.5,1e-20,,,,,,,,,,,\n5,,,,,,,,,,,7,8,9,20,3\n")
        self.assertEqual(mcap.messages, [
            (1, 7, 9, 9, {"time_ns": 9, "counter": 7, "gyro": {"x": 1, "y": -2.5, "z": 1e-20}, "status": 0, "fields": 7}),
            (1, 0, 5, 5, {"time_ns": 5, "dvel": {"x": 7, "y": 8, "z": 9}, "temperature": 20, "status": 3, "fields": 225})])
        self.assertEqual(mcap.chunks[0]["time"], (5, 9))
        self.assertEqual(mcap.channels[1][1], "/imu")

    def test_measurements_without_time_need_a_rate(self):
        rows = HEADER + ",,1,2,3,,,,,,,,,,,\n,,4,5,6,,,,,,,,,,,\n"
        _, mcap, errors = self.decode("csv", "-", stdin=rows, exit_code=1)
        self.assertIn("a.mcap: 2 of 2 measurements carry no time", errors)
        self.assertEqual((mcap.messages, mcap.chunks), ([], []))
        _, mcap, _ = self.decode("csv", "-", "--rate-hz", 400, stdin=rows)
        self.assertEqual([message[2] for message in mcap.messages], [0, 2_500_000])
        self.assertNotIn("time_ns", mcap.messages[0][4])

    def test_the_reader_reads_the_reference_writer(self):
        mcap = Mcap(base64.b64decode(REFERENCE))
        self.assertEqual(mcap.messages, [(1, 7, 9, 9, {"x": 1}), (1, 8, 5, 5, {"x": 2})])
        self.assertEqual((mcap.library, mcap.metadata), ("x", {"imud": {"a": "b"}}))
        self.assertEqual((mcap.schemas, mcap.channels), ({1: ("S", "jsonschema", {})}, {1: (1, "/t", "json", {})}))

    def test_the_reader_refuses_every_flipped_bit(self):
        self.decode("csv", "-", stdin=HEADER + "5,,1,2,3,,,,,,,,,,,\n")
        data = (self.folder / "a.mcap").read_bytes()
        for at in range(0, len(data), 7):
            flipped = bytearray(data)
            flipped[at] ^= 1 << at % 8
            with self.assertRaises(Exception, msg=at):
                Mcap(bytes(flipped))

    def test_a_full_disk_is_an_error(self):
        file, _ = self.flight()
        done = subprocess.run(["bash", "-c", f"ulimit -f 64; trap '' XFSZ; exec {PROGRAMS}/imu-decode native "
                               f"file:{file} --quiet --mcap {self.folder}/a.mcap"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn(f"{self.folder}/a.mcap: File too large", done.stderr)


if __name__ == "__main__":
    unittest.main()
