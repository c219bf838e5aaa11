"""imu-decode says what to give in place of a product, and where it has looked for a link;
closed standard input is empty.

usage: decode_test.py IMUD
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

DECODE = pathlib.Path(sys.argv.pop(1)).resolve().parent / "imu-decode"


class DecodeTest(unittest.TestCase):
    def refused(self, *words):
        with tempfile.TemporaryDirectory() as outer:
            folder = pathlib.Path(outer).resolve() / "here"
            folder.mkdir()
            done = subprocess.run([DECODE, *words], cwd=folder, capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        return done.stderr, folder

    def test_a_product(self):
        self.assertIn("vn-100 is a product of the protocol vectornav; give vectornav pty:imu1 --set model=vn-100",
                      self.refused("vn-100", "pty:imu1")[0])

    def test_standard_input_that_is_closed(self):
        """It is empty, and no file or socket takes its place, for which the program would wait."""
        with tempfile.TemporaryDirectory() as folder:
            (pathlib.Path(folder) / "imu.toml").write_text("""[truth]
port = "file:none.csv"
format = "csv"
[[imu]]
protocol = "stim300"
port = "file:imu.bin"
""")
            for words, said in ((("imud", "replay", "imu.toml", "-", "--fast"), "there is no truth of the format csv"),
                                (("imu-decode", "native", "-"), "no sample was decoded")):
                done = subprocess.run(["/bin/sh", "-c", 'exec "$0" "$@" <&-', DECODE.parent / words[0], *words[1:]], cwd=folder,
                                      capture_output=True, text=True, timeout=120)
                self.assertEqual(done.returncode, 1, done.stderr)
                self.assertIn(said, done.stderr)

    def test_a_link_that_is_in_another_folder(self):
        said, folder = self.refused("vectornav", "pty:../x/imu1")
        self.assertIn("is the process running that serves it?", said)
        self.assertIn(f"It was looked for at {folder.parent}/x/imu1; give an absolute path", said)
        said, _ = self.refused("vectornav", "pty:/nowhere/imu1")
        self.assertTrue(said.endswith("looked for at /nowhere/imu1\n"), said)


if __name__ == "__main__":
    unittest.main()
