"""Whatever path --help, the lists, the messages of the programs and the links and commands of the README.md files name exists after
`cmake --install`, below share/doc/imud, and so does the Python package.

usage: install_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import commands

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
FOLDERS = ("core", "emulator", "protocols", "transports", "tools", "tests")
PATH = re.compile(rf"(?<![\w./-])(?:{'|'.join(FOLDERS)})/[\w./-]*\w")
LITERAL = re.compile(r'"(?:[^"\\\n]|\\.)*"')


def paths_in(text):
    return {path for path in PATH.findall(text) if (SOURCE / path).exists()}


def messages():
    """The texts in the sources of the programs, without what they include."""
    for folder in FOLDERS[:-1]:
        for path in (SOURCE / folder).rglob("*.cpp"):
            for line in path.read_text().splitlines():
                if not line.startswith("#"):
                    yield from LITERAL.findall(line)


def readmes():
    return [path for path in SOURCE.rglob("README.md") if "build" not in path.relative_to(SOURCE).parts]


class InstallTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.prefix = pathlib.Path(folder.name)
        subprocess.run(["cmake", "--install", BUILD, "--prefix", cls.prefix], check=True, capture_output=True)
        cls.documents = cls.prefix / "share/doc/imud"

    def expect_installed(self, paths, least):
        self.assertGreaterEqual(len(paths), least)
        self.assertEqual([path for path in sorted(paths) if not (self.documents / path).exists()], [])

    def test_what_the_programs_print(self):
        texts = []
        for program in ("imud", "imu-decode", "imu-truth", "imu-allan", "imu-fit", "imu-plot"):
            texts.append(subprocess.run([self.prefix / "bin" / program, "--help"], capture_output=True, text=True, check=True).stdout)
        texts.append(subprocess.run([self.prefix / "bin/imud", "list"], capture_output=True, text=True, check=True).stdout)
        self.expect_installed(paths_in("\n".join(texts)), 2)
        self.expect_installed(paths_in("\n".join(messages())), 8)

    def test_links_and_commands_of_the_readmes(self):
        linked, used = set(), set()
        for readme in readmes():
            text = readme.read_text()
            for link in re.findall(r"\]\(([^)#]+)", text):
                if "://" not in link:
                    linked.add(str((readme.parent / link).resolve().relative_to(SOURCE)))
            for command in commands.read(text):
                if isinstance(command, commands.Command) and command.reason != "minutes":
                    used |= paths_in(command.text)
        self.expect_installed(linked, 35)
        self.expect_installed(used, 12)

    def test_the_python_package(self):
        found = list(self.prefix.glob("lib/python3*/dist-packages/imud/__init__.py"))
        self.assertEqual(len(found), 1)
        subprocess.run(["/usr/bin/python3", "-c", "import imud"], env={"PYTHONPATH": str(found[0].parents[1])}, check=True)


if __name__ == "__main__":
    unittest.main()
