"""N and the minimum of the Allan deviation of every preset at rest, as two tables for core/README.md: of imud's sensors through `native`, and
of what products send, each beside the figures of the preset.
usage: preset_table.py IMUD [--tables {native,products}...] [--only NAME...] [--short]

Nothing here is of imud's code, unless a product has a dagger, whose bytes imud decodes: the figures are read from the presets, the bytes
are decoded and estimated alone. Each channel has 8 seeds of three axes. N is fitted, with the Q of the digits, to the mean Allan
variances at 0.08 s to 0.8 s less the share of the flicker, which has correlation times from 0.32 s on. The minimum is the lowest of the
root mean Allan variances at the averaging times of octaves from 1 s to 1024 s, or as far as a table states where the preset's flicker is
flat to 10000 s; its standard error is about 2 % in 8 hours, 3 % in 4. Exit code 1: N is not within 5 %, or a minimum not within 10 %, of
the preset; but for N that digits hide, with a *, and N of values that the product's filter and digits raise, within 5 % of what these make.
--short leaves the minimum of the products out.
"""
import argparse
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from allan_fit import SHORT, allan_variance, lowest, noise
from noise_bench import ACCELEROMETER, DEG, FLAT, G0, GYRO, HOUR, SENSORS, np, write_truth
from preset_products import KINDS, PRODUCTS, VALUES, measure_seed

HZ, SEEDS = 25, 8
UNITS = {"deg_per_rt_hr": DEG / 60, "m_per_s_per_rt_hr": 1 / 60, "deg_per_s_per_rt_hz": DEG, "mdeg_per_s_per_rt_hz": 1e-3 * DEG,
         "ug_per_rt_hz": 1e-6 * G0, "mg_per_rt_hz": 1e-3 * G0, "deg_per_hr": DEG / HOUR, "mg": 1e-3 * G0, "m_per_s2": 1}
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


def figures(imu, sensor):
    """Returns the preset's N and minimum, None if it has none. A B is the minimum over 0.664."""
    minimum, B = stated(imu[sensor], "bias_minimum"), stated(imu[sensor], "bias_instability")
    return stated(imu[sensor], "angle_random_walk", "velocity_random_walk", "noise_density"), minimum or (B and B * FLAT**0.5)


def native_table(imud, presets, only):
    """Prints the rows of the presets, and returns whether all are good."""
    good = True
    print("| preset | channel | N | of it: values | increments | minimum | of it: values | increments |\n|---|---|---|---|---|---|---|---|")
    for preset, imu in presets.items():
        if only and preset not in only:
            continue
        is_long = any("bias_instability_to_s" in imu[s] for s in SENSORS)
        taus = 2.0 ** np.arange(14 if is_long else 11)
        sums = measure(imud, preset, 24 if is_long else 8, taus)
        for sensor in SENSORS:
            N, minimum = figures(imu, sensor)
            last = len(taus) if "bias_instability_to_s" in imu[sensor] else 11
            n = [noise(kind[sensor][:len(SHORT)], SHORT, minimum or 0) / N for kind in sums]
            low = [lowest(kind[sensor][len(SHORT):len(SHORT) + last]) / minimum if minimum else 1 for kind in sums]
            (n_unit, n_name), (b_unit, b_name) = DATASHEET[sensor]
            hidden = is_hidden(imu[sensor], N)
            # Increments without digits of their own have the digits of the values.
            both = hidden and not any(key.startswith("lsb_delta") for key in imu[sensor])
            good = good and all(abs(x - 1) <= 0.05 for x in n[hidden + both:]) and all(abs(x - 1) <= 0.1 for x in low)
            text = f"{minimum / b_unit:.3g} {b_name} | {low[0]:.3f} | {low[1]:.3f}" if minimum else "- | - | -"
            print(f"| `{preset}` | {sensor} | {N / n_unit:.3g} {n_name} | {n[0]:.3f}{'*' * hidden} | {n[1]:.3f}{'*' * both} | {text} |", flush=True)
    return good


def product_channels(imud, product, hours, taus):
    """Returns measure_seed()'s channels, as means over the seeds."""
    seeds = []
    for seed in range(1, SEEDS + 1):
        with tempfile.TemporaryDirectory(prefix="noise") as folder:
            seeds.append(measure_seed(imud, product, seed, hours, taus, Path(folder)))
    return {channel: [np.mean([made[channel][i] for made in seeds], axis=0) for i in range(3)] for channel in seeds[0]}


def product_table(imud, presets, only, is_short):
    """As native_table(), of the products. `is_short`: without the minimum."""
    good = True
    print("| preset | product | channel | N: values | expected | increments | minimum: values | increments |\n|---|---|---|---|---|---|---|---|")
    for product in PRODUCTS:
        if only and product.preset not in only and product.name not in only:
            continue
        imu = presets[product.preset]
        sheet = {sensor: figures(imu, sensor) for sensor in SENSORS}
        has_minimum = not is_short and any(minimum for _, minimum in sheet.values())
        taus = 2.0 ** np.arange(product.last_s.bit_length() if has_minimum else 0)
        channels = product_channels(imud, product, product.hours, taus)
        expected = product.expected({sensor: N for sensor, (N, _) in sheet.items()})
        for sensor in SENSORS:
            N, minimum = sheet[sensor]
            cells = {}
            for kind in KINDS:
                if (kind, sensor) not in channels:
                    cells[kind] = "-", "-"
                    continue
                at, short, long = channels[kind, sensor]
                n = noise(short, at, minimum or 0) / N
                good = good and abs(n / (expected[sensor] if kind == VALUES else 1) - 1) <= 0.05
                low = lowest(long if sensor == GYRO else long[:11]) / minimum if has_minimum and minimum else None
                good = good and (low is None or abs(low - 1) <= 0.1)
                cells[kind] = f"{n:.3f}", f"{low:.3f}" if low else "-"
            (n_values, low_values), (n_increments, low_increments) = (cells[kind] for kind in KINDS)
            dagger = "" if product.has_own_decoder() else " \u2020"
            wanted = "-" if n_values == "-" else f"{expected[sensor]:.3f}"
            print(f"| `{product.preset}` | {product.title}{dagger} | {sensor} | {n_values} | {wanted} | {n_increments} | {low_values} | "
                  f"{low_increments} |", flush=True)
    return good


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("imud")
    parser.add_argument("--tables", nargs="+", choices=("native", "products"), default=["native", "products"])
    parser.add_argument("--only", nargs="+", metavar="NAME", help="presets, or protocols and descriptions")
    parser.add_argument("--short", action="store_true")
    options = parser.parse_args()
    folder = Path(__file__).resolve().parents[2] / "emulator" / "presets"
    presets = {path.stem: tomllib.loads(path.read_text())["imu"] for path in sorted(folder.glob("*.toml"))}
    only = set(options.only or ())
    if unknown := only - presets.keys() - {product.name for product in PRODUCTS}:
        parser.error(f"there is no preset or product {', '.join(sorted(unknown))}")
    good = True
    if "native" in options.tables:
        good = native_table(options.imud, presets, only)
    if "products" in options.tables:
        good = product_table(options.imud, presets, only, options.short) and good
    return 0 if good else 1


sys.exit(main())
