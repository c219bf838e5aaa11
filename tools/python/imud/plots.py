"""The picture of a run. Needs matplotlib."""
import numpy

from .measurements import NO_TIME


def plot(run, path=None, rate_hz=None):
    """Draws gyro and accel of measurements as load() returns them, over their truth where they have it, and the errors.

    Writes a picture to `path` if it is given, in the format of its suffix, and returns matplotlib's figure. Without a
    time in the measurements, samples are at 1/`rate_hz`, or have their numbers.
    """
    if path is not None:
        import matplotlib

        matplotlib.use("agg")
    from matplotlib import pyplot

    if run.ndim != 1:
        raise ValueError(f"the array has the shape {run.shape}; give one run of it, such as runs[0]")
    has_time = len(run) > 0 and (run["time_ns"] != NO_TIME).all()
    time = numpy.arange(len(run)) / (rate_hz or 1)
    label = "time, s" if rate_hz else "sample"
    if has_time:
        time, label = 1e-9 * (run["time_ns"] - run["time_ns"][0]), "time, s"
    has_truth = "true_gyro" in run.dtype.names
    figure, all_axes = pyplot.subplots(2, 2 if has_truth else 1, sharex=True, squeeze=False, figsize=(12, 7))
    for row, (name, unit) in enumerate([("gyro", "rad/s"), ("accel", "m/s^2")]):
        for axis, letter in enumerate("xyz"):
            (line,) = all_axes[row][0].plot(time, run[name][:, axis], linewidth=0.7, label=f"{name} {letter}")
            if has_truth:
                truth = run["true_" + name][:, axis]
                all_axes[row][0].plot(time, truth, "--", color=line.get_color(), linewidth=1)
                all_axes[row][1].plot(time, run[name][:, axis] - truth, linewidth=0.7, label=f"error of {name} {letter}")
        for axes in all_axes[row]:
            axes.set_ylabel(f"{name}, {unit}")
            axes.legend(loc="upper right")
    for axes in all_axes[-1]:
        axes.set_xlabel(label)
    figure.tight_layout()
    if path is not None:
        figure.savefig(path)
    return figure
