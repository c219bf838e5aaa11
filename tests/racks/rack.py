"""Hosts of a rack as network namespaces of this machine: a bridge, a veth for each, and truth that reaches each with a delay of its own.

All of it ends with the process: namespaces have no names, and links end with their namespace.
"""
import ctypes
import heapq
import os
import pathlib
import random
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time

CLONE_NEWNET, PR_SET_PDEATHSIG = 0x40000000, 1
GROUP, PORT = "239.77.0.1", 9810
RATE_HZ = 200
PERIOD_NS = 1_000_000_000 // RATE_HZ
DELAY_MS = 20
LIMIT_S = 120  # only a test that fails waits so long

_libc = ctypes.CDLL(None, use_errno=True)


class Missing(Exception):
    """This machine cannot have network namespaces."""


def _check(result):
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def prefer():
    """Puts this process before others, if it may, so that load does not hold up truth."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pass


class Namespace:
    """A network namespace. A `with` puts the thread in it. Throws Missing."""

    def __init__(self):
        self._home = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        try:
            _check(_libc.unshare(CLONE_NEWNET))
        except OSError as why:
            raise Missing(f"no network namespace: {why}") from why
        self.descriptor = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        self.path = f"/proc/{os.getpid()}/fd/{self.descriptor}"
        self.__exit__()

    def enter(self):
        _check(_libc.setns(self.descriptor, CLONE_NEWNET))

    def __enter__(self):
        self.enter()

    def __exit__(self, *_):
        _check(_libc.setns(self._home, CLONE_NEWNET))

    def popen(self, words, prefers=False, **others):
        def begin():
            _libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)  # no process outlives this one
            self.enter()
            if prefers:
                prefer()
        return subprocess.Popen(words, preexec_fn=begin, **others)

    def ip(self, *commands):
        """Executes commands of ip(8)."""
        done = subprocess.run(["ip", "-batch", "-"], input="\n".join(commands), text=True, capture_output=True,
                              preexec_fn=self.enter)
        if done.returncode != 0:
            raise Missing(f"ip: {done.stderr.strip()}")


class Relay:
    """A process that passes the truth that reaches each host on to its port of truth on loopback, each datagram after a delay of its own.

    Number i delays by 0.2 ms + i * 0.3 ms, and up to 0.7 ms more at random.
    """

    def __init__(self, hosts):
        self._inputs, self._outputs = {}, []  # by descriptor: host and socket; by host
        for number, host in enumerate(hosts):
            with host:
                receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                receiver.setsockopt(socket.SOL_SOCKET, 33, 1 << 22)  # SO_RCVBUFFORCE: one that waits long loses nothing
                receiver.bind((GROUP, PORT))
                index = socket.if_nametoindex("eth0")
                receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                                    struct.pack("4s4si", socket.inet_aton(GROUP), bytes(4), index))
                sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            receiver.setblocking(False)
            self._inputs[receiver.fileno()] = (number, receiver)
            self._outputs.append(sender)
        self._process = os.fork()
        if self._process == 0:
            try:
                _libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
                prefer()
                self._run()
            finally:
                os._exit(1)
        for one in [receiver for _, receiver in self._inputs.values()] + self._outputs:
            one.close()

    def _run(self):
        delays = random.Random(31)
        poll = select.poll()
        for descriptor in self._inputs:
            poll.register(descriptor, select.POLLIN)
        held = []  # due, number of the datagram, host, bytes
        count = 0
        while True:
            for descriptor, _ in poll.poll(max(0, 1e3 * (held[0][0] - time.monotonic())) if held else None):
                host, receiver = self._inputs[descriptor]
                count += 1
                delay = 2e-4 + 3e-4 * host + delays.uniform(0, 7e-4)
                heapq.heappush(held, (time.monotonic() + delay, count, host, receiver.recv(2048)))
            while held and held[0][0] <= time.monotonic():
                _, _, host, datagram = heapq.heappop(held)
                try:
                    self._outputs[host].sendto(datagram, ("127.0.0.1", PORT))
                except OSError:  # nobody listens yet
                    pass

    def end(self):
        os.kill(self._process, signal.SIGKILL)
        os.waitpid(self._process, 0)


CONFIGURATION = """seed = 1
[truth]
port = "udp:127.0.0.1:{port}"
delay_ms = {delay_ms}
[control]
socket = "none"
[realtime]
epoch = "monotonic"  # the hosts are of one machine, and have one clock
skip_after_ms = 3600000
{realtime}
[[imu]]
name = "imu1"
rate_hz = {rate_hz}
phase_us = {phase_us}
protocol = "csv"
port = "file:{folder}/{name}.csv"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
"""


class Rack:
    """`count` hosts, of which none runs imud yet. Throws Missing. `phases_us`: of their grids, by number; the others have 0."""

    def __init__(self, build, source, folder, count=8, realtime="priority = 0\nlock_memory = false", phases_us={}):
        if os.geteuid() != 0 or not shutil.which("ip"):
            raise Missing("needs root, and ip (iproute2)")
        self._imud, self._tools, self._realtime = str(build / "imud"), str(source / "tools"), realtime
        self._phases_us = phases_us
        self.folder, self.imuds, self._processes = pathlib.Path(folder), {}, []
        self._network = Namespace()
        self.hosts = [Namespace() for _ in range(count)]
        self._network.ip("link set lo up", "link add bridge type bridge mcast_snooping 0", "address add 10.77.0.1/24 dev bridge",
                         "link set bridge up", "route add 239.0.0.0/8 dev bridge",
                         *(line for number, host in enumerate(self.hosts) for line in (
                             f"link add veth{number} type veth peer name eth0 netns {host.path}",
                             f"link set veth{number} master bridge up")))
        for number, host in enumerate(self.hosts):
            host.ip("link set lo up", f"address add 10.77.0.{number + 2}/24 dev eth0", "link set eth0 up")
        self._relay = Relay(self.hosts)

    def end(self):
        for process in self._processes:
            process.kill()
            process.wait()
        self._relay.end()

    def file(self, number, kind):
        return self.folder / f"host{number}.{kind}"

    def start(self, number):
        """Starts imud on a host, and waits until it is ready."""
        name = f"host{number}"
        self.file(number, "toml").write_text(CONFIGURATION.format(
            port=PORT, delay_ms=DELAY_MS, rate_hz=RATE_HZ, phase_us=self._phases_us.get(number, 0), realtime=self._realtime, folder=self.folder, name=name))
        read, write = os.pipe()
        with open(self.file(number, "log"), "wb") as log:
            imud = self.hosts[number].popen(
                [self._imud, "run", self.file(number, "toml"), "--record", self.file(number, "pcapng"), "--summary",
                 self.file(number, "json"), "--ready-fd", str(write)], pass_fds=[write], stdout=log, stderr=log, cwd=self.folder,
                env={**os.environ, "XDG_RUNTIME_DIR": str(self.folder)})
        os.close(write)
        self.imuds[number] = imud
        self._processes.append(imud)
        if not select.select([read], [], [], LIMIT_S)[0] or os.read(read, 6) != b"ready\n":
            raise AssertionError(f"{name} is not ready: " + self.file(number, "log").read_text())
        os.close(read)

    def source(self, **options):
        """Starts a simulator, which multicasts truth at 200 Hz: a turntable whose rate varies. `options`: of RealtimeClient."""
        source = self._network.popen([sys.executable, "-B", "-c", SOURCE, self._tools, GROUP, str(PORT), repr(options)], prefers=True)
        self._processes.append(source)
        return source

    def cut(self, number, off):
        self._network.ip(f"link set veth{number} {'down' if off else 'up'}")


SOURCE = """
import ast, itertools, math, sys
tools, group, port, options = sys.argv[1:]
sys.path.insert(0, tools)
from realtime_client import RealtimeClient, Truth
with RealtimeClient(group, int(port), **ast.literal_eval(options)) as imud:
    for step in itertools.count():
        time_s = step / %d
        angle = time_s + 0.5 * (1 - math.cos(2 * math.pi * time_s)) / (2 * math.pi)
        angle = math.remainder(angle, 2 * math.pi)
        imud.send(Truth(simulation_time_ns=step * %d, sigma_BN=(0, 0, math.tan(angle / 4)),
                        omega_BN_B=(0, 0, 1 + 0.5 * math.sin(2 * math.pi * time_s)), specific_force_B=(0, 0, -9.8)))
""" % (RATE_HZ, PERIOD_NS)
