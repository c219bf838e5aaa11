"""`imud run` and `imud check` without a file find one in three places, in order, and print which they took.

usage: found_config_test.py IMUD
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

IMUD = pathlib.Path(sys.argv.pop(1)).resolve()


def configuration(name):
    return f"""[truth]
port = "udp:127.0.0.1:0"
[[imu]]
name = "{name}"
protocol = "stim300"
port = "file:/dev/null"
"""


class FoundConfigTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.home = pathlib.Path(folder.name)
        self.here = self.home / "here"
        self.here.mkdir()

    def write(self, path, name):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(configuration(name))

    def imud(self, *words, **variables):
        """Runs imud where /etc has nothing but the configuration of self.system, if that exists."""
        script = """mount -t tmpfs none /etc; mkdir /etc/imud
            if [ -e "$1" ]; then cp "$1" /etc/imud/imud.toml; fi
            cd "$2"; shift 2; exec "$@\""""
        as_root = [] if os.geteuid() == 0 else ["--map-root-user"]
        environment = {"HOME": str(self.home), "XDG_RUNTIME_DIR": str(self.home), **variables}
        return subprocess.run(["/usr/bin/unshare", *as_root, "--mount", "/bin/sh", "-ec", script, "sh",
                               self.home / "system.toml", self.here, IMUD, *words], capture_output=True, text=True,
                              env=environment)

    def expect(self, place, name, *words, **variables):
        done = self.imud("check", *words, **variables)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f"imud: configuration {place}\n", done.stderr)
        self.assertIn(name, done.stdout)
        run = self.imud("run", "--for", "0.01", "--log-every", "0", *words, **variables)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn(f"imud: configuration {place}\n", run.stderr)
        self.assertIn(name, run.stdout)

    def test_the_order_of_the_places(self):
        xdg = self.home / "xdg"
        self.write(self.home / "system.toml", "of_system")
        self.expect("/etc/imud/imud.toml", "of_system")
        self.write(self.home / ".config/imud/imud.toml", "of_home")
        self.expect(f"{self.home}/.config/imud/imud.toml", "of_home")
        # With XDG_CONFIG_HOME ~/.config is not looked at; a relative one does not count.
        self.expect("/etc/imud/imud.toml", "of_system", XDG_CONFIG_HOME=str(xdg))
        self.expect(f"{self.home}/.config/imud/imud.toml", "of_home", XDG_CONFIG_HOME="xdg")
        self.write(xdg / "imud/imud.toml", "of_xdg")
        self.expect(f"{xdg}/imud/imud.toml", "of_xdg", XDG_CONFIG_HOME=str(xdg))
        self.write(self.here / "imud.toml", "of_here")
        self.expect("./imud.toml", "of_here", XDG_CONFIG_HOME=str(xdg))
        self.expect("./imud.toml", "of_here", "--set", "seed=2")

    def test_a_named_file_counts_alone(self):
        self.write(self.here / "imud.toml", "of_here")
        self.write(self.here / "other.toml", "of_other")
        done = self.imud("check", "other.toml")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("of_other", done.stdout)
        self.assertNotIn("configuration ./imud.toml", done.stderr)

    def test_none_names_the_places(self):
        (self.here / "imud.toml").mkdir()  # is no file
        for command in ("run", "check"):
            done = self.imud(command)
            self.assertEqual(done.returncode, 2)
            for words in ("./imud.toml", f"{self.home}/.config/imud/imud.toml", "/etc/imud/imud.toml", "`imud init`"):
                self.assertIn(words, done.stderr)


if __name__ == "__main__":
    unittest.main()
