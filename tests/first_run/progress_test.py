"""Long work shows its progress and the time left at a terminal, at most five times a second, and nothing in a pipe.

usage: progress_test.py IMUD
"""
import os
import pathlib
import pty
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

IMUD = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE = pathlib.Path(__file__).resolve().parents[2]
LINE = re.compile(r"(\d+) % of ([^,\r\x1b]+)(?:, (\d+(?:\.\d)?) (s|min|h) left)?")
CONFIGURATION = """[truth]
port = "udp:127.0.0.1:0"
format = "csv"
[[imu]]
protocol = "stim300"
port = "file:imu.bin"
"""


class ProgressTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        (cls.folder / "imu.toml").write_text(CONFIGURATION)
        for duration_s, name in ("2500", "truth.csv"), ("1200", "half.csv"):
            subprocess.run([IMUD.parent / "imu-truth", "rest", "--rate", "10", "--for", duration_s, "--csv", name], check=True,
                           cwd=cls.folder, stderr=subprocess.DEVNULL)
        # What the decoders read.
        subprocess.run([IMUD, "replay", "imu.toml", "truth.csv", "--fast", "--quiet", "--set", "imu.0.port=file:whole.bin"], check=True,
                       cwd=cls.folder, stdout=subprocess.DEVNULL)
        once = (cls.folder / "whole.bin").read_bytes()
        (cls.folder / "whole.bin").write_bytes(2 * once)
        (cls.folder / "long.bin").write_bytes(8 * once)

    def at_terminal(self, words, exit_code=0, with_output=False):
        """Runs a program whose standard error is a terminal, and its output, too. Returns the text there, and how long it took;
        self.first_s is when it showed progress."""
        terminal, end = pty.openpty()
        begin = time.monotonic()
        running = subprocess.Popen([IMUD.parent / words[0], *words[1:]], cwd=self.folder,
                                   stdout=end if with_output else subprocess.DEVNULL, stderr=end)
        os.close(end)
        text = b""
        self.first_s = None
        while True:
            try:
                text += os.read(terminal, 65536)
            except OSError:
                break
            if self.first_s is None and b"%" in text:
                self.first_s = time.monotonic() - begin
        self.assertEqual(running.wait(), exit_code, text)
        os.close(terminal)
        return text.decode(), time.monotonic() - begin

    def expect_progress(self, work, *words):
        text, took_s = self.at_terminal(words)
        shown = [line for line in LINE.findall(text) if re.fullmatch(work, line[1])]
        self.assertGreater(len(shown), 0, text)
        self.assertLessEqual(len(LINE.findall(text)), 5 * took_s + 1)
        for phase in {line[1] for line in shown}:
            shares = [int(line[0]) for line in shown if line[1] == phase]
            self.assertEqual(shares, sorted(shares))
            self.assertLessEqual(shares[-1], 100)
        self.assertTrue(any(line[2] for line in shown), text)
        # The last line is removed, and no other text is appended to one.
        self.assertEqual(len(LINE.findall(text)), text.count("\r\x1b[K"), text)
        for part in text.split("\r\x1b[K")[:-1]:
            self.assertRegex(part.split("\n")[-1], rf"^{LINE.pattern}$")
        # In a pipe nothing is shown in twice the time; the rest of the work is that of the run above.
        piped = subprocess.Popen([IMUD.parent / words[0], *words[1:]], cwd=self.folder, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.PIPE, text=True)
        try:
            errors = piped.communicate(timeout=2 * self.first_s)[1]
            self.assertEqual(piped.returncode, 0, errors)
        except subprocess.TimeoutExpired:
            piped.kill()
            errors = piped.communicate()[1]
        self.assertNotRegex(errors, r"\r|\x1b|% of ")

    def test_a_fast_replay(self):
        self.expect_progress("the capture", "imud", "replay", "imu.toml", "truth.csv", "--fast", "--log-every", "0")

    def test_a_quiet_one(self):
        text, _ = self.at_terminal(["imud", "replay", "imu.toml", "truth.csv", "--fast", "--quiet"])
        self.assertNotIn("%", text)

    def test_seeds(self):
        self.expect_progress("3 runs", "imud", "replay", "imu.toml", "half.csv", "--seeds", "1..3", "--jobs", "1", "--set",
                             "imu.0.port=file:imu{seed}.bin")

    def test_a_line_of_the_log_is_not_appended_to_one_of_progress(self):
        text, _ = self.at_terminal(["imud", "replay", "imu.toml", "half.csv", "--seeds", "1..2", "--jobs", "1", "--require", "samples<1",
                                    "--set", "imu.0.port=file:log{seed}.bin"], exit_code=3)
        self.assertRegex(text, LINE)
        logged = [line for line in re.split(r"\r\x1b\[K|\r\n", text) if "required samples<1" in line]
        self.assertEqual(len(logged), 2, text)
        for line in logged:
            self.assertRegex(line, r"^\d{4}-\d\d-\d\dT")

    def test_seeds_log_nothing_in_a_pipe(self):
        """However long they take: here 6 s more, for which they are stopped."""
        running = subprocess.Popen([IMUD, "replay", "imu.toml", "half.csv", "--seeds", "1..2", "--jobs", "1", "--set",
                                    "imu.0.port=file:long{seed}.bin"], cwd=self.folder, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, start_new_session=True, text=True)
        while running.poll() is None and not (self.folder / "long1.bin").exists():
            time.sleep(0.01)
        os.killpg(running.pid, signal.SIGSTOP)
        time.sleep(6)
        os.killpg(running.pid, signal.SIGCONT)
        self.assertNotRegex(running.communicate()[1], r" of \d+ runs| left|%")
        self.assertEqual(running.returncode, 0)

    def test_a_campaign(self):
        (self.folder / "plan.toml").write_text('base = "imu.toml"\ncapture = "half.csv"\nseeds = "1..2"\n')
        words = ["campaign", "run", "plan.toml", "--jobs", "1", "--into"]
        self.assertRegex(self.at_terminal(["imud", *words, "terminal"])[0], r"\d+ % of 2 cases, \d+ s left\r\x1b\[K")
        piped = subprocess.run([IMUD, *words, "pipe"], cwd=self.folder, capture_output=True, text=True, check=True)
        self.assertNotRegex(piped.stderr, r"\r|\x1b|%| left")

    def test_the_result_is_a_line_of_its_own(self):
        (self.folder / "result.toml").write_text('base = "imu.toml"\ncapture = "truth.csv"\n')
        for words in (["replay", "imu.toml", "truth.csv", "--seeds", "1..1", "--set", "imu.0.port=file:result{seed}.bin"],
                      ["campaign", "run", "result.toml", "--into", "result"]):
            text, _ = self.at_terminal(["imud", *words, "--jobs", "1"], with_output=True)
            self.assertRegex(text, r"\d % of 1 [^\r]*\r\x1b\[Kran  ")

    def test_the_measurements_of_the_machine(self):
        self.expect_progress(r"\d measurements", "imud", "selftest", "--for", "0.4")

    def test_a_plot(self):
        capture = SOURCE / "tests/captures/jsbsim_c172_10s.pcap"
        self.expect_progress("1002 runs", "imu-plot", SOURCE / "tools/demo.toml", f"{capture}?port=5140", "--seeds", "1000", "--plot", "run.svg")

    def test_truth_as_csv(self):
        self.expect_progress("the motion", "imu-truth", "rest", "--rate", "10", "--for", "100000", "--csv", "motion.csv")
        subprocess.run([IMUD.parent / "imu-truth", "rest", "--rate", "10", "--for", "100000", "--csv", "long.csv"], check=True,
                       cwd=self.folder, stderr=subprocess.DEVNULL)
        self.expect_progress("long.csv", "imu-truth", "capture", "long.csv", "--format", "csv", "--csv", "copy.csv")

    def test_a_decoder(self):
        self.expect_progress("file:long.bin", "imu-decode", "stim300", "file:long.bin", "--quiet")

    def test_the_allan_deviation(self):
        self.expect_progress("file:whole.bin|the deviations", "imu-allan", "stim300", "file:whole.bin", "--rate-hz", "1000")


if __name__ == "__main__":
    unittest.main()
