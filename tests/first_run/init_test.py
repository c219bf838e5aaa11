"""`imud init` writes a configuration that `imud check` accepts, for every product and every simulator, prints commands that
work, and asks at a terminal for what is missing.

usage: init_test.py IMUD
"""
import json
import os
import pathlib
import pty
import re
import select
import shlex
import subprocess
import sys
import tempfile
import tomllib
import unittest

IMUD = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE = pathlib.Path(__file__).resolve().parents[2]
SIMULATORS = SOURCE / "emulator/simulators"
ENVIRONMENT = {**os.environ, "PATH": f"{IMUD.parent}:{os.environ['PATH']}"}
ENTRIES = json.loads(subprocess.run([IMUD, "list", "--json"], check=True, capture_output=True, text=True).stdout)
PROTOCOLS = {entry["name"]: entry for entry in ENTRIES if entry["kind"] == "protocol"}
FORMATS = [entry["name"] for entry in ENTRIES if entry["kind"] == "truth format"]
NAMES = sorted(path.stem for path in SIMULATORS.glob("*.toml"))


def units():
    """The products of a protocol that has several."""
    return {unit: name for name, entry in PROTOCOLS.items() for setting in entry["settings"] if setting["key"] == "model"
            for unit in setting["valid"].removeprefix("one of ").split(", ")}


def port_of(protocol):
    return "can:can0" if PROTOCOLS[protocol]["link"] == "CAN" else "pty:imu1"


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def imud(self, *words):
        return subprocess.run([IMUD, *words], cwd=self.folder, capture_output=True, text=True, stdin=subprocess.DEVNULL,
                              env={**ENVIRONMENT, "XDG_RUNTIME_DIR": str(self.folder)})

    def accepted(self, *words):
        """Makes a configuration, which `check` accepts, and returns it and what was printed."""
        made = self.imud("init", *words, "--force")
        self.assertEqual(made.returncode, 0, (words, made.stderr))
        checked = self.imud("check")
        self.assertEqual(checked.returncode, 0, (words, checked.stderr))
        return tomllib.loads((self.folder / "imud.toml").read_text()), made.stdout


class ProductsAndSimulators(InFolder):
    """Every product with a simulator in real time and one in lockstep; every simulator and truth format with a product on a
    serial line, one that computes its own solution, one on CAN and one that brings no rate."""

    def test_every_product(self):
        self.assertGreater(len(PROTOCOLS), 40)
        self.assertGreater(len(units()), 9)
        for name in [*PROTOCOLS, *units()]:
            protocol = units().get(name, name)
            for simulator in ("imu-truth", "ardupilot"):
                made, printed = self.accepted(name, "--port", port_of(protocol), "--from", simulator)
                imu = made["imu"][0]
                self.assertEqual((imu["protocol"], imu["port"]), (protocol, port_of(protocol)))
                self.assertEqual(imu.get("device", {}).get("model"), name if name in units() else None)
                self.assertIn(f"imu-decode {protocol} {port_of(protocol)}", printed)

    def test_every_simulator_and_format(self):
        self.assertEqual(len(NAMES), 9)
        for simulator in [*NAMES, *FORMATS]:
            for product in ("stim300", "vn-300", "dronecan", "csv"):
                port = "can:can0" if product == "dronecan" else "udp:127.0.0.1:9820" if product == "csv" else "pty:imu1"
                made, printed = self.accepted(product, "--port", port, "--from", simulator)
                self.assertIn("While imud runs, start: ", printed)
                if simulator in NAMES:
                    stated = tomllib.loads((SIMULATORS / f"{simulator}.toml").read_text())
                    self.assertEqual(made["truth"], stated["truth"])
                    self.assertEqual(made.get("clock"), stated.get("clock"))
                else:
                    self.assertEqual(made["truth"]["format"], simulator)

    def test_every_port(self):
        have_clients = ("pty", "udp", "can", "canmcast", "file", "canfile")  # at the same address
        for entry in ENTRIES:
            if entry["kind"] != "transport" or entry["name"] in ("pcap", "record"):
                continue
            product = "j1939" if "can" in entry["name"] else "native"
            made, printed = self.accepted(product, "--port", entry["example"], "--from", "jsbsim")
            self.assertEqual(made["imu"][0]["port"], entry["example"])
            client = f"imu-decode {product} {shlex.quote(entry['example'])}"
            self.assertEqual(client in printed, entry["name"] in have_clients, entry["name"])

    def test_the_bridges_have_the_same_truth(self):
        compared = 0
        for simulator, path in {"42": "nasa_42/imud.toml", "ardupilot": "ardupilot/imud.toml", "jsbsim": "jsbsim/imud.toml",
                                "px4": "px4/imud.toml", "struct": "struct/simulink.toml"}.items():
            bridge = tomllib.loads((SOURCE / "tools/bridges" / path).read_text())
            made = tomllib.loads((SIMULATORS / f"{simulator}.toml").read_text())
            self.assertEqual((made["truth"], made.get("clock")), (bridge["truth"], bridge.get("clock")), simulator)
            compared += 1
        self.assertEqual(compared, len(list((SOURCE / "tools/bridges").glob("*/*.toml"))))


class Options(InFolder):
    def test_errors_of_another_unit_are_named(self):
        for unit, model in (("vn-100", None), ("vn-200", "vn-100"), ("vn-300", "vn-100"), ("3dm-gx5-25", None), ("3dm-gx5-45", "3dm-gx5-25"),
                            ("3dm-gq7", "3dm-cv7"), ("3dm-cv7-ahrs", None), ("openimu300ri", None),
                            ("stim300", None)):
            _, printed = self.accepted(unit, "--port", port_of(units().get(unit, unit)), "--from", "jsbsim")
            self.assertEqual(re.findall(r"^The sensors have the errors of (.*): imud has none of (.*) itself", printed, re.MULTILINE),
                             [(model, unit)] if model else [])

    def test_another_port_of_the_truth(self):
        made, printed = self.accepted("stim300", "--port", "pty:a", "--from", "imu-truth", "--truth", "5555")
        self.assertEqual(made["truth"]["port"], "udp:127.0.0.1:5555")
        self.assertIn("imu-truth coning --to udp:127.0.0.1:5555\n", printed)
        made, printed = self.accepted("stim300", "--port", "pty:a", "--from", "gazebo", "--truth", "udp:0.0.0.0:777")
        self.assertEqual(made["truth"]["port"], "udp:0.0.0.0:777")
        self.assertIn("gazebo_to_imud.py --port 777\n", printed)
        # Of a file that imud brings along, the path and the port: a copy has to name another one.
        for name, number, file in (("jsbsim", "5140", "jsbsim/imud_output.xml"), ("42", "10001", "nasa_42/Inp_IPC.txt")):
            for given, advice in (((), ""), (("--truth", number), ""),
                                  (("--truth", "5141"), f" (copy {file.split('/')[1]} and set its port to 5141; it has {number})")):
                _, printed = self.accepted("stim300", "--port", "pty:a", "--from", name, *given)
                start = printed.split("While imud runs, start: ")[1].splitlines()[0]
                self.assertIn(f"{SOURCE}/tools/bridges/{file}", start)
                self.assertEqual(re.findall(r" \(copy.*", start), [advice] if advice else [], start)
                self.assertNotIn(number, re.sub(r" \(copy.*", "", start))
        self.assertIn("no number", self.imud("init", "stim300", "--port", "pty:a", "--from", "tum", "--truth", "5").stderr)

    def test_place(self):
        for simulator, frame, latitude in (("gazebo", "local", "latitude_deg"), ("jsbsim", None, "rest_latitude_deg"),
                                           ("42", "inertial", "rest_latitude_deg"), ("basilisk", "inertial", "rest_latitude_deg")):
            made, _ = self.accepted("vn-200", "--port", "pty:a", "--from", simulator, "--place=-47.5,11.25,577")
            self.assertEqual((made["earth"].get("frame"), made["earth"][latitude]), (frame, -47.5))
        for place in ("47", "91,0", "47,11,5,6", "a,b", "47;11", "47,"):
            refused = self.imud("init", "stim300", "--port", "pty:a", "--from", "jsbsim", f"--place={place}", "--force")
            self.assertEqual(refused.returncode, 2)
            self.assertIn("is no place", refused.stderr)

    def test_a_capture(self):
        folder = SOURCE / "tests/captures"
        subprocess.run([IMUD.parent / "imu-truth", "coning", "--for", "2", "--csv", self.folder / "truth.csv"], check=True,
                       stderr=subprocess.DEVNULL)
        for name, format in ((f"{folder}/jsbsim_c172_10s.pcap", "jsbsim"), ("truth.csv", "csv"),
                             (f"pcap:{folder}/jsbsim_two_ways.pcap.gz?port=15140", "jsbsim"),
                             (f"pcap:{folder}/jsbsim_two_ways.pcap.gz?port=15550", "fgnetfdm")):
            made, printed = self.accepted("stim300", "--port", "file:imu.bin", "--from", name)
            self.assertEqual(made["truth"]["format"], format)
            self.assertIn(f"fit the truth format {format}:", printed)
            self.assertNotIn("While imud runs", printed)
        (self.folder / "noise.pcap").write_bytes(bytes(range(256)))
        refused = self.imud("init", "stim300", "--port", "file:imu.bin", "--from", "noise.pcap", "--output", "no.toml")
        self.assertEqual((refused.returncode, (self.folder / "no.toml").exists()), (2, False), refused.stderr)

    def test_an_existing_file_is_kept(self):
        (self.folder / "imud.toml").write_text("mine")
        words = ("init", "stim300", "--port", "pty:a", "--from", "jsbsim")
        refused = self.imud(*words)
        self.assertEqual((refused.returncode, (self.folder / "imud.toml").read_text()), (2, "mine"))
        self.assertIn("--force", refused.stderr)
        self.assertEqual(self.imud(*words, "--output", "other.toml").returncode, 0)
        self.assertEqual(self.imud("check", "other.toml").returncode, 0)
        self.assertEqual(self.imud(*words, "--force").returncode, 0)
        self.assertEqual(self.imud("check").returncode, 0)

    def test_standard_output(self):
        words = ("init", "stim300", "--port", "pty:a", "--from", "imu-truth")
        for name in ("-", "/dev/stdout"):
            done = self.imud(*words, "--output", name)
            self.assertEqual((done.returncode, list(self.folder.iterdir())), (0, []), done.stderr)
            self.assertEqual(tomllib.loads(done.stdout)["imu"][0]["port"], "pty:a")
            self.assertIn("\n  imud check FILE ", done.stderr)
            self.assertIn("While imud runs, start: ", done.stderr)
            self.assertNotRegex(done.stdout + done.stderr, r"check -|is written")

    def test_a_file_whose_name_begins_as_an_option(self):
        done = self.imud("init", "stim300", "--port", "pty:a", "--from", "imu-truth", "--output=-weird.toml")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("\n  imud check ./-weird.toml ", done.stdout)
        self.assertEqual(self.imud("check", "./-weird.toml").returncode, 0)

    def test_a_port_of_any_characters(self):
        for port in (r"pty:a\tb", 'pty:a"b', r"pty:a\\", "pty:a b"):
            truth = f"unix:{self.folder}/truth_{port[4:]}"
            made, _ = self.accepted("stim300", "--port", port, "--from", "jsbsim", "--truth", truth)
            self.assertEqual((made["imu"][0]["port"], made["truth"]["port"]), (port, truth))

    def test_what_is_wrong_writes_nothing(self):
        for words, fault in (((), "PRODUCT, --port PORT, --from SIMULATOR are missing"),
                             (("stim300", "--port", "pty:a"), "--from SIMULATOR is missing"),
                             (("stim30", "--port", "pty:a", "--from", "jsbsim"), 'did you mean "stim300"?'),
                             (("adis16470", "--port", "pty:a", "--from", "jsbsim"), 'give model = "adis16470" in [[imu]]'),
                             (("vn200", "--port", "pty:a", "--from", "jsbsim"), 'did you mean "vn-200"?'),
                             (("stim300", "--port", "pty:a", "--from", "jsbsin"), 'did you mean "jsbsim"?'),
                             (("stim300", "--port", "can:can0", "--from", "jsbsim"), "is on a serial line"),
                             (("dronecan", "--port", "pty:a", "--from", "jsbsim"), "is on a CAN bus"),
                             (("native", "--port", "udp:127.0.0.1:5140", "--from", "jsbsim"), "sends to truth.port"),
                             (("stim300", "--port", "pty:a?baud=0", "--from", "jsbsim"), "baud")):
            refused = self.imud("init", *words)
            self.assertEqual(refused.returncode, 2, words)
            self.assertIn(fault, refused.stderr)
            self.assertEqual(list(self.folder.glob("*.toml")), [])

    def test_the_commands_work(self):
        """What init prints, as it stands: the run, a client, and motions in a simulator's place."""
        _, printed = self.accepted("VN-100", "--port", f"pty:{self.folder}/imu1", "--from", "imu-truth", "--truth", "0")
        check, run, client = re.findall(r"^  (.*?)    #", printed, re.MULTILINE)
        self.assertEqual((check, run), ("imud check imud.toml", "imud run imud.toml"))
        start = printed.split("While imud runs, start: ")[1].strip()
        self.assertEqual(start, "imu-truth coning --to udp:127.0.0.1:0")

        def begin(command, **more):
            return subprocess.Popen(shlex.split(command), cwd=self.folder, text=True, stdout=subprocess.PIPE,
                                    env={**ENVIRONMENT, "XDG_RUNTIME_DIR": str(self.folder)}, **more)
        ready, written = os.pipe()
        running = begin(f"{run} --ready-fd {written}", pass_fds=[written], stderr=subprocess.PIPE)
        try:
            os.close(written)
            self.assertEqual(os.read(ready, 10), b"ready\n")
            port = None  # the one that the system has chosen
            while port is None:
                line = running.stderr.readline()
                self.assertTrue(line, "the run has ended")
                port = re.search(r"udp:127\.0\.0\.1:([1-9]\d*)", line)
            truth = begin(start[:-1] + port.group(1), stderr=subprocess.DEVNULL)
            try:
                decoded = begin(f"{client} --count 100 --quiet --require checksum=0", stderr=subprocess.PIPE).communicate()
                self.assertRegex(decoded[1], r"samples +100 ")
            finally:
                truth.terminate()
                truth.communicate()
        finally:
            running.terminate()
            summary = running.communicate()[0]
            os.close(ready)
        self.assertEqual(running.returncode, 0)
        self.assertNotRegex(summary, r"truth +0 received")


# A machine whose /dev and /sys have two USB adapters, one of which has a name, a UART that exists, one that does not, a CAN
# interface and an Ethernet interface.
MACHINE = """set -e
mount -t tmpfs none /dev; mkdir -p /dev/serial/by-id
touch /dev/ttyUSB0 /dev/ttyACM0 /dev/ttyS0 /dev/ttyS1 /dev/ttyS2 /dev/tty1
ln -s ../../ttyUSB0 /dev/serial/by-id/usb-FTDI_bench
mount -t tmpfs none /sys/class/tty
for name in ttyUSB0 ttyACM0 ttyS0 ttyS1; do mkdir -p /sys/class/tty/$name/device; ln -s drivers/a_driver /sys/class/tty/$name/device/driver; done
echo 4 > /sys/class/tty/ttyS0/type; echo 0 > /sys/class/tty/ttyS1/type; mkdir /sys/class/tty/ttyS2
mount -t tmpfs none /sys/class/net
mkdir /sys/class/net/can3 /sys/class/net/eth0; echo 280 > /sys/class/net/can3/type; echo 1 > /sys/class/net/eth0/type
cd "$1"; shift; exec "$@"
"""


class AtATerminal(InFolder):
    def asked(self, answers, *words):
        """Runs init at a terminal, and sends each answer when its question stands there. Returns the exit code, the output, and
        the output at each question."""
        child, terminal = pty.fork()
        if child == 0:
            as_root = [] if os.geteuid() == 0 else ["--map-root-user"]
            os.execvpe("unshare", ["unshare", *as_root, "--mount", "/bin/sh", "-c", MACHINE, "sh", str(self.folder), str(IMUD), "init",
                                   *words], ENVIRONMENT)
        output, seen = "", []
        try:
            for question, given in answers:
                begin = len(output)
                while not re.search(question + r"[^\n]*: $", output[begin:]):
                    self.assertTrue(select.select([terminal], [], [], 60)[0], output)
                    output += os.read(terminal, 65536).decode()
                seen.append(output[begin:])
                os.write(terminal, given.encode())
            while True:
                try:
                    output += os.read(terminal, 65536).decode()
                except OSError:  # the other end is closed
                    break
        finally:
            status = os.waitpid(child, 0)[1]
            os.close(terminal)
        return os.waitstatus_to_exitcode(status), output, seen

    def test_asks_for_everything(self):
        code, output, seen = self.asked([("product", "stim30\n"), ("product", "STIM300\n"), ("port", "can:can0\n"), ("port", "1\n"),
                                         ("simulator", "jsbsim\n"), ("its port", "5141\n"), ("place", "nowhere\n"),
                                         ("place", "47.26,11.35\n")])
        self.assertEqual(code, 0, output)
        self.assertIn(" vectornav (vn-100, vn-200, vn-300) ", seen[0].replace("\r\n", " "))
        self.assertIn('did you mean "stim300"?', seen[1])
        rows = re.findall(r"^ +\d+  (\S+)", seen[2], re.MULTILINE)
        self.assertEqual(rows[:3], ["serial:/dev/serial/by-id/usb-FTDI_bench", "serial:/dev/ttyACM0", "serial:/dev/ttyS0"])
        self.assertIn("pty:imu1", rows)
        self.assertNotRegex(seen[2], r"ttyS1|ttyS2|tty1\b|serial:/dev/ttyUSB0|can")
        self.assertIn("is on a serial line", seen[3])
        self.assertEqual(re.findall(r"^ +\d+  (\S+)", seen[4], re.MULTILINE), NAMES)
        self.assertIn("is no place", seen[7])
        made = tomllib.loads((self.folder / "imud.toml").read_text())
        self.assertEqual(made["truth"], {"port": "udp:127.0.0.1:5141", "format": "jsbsim"})
        self.assertEqual(made["earth"]["rest_latitude_deg"], 47.26)
        self.assertEqual((made["imu"][0]["protocol"], made["imu"][0]["port"]), ("stim300", "serial:/dev/serial/by-id/usb-FTDI_bench"))
        self.assertIn("imud check imud.toml", output)

    def test_empty_answers_take_the_defaults(self):
        code, output, seen = self.asked([("port", "\n"), ("simulator", "\n"), ("its port", "\n"), ("place", "\n")], "dronecan")
        self.assertEqual(code, 0, output)
        self.assertRegex(seen[0], r" 1  can:can3 +virtual")
        self.assertNotIn("eth0", seen[0])
        made = tomllib.loads((self.folder / "imud.toml").read_text())
        self.assertEqual((made["imu"][0]["port"], made["truth"]["port"]), ("can:can3", "udp:127.0.0.1:9810"))
        self.assertNotIn("earth", made)
        self.assertEqual(self.imud("check").returncode, 0)

    def test_asks_for_nothing_that_is_given(self):
        code, output, seen = self.asked([], "stim300", "--port", "pty:imu1", "--from", "jsbsim")
        self.assertEqual((code, output.splitlines()[0]), (0, "imud.toml is written. Next:"))
        code, output, seen = self.asked([("port", "\n"), ("place", "\n")], "stim300", "--from", "jsbsim", "--force")
        self.assertEqual((code, len(seen)), (0, 2), output)

    def test_the_end_of_the_input(self):
        code, output, _ = self.asked([("product", "\x04")])
        self.assertEqual(code, 2, output)
        self.assertIn("has ended", output)
        self.assertEqual(list(self.folder.glob("*.toml")), [])


if __name__ == "__main__":
    unittest.main()
