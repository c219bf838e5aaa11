"""The products of the presets at rest: Allan variances of the bytes that they send, at their own rates and with their own filters."""
import subprocess
from dataclasses import dataclass
from functools import partial

from allan_fit import allan_variance, np, short_taus
from noise_bench import HOUR, SENSORS, write_truth
from product_formats import (INCREMENTS, VALUES, hg4930, kvh1750, mip, novatel_raw, sbg, stim300, vectornav, vectornav_text, xsens)

KINDS = (VALUES, INCREMENTS)
BLOCK = 600  # s that are decoded together


@dataclass
class Run:
    keys: str  # of [[imu]]
    hz: int  # of the frames
    decode: object = None  # None: imud's own decoder
    size: int = 0  # bytes of a frame, or of a row of frames


@dataclass
class Product:
    preset: str
    title: str  # the protocol or description, then what it sends how often; in brackets the rates of `slow`
    delivered: list  # runs at the rate as delivered, or at a usual one where there is none
    slow: list = ()  # the same at a lower rate, for the minimum; none: as delivered
    folded: float = 1.0  # N of the values over the sheet's, by the product's own filter and decimation
    digits: tuple = (0.0, 0.0)  # of the values, rad/s and m/s^2: those that are not far below the noise

    hours: float = 4  # of each seed: 8 where the white noise is a twentieth of the minimum at the longest averaging time
    last_s: int = 1024  # the longest averaging time of the gyros' minimum

    @property
    def name(self):
        return self.title.split("`")[1]

    def expected(self, N):
        """N of the values, of gyro and accelerometer, over the sheet's `N`: rounding adds a white noise of LSB^2/12 in each value."""
        return {sensor: np.sqrt(self.folded**2 + lsb**2 / 12 / N[sensor]**2 / self.delivered[0].hz) for sensor, lsb in zip(SENSORS, self.digits)}

    def has_own_decoder(self):
        return self.delivered[0].decode is not None


def folded(internal_hz, hz, response):
    """By what the noise above half the rate raises N of values that are decimated; `response` is |H|^2 at a frequency over internal_hz."""
    steps = round(internal_hz / hz)
    return np.sqrt(sum(response(k / steps) for k in range(steps)))


def butterworth(cut_off_hz, internal_hz, order):
    """By the bilinear transform, as IEEE Std 1293 and every text have it."""
    return lambda f: 1 / (1 + (np.tan(np.pi * f) / np.tan(np.pi * cut_off_hz / internal_hz))**(2 * order))


def boxcar(length):
    return lambda f: 1.0 if f == 0 else (np.sin(np.pi * f * length) / (length * np.sin(np.pi * f)))**2


def blocks_by_decoder(imud, run, config):
    """Decodes what imud writes to a pipe, without its first second."""
    with subprocess.Popen([imud, "run", "-q", config], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        head = process.stdout.read(run.size * run.hz)
        for start in range(run.size):
            try:
                run.decode(head[start + run.size * (run.hz - 4):], run.hz)
                break
            except ValueError:
                continue
        else:
            raise ValueError(f"no frame in {head[-2 * run.size:].hex()}")
        process.stdout.read(start)
        while len(data := process.stdout.read(run.size * run.hz * BLOCK)) == run.size * run.hz * BLOCK:
            yield run.decode(data, run.hz)
        if process.wait() != 0:
            raise RuntimeError(process.stderr.read().decode())


def blocks_by_imud(imud, run, config, folder):
    """What imud's own decoder gives, likewise."""
    done = subprocess.run([imud, "replay", config, folder / "truth.csv", "--jobs", "1", "-q", "--npy", folder / "{imu}.npy"],
                          capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    made = np.load(folder / "imu1.npy", mmap_mode="r").reshape(-1)
    for first in range(run.hz, len(made) - run.hz * BLOCK + 1, run.hz * BLOCK):
        rows = made[first:first + run.hz * BLOCK]
        yield {VALUES: [np.array(rows[name]) for name in ("gyro", "accel")],
               INCREMENTS: [np.array(rows[name]) for name in ("dtheta", "dvel")]}


def blocks(imud, run, preset, seed, hours, folder):
    """Yields what the run sends in BLOCK seconds, {(kind, sensor): rates or specific forces, n x 3}."""
    write_truth(folder / "truth.csv", hours)
    can = run.decode is None
    config = folder / "imu.toml"
    config.write_text(f'seed = {seed}\nclock = "fast"\n[truth]\nport = "file:{folder / "truth.csv"}"\nformat = "csv"\n[[imu]]\n'
                      f'port = "{"canfile:x" if can else "file:-"}"\nmodel = "{preset}"\n{run.keys}')
    made = blocks_by_imud(imud, run, config, folder) if can else blocks_by_decoder(imud, run, config)
    for block in made:
        yield {(kind, sensor): series * (run.hz if kind == INCREMENTS else 1) for kind in KINDS
               for sensor, series in zip(SENSORS, block[kind]) if series is not None and np.isfinite(series).all()}


def measure_seed(imud, product, seed, hours, taus, folder):
    """Returns {(kind, sensor): (short taus, Allan variances at them, Allan variances at `taus`)} of one seed, means over its axes."""
    short, seconds = {}, {}
    for run in product.delivered:
        for block in blocks(imud, run, product.preset, seed, (BLOCK + 60) / HOUR if product.slow or len(taus) == 0 else hours, folder):
            for channel, series in block.items():
                hz = len(series) // BLOCK
                if channel not in short:
                    at = short_taus(hz)
                    short[channel] = (at, np.array([allan_variance(series, round(tau * hz)).mean() for tau in at]))
                if not product.slow:
                    seconds.setdefault(channel, []).append(series.reshape(BLOCK, hz, 3).mean(axis=1))
            if product.slow:
                break
    for run in product.slow if len(taus) else ():
        for block in blocks(imud, run, product.preset, seed, hours, folder):
            for channel, series in block.items():
                seconds.setdefault(channel, []).append(series.reshape(BLOCK, -1, 3).mean(axis=1))
    if len(taus) and short.keys() != seconds.keys():
        raise ValueError(f"{product.title}: the rates have {sorted(short)} and {sorted(seconds)}")
    return {channel: (*short[channel], np.array([allan_variance(np.concatenate(seconds[channel]), round(tau)).mean() for tau in taus]))
            for channel in short}


# --- The products ---
def stim(hz):
    units = ((VALUES, "rate", "acceleration"), (INCREMENTS, "increment", "increment"))
    return [Run(f'protocol = "stim300"\ndevice.start_up = false\ndevice.inclination = false\ndevice.temperature = false\n'
                f'device.sample_rate = {hz}\ndevice.gyro_unit = "{gyro}"\ndevice.accelerometer_unit = "{accelerometer}"\n',
                hz, partial(stim300, gyro=kind, accelerometer=kind), 28) for kind, gyro, accelerometer in units]


def vn(hz, model="vn-100", internal_hz=800):
    return [Run(f'protocol = "vectornav"\ndevice.model = "{model}"\ndevice.async_type = 0\n'
                f'device.binary_1 = "1,{internal_hz // hz},04,06C0"\n', hz, vectornav, 58)]


def microstrain(model, hz=100):
    fields = '["acceleration", "rate", "delta_angle", "delta_velocity"]'
    # As delivered, a 7 series streams filter data as well.
    return [Run(f'protocol = "mip"\ndevice.model = "{model}"\ndevice.sensor_rate_hz = {hz}\ndevice.sensor_fields = {fields}\n'
                f'device.filter_fields = []\ndevice.gnss_fields = []\n', hz, mip, 62)]


def frame(name, hz, decode, size, rows_hz=None, keys=""):
    return Run(f'protocol = "frame"\nrate_hz = {hz}\ndevice.frame_file = "{name}"\n{keys}', rows_hz or hz, decode, size)


def kvh(hz):
    return [frame("kvh1750", 1000, partial(kvh1750, gyro=kind), 36, hz, f'device.settings = {{DR = {hz}, ROTFMT = "{name}"}}\n')
            for kind, name in ((INCREMENTS, "DELTA"), (VALUES, "RATE"))]


PRODUCTS = [
    # The gyros' flicker is flat to 10000 s, and covered by white noise up to 1000 s. Of their values at 125 Hz, twice the noise would be left.
    Product("stim300", "`stim300`, 1000 Hz (500, 125 Hz)", stim(1000), [stim(500)[0], stim(125)[1]],
            folded(2000, 1000, butterworth(262, 2000, 2)), hours=10, last_s=4096),
    Product("stim300", "`novatel-raw`, 125 Hz", [frame("novatel-raw", 125, novatel_raw, 56)], hours=10, last_s=4096),
    # Register 85, as delivered: means of four samples. A VN-200 has the rates of a VN-100.
    Product("vn-100", "`vectornav`, VN-100, 200 Hz (50 Hz)", vn(200), vn(50), folded(800, 200, boxcar(4))),
    Product("vn-100", "`vectornav`, VN-300, 100 Hz", vn(100, "vn-300", 400), (), folded(400, 100, boxcar(4))),
    Product("vn-100", "`vectornav`, VN-100, VNYMR, 40 Hz", [Run('protocol = "vectornav"\n', 40, vectornav_text, 122)], (), folded(800, 40, boxcar(4))),
    # A single pole at half of the rate.
    *(Product(preset, f"`mip`, {model.upper()}, 100 Hz", microstrain(model), (), folded(1000, 100, butterworth(50, 1000, 1)))
      for preset, model in (("3dm-gx5-25", "3dm-gx5-25"), ("3dm-cv7", "3dm-cv7-ahrs"), ("3dm-cv7", "3dm-gq7"))),
    *(Product(f"hg4930-{grade}", "`hg4930`, 600 and 100 Hz", [frame("hg4930", 600, hg4930, 144, 100)], hours=8)
      for grade in ("aa51", "ba51", "ca51")),
    Product("kvh-1775", "`kvh1750`, 1000 Hz (1000, 100 Hz)", kvh(1000), [kvh(100)[0], kvh(1000)[1]], last_s=2048),
    Product("mti-3", "`xsens-mtdata2`, 100 Hz", [frame("xsens-mtdata2", 100, xsens, 54)]),
    Product("mti-300", "`xsens-mtdata2`, 100 Hz", [frame("xsens-mtdata2", 100, xsens, 54)]),
    Product("mti-630", "`xsens-can`, 100 Hz", [Run('protocol = "xsens-can"\ndevice.messages = ["rate_of_turn", "acceleration", "delta_v"]\n', 100)],
            digits=(2.0**-9, 2.0**-8)),
    Product("sbg-ellipse", "`sbg-imu`, 200 Hz (50 Hz)", [frame("sbg-imu", 200, sbg, 41)], [frame("sbg-imu", 50, sbg, 41)]),
    # At a lower rate, steps of 1e-3 rad/s would hide a part of the flicker.
    Product("sbg-ellipse", "`sbg-can`, 200 Hz", [Run('protocol = "sbg-can"\n', 200)], digits=(1e-3, 1e-2)),
    # The low pass at 20 Hz, as delivered. Floats of 16 bits have steps of 2^-7 m/s^2 on the axis that senses gravity.
    Product("icm-42688-p", "`dronecan`, 200 Hz", [Run('protocol = "dronecan"\n', 200)], (), folded(1000, 200, butterworth(20, 1000, 2)),
            (0, 2.0**-7 / 3**0.5)),
]
