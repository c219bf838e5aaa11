"""Runs the commands of every README.md, as a reader does who copies them: in order, in a copy of the tree, with the programs
that were built in build/release. First those of the README.md at the top; the others begin with the files that these have
made. commands.py has the marks for what is not run, which the totals below count.

usage: readme_test.py FOLDER_OF_THE_PROGRAMS SOURCE_FOLDER [README.md ...]
"""
import collections
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

import commands
import shell

PROGRAMS, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
ONLY = [sys.argv.pop(1) for argument in sys.argv[1:] if argument.endswith(".md")]
LIMIT_S = 120  # of one command

# What is stated here is found: a command that the extractor misses, or one that is not run any more, is a failure.
NOT_RUN = {"hardware": 9, "minutes": 17, "guest": 3, "simulator": 18, "network": 7, "root": 12}
AT_LEAST = 60  # commands that run

# What a machine that only runs imud lacks.
PATH = f"{PROGRAMS}:/usr/sbin:/usr/bin:/sbin:/bin"
BASH_WORDS = set(subprocess.run(["bash", "-c", "compgen -bk"], capture_output=True, text=True, check=True).stdout.split())


def readmes():
    """All README.md of the tree, the one at the top first."""
    found = [path for path in SOURCE.glob("**/README.md") if "build" not in path.relative_to(SOURCE).parts]
    return sorted((str(path.relative_to(SOURCE)) for path in found), key=lambda name: (name.count("/") > 0, name))


def scratch_copy(folder):
    """Makes a tree like a clone after the build: what commands may write is copied, the rest is linked."""
    for entry in SOURCE.iterdir():
        if entry.name in ("build", ".git"):
            continue
        if entry.name == "tools":
            shutil.copytree(entry, folder / entry.name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            (folder / entry.name).symlink_to(entry)
    (folder / "build" / "release").mkdir(parents=True)
    for program in PROGRAMS.glob("imu*"):  # not the build itself, which a command might change
        if program.is_file():
            (folder / "build" / "release" / program.name).symlink_to(program)


def head_of(text):
    """The program that a command begins with."""
    words = [word for word in text.split() if not re.match(r"[A-Z_]+=", word)]
    return words[0] if words else ""


class Runner:
    """Runs the commands of README.md after README.md, and keeps count."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.not_run, self.run, self.faults = collections.Counter(), 0, []

    def run_readme(self, name, tree):
        """Runs what that README.md has in a copy of the tree."""
        try:
            found = commands.read((SOURCE / name).read_text())
        except ValueError as error:
            self.faults.append(f"{name}: {error}")
            return
        home = self.folder / f"home{len(list(self.folder.iterdir()))}"
        home.mkdir(mode=0o700)
        log = home / "log"
        environment = {"PATH": PATH, "HOME": str(home), "TMPDIR": str(home), "XDG_RUNTIME_DIR": str(home), "LANG": "C.UTF-8"}
        reader = None
        for item in found:
            if isinstance(item, commands.File):
                (tree / item.name).write_text(item.text)
                (tree / item.name).chmod(0o755)
                continue
            where = f"{name}:{item.line}: {item.text}"
            if item.reason:
                self.not_run[item.reason] += 1
                continue
            head = head_of(item.text)
            if head not in BASH_WORDS and not shutil.which(head, path=PATH) and not (tree / head).is_file():
                self.faults.append(f"{where}\n    is no command here: mark the block by <!-- commands: none -->, or why it is not run")
                continue
            reader = reader or shell.Shell(tree, environment, log)
            started = time.monotonic()
            begin = log.stat().st_size if log.exists() else 0
            code = reader.run(item.text, item.stop_s, LIMIT_S)
            self.run += 1
            if (took := time.monotonic() - started) > 5:
                print(f"{took:.0f} s: {where}", file=sys.stderr)
            if code != item.exit_code and not (item.stop_s and code == 130):
                said = log.read_bytes()[begin:].decode(errors="replace")[-2000:]
                ended = f"did not end in {LIMIT_S} s" if code is None else f"ended with {code}, not {item.exit_code}"
                self.faults.append(f"{where}\n    {ended}\n{said}")
            if code is None:
                break  # the shell still waits for it
        if reader:
            reader.close()


def help_of(*program):
    """What --help prints; the programs are those of the build."""
    done = subprocess.run([PROGRAMS / program[0], *program[1:], "--help"], capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else ""


class ReadmeTest(unittest.TestCase):
    def test_commands_within_the_text(self):
        """Those that stand in a sentence have a subcommand and options that exist."""
        found, faults, known = 0, [], {}
        for name in ONLY or readmes():
            text = re.sub(r"^(```.*?^```|    .*?)$", "", (SOURCE / name).read_text(), flags=re.MULTILINE | re.DOTALL)
            for span in re.findall(r"`((?:imud|imu-(?:allan|campaign|decode|plot|truth))(?: [^`]+))`", text):
                words = re.split(r"\s+", span)
                program = words[:2] if words[0] == "imud" and not words[1].startswith("-") else words[:1]
                if span == "imud config":  # an interface of a record
                    continue
                found += 1
                while True:
                    if tuple(program) not in known:
                        known[tuple(program)] = help_of(*program)
                    text_of_help = known[tuple(program)]
                    after = words[len(program):len(program) + 1]  # which may be a command below this one
                    if not after or not re.search(rf"^Subcommands:\n(  .*\n)*?  {re.escape(after[0])} ", text_of_help, re.MULTILINE):
                        break
                    program = [*program, *after]
                lacking = [word for word in words if re.fullmatch(r"--[a-z][a-z0-9-]*", word) and word not in text_of_help]
                if not text_of_help or lacking:
                    faults.append(f"{name}: `{span}`: {lacking or program} does not exist")
        self.assertEqual(faults, [], "\n" + "\n".join(faults))
        if not ONLY:
            self.assertGreater(found, 40)

    def test_commands(self):
        all_names = readmes()
        self.assertGreater(len(all_names), 20)
        with tempfile.TemporaryDirectory(prefix="readme.") as folder:
            top = pathlib.Path(folder) / "top"
            top.mkdir()
            scratch_copy(top)
            runner = Runner(folder)
            for name in all_names:
                if ONLY and name not in ("README.md", *ONLY):
                    continue
                tree = top
                if name != "README.md":
                    tree = pathlib.Path(folder) / name.replace("/", "_")
                    shutil.copytree(top, tree, symlinks=True)
                runner.run_readme(name, tree)
        print(f"{runner.run} commands were run, not run: {dict(runner.not_run)}", file=sys.stderr)
        self.assertEqual(runner.faults, [], "\n" + "\n".join(runner.faults))
        if not ONLY:
            self.assertEqual(dict(runner.not_run), NOT_RUN, "state in readme_test.py what is not run")
            self.assertGreaterEqual(runner.run, AT_LEAST, "commands are missed")


if __name__ == "__main__":
    unittest.main()
