"""Three products at rest: the bytes that imud sends for them, decoded by the vendors' documents, and the figures of their data sheets.

Nothing here is of imud's code. The increments are decoded, because they are sums over the sensor's own samples: a rate that is
decimated would have aliases, more or less of them by the sensor's filters.
"""
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from product_formats import DEG, G0, INCREMENTS, mip, stim300, vectornav

HOUR = 3600.0
GYRO, ACCELEROMETER = "gyro", "accelerometer"
SENSORS = (GYRO, ACCELEROMETER)
FLAT = 2 * np.log(2) / np.pi  # of B^2 in the Allan variance


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
device.binary_1 = "1,16,04,06C0"
""", (("noise_density_deg_per_s_per_rt_hz", DEG), ("noise_density_mg_per_rt_hz", 1e-3 * G0)),
                      (0.0035 * DEG, 0.14e-3 * G0), (10 * DEG / HOUR, 0.04e-3 * G0)),
    # Data sheet of the 3DM-GX5-25: 0.005 deg/s/sqrt(Hz), 80 ug/sqrt(Hz); 8 deg/h, 0.04 mg.
    "3dm-gx5-25": Product(mip, 100, """protocol = "mip"
model = "3dm-gx5-25"
device.model = "3dm-gx5-25"
device.sensor_rate_hz = 100
device.sensor_fields = ["acceleration", "rate", "delta_angle", "delta_velocity"]
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
        angle, velocity = product.decode(sent.read_bytes(), product.hz)[INCREMENTS]
    wanted = round(hours * HOUR * product.hz)
    if abs(len(angle) - wanted) > 2:
        raise ValueError(f"{name}: {len(angle)} samples in {hours} h, not {wanted}")
    # The first increments have no step.
    return {GYRO: angle[1:] * product.hz, ACCELEROMETER: velocity[1:] * product.hz}
