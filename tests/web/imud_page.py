"""An imud with the web server and a simulator, on ports that the system chooses."""
import pathlib
import re
import subprocess
import tempfile
import time


# A product at the speed of its line, and a file.
TWO_IMUS = """
[[imu]]
name = "imu1"
protocol = "stim300"
port = "pty:{folder}/imu1"
pace = "line"
[[imu]]
name = "tail \\"left\\""
protocol = "native"
rate_hz = 200
port = "file:{folder}/imu2.bin"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
"""
NO_PRIORITY = """
[realtime]
priority = 0
lock_memory = false
"""


class Imud:
    """`imus` and `realtime` are parts of the configuration, `arguments` further ones of `imud run`; {folder} is that of the run. `start_s`: the
    simulation time of the first truth."""

    def __init__(self, imud, imu_truth, imus=TWO_IMUS, realtime=NO_PRIORITY, listen="127.0.0.1:0", arguments=(), start_s=0):
        self.folder = tempfile.TemporaryDirectory(prefix="web")
        folder = self.folder.name
        config = pathlib.Path(folder) / "imu.toml"
        config.write_text(f"""
[truth]
port = "udp:127.0.0.1:0"
{realtime}
[control]
socket = "{folder}/control.sock"
[web]
listen = "{listen}"
{imus.replace("{folder}", folder)}""")
        arguments = [argument.replace("{folder}", folder) for argument in arguments]
        self.imud = subprocess.Popen([imud, "run", config, "--log-every", "0", *arguments], stderr=subprocess.PIPE, text=True)
        self.log = []
        for line in self.imud.stderr:
            self.log.append(line)
            if " ready" in line:
                break
        else:
            raise RuntimeError("imud has not begun:\n" + "".join(self.log))
        ports = dict(re.findall(r"(\S+) is (\S+?)(?:,|$)", self.log[-1].strip()))
        self.address = ports.get("web.listen", listen)
        self.truth = subprocess.Popen([imu_truth, "coning", "--to", ports["truth.port"], "--frequency-hz", "0.5", "--half-angle-rad", "0.2",
                                       "--start", str(start_s)],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def stop(self):
        """Returns imud's exit code."""
        for program in (self.truth, self.imud):
            program.terminate()
        self.log += self.imud.stderr.readlines()
        self.truth.wait()
        return self.imud.wait()


def wait_until(what, condition, limit_s=120):
    """Returns the value of the condition once it is true."""
    end = time.monotonic() + limit_s
    while not (value := condition()):
        if time.monotonic() > end:
            raise AssertionError(f"not within {limit_s} s: {what}")
        time.sleep(0.05)
    return value
