#!/usr/bin/env python3
"""A vehicle without anything proprietary: a rigid body on an air bearing, which three torquers turn.

The bearing holds its centre of mass, so that an accelerometer there senses what carries its weight. It sends its true
motion to imud, in real time or in lockstep, and receives the flight computer's torques by UDP. See README.md.
"""
import argparse
import math
import pathlib
import socket
import struct
import sys

from rotation import cross, euler, from_euler, from_rotation_vector, inverse, normalised, product, rotate

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from lockstep_client import LockstepClient, Truth  # noqa: E402
from realtime_client import RealtimeClient  # noqa: E402

RATE_HZ = 250
INERTIA = (2.0, 2.5, 3.0)  # kg m^2, about principal axes
TORQUER_LAG = 0.05  # s, of first order
LARGEST_TORQUE = 5.0  # N m
GRAVITY = 9.80665  # m/s^2
DEGREE = math.pi / 180


class Body:
    def __init__(self, roll, pitch, yaw):
        self.q_NB = from_euler(roll, pitch, yaw)
        self.omega = (0.0, 0.0, 0.0)  # omega_BN_B, rad/s
        self.torque = (0.0, 0.0, 0.0)  # N m

    def acceleration(self, omega, torque):
        """Euler's equations: rad/s^2."""
        gyroscopic = cross(omega, [j * w for j, w in zip(INERTIA, omega)])
        return tuple((t - g) / j for t, g, j in zip(torque, gyroscopic, INERTIA))

    def integrate(self, command, step):
        """One step: Runge-Kutta for the rate; the turn is the rate's integral of fourth order, with its coning."""
        wanted = [max(-LARGEST_TORQUE, min(LARGEST_TORQUE, x)) for x in command]
        begin, middle, end = (tuple(w + (t - w) * math.exp(-dt / TORQUER_LAG) for w, t in zip(wanted, self.torque))
                              for dt in (0, step / 2, step))

        def after(acceleration, dt):
            return tuple(w + a * dt for w, a in zip(self.omega, acceleration))

        k1 = self.acceleration(self.omega, begin)
        k2 = self.acceleration(after(k1, step / 2), middle)
        k3 = self.acceleration(after(k2, step / 2), middle)
        k4 = self.acceleration(after(k3, step), end)
        omega = after([(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)], step)
        turn = [step / 2 * (w0 + w1) + step**2 / 12 * (a0 - a1 + c) for w0, w1, a0, a1, c in
                zip(self.omega, omega, k1, self.acceleration(omega, end), cross(self.omega, omega))]
        self.q_NB = normalised(product(self.q_NB, from_rotation_vector(turn)))
        self.omega, self.torque = omega, end

    def truth(self, time_ns):
        w, *v = self.q_NB if self.q_NB[0] >= 0 else [-x for x in self.q_NB]
        return Truth(simulation_time_ns=time_ns, sigma_BN=[x / (1 + w) for x in v], omega_BN_B=self.omega,
                     omegaDot_BN_B=self.acceleration(self.omega, self.torque),
                     specific_force_B=rotate(inverse(self.q_NB), (0, 0, -GRAVITY)))


class Commands:
    """The flight computer's torques; each datagram has the number of the sample that they follow from."""

    def __init__(self, port):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self.number, self.torque = -1, (0.0, 0.0, 0.0)  # none so far

    def receive(self, least):
        """Receives what has arrived; waits for the command of sample `least`. Raises TimeoutError after 5 s."""
        while True:
            self._socket.settimeout(5.0 if self.number < least else 0.0)
            try:
                self.number, *self.torque = struct.unpack("<I3d", self._socket.recv(64))
            except BlockingIOError:
                return
            except TimeoutError:
                raise TimeoutError(f"no command for sample {least}; right would be flight_computer.py") from None


def main():
    parser = argparse.ArgumentParser(description="A rigid body on an air bearing, which a flight computer controls.")
    parser.add_argument("--clock", choices=("realtime", "lockstep"), default="realtime",
                        help="that of imud (%(default)s)")
    parser.add_argument("--truth-port", type=int, default=9810, help="UDP port of imud's truth.port (%(default)s)")
    parser.add_argument("--command-port", type=int, default=9820, help="UDP port for the torques (%(default)s)")
    parser.add_argument("--for", dest="seconds", type=float, default=18.0, help="simulated seconds (%(default)s)")
    parser.add_argument("--csv", default="truth.csv", help="writes the true motion (%(default)s)")
    options = parser.parse_args()
    body, commands = Body(25 * DEGREE, -15 * DEGREE, 0.0), Commands(options.command_port)
    in_lockstep = options.clock == "lockstep"
    client = LockstepClient if in_lockstep else RealtimeClient
    with client("127.0.0.1", options.truth_port) as imud, open(options.csv, "w", encoding="ascii") as log:
        log.write("time_s,roll,pitch,yaw,omega_x,omega_y,omega_z,torque_x,torque_y,torque_z\n")
        for step in range(round(options.seconds * RATE_HZ) + 1):
            truth = body.truth(step * 1_000_000_000 // RATE_HZ)
            columns = (step / RATE_HZ, *euler(body.q_NB), *body.omega, *body.torque)
            log.write(",".join(f"{x:.9g}" for x in columns) + "\n")
            if in_lockstep:
                answer = imud.step(truth)
                if not answer.accepted:
                    raise RuntimeError("imud refused the truth; its log has the cause")
                commands.receive(step)  # the sensor sends a datagram for each truth
            else:
                imud.send(truth)
                commands.receive(-1)
            body.integrate(commands.torque, 1 / RATE_HZ)
    if not in_lockstep:
        print(f"vehicle: {imud.sent} truths, the latest {imud.max_lateness_ns / 1e6:.3g} ms late", file=sys.stderr)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (OSError, RuntimeError) as error:
        sys.exit(f"vehicle.py: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
