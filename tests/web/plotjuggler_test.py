"""Samples as datagrams of JSON for PlotJuggler. usage: plotjuggler_test.py IMUD IMU_TRUTH TO_PLOTJUGGLER"""
import json
import socket
import subprocess
import sys

from imud_page import Imud

imud = Imud(sys.argv[1], sys.argv[2])
try:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        udp.settimeout(120)
        ctl = subprocess.Popen([sys.argv[1], "ctl", "--socket", f"{imud.folder.name}/control.sock", "subscribe", "what=samples",
                                "rate_hz=50"], stdout=subprocess.PIPE)
        sender = subprocess.Popen([sys.argv[3], f"127.0.0.1:{udp.getsockname()[1]}"], stdin=ctl.stdout)
        samples = []
        # The product sends before the first truth comes, the other does not.
        while min(sum(name in sample for sample in samples) for name in ("imu1", 'tail "left"')) <= 30:
            samples.append(json.loads(udp.recv(2000)))
        ctl.terminate()
        ctl.wait()
        ctl.stdout.close()
        assert sender.wait(120) == 0
    for name in ("imu1", 'tail "left"'):
        of_imu = [sample for sample in samples if name in sample]
        times = [sample["timestamp"] for sample in of_imu]
        steps = [b - a for a, b in zip(times, times[1:])]
        assert all(abs(step - 0.02) < 1e-9 for step in steps), steps
        for sample in of_imu:
            values = sample.pop(name)
            assert list(sample) == ["timestamp"], sample
            for quantity, tolerance in (("rate", 0.1), ("specific_force", 0.5)):
                for axis in "xyz":
                    error = values[quantity][axis] - values[f"true_{quantity}"][axis]
                    assert abs(error) < tolerance, f"{quantity}.{axis}: {error}"
            assert isinstance(values["k"], int) and values["temperature_c"] > 0, values
finally:
    code = imud.stop()
    print("".join(imud.log))
assert code == 0, f"imud has ended with {code}"
