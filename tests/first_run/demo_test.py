"""`imud demo` shows the captured flight from the build, without a network, at a terminal and in a pipe.

usage: demo_test.py IMUD
"""
import os
import pathlib
import pty
import re
import signal
import subprocess
import sys
import tempfile
import unittest

IMUD = pathlib.Path(sys.argv.pop(1)).resolve()
ROW = re.compile(r"^ *(\d+\.\d{3})" + r" +(-?\d+\.\d{3})" * 6 + r"\r?$", re.MULTILINE)


class DemoTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.environment = {**os.environ, "TMPDIR": str(self.folder)}

    def undisturbed(self, demo):
        """What `demo` shows when no frame is dropped: on a busy machine its reader may not run for a third of a second,
        after which the pty is full."""
        for _ in range(10):
            text = demo()
            if "frames sent, 0 dropped" in text:
                break
        return text

    def expect_flight(self, text, seconds):
        rows = [[float(number) for number in row] for row in ROW.findall(text)]
        self.assertGreaterEqual(len(rows), 2 * seconds - 1, text)
        for before, after in zip(rows, rows[1:]):
            self.assertAlmostEqual(after[0] - before[0], 0.5, delta=0.1)
        for row in rows:  # a Cessna in the air: it is carried, and turns slowly
            self.assertTrue(5 < -row[6] < 15 and all(abs(rate) < 60 for rate in row[1:4]), row)
        self.assertRegex(text, r"(?m)^  samples +[1-9]\d+ ")
        self.assertRegex(text, r"(?m)^  checksum +0 failures")
        self.assertRegex(text, r"imu1 +[1-9]\d+ samples, [1-9]\d+ frames sent, 0 dropped")
        self.assertEqual(list(self.folder.iterdir()), [], "is left behind")

    def test_in_a_pipe_without_network(self):
        as_root = [] if os.geteuid() == 0 else ["--map-root-user"]

        def demo():
            done = subprocess.run(["unshare", *as_root, "--net", IMUD, "demo", "--for", "3"], capture_output=True, text=True,
                                  env=self.environment)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            return done.stdout

        text = self.undisturbed(demo)
        self.expect_flight(text, 3)
        self.assertRegex(text, r"(?m)^\$ imud run .*tools/demo\.toml")
        self.assertRegex(text, r"(?m)^\$ imu-decode native pty:")

    def test_at_a_terminal(self):
        def demo():
            child, terminal = pty.fork()
            if child == 0:
                os.execve(IMUD, [IMUD, "demo", "--for", "2"], self.environment)
            text = ""
            while True:
                try:
                    text += os.read(terminal, 65536).decode()
                except OSError:
                    break
            self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), 0, text)
            os.close(terminal)
            return text

        self.expect_flight(self.undisturbed(demo), 2)

    def test_nothing_is_left_behind_by_a_signal(self):
        for number, exit_code in (signal.SIGTERM, 143), (signal.SIGINT, 130):
            demo = subprocess.Popen([IMUD, "demo"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.environment,
                                    start_new_session=True)
            while not ROW.match(line := demo.stdout.readline()):
                self.assertTrue(line, "the demonstration has ended")
            os.killpg(demo.pid, number) if number == signal.SIGINT else demo.send_signal(number)  # a terminal signals all
            demo.communicate()
            self.assertEqual(demo.returncode, exit_code)
            self.assertEqual(list(self.folder.iterdir()), [], "is left behind")
            self.assertRaises(ProcessLookupError, os.killpg, demo.pid, 0)

    def test_a_missing_flight(self):
        """A program that was copied alone."""
        copy = self.folder / "bin/imud"
        copy.parent.mkdir()
        copy.write_bytes(IMUD.read_bytes())
        copy.chmod(0o755)
        done = subprocess.run([copy, "demo"], capture_output=True, text=True, env=self.environment)
        self.assertEqual(done.returncode, 2)
        self.assertIn(f"there is no captured flight, tests/captures/jsbsim_c172_10s.pcap, in {self.folder}/share/imud", done.stderr)


if __name__ == "__main__":
    unittest.main()
