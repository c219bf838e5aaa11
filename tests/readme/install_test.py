"""`cmake --install` puts what tools/packaging/files.txt and install.cmake state, each file once, and nothing else; whatever path
--help, the lists, the messages of the programs and the links and commands of the README.md files name is below share/imud;
the programs run there without the source tree.

usage: install_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

import commands

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
PROGRAMS = ("imud", "imu-decode", "imu-truth", "imu-allan", "imu-campaign", "imu-fit", "imu-plot")
FOLDERS = ("core", "emulator", "protocols", "transports", "tools", "tests")
DOCUMENTS = {"man": "share/man", "bash": "share/bash-completion/completions", "zsh": "share/zsh/site-functions",
             "fish": "share/fish/vendor_completions.d"}
PATH = re.compile(rf"(?<![\w./-])(?:{'|'.join(FOLDERS)})/[\w./-]*\w")
LITERAL = re.compile(r'"(?:[^"\\\n]|\\.)*"')


def paths_in(text):
    return {path for path in PATH.findall(text) if (SOURCE / path).exists()}


def listed():
    """The paths of tools/packaging/files.txt, as CMake reads it: a pattern is of names in a folder and those below it."""
    for line in (SOURCE / "tools/packaging/files.txt").read_text().splitlines():
        if not line or line.startswith("#"):
            continue
        pattern = pathlib.PurePath(line.split()[1])
        if "*" in pattern.name:
            found = [path for path in (SOURCE / pattern.parent).rglob(pattern.name) if path.is_file() and "__pycache__" not in path.parts]
        else:
            found = [SOURCE / pattern]
        assert found, line
        for path in found:
            yield str(path.relative_to(SOURCE))


def messages():
    """The texts in the sources of the programs, without what they include."""
    for folder in FOLDERS[:-1]:
        for path in (SOURCE / folder).rglob("*.cpp"):
            for line in path.read_text().splitlines():
                if not line.startswith("#"):
                    yield from LITERAL.findall(line)


def readmes():
    return [path for path in SOURCE.rglob("README.md") if "build" not in path.relative_to(SOURCE).parts]


def linked_files():
    linked = set()
    for readme in readmes():
        for link in re.findall(r"\]\(([^)#]+)", readme.read_text()):
            if "://" not in link:
                linked.add(str((readme.parent / link).resolve().relative_to(SOURCE)))
    return linked


class InstallTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.prefix = pathlib.Path(folder.name)
        installed = subprocess.run(["cmake", "--install", BUILD, "--prefix", cls.prefix], check=True, capture_output=True,
                                   text=True)
        cls.lines = re.findall(r"^-- (?:Installing|Up-to-date): (.*)$", installed.stdout, re.MULTILINE)
        cls.documents = cls.prefix / "share/imud"

    def test_is_the_stated_list(self):
        python = f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/dist-packages/imud"
        expected = {f"bin/{program}" for program in PROGRAMS}
        expected |= {f"share/imud/{path}" for path in listed()}
        expected |= {f"{python}/{path.name}" for path in (SOURCE / "tools/python/imud").glob("*.py")}
        for made, installed in DOCUMENTS.items():
            paths = [path.relative_to(BUILD / "documents" / made) for path in (BUILD / "documents" / made).rglob("*") if path.is_file()]
            self.assertTrue(paths, made)
            expected |= {f"{installed}/{path}" for path in paths}
        expected |= {"share/doc/imud/copyright", "include/imud/lockstep_client.hpp", "include/imud/realtime_client.hpp", "etc/security/limits.d/imud.conf",
                     "lib/systemd/system/imud@.service", "lib/systemd/user/imud@.service", "lib/sysusers.d/imud.conf", "lib/tmpfiles.d/imud.conf",
                     "lib/udev/rules.d/60-imud.rules"}
        found = [str(path.relative_to(self.prefix)) for path in self.prefix.rglob("*") if path.is_file() or path.is_symlink()]
        self.assertGreater(len(found), 150)
        self.assertEqual(sorted(found), sorted(expected))
        lines = [line for line in self.lines if not os.path.isdir(line)]
        self.assertEqual(sorted(lines), sorted(str(self.prefix / path) for path in expected), "installed twice")

    def test_is_readable_and_scripts_are_executable(self):
        for path in self.prefix.rglob("*"):
            if path.is_dir():
                continue
            mode = path.stat().st_mode & 0o7777
            runs = path.parent.name == "bin" or path.read_bytes()[:2] == b"#!"
            self.assertEqual(oct(mode), oct(0o755 if runs else 0o644), path)

    def test_one_version(self):
        """The build, the packages and the Python package have the same."""
        stated = subprocess.run([self.prefix / "bin/imud", "--version"], capture_output=True, text=True, check=True).stdout.split()[1]
        changelog = (SOURCE / "tools/packaging/debian/changelog").read_text()
        project = (SOURCE / "tools/python/pyproject.toml").read_text()
        self.assertEqual(re.match(r"imud \((.*?)\)", changelog).group(1), stated)
        self.assertEqual(re.search(r'^version = "(.*)"$', project, re.MULTILINE).group(1), stated)

    def test_headers_are_for_users(self):
        """The clients are complete in themselves; the other headers are pages of documentation, which a text names."""
        self.assertEqual({path.name for path in (self.prefix / "include").rglob("*") if path.is_file()},
                         {"lockstep_client.hpp", "realtime_client.hpp"})
        named = paths_in("\n".join(messages())) | linked_files()
        found = {str(path.relative_to(self.documents)) for path in self.documents.rglob("*.hpp")}
        self.assertEqual({path for path in found if not path.startswith("tools/vcan/")} - named, set())

    def test_needs_no_source_tree(self):
        """In a namespace where the source tree and the build are hidden by empty folders, a configuration, the captured
        flight and a scenario of the installed tree become packets, and `imud demo` shows them."""
        script = f"""mount -t tmpfs none {shlex.quote(str(SOURCE))}
            if [ -e {shlex.quote(str(BUILD))} ]; then mount -t tmpfs none {shlex.quote(str(BUILD))}; fi
            cd {shlex.quote(str(self.documents))}
            export PATH={shlex.quote(str(self.prefix / "bin"))}:$PATH
            imud demo --for 1 > "$1/demo"
            grep -q "checksum   0 failures" "$1/demo"
            imud example stim300 > "$1/imu.toml"
            imud replay "$1/imu.toml" tests/captures/jsbsim_c172_10s.pcap --fast --set truth.format=jsbsim --set truth.port=udp:127.0.0.1:5140 \\
                --set imu.0.port=file:"$1/imu.bin" --scenario tools/scenarios/usb_batches.toml --quiet
            imu-decode stim300 file:"$1/imu.bin" --quiet --require 'samples>=9000,checksum=0'"""
        as_root = [] if os.geteuid() == 0 else ["--map-root-user"]
        with tempfile.TemporaryDirectory() as folder:
            ran = subprocess.run(["unshare", *as_root, "--mount", "bash", "-ec", script, "bash", folder],
                                 capture_output=True, text=True)
            self.assertEqual(ran.returncode, 0, ran.stderr)

    def expect_installed(self, paths, least):
        self.assertGreaterEqual(len(paths), least)
        self.assertEqual([path for path in sorted(paths) if not (self.documents / path).exists()], [])

    def test_what_the_programs_print(self):
        texts = []
        for program in PROGRAMS:
            texts.append(subprocess.run([self.prefix / "bin" / program, "--help"], capture_output=True, text=True, check=True).stdout)
        texts.append(subprocess.run([self.prefix / "bin/imud", "list"], capture_output=True, text=True, check=True).stdout)
        self.expect_installed(paths_in("\n".join(texts)), 2)
        self.expect_installed(paths_in("\n".join(messages())), 8)

    def test_links_and_commands_of_the_readmes(self):
        used = set()
        for readme in readmes():
            for command in commands.read(readme.read_text()):
                if isinstance(command, commands.Command) and command.reason != "minutes":
                    used |= paths_in(command.text)
        self.expect_installed(linked_files(), 35)
        self.expect_installed(used, 12)

    def test_the_python_package(self):
        found = list(self.prefix.glob("lib/python3*/dist-packages/imud/__init__.py"))
        self.assertEqual(len(found), 1)
        subprocess.run(["/usr/bin/python3", "-c", "import imud"], env={"PYTHONPATH": str(found[0].parents[1])}, check=True)


if __name__ == "__main__":
    unittest.main()
