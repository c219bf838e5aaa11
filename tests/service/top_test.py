"""`imud top` in a terminal of a fixed size: pyte interprets what it draws.

usage: top_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import termios
import time
import unittest

import pyte

from runs import IMUD, RunsTest

LIMIT_S = 120  # only a test that fails waits so long
FAULTS = """[[fault]]
name = "broken"
imu = "imu1"
target = "gyro.x"
kind = "bias"
value = 0.1
at_s = 100000
for_s = 1000
optional = true
"""


class TopTest(RunsTest):
    rows, columns = 40, 120

    def setUp(self):
        super().setUp()
        self.environment["TERM"] = "linux"  # pyte has all that this terminal can, and not all of an xterm

    def tput(self, name):
        return subprocess.run(["tput", "-T", self.environment["TERM"], name], capture_output=True).stdout

    def open(self, *words):
        """Begins to show a run; again while the run has not answered in time, as on a busy machine."""
        for _ in range(10):
            self.launch(*words)
            while not self.drawn and self.top.poll() is None:
                self.read(0.1)
            while self.read(0):
                pass
            if b"does not answer" not in self.drawn:
                break

    def launch(self, *words):
        self.screen = pyte.Screen(self.columns, self.rows)
        self.stream = pyte.ByteStream(self.screen)
        self.drawn = b""
        self.terminal, slave = pty.openpty()
        self.set_size(self.rows, self.columns)
        self.before = termios.tcgetattr(slave)
        self.slave = slave
        self.addCleanup(os.close, slave)
        self.addCleanup(os.close, self.terminal)
        self.top = subprocess.Popen([IMUD, "top", *words], env=self.environment, stdin=slave, stdout=slave, stderr=slave,
                                    start_new_session=True, preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0))
        self.addCleanup(lambda: (self.top.kill(), self.top.wait()))

    def set_size(self, rows, columns):
        fcntl.ioctl(self.terminal, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def read(self, seconds):
        if select.select([self.terminal], [], [], seconds)[0]:
            got = os.read(self.terminal, 65536)
            self.drawn += got
            self.stream.feed(got)
            return True
        return False

    def wait_for(self, is_seen):
        """Reads until the rows of the screen are as expected."""
        end = time.monotonic() + LIMIT_S
        while not is_seen(self.screen.display):
            if time.monotonic() > end or (self.top.poll() is not None and not self.read(0.1)):
                self.fail("\n".join(row.rstrip() for row in self.screen.display))
            self.read(0.1)

    def wait_for_text(self, text):
        self.wait_for(lambda rows: any(text in row for row in rows))

    def type(self, text):
        os.write(self.terminal, text.encode())

    def expect_end(self, code):
        end = time.monotonic() + LIMIT_S
        while self.top.poll() is None and time.monotonic() < end:
            self.read(0.1)
        while self.read(0):
            pass
        self.assertEqual(self.top.poll(), code, "\n".join(self.screen.display))
        # The terminal has its modes, the screen before, and its cursor again.
        self.assertEqual(termios.tcgetattr(self.slave), self.before)
        self.assertGreater(self.drawn.rfind(self.tput("cnorm")), self.drawn.rfind(self.tput("civis")))
        if self.environment["TERM"] == "xterm":
            self.assertGreater(self.drawn.rfind(self.tput("rmcup")), self.drawn.rfind(self.tput("smcup")))

    def test_shows_a_run(self):
        run = self.start()
        self.open("bench")
        self.wait_for_text("imu1  stim300    2000")
        self.assertRegex(self.screen.display[0], rf"^bench: process {run.pid}, since \S+Z, for 0:00:\d\d, clock realtime")

        def shows_last_second(rows):
            at = next((i for i, row in enumerate(rows) if row.startswith("the last second: truth 0.0 Hz")), None)
            # Of the run's 2000 Hz at least some are sampled in a second, however busy the machine is.
            return at is not None and rows[at + 1].startswith("IMU") and rows[at + 2].split()[0] == "imu1" \
                and float(rows[at + 2].split()[3]) > 0

        self.wait_for(shows_last_second)
        self.wait_for_text("the whole run: truth")
        self.assertTrue(self.screen.display[-1].startswith("q quit   f begin a fault"))
        self.type("q")
        self.expect_end(0)
        self.assertIsNone(run.poll())

    def test_shows_the_clock_of_the_grids(self):
        self.start(words=["--set", "realtime.epoch=monotonic"])
        self.open("bench")
        self.wait_for(lambda rows: rows[1].startswith("grids on monotonic, 0 steps, imu1 from k "))
        self.type("q")
        self.expect_end(0)

    def test_begins_faults(self):
        self.start(more=FAULTS)
        self.open("bench")
        self.wait_for_text("2000")
        self.type("f")
        self.wait_for_text("1 broken: imu1 gyro.x: a constant is added")
        self.type("1\r")
        self.wait_for_text("fault broken: bias of gyro.x, imu imu1, since sample")
        self.wait_for_text("fault.begin broken, imu1, sample")
        self.type("c")
        self.wait_for_text("fault.end broken")
        self.wait_for(lambda rows: not any("fault broken:" in row for row in rows))
        self.type("fname=sticks imu=imu1 target=gyro.y kind=stuckX\x7f\r")
        self.wait_for_text("fault sticks: stuck of gyro.y, imu imu1, since sample")
        # Esc leaves the entry; q is a letter in it.
        self.type("fqq")
        self.wait_for(lambda rows: rows[-1].startswith("fault: qq_"))
        self.type("\x1b")
        self.wait_for(lambda rows: rows[-1].startswith("q quit"))
        self.type("fnone\r")
        self.wait_for(lambda rows: 'the configuration has no fault "none"; it has broken' in rows[-1])
        self.type("q")
        self.expect_end(0)

    def test_takes_another_size(self):
        self.start()
        self.open("bench")
        self.wait_for_text("2000")
        self.screen.resize(12, 60)
        self.set_size(12, 60)
        self.wait_for(lambda rows: rows[0].startswith("bench: process") and rows[11].startswith("q quit   f begin a fault"))
        self.wait_for_text("the last second")
        self.screen.resize(30, 100)
        self.set_size(30, 100)
        self.wait_for(lambda rows: rows[29].startswith("q quit") and "q quit" not in rows[11])
        self.type("q")
        self.expect_end(0)

    def test_signals_restore_the_terminal(self):
        self.environment["TERM"] = "xterm"  # which has the screen before
        self.start()
        for number, code in ((signal.SIGTERM, 143), (signal.SIGHUP, 129), (None, 0)):
            self.open("bench")
            self.wait_for_text("2000")
            if number:
                self.top.send_signal(number)
            else:
                self.type("\x03")
            self.expect_end(code)

    def test_the_run_is_lost(self):
        self.environment["TERM"] = "xterm"
        for number in (signal.SIGTERM, signal.SIGKILL):
            run = self.start()
            self.open("bench")
            self.wait_for_text("2000")
            run.send_signal(number)
            run.wait()
            self.expect_end(1)
            self.assertIn(b"imud: bench has ended", self.drawn[self.drawn.rfind(self.tput("rmcup")):])

    def test_the_run_is_stopped(self):
        run = self.start()
        self.open("bench")
        self.wait_for_text("2000")
        run.send_signal(signal.SIGSTOP)
        self.wait_for_text("NO ANSWER for ")
        run.send_signal(signal.SIGCONT)
        self.wait_for(lambda rows: not any("NO ANSWER" in row for row in rows))
        run.send_signal(signal.SIGSTOP)
        for _ in range(40):  # more requests than its socket has room for
            self.type("c" * 20)
            self.read(0.05)
        self.type("q")
        self.expect_end(0)
        self.launch("bench")  # it does not begin with a screen that stays empty
        end = time.monotonic() + LIMIT_S
        while self.top.poll() is None and time.monotonic() < end:
            self.read(0.1)
        while self.read(0):
            pass
        self.assertEqual(self.top.poll(), 1)
        self.assertIn(b"bench does not answer", self.drawn)
        run.send_signal(signal.SIGCONT)

    def test_refuses_what_it_cannot_show(self):
        code, text = self.imud("top", stdin=subprocess.DEVNULL)
        self.assertEqual(code, 2)
        self.assertIn("standard input or output is no terminal; imud status", text)
        for name, words, expected in (("xterm", ("bench",), (1, b"imud: ")), ("nonsense", ("bench",), (2, b'TERM="nonsense"')),
                                      ("xterm", ("other",), (1, b"there is no other; those that run: bench"))):
            self.environment["TERM"] = name
            # ncurses 6.4 leaves 1.6 kB of a terminal that it does not know (new_prescr); the program ends then.
            self.environment["ASAN_OPTIONS"] = "detect_leaks=0" if name == "nonsense" else ""
            if name == "nonsense":
                self.start()
            self.open(*words)
            end = time.monotonic() + LIMIT_S
            while self.top.poll() is None and time.monotonic() < end:
                self.read(0.1)
            while self.read(0):
                pass
            self.assertEqual(self.top.poll(), expected[0], self.drawn)
            self.assertIn(expected[1], self.drawn)
            self.assertEqual(termios.tcgetattr(self.slave), self.before)


if __name__ == "__main__":
    unittest.main()
