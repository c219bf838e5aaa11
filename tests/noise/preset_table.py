"""N and the minimum of the Allan deviation of every preset, from what imud's sensors show at rest, by NumPy; as a table for core/README.md.
usage: preset_table.py IMUD [PRESET...]

Nothing here is of imud's code: the figures are read from the presets, the arrays that imud writes are estimated alone. Each channel has
8 seeds of three axes. N is fitted, with the Q of the digits, to the mean Allan variances at 0.08 s to 0.8 s less the share of the flicker, which
has correlation times from 0.32 s on. The minimum is
the lowest of the root mean Allan variances at the averaging times of octaves from 1 s to 1024 s, or to 8192 s where the preset's flicker
is flat to 10000 s; its standard error is about 2 %. Exit code 1: N is not within 5 %, or a minimum not within 10 %, of the preset; but for N that digits hide, with a *.
"""
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from allan_fit import SHORT, allan_variance, lowest, noise
from noise_bench import ACCELEROMETER, DEG, G0, GYRO, HOUR, SENSORS, np, write_truth

HZ, SEEDS = 25, 8
UNITS = {"deg_per_rt_hr": DEG / 60, "m_per_s_per_rt_hr": 1 / 60, "deg_per_s_per_rt_hz": DEG, "mdeg_per_s_per_rt_hz": 1e-3 * DEG,
         "ug_per_rt_hz": 1e-6 * G0, "mg_per_rt_hz": 1e-3 * G0, "deg_per_hr": DEG / HOUR, "mg": 1e-3 * G0}
DATASHEET = {GYRO: ((DEG / 60, "deg/sqrt(h)"), (DEG / HOUR, "deg/h")), ACCELEROMETER: ((1 / 60, "m/s/sqrt(h)"), (1e-3 * G0, "mg"))}


def stated(triad, *stems):
    """Returns the preset's value of the first key that begins so, in SI; None if it has none."""
    for stem in stems:
        for key, value in triad.items():
            if key.startswith(stem + "_") and key[len(stem) + 1:] in UNITS:
                one_sided = stem == "noise_density" and triad.get("noise_density_sidedness") == "one_sided"
                return value * UNITS[key[len(stem) + 1:]] / (2**0.5 if one_sided else 1)
    return None


def is_hidden(triad, N):
    """Whether the digits of the values are coarser than their noise at HZ: then N is not that of the noise alone."""
    units = {"lsb_rad_per_s": 1, "lsb_deg_per_s": DEG, "lsb_m_per_s2": 1, "lsb_g": G0}
    lsb = sum(value * units[key] for key, value in triad.items() if key in units)
    return lsb > N * HZ**0.5


def seed_of(imud, preset, seed, hours, folder):
    """Returns the values, as {sensor: n x 3}, and the increments over their period."""
    truth = folder / "truth.csv"
    write_truth(truth, hours)
    config = folder / "imu.toml"
    config.write_text(f'clock = "fast"\n[truth]\nport = "file:{truth}"\nformat = "csv"\n[[imu]]\nprotocol = "native"\nport = "file:x"\n'
                      f'rate_hz = {HZ}\nmodel = "{preset}"\n')
    done = subprocess.run([imud, "replay", config, truth, "--seeds", f"{seed}..{seed}", "--jobs", "1", "-q", "--npy", folder / "{imu}.npy"],
                          capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    made = np.load(folder / "imu1.npy", mmap_mode="r")[0, 1:]
    return ({GYRO: np.array(made["gyro"]), ACCELEROMETER: np.array(made["accel"])},
            {GYRO: np.array(made["dtheta"]) * HZ, ACCELEROMETER: np.array(made["dvel"]) * HZ})


def measure(imud, preset, hours, taus):
    """Returns for values and increments, by sensor, the Allan variances at SHORT and at `taus`, as means over axes and seeds."""
    sums = [{s: np.zeros(len(SHORT) + len(taus)) for s in SENSORS} for _ in range(2)]
    for seed in range(1, SEEDS + 1):
        with tempfile.TemporaryDirectory(prefix="noise") as folder:
            for kind, values in enumerate(seed_of(imud, preset, seed, hours, Path(folder))):
                for sensor in SENSORS:
                    series = values[sensor] - values[sensor].mean(axis=0)
                    sums[kind][sensor] += [allan_variance(series, round(tau * HZ)).mean() / SEEDS for tau in (*SHORT, *taus)]
    return sums


def main():
    imud, good = sys.argv[1], True
    presets = Path(__file__).resolve().parents[2] / "emulator" / "presets"
    print("| preset | channel | N | of it: values | increments | minimum | of it: values | increments |\n|---|---|---|---|---|---|---|---|")
    for path in sorted(presets.glob("*.toml")):
        if len(sys.argv) > 2 and path.stem not in sys.argv[2:]:
            continue
        imu = tomllib.loads(path.read_text())["imu"]
        is_long = any("bias_instability_to_s" in imu[s] for s in SENSORS)
        taus = 2.0 ** np.arange(14 if is_long else 11)
        sums = measure(imud, path.stem, 24 if is_long else 8, taus)
        for sensor in SENSORS:
            N = stated(imu[sensor], "angle_random_walk", "velocity_random_walk", "noise_density")
            minimum = stated(imu[sensor], "bias_minimum")
            last = len(taus) if "bias_instability_to_s" in imu[sensor] else 11
            n, low = [], []
            for kind in sums:
                variances = kind[sensor]
                n.append(noise(variances[:len(SHORT)], SHORT, minimum or 0) / N)
                low.append(lowest(variances[len(SHORT):len(SHORT) + last]) / minimum if minimum else 1)
            (n_unit, n_name), (b_unit, b_name) = DATASHEET[sensor]
            hidden = is_hidden(imu[sensor], N)
            # Increments without digits of their own have the digits of the values.
            both = hidden and not any(key.startswith("lsb_delta") for key in imu[sensor])
            good = good and all(abs(x - 1) <= 0.05 for x in n[hidden + both:]) and all(abs(x - 1) <= 0.1 for x in low)
            text = f"{minimum / b_unit:.3g} {b_name} | {low[0]:.3f} | {low[1]:.3f}" if minimum else "- | - | -"
            print(f"| `{path.stem}` | {sensor} | {N / n_unit:.3g} {n_name} | {n[0]:.3f}{'*' * hidden} | {n[1]:.3f}{'*' * both} | {text} |", flush=True)
    return 0 if good else 1


sys.exit(main())
