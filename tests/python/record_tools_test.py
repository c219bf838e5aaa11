#!/usr/bin/env python3
"""A record after reordercap and mergecap: it has its times, its configuration, and the run."""
import struct
import subprocess
import time
import unittest

from support import FLIGHT, PROGRAMS, SOURCE, RunTest, run

CONFIG = """name = 'a'
protocol = 'native'
rate_hz = 200
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
port = 'file:{folder}/a.bin'
"""


class RecordTools(RunTest):
    def record(self):
        self.begin = time.time()
        config = self.config(CONFIG.format(folder=self.folder))
        run("imud", "replay", config, FLIGHT, "--fast", "-q", "--record", self.folder / "r.pcapng")
        return self.folder / "r.pcapng", (self.folder / "a.bin").read_bytes()

    def repeated(self, record):
        run("imud", "replay", record, record, "--fast", "-q", f"--set=imu.a.port=file:{self.folder}/again")
        return (self.folder / "again").read_bytes()

    def test_all_packets_have_the_time_of_the_run(self):
        record, _ = self.record()
        content, at, times = record.read_bytes(), 0, []
        while at < len(content):
            kind, length = struct.unpack_from("<II", content, at)
            if kind == 6:
                _, high, low = struct.unpack_from("<III", content, at + 8)
                times.append((high << 32 | low) / 1e9)
            at += length
        self.assertGreater(len(times), 6000)
        # Those of the truth are from the capture.
        of_run = [t for t in times[:10] + times[-10:] if t > self.begin - 86400]
        self.assertGreater(len(of_run), 8)
        self.assertTrue(all(self.begin - 1 < t < time.time() + 1 for t in times[:4]), times[:4])

    def test_a_record_is_repeated_after_its_packets_were_sorted_or_merged(self):
        record, sent = self.record()
        self.assertEqual(self.repeated(record), sent)
        other = self.folder / "other.pcap"
        other.write_bytes((SOURCE / "tests/captures/jsbsim_c172_10s.pcap").read_bytes())
        sorted_record, merged = self.folder / "sorted.pcapng", self.folder / "merged.pcapng"
        subprocess.run(["reordercap", record, sorted_record], check=True, capture_output=True)
        subprocess.run(["mergecap", "-w", merged, other, record], check=True, capture_output=True)
        before = subprocess.run([PROGRAMS / "imud", "check", record, "--toml"], capture_output=True, check=True).stdout
        for changed in sorted_record, merged:
            with self.subTest(changed.name):
                after = subprocess.run([PROGRAMS / "imud", "check", changed, "--toml"], capture_output=True)
                self.assertEqual(after.stdout, before, after.stderr)
                self.assertEqual(self.repeated(changed), sent)

    def test_a_record_to_standard_output_is_the_record_alone(self):
        config = self.config(CONFIG.format(folder=self.folder))
        done = subprocess.run([PROGRAMS.resolve() / "imud", "replay", config, FLIGHT, "--fast", "--record", "-"],
                              capture_output=True, check=True, cwd=self.folder)
        self.assertEqual(done.stdout[:4], b"\x0a\x0d\x0d\x0a")
        self.assertFalse((self.folder / "-").exists())
        (self.folder / "out.pcapng").write_bytes(done.stdout)
        sent = (self.folder / "a.bin").read_bytes()
        self.assertEqual(self.repeated(self.folder / "out.pcapng"), sent)
        _, errors = run("imud", "replay", config, FLIGHT, "--record", "-", "--record-max-mb", "1", exit_code=2)
        self.assertIn("--record-max-mb: standard output is one file", errors)

    def test_a_line_feed_in_a_name_is_refused(self):
        config = self.config(CONFIG.format(folder=self.folder).replace("'a'", '"a\\nb"'))
        _, errors = run("imud", "check", config, exit_code=2)
        self.assertIn("imu.0.name: has a line feed or another control character", errors)


if __name__ == "__main__":
    unittest.main()
