"""Runs commands one after another in one bash, as a reader who copies them line by line."""
import ctypes
import os
import pathlib
import re
import signal
import subprocess
import time

# Reads commands that end in NUL from descriptor 9, and writes their exit codes to 8. They are executed by this shell, so that
# variables, jobs and the folder last.
LOOP = r"""while IFS= read -r -d '' text <&9; do { eval "$text"; } </dev/null 8>&- 9<&-; echo $? >&8; done"""
SET_CHILD_SUBREAPER = 36


# imud ctl, as root, finds the sockets of all instances in /run/imud.
ALONE = """PATH=$PATH:/usr/sbin:/sbin
ip link set lo up && { [ ! -d /run/imud ] || mount -t tmpfs imud /run/imud; } && exec "$@"
"""


def alone():
    """Returns the command that runs another one with a network and sockets of its own, or nothing where that is forbidden."""
    for unshare in (["unshare", "--net", "--mount"], ["unshare", "--map-root-user", "--net", "--mount"]):
        start = [*unshare, "sh", "-c", ALONE, "sh"]
        if subprocess.run([*start, "true"], capture_output=True).returncode == 0:
            return start
    return []


class Shell:
    def __init__(self, folder, environment, log):
        ctypes.CDLL(None).prctl(SET_CHILD_SUBREAPER, 1)  # what goes into the background stays a descendant
        commands, self._commands = os.pipe()
        self._codes, codes = os.pipe()
        os.set_blocking(self._codes, False)
        # dup2() of bash: 8 and 9 are as the loop has them.
        start = f"exec 9<&{commands} 8>&{codes} {commands}<&- {codes}>&-; {LOOP}"
        self._log = open(log, "ab")
        self._bash = subprocess.Popen([*alone(), "bash", "-c", start], cwd=folder, env=environment, stdout=self._log,
                                      stderr=self._log, stdin=subprocess.DEVNULL, pass_fds=(commands, codes),
                                      start_new_session=True)
        os.close(commands)
        os.close(codes)

    def run(self, text, stop_s, limit_s):
        """Returns the exit code; None if the command does not end. After stop_s seconds, if not 0, its processes get SIGINT."""
        before = set(self._children()) if stop_s else set()
        self._begin = self._log.seek(0, os.SEEK_END)
        os.write(self._commands, text.encode() + b"\0")
        stop_at = time.monotonic() + (stop_s or limit_s)
        code = self._code_until(stop_at)
        if re.search(r"&\s*(#.*)?$", text):
            self._wait_until_it_runs(text)
        if code is None and stop_s:
            for process in set(self._children()) - before:
                self._send(process, signal.SIGINT)
            code = self._code_until(time.monotonic() + limit_s)
        return code

    def close(self):
        """Ends the shell and whatever runs in the background."""
        os.close(self._commands)
        for how in (signal.SIGTERM, signal.SIGKILL):
            deadline = time.monotonic() + 5
            while (all_ := descendants(os.getpid())) and time.monotonic() < deadline:
                for process in all_:
                    self._send(process, how)
                time.sleep(0.1)
                self._bash.poll()
                self._reap()
        os.close(self._codes)
        self._log.close()
        self._bash.wait()

    def _wait_until_it_runs(self, text):
        """No reader types the next line at once, and one who starts imud waits for its line `ready`."""
        time.sleep(1)
        deadline = time.monotonic() + 60
        while re.match(r"imud (run|replay) ", text) and time.monotonic() < deadline:
            with open(self._log.name, "rb") as log:
                log.seek(self._begin)
                if b" ready" in log.read():
                    return
            time.sleep(0.05)

    def _children(self):
        return descendants(self._bash.pid)

    def _code_until(self, deadline):
        text = b""
        while time.monotonic() < deadline:
            try:
                text += os.read(self._codes, 16)
            except BlockingIOError:
                time.sleep(0.005)
            if text.endswith(b"\n"):
                return int(text)
        return None

    @staticmethod
    def _reap():
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            pass

    @staticmethod
    def _send(process, number):
        try:
            os.kill(process, number)
        except ProcessLookupError:
            pass


def descendants(root):
    """The processes below that one, zombies left out."""
    parents = {}
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            parents[int(stat.parent.name)] = int(fields[1])
    found, level = [], {root}
    while level:
        level = {process for process, parent in parents.items() if parent in level}
        found += level
    return found
