"""imud check lists faults in the order of their lines, names each key once, and says where a text has no end.

usage: fault_text_test.py IMUD
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

IMUD = pathlib.Path(sys.argv.pop(1)).resolve()
TRUTH = '[truth]\nport = "udp:127.0.0.1:9810"\nformat = "jsbsim"\n'


class FaultTextTest(unittest.TestCase):
    def faults(self, text):
        checked = subprocess.run([IMUD, "check", "-"], input=text, capture_output=True, text=True)
        self.assertEqual(checked.returncode, 2, checked.stdout)
        return checked.stderr.splitlines()[:-1]

    def test_the_order(self):
        found = self.faults(TRUTH + 'rate = 3\n[[imu]]\nprotocol = "vectornav"\nport = "pty:a"\nmodel = "no"\nspeed = 1\n'
                            '[imu.device]\nmodel = "vn-900"\nasync_type = 99\n[realtime]\npriority = 200\n[earth]\nframe = "flat"\n')
        lines = [int(re.match(r"(?:-|[^:]*):(\d+): ", line)[1]) for line in found]
        self.assertEqual(len(lines), 7, found)
        self.assertEqual(lines, sorted(lines))
        self.assertIn("device.model: must be one of vn-100", found[3])
        self.assertNotIn("model: model", " ".join(found))

    def test_a_text_without_end(self):
        for quote in ('"', "'"):
            for end in ("\n", "\r\n", ""):
                line = f"format = {quote}jsbsim"
                found = self.faults("[truth]\n" + line + end)
                self.assertIn("2: TOML: a text is not closed: a quotation mark is missing before the end of the line: " + line, found[0])
        self.assertNotIn("not closed", self.faults('[truth]\nformat = "a\x01b"\n')[0])

    def test_a_name_that_no_option_can_give(self):
        """--require and {imu} in the name of a file have names of imus."""
        imu = '[[imu]]\nprotocol = "vectornav"\nport = "pty:a"\n'
        for name in ("a,b", "a<b", "a>b", "a=b", "a/b", "truth", "record", "control", "clock", "truth.a"):
            self.assertRegex("".join(self.faults(TRUTH + imu + f'name = "{name}"\n')), "imu.0.name: .*give another name")
        for name in ("a b", "a.b", "truths", "Anemoi-2"):
            checked = subprocess.run([IMUD, "check", "-"], input=TRUTH + imu + f'name = "{name}"\n', capture_output=True, text=True)
            self.assertEqual(checked.returncode, 0, checked.stderr)


if __name__ == "__main__":
    unittest.main()
