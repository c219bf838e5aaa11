"""The completions of bash, zsh and fish, in these shells, have every command, option, name, method and key.

usage: completion_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import os
import pathlib
import pty
import select
import subprocess
import tempfile
import unittest

from stated import DOCUMENTS, ENVIRONMENT, commands, methods, names, options, output


class Bash:
    def complete(self, lines):
        """The completions of each line, whose last word is what stands so far."""
        script = f"source {DOCUMENTS}/bash/imud\n"
        for words in lines:
            program = words[0]
            script += (f"COMP_WORDS=({' '.join(repr(word) for word in words)}); COMP_CWORD={len(words) - 1}; COMPREPLY=()\n"
                       f"$(complete -p {program} | sed 's/.*-F \\([^ ]*\\).*/\\1/') {program}; "
                       "printf '%s ' \"${COMPREPLY[@]}\"; echo\n")
        return [row.split() for row in output("bash", "--norc", "-c", script).splitlines()]


class Fish:
    def complete(self, lines):
        script = f"source {DOCUMENTS}/fish/imud.fish\n"
        for program in ("imu-allan", "imu-campaign", "imu-decode", "imu-fit", "imu-plot", "imu-truth"):
            script += f"source {DOCUMENTS}/fish/{program}.fish\n"
        for words in lines:
            script += f"complete -C {' '.join(words)!r}; echo ----\n"
        with tempfile.TemporaryDirectory() as home:
            answer = subprocess.run(["fish", "--no-config", "-c", script], check=True, capture_output=True, text=True, cwd=home,
                                    env={**ENVIRONMENT, "HOME": home}).stdout
        return [[row.split("\t")[0] for row in block.splitlines()] for block in answer.split("----\n")[:-1]]


# A terminal that is large enough for every list, and nothing but prompt and line between the lists.
ZSHRC = f"""
stty rows 900 cols 400
unsetopt prompt_sp prompt_cr
LISTMAX=0
PS1='<>'
fpath=({DOCUMENTS}/zsh $fpath)
autoload -U compinit
compinit -u -D
zstyle ':completion:*' verbose no
bindkey '^D' list-choices
"""


class Zsh:
    def complete(self, lines):
        """Asks a shell at a terminal, by control-D, for the list of what could stand there."""
        with tempfile.TemporaryDirectory() as home:
            (pathlib.Path(home) / ".zshrc").write_text(ZSHRC)
            child, terminal = pty.fork()
            if child == 0:
                os.chdir(home)
                os.execvpe("zsh", ["zsh", "-d", "-i"], {**ENVIRONMENT, "HOME": home, "ZDOTDIR": home})
            try:
                self.read_until(terminal, "", "<>")
                return [self.listed(terminal, " ".join(words)) for words in lines]
            finally:
                os.close(terminal)
                os.waitpid(child, 0)

    def listed(self, terminal, line):
        # The shell shows prompt and line again after the list; control-U empties the line.
        text = self.read_until(terminal, line + "\x04", f"<>{line}")
        os.write(terminal, b"\x15")
        self.read_until(terminal, "print en''d\n", "end\r\n<>")
        return text.split()

    def read_until(self, terminal, text, end):
        os.write(terminal, text.encode())
        got = ""
        while not got.removesuffix("\x1b[?2004h").endswith(end):  # which turns bracketed paste on
            if not select.select([terminal], [], [], 120)[0]:
                raise AssertionError(f"zsh has not answered: {got[-300:]!r}")
            got += os.read(terminal, 65536).decode(errors="replace")
        return got


class CompletionTest(unittest.TestCase):
    def expect_all(self, shell):
        cases = [([*words, "--"], [name for name in options(words) if name.startswith("--")]) for words in commands()]
        cases += [(["imud", ""], [words[1] for words in commands() if len(words) == 2]),
                  (["imud", "help", ""], [words[1] for words in commands() if len(words) == 2]),
                  *((["imud", group, ""], [words[2] for words in commands() if len(words) == 3 and words[1] == group]) for group in ("campaign", "rack")),
                  (["imud", "help", "truth.d"], ["truth.delay_ms"]),
                  (["imud", "help", "async"], ["async_type", "async_hz"]),
                  (["imud", "example", ""], names("protocol", "truth format", "preset")),
                  (["imud", "init", ""], [*names("protocol"), "vn-200", "3dm-gq7", "openimu300ri"]),
                  (["imud", "init", "stim300", "--from", ""], ["jsbsim", "gazebo", "px4", "ardupilot", "basilisk", "fmi", "42",
                                                               "struct", "imu-truth", *names("truth format")]),
                  (["imud", "init", "stim300", "--port", ""], [f"{name}:" for name in names("transport")]),
                  (["imud", "run", "--set", "imu.0.gyro.unit"], ["imu.0.gyro.unit_sigma.bias_rad_per_s="]),
                  (["imu-decode", ""], names("protocol") + ["ulog", "mcap"]),
                  (["imu-decode", "native", ""], [f"{name}:" for name in names("transport")]),
                  (["imu-allan", "--against", ""], names("preset")),
                  (["imu-truth", "--format", ""], names("truth format")),
                  (["imu-campaign", ""], ["collect", "report"]),
                  (["imu-truth", ""], ["rest", "turntable", "coning", "spiral", "boost", "capture"]),
                  (["imud", "ctl", ""], methods()),
                  (["imud", "run", "--set", "imu.0.gyro."], ["imu.0.gyro.bias_rad_per_s=", "imu.0.gyro.max_rad_per_s="]),
                  (["imud", "run", "--set", ""], ["seed=", "clock=", "truth.port=", "imu.0.rate_hz=", "web.listen="]),
                  (["imud", "check", "a.toml", "--set", "truth.de"], ["truth.delay_ms="])]
        answers = shell.complete([words for words, _ in cases])
        self.assertEqual(len(answers), len(cases))
        for (words, expected), found in zip(cases, answers):
            self.assertTrue(expected, words)
            self.assertEqual([name for name in expected if name not in found], [], f"{words}: {found}")
            if words[-2:] == ["--from", ""]:
                self.assertEqual({found.count(name) for name in expected}, {1}, found)

    def test_bash(self):
        self.expect_all(Bash())

    def test_fish(self):
        self.expect_all(Fish())

    def test_zsh(self):
        self.expect_all(Zsh())

    def test_configurations_come_before_other_files(self):
        """Of bash: those that can be one, and folders; all files where there is none."""
        with tempfile.TemporaryDirectory() as folder:
            for name in ("a.toml", "b.bin", "c.pcapng.gz"):
                (pathlib.Path(folder) / name).write_text("")
            (pathlib.Path(folder) / "d").mkdir()
            for command in ("run", "check"):
                found = Bash().complete([["imud", command, f"{folder}/"], ["imud", command, f"{folder}/b"]])
                self.assertEqual([sorted(pathlib.Path(name).name for name in names) for names in found],
                                 [["a.toml", "c.pcapng.gz", "d"], ["b.bin"]])

    def test_running_instances(self):
        """`imud ctl --name` completes what runs: here a stand-in lists it."""
        with tempfile.TemporaryDirectory() as folder:
            stand_in = pathlib.Path(folder) / "imud"
            stand_in.write_text("#!/bin/sh\n[ \"$1\" = ctl ] && echo 'bench        /run/imud-bench.sock'\n")
            stand_in.chmod(0o755)
            path = ENVIRONMENT["PATH"]
            ENVIRONMENT["PATH"] = f"{folder}:{path}"
            try:
                for shell in (Bash(), Fish(), Zsh()):
                    # zsh completes a single one at once.
                    for line in (["imud", "ctl", "--name", ""], ["imud", "status", ""], ["imud", "top", ""]):
                        self.assertIn("bench", shell.complete([line])[0], (shell, line))
            finally:
                ENVIRONMENT["PATH"] = path

if __name__ == "__main__":
    unittest.main()
