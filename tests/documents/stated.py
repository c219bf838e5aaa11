"""What the programs state of themselves: commands, options, names, keys and methods. They come from --help, `imud list`, the
configurations that `imud example` prints and the answers of a running imud, not from what the documents are made by.

Used by tests whose arguments are BUILD_FOLDER SOURCE_FOLDER.
"""
import functools
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
DOCUMENTS = BUILD / "documents"
ENVIRONMENT = {**os.environ, "PATH": f"{BUILD}:{os.environ['PATH']}", "LC_ALL": "C.UTF-8", "TERM": "dumb"}


def output(*words, **others):
    return subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True, env=ENVIRONMENT, **others).stdout


def commands():
    """The words of each command line that has a --help."""
    for program in ("imud", "imu-allan", "imu-campaign", "imu-decode", "imu-fit", "imu-plot", "imu-truth"):
        yield from below([program])


def below(words):
    """A command, and the commands that it has."""
    yield words
    for listed in re.findall(r"^Subcommands:\n(.*?)(?:\n\n|\Z)", help_of(*words), re.MULTILINE | re.DOTALL):
        for name in re.findall(r"^  (\w+)", listed, re.MULTILINE):
            yield from below([*words, name])


@functools.cache
def help_of(*words):
    return output(*words, "help" if words[-1] == "help" else "--help")  # `imud help --help` shows the help of imud


def options(words):
    found = re.findall(r"^  (?:(-\w),)?(--[a-z0-9-]+)", help_of(*words), re.MULTILINE)
    return [name for pair in found for name in pair if name]


@functools.cache
def names(*kinds):
    return [name["name"] for name in json.loads(output("imud", "list", "--json")) if name["kind"] in kinds]


def keys():
    """The keys of the configurations that `imud example` prints, those that are comments there, too."""
    found = set()
    for name in names("protocol", "truth format"):
        for key in re.findall(r"^#?([a-z][a-z0-9_]*) += ", output("imud", "example", name), re.MULTILINE):
            found.add(key)
    return found


@functools.cache
def methods():
    """The methods that a running imud lists."""
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "imu.toml").write_text(
            '[truth]\nport = "udp:127.0.0.1:0"\n[[imu]]\nprotocol = "stim300"\nport = "file:/dev/null"\n'
            '[realtime]\npriority = 0\nlock_memory = false\n[control]\nsocket = "imud.sock"\n')
        read, write = os.pipe()
        run = subprocess.Popen(["imud", "run", "imu.toml", "--quiet", "--ready-fd", str(write)], cwd=folder, env=ENVIRONMENT,
                               pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write)
        try:
            assert os.read(read, 6) == b"ready\n"
            answer = json.loads(output("imud", "ctl", "--socket", "imud.sock", "--json", "list", cwd=folder))
        finally:
            run.terminate()
            run.wait()
            os.close(read)
    return [method["name"] if isinstance(method, dict) else method for method in answer["methods"]]
