"""A decoder by others reads the CANopen unit's frames: tshark finds the service, the node and the content of each.

Usage: canopen_decoders_test.py CANOPEN_SLAVE. Needs tshark.
"""
import os
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
from tshark import require, tshark, write_log

NODE = 10
BOOT, HEARTBEAT = "NMT Error Control: Boot-up [0xa]", "NMT Error Control: Operational [0xa]"
PRE_OPERATIONAL = "NMT Error Control: Pre-operational [0xa]"
UPLOAD, SEGMENT = "Default-SDO (tx): Initiate upload response", "Default-SDO (tx): Upload segment response"
DOWNLOAD, ABORT = "Default-SDO (tx): Initiate download response", "Default-SDO (tx): Abort transfer"
BLOCK = "Default-SDO (tx): Block upload"
NODE_ID, VENDOR = ("LSS (Slave): Inquire " + what for what in ("node-ID protocol, Node-ID 0x0000000a",
                                                               "identity vendor-ID protocol, Vendor-ID 0x00000077"))
# Specific force 1, -2, -9.75 m/s^2 in 2^-8 and rate 0.25, -0.5, 1 rad/s in 2^-11, as of canopen_slave, with the number of the sample.
TPDO1, TPDO2 = "000100fe40f6{:02x}00", "000200fc0008{:02x}00"

# What is sent to the unit, or the milliseconds that pass, with a sample every 10 ms; then what tshark finds in its answers: function code,
# service, content.
SESSION = (
    ("+10", (14, BOOT, "0x00 0")),
    ("000#010A",),  # NMT: start
    ("+10", (3, "PDO1 (tx)", TPDO1.format(1)), (5, "PDO2 (tx)", TPDO2.format(1))),
    ("60A#4018100100000000", (11, UPLOAD, "0x1018 0x01 77000000")),
    ("60A#4008100000000000", (11, UPLOAD, "0x1008 0x00 26000000")),
    ("60A#6000000000000000", (11, SEGMENT, b"imud CA".hex())),
    ("60A#7000000000000000", (11, SEGMENT, b"Nopen i".hex())),
    ("60A#A008100007000000", (11, BLOCK, "")),
    ("60A#4034120000000000", (11, ABORT, "0x1234 0x00 0x06020000")),
    ("60A#2F00180201000000", (11, DOWNLOAD, "0x1800 0x02")),  # the transmission types of TPDO1 and 2: at SYNC
    ("60A#2F01180201000000", (11, DOWNLOAD, "0x1801 0x02")),
    ("+10",),
    ("080#", (3, "PDO1 (tx)", TPDO1.format(2)), (5, "PDO2 (tx)", TPDO2.format(2))),
    ("60A#2316100164000300", (11, DOWNLOAD, "0x1016 0x01")),  # the heartbeat of node 3 is expected within 100 ms
    ("703#05",),
    ("+70",),
    ("+50", (14, HEARTBEAT, "0x05 0"), (1, "EMCY", "0x8130 0x11 0303000000")),
    ("60A#2B17100000000000", (11, DOWNLOAD, "0x1017 0x00")),  # no heartbeat
    ("000#800A",),  # NMT: pre-operational
    ("70A#R", (14, PRE_OPERATIONAL, "0x7f 0")),  # node guarding
    ("70A#R", (14, PRE_OPERATIONAL, "0x7f 1")),
    ("7E5#0401000000000000",),  # LSS: configuration
    ("7E5#5E00000000000000", (15, NODE_ID, "0x0a")),
    ("7E5#5A00000000000000", (15, VENDOR, "0x00000077")),
    ("7E5#0400000000000000",),
    ("000#820A",),  # NMT: reset communication
    ("+10", (14, BOOT, "0x00 0")),
)
CONTENT = ("nmt_guard.state", "nmt_guard.toggle", "sdo.main_idx", "sdo.sub_idx", "sdo.data.bytes", "sdo.abort_code", "em.err_code",
           "em.err_reg", "em.err_field", "pdo.data.bytes", "lss.nid", "lss.addr.vendor")


def main(slave):
    text = "".join(step[0] + "\n" for step in SESSION)
    run = subprocess.run([slave, "start_up_ms=10", "heartbeat_ms=100", "vendor_id=119"], input=text, stdout=subprocess.PIPE, text=True,
                         check=True)
    answers = run.stdout.splitlines()
    require(len(answers) == len(SESSION), answers)
    frames, wanted = [], []  # None: a frame of the master
    for (sent, *expected), answer in zip(SESSION, answers):
        if not sent.startswith("+"):
            frames.append(sent)
            wanted.append(None)
        frames += answer.split()
        require(len(answer.split()) == len(expected), sent, answer)
        wanted += expected
    with tempfile.TemporaryDirectory() as folder:
        log = os.path.join(folder, "bus.log")
        write_log(log, frames)
        rows = tshark(log, "canopen", "canopen.function_code", "canopen.node_id", "_ws.col.Info", *("canopen." + name for name in CONTENT))
    require(len(rows) == len(frames), len(rows), len(frames))
    compared = 0
    for (code, node, service, *content), expected, frame in zip(rows, wanted, frames):
        if expected is None:
            continue
        got = int(code, 0), service, " ".join(part for part in content if part)
        require(got == expected, frame, got, expected)
        require(int(node, 0) == (0x64 if expected[0] == 15 else NODE), frame, node)  # 7E4 has no node
        compared += 1
    require(compared == 22, compared)
    print("tshark:", compared, "frames of the unit")


main(*sys.argv[1:])
