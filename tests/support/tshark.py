"""For the tests in which tshark reads frames of a CAN bus."""
import subprocess


def require(condition, *what):
    if not condition:  # not `assert`, which PYTHONOPTIMIZE removes
        raise AssertionError(what)


def write_log(path, frames):
    """Writes frames ("60A#4000100000000000") as candump -L does, 1 ms apart."""
    with open(path, "w") as file:
        for i, frame in enumerate(frames):
            file.write(f"({1000 + i / 1000:.6f}) can0 {frame}\n")


def tshark(log, dissector, *fields):
    """Returns the texts of the fields for each frame of a log; empty where a frame has none."""
    command = ["tshark", "-n", "-d", f"can.subdissector,{dissector}", "-r", log, "-T", "fields"]
    for field in fields:
        command += ["-e", field]
    run = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return [line.split("\t") for line in run.stdout.splitlines()]
