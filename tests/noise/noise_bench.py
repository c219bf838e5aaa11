"""Three products at rest: the bytes that imud sends for them, decoded by the vendors' documents, and the figures of their data sheets.

Nothing here is of imud's code. The increments are decoded, because they are sums over the sensor's own samples: a rate that is
decimated would have aliases, more or less of them by the sensor's filters.
"""
import subprocess
import tempfile
from pathlib import Path

import numpy as np

G0 = 9.80665
DEG = np.pi / 180
HOUR = 3600.0
GYRO, ACCELEROMETER = "gyro", "accelerometer"
SENSORS = (GYRO, ACCELEROMETER)
FLAT = 2 * np.log(2) / np.pi  # of B^2 in the Allan variance


# --- The documents' formats ---
def rows_of(data, begin, size):
    """Frames of one size, a row for each. The last may be cut off."""
    if not data.startswith(begin):
        raise ValueError(f"the output begins with {data[:8].hex()}, not with {begin.hex()}")
    frames = np.frombuffer(data[:len(data) // size * size], np.uint8).reshape(-1, size)
    if (frames[:, :len(begin)] != np.frombuffer(begin, np.uint8)).any():
        raise ValueError("a frame has another header than the first")
    return frames


def crc_rows(rows, bits, polynomial, start):
    """A CRC without reflection over each row."""
    top, mask = np.uint32(1 << bits - 1), np.uint32((1 << bits) - 1)
    table = np.arange(256, dtype=np.uint32) << np.uint32(bits - 8)
    for _ in range(8):
        table = np.where(table & top, table << np.uint32(1) ^ np.uint32(polynomial), table << np.uint32(1)) & mask
    crc = np.full(len(rows), start, np.uint32)
    for column in rows.T:
        crc = (crc << np.uint32(8) & mask) ^ table[(crc >> np.uint32(bits - 8)) ^ column]
    return crc


def require(what, holds):
    if not np.all(holds):
        raise ValueError(f"{what} is wrong in {np.count_nonzero(~holds)} of {holds.size} frames")


def stim300(data):
    """TS1524 revision 31: datagram 0x91, increments of angle in 2^-21 deg and of velocity in 2^-22 m/s (10 g), a counter of samples
    at 2 kHz."""
    frames = rows_of(data, b"\x91", 28)
    require("the CRC", crc_rows(frames[:, :24], 32, 0x04C11DB7, 0xFFFFFFFF) == frames[:, 24:].copy().view(">u4")[:, 0])
    require("a status", (frames[:, 10] == 0) & (frames[:, 20] == 0))
    require("the counter", np.diff(frames[:, 21]) == np.uint8(2000 // 125))

    def three(first):
        bytes_ = frames[:, first:first + 9].reshape(-1, 3, 3).astype(np.int32)
        raw = bytes_[:, :, 0] << 16 | bytes_[:, :, 1] << 8 | bytes_[:, :, 2]
        return (raw ^ 0x800000) - 0x800000
    return three(1) * (DEG / 2**21), three(11) * 2.0**-22


def vectornav(data):
    """Binary output of the IMU group's dTheta (s, then deg) and dVel (m/s), as floats."""
    frames = rows_of(data, bytes((0xFA, 0x04, 0xC0, 0x00)), 34)
    require("the CRC", crc_rows(frames[:, 1:], 16, 0x1021, 0) == 0)
    numbers = frames[:, 4:32].copy().view("<f4").astype(float)
    require("the time step", abs(numbers[1:, 0] - 0.02) < 1e-6)
    return numbers[:, 1:4] * DEG, numbers[:, 4:7]


def mip(data):
    """Sensor data (0x80) of two fields: delta angle (0x07, rad) and delta velocity (0x08, g s), of 14 bytes each."""
    frames = rows_of(data, bytes((0x75, 0x65, 0x80, 28, 14, 0x07)), 34)
    require("the second field", (frames[:, 18] == 14) & (frames[:, 19] == 8))
    a = np.cumsum(frames[:, :32], axis=1, dtype=np.uint32)
    require("the checksum", (a[:, -1] % 256 == frames[:, 32]) & (np.sum(a, axis=1) % 256 == frames[:, 33]))
    return (frames[:, 6:18].copy().view(">f4").astype(float), frames[:, 20:32].copy().view(">f4") * G0)


class Product:
    def __init__(self, decode, hz, keys, unit_keys, N, minimum):
        self.decode, self.hz, self.keys = decode, hz, keys
        self.unit_keys = unit_keys  # of each sensor: the key of N in imud's configuration, and its unit in SI
        # SI. The sheet's in-run bias is the minimum of the Allan deviation, of flicker alone 0.664 B.
        self.N, self.B = dict(zip(SENSORS, N)), dict(zip(SENSORS, np.array(minimum) / FLAT**0.5))


RT_HOUR = HOUR**0.5
PRODUCTS = {
    # Data sheet of the STIM300: 0.15 deg/sqrt(h), 0.06 m/s/sqrt(h); 0.5 deg/h, 0.05 mg.
    "stim300": Product(stim300, 125, """protocol = "stim300"
model = "stim300"
device.start_up = false
device.sample_rate = 125
device.inclination = false
device.temperature = false
device.gyro_unit = "increment"
device.accelerometer_unit = "increment"
""", (("angle_random_walk_deg_per_rt_hr", DEG / RT_HOUR), ("velocity_random_walk_m_per_s_per_rt_hr", 1 / RT_HOUR)),
                       (0.15 * DEG / RT_HOUR, 0.06 / RT_HOUR), (0.5 * DEG / HOUR, 0.05e-3 * G0)),
    # Data sheet of the VN-100: 0.0035 deg/s/sqrt(Hz), 0.14 mg/sqrt(Hz); 10 deg/h, 0.04 mg.
    "vn-100": Product(vectornav, 50, """protocol = "vectornav"
model = "vn-100"
device.model = "vn-100"
device.async_type = 0
device.binary_1 = "1,16,04,00C0"
""", (("noise_density_deg_per_s_per_rt_hz", DEG), ("noise_density_mg_per_rt_hz", 1e-3 * G0)),
                      (0.0035 * DEG, 0.14e-3 * G0), (10 * DEG / HOUR, 0.04e-3 * G0)),
    # Data sheet of the 3DM-GX5-25: 0.005 deg/s/sqrt(Hz), 80 ug/sqrt(Hz); 8 deg/h, 0.04 mg.
    "3dm-gx5-25": Product(mip, 100, """protocol = "mip"
model = "3dm-gx5-25"
device.model = "3dm-gx5-25"
device.sensor_rate_hz = 100
device.sensor_fields = ["delta_angle", "delta_velocity"]
""", (("noise_density_deg_per_s_per_rt_hz", DEG), ("noise_density_ug_per_rt_hz", 1e-6 * G0)),
                          (0.005 * DEG, 80e-6 * G0), (8 * DEG / HOUR, 0.04e-3 * G0)),
}


B_KEYS, B_UNITS = ("bias_instability_deg_per_hr", "bias_instability_mg"), (DEG / HOUR, 1e-3 * G0)


# --- The sensor at rest ---
def write_truth(path, hours):
    axes = [f"{q}_{a}" for q in ("r_BN_N", "v_BN_N", "omega_BN_B", "omegaDot_BN_B", "nonConservativeAccelpntB_B") for a in "xyz"]
    rows = [",".join(["time_ns", "sigma_BN_1", "sigma_BN_2", "sigma_BN_3", *axes])]
    rows += [f"{k * 30 * 10**9},0,0,0" + ",0" * 14 + f",{-G0}" for k in range(round(hours * 120) + 1)]
    path.write_text("\n".join(rows) + "\n")


def at_rest(imud, name, hours, seed=1, white=None, flicker=None):
    """Rates and specific forces (n x 3) of the product, averaged over each period. Faults to find: `white`, for each sensor factors on
    its axes' N; `flicker`, a factor on every B."""
    product = PRODUCTS[name]
    keys = product.keys
    for sensor, (key, unit), b_key, b_unit in zip(SENSORS, product.unit_keys, B_KEYS, B_UNITS):
        if white:
            keys += f"{sensor}.{key} = {[float(f * product.N[sensor] / unit) for f in white[sensor]]}\n"
        if flicker:
            keys += f"{sensor}.{b_key} = {flicker * product.B[sensor] / b_unit}\n"
    with tempfile.TemporaryDirectory(prefix="noise") as folder:
        truth, config, sent = (Path(folder) / n for n in ("truth.csv", "imu.toml", "bytes"))
        write_truth(truth, hours)
        config.write_text(f'seed = {seed}\nclock = "fast"\n[truth]\nport = "file:{truth}"\nformat = "csv"\n'
                          f'[[imu]]\nport = "file:{sent}"\n{keys}')
        done = subprocess.run([imud, "run", str(config)], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        angle, velocity = product.decode(sent.read_bytes())
    wanted = round(hours * HOUR * product.hz)
    if abs(len(angle) - wanted) > 2:
        raise ValueError(f"{name}: {len(angle)} samples in {hours} h, not {wanted}")
    # The first increments have no step.
    return {GYRO: angle[1:] * product.hz, ACCELEROMETER: velocity[1:] * product.hz}


def allan_variance(values, m):
    """Of each column, over averages of m samples, which overlap (IEEE Std 952-1997, C.1)."""
    phase = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values - values.mean(axis=0), axis=0)])
    second = phase[2 * m:] - 2 * phase[m:-m] + phase[:-2 * m]
    return np.mean(second**2, axis=0) / (2 * m * m)
