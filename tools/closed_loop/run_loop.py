#!/usr/bin/env python3
"""Runs the loop of README.md: imud, flight_computer.py, and vehicle.py or JSBSim. Their files remain in --folder."""
import argparse
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent


def free_ports(kind, count):
    sockets = [socket.socket(socket.AF_INET, kind) for _ in range(count)]
    for entry in sockets:
        entry.bind(("127.0.0.1", 0))
    ports = [entry.getsockname()[1] for entry in sockets]
    for entry in sockets:
        entry.close()
    return ports


def wait_for(condition, fault):
    until = time.monotonic() + 30
    while not condition():
        if time.monotonic() > until:
            sys.exit(fault)
        time.sleep(0.02)


def program(name, option):
    """The absolute path of a program, as those that are started have another folder."""
    found = shutil.which(name) or sys.exit(f"{name} is no program; right would be {option} PATH")
    return str(pathlib.Path(found).resolve())


def jsbsim_command(options, truth_port, command_port):
    """JSBSim with the script of this folder, at ports that are free, and waiting for each command in lockstep."""
    script = (HERE / "jsbsim.xml").read_text()
    action = ' action="BLOCKING_INPUT"' if options.clock == "lockstep" else ""
    script = script.replace('<input port="5137"/>', f'<input port="{command_port}"{action}/>')
    script = script.replace('port="5140"', f'port="{truth_port}"')
    script = script.replace('end="60"', f'end="{options.seconds:g}"')
    (options.folder / "jsbsim.xml").write_text(script)
    pace = "--realtime" if options.clock == "realtime" else "--suspend"
    return [options.jsbsim, f"--script={options.folder}/jsbsim.xml", f"--root={options.jsbsim_root.resolve()}",
            f"--outputpath={options.folder}", "--nohighlight", pace]


def main():
    parser = argparse.ArgumentParser(description="Runs a closed loop: vehicle, imud, flight computer.")
    parser.add_argument("--clock", choices=("realtime", "lockstep"), default="realtime", help="of imud (%(default)s)")
    parser.add_argument("--for", dest="seconds", type=float, help="simulated seconds (18; JSBSim: 60)")
    parser.add_argument("--folder", type=pathlib.Path, default="closed_loop", help="of the results (%(default)s)")
    parser.add_argument("--imud", default="imud", help="the program (%(default)s)")
    parser.add_argument("--jsbsim", help="the program JSBSim, in place of vehicle.py")
    parser.add_argument("--jsbsim-root", type=pathlib.Path, default=".",
                        help="the folder that has JSBSim's aircraft (%(default)s)")
    options = parser.parse_args()
    options.seconds = options.seconds or (60.0 if options.jsbsim else 18.0)
    options.folder = options.folder.resolve()
    options.folder.mkdir(parents=True, exist_ok=True)
    imud_program = program(options.imud, "--imud")
    if options.jsbsim:
        options.jsbsim = program(options.jsbsim, "--jsbsim")
        if not (options.jsbsim_root / "aircraft").is_dir():
            sys.exit(f"{options.jsbsim_root.resolve()} has no aircraft of JSBSim; right would be --jsbsim-root PATH")
    (truth_port, command_port), (jsbsim_port,) = free_ports(socket.SOCK_DGRAM, 2), free_ports(socket.SOCK_STREAM, 1)
    line, log, estimate = (options.folder / name for name in ("imu1", "imud.log", "estimate.csv"))
    estimate.unlink(missing_ok=True)

    python = [sys.executable, "-B"]
    settings = [f"clock={options.clock}", f"truth.port=udp:127.0.0.1:{truth_port}", f"imu.0.port=pty:{line}"]
    computer = [*python, HERE / "flight_computer.py", line, "--csv", estimate]
    if options.jsbsim:
        vehicle = jsbsim_command(options, truth_port, jsbsim_port)
        settings.append("truth.format=jsbsim")
        # The flight begins level, with heading 200 deg (JSBSim's aircraft/c172x/reset01.xml).
        computer += ["--jsbsim", f"127.0.0.1:{jsbsim_port}", "--start-deg", "0", "0", "200"]
        computer += ["--lockstep"] if options.clock == "lockstep" else []
    else:
        vehicle = [*python, HERE / "vehicle.py", "--clock", options.clock, "--for", str(options.seconds),
                   "--truth-port", str(truth_port), "--command-port", str(command_port),
                   "--csv", options.folder / "truth.csv"]
        computer += ["--vehicle", f"127.0.0.1:{command_port}"]

    running = []
    try:
        with log.open("w") as errors:
            running.append(subprocess.Popen(
                [imud_program, "run", HERE / "imud.toml", "--wait-for-reader",
                 *(x for setting in settings for x in ("--set", setting)),
                 "--summary", options.folder / "summary.json"], stdout=errors, stderr=subprocess.STDOUT))
        wait_for(lambda: "waiting for a reader" in log.read_text(), f"imud does not begin; see {log}")
        running.append(subprocess.Popen(computer))
        wait_for(estimate.exists, f"{estimate} does not appear")  # the flight computer has opened the port
        time.sleep(0.2)  # and imud has noticed it
        with (options.folder / "vehicle.log").open("w") as output:
            exit_code = subprocess.run(vehicle, cwd=options.folder, stdout=output, stderr=subprocess.STDOUT).returncode
        if exit_code != 0:
            print((options.folder / "vehicle.log").read_text(), file=sys.stderr)
    finally:
        for process in running:
            process.send_signal(signal.SIGINT)
        codes = [process.wait(timeout=30) for process in running]
    print(re.sub(r"(?m)^\d{4}-.*\n", "", log.read_text()), end="")  # the summary, without the log
    return max(exit_code, *codes)


if __name__ == "__main__":
    sys.exit(main())
