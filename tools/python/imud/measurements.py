"""Measurements as a structured array: time_ns, counter, gyro, accel, dtheta, dvel, temperature, status, fields.

SI, in the sensor's platform axes; with the truth beside them also true_gyro, true_accel, true_dtheta, true_dvel. A
quantity that the protocol does not carry is NaN; time_ns is NaT then (as "m8[ns]"), counter its greatest value, and
fields lacks its bit (1 time, 2 counter, 4 gyro, 8 accel, 16 dtheta, 32 dvel, 64 temperature, 128 status). A CSV of a
sensor with inclinometers also has incl, the specific force that they measure.
"""
import pathlib

import numpy

VECTORS = "gyro", "accel", "dtheta", "dvel"
DTYPE = numpy.dtype([("time_ns", "<i8"), ("counter", "<u8")] + [(name, "<f8", (3,)) for name in VECTORS] +
                    [("temperature", "<f8"), ("status", "<u4"), ("fields", "<u4")])
CSV_COLUMNS = ["time_ns", "counter"] + [f"{name}_{axis}" for name in VECTORS for axis in "xyz"] + ["temperature", "status"]
INCLINATION_COLUMNS = [f"incl_{axis}" for axis in "xyz"]
NO_TIME = numpy.iinfo("i8").min
NO_COUNTER = numpy.iinfo("u8").max


def load(path, mmap_mode=None):
    """Returns the measurements of imu-decode (CSV, --npy, --hdf5), of protocol "csv", or of imud replay --npy.

    The file's name ends in .npy, .h5, .hdf5, or otherwise is CSV. An array of many seeds has the shape (seeds,
    measurements). `mmap_mode`: as of numpy.load, for .npy. Raises ValueError, which names the fault, if the file has
    other content.
    """
    suffix = pathlib.Path(path).suffix.lower()
    if suffix == ".npy":
        array = numpy.load(path, mmap_mode=mmap_mode)
        if array.dtype.names is None or "time_ns" not in array.dtype.names:
            raise ValueError(f"{path}: has no field time_ns; give an array of imu-decode --npy or imud replay --npy")
        return array
    if suffix in (".h5", ".hdf5"):
        return _load_hdf5(path)
    return _load_csv(path)


def _load_hdf5(path):
    import h5py  # the only function that needs it

    with h5py.File(path, "r") as file:
        if "time_ns" not in file:
            raise ValueError(f"{path}: has no dataset time_ns; give a file of imu-decode --hdf5")
        names = [name for name in DTYPE.names if name in file] + [f"true_{name}" for name in VECTORS
                                                                  if f"true_{name}" in file]
        array = numpy.empty(len(file["time_ns"]), [(name, file[name].dtype, file[name].shape[1:]) for name in names])
        for name in names:
            array[name] = file[name][:]
    return array


def _load_csv(path):
    with open(path, encoding="ascii") as file:
        header = file.readline().rstrip("\r\n")
        columns = CSV_COLUMNS + INCLINATION_COLUMNS if header.endswith(INCLINATION_COLUMNS[-1]) else CSV_COLUMNS
        if header != ",".join(columns):
            raise ValueError(f"{path}: begins with {header[:60]!r}; give a CSV with the columns {','.join(CSV_COLUMNS)}")
        blocks, rows = [], []
        for number, line in enumerate(file, 2):
            row = line.rstrip("\r\n").split(",")
            if len(row) != len(columns):
                if not line.endswith("\n"):
                    break  # the program was killed within the line
                raise ValueError(f"{path}:{number}: has {len(row)} columns, not {len(columns)}")
            rows.append(row)
            if len(rows) == 65536:
                blocks.append(_block(rows, columns))
                rows = []
    return numpy.concatenate(blocks + [_block(rows, columns)])


def _block(rows, names):
    with_inclination = len(names) > len(CSV_COLUMNS)
    array = numpy.empty(len(rows), DTYPE.descr + [("incl", "<f8", (3,))] if with_inclination else DTYPE)
    columns = list(zip(*rows)) if rows else [()] * len(names)
    for axis in range(3 if with_inclination else 0):
        array["incl"][:, axis] = [float(text) if text else numpy.nan for text in columns[len(CSV_COLUMNS) + axis]]
    array["time_ns"] = [int(text) if text else NO_TIME for text in columns[0]]
    array["counter"] = [int(text) if text else NO_COUNTER for text in columns[1]]
    for i, name in enumerate(VECTORS):
        for axis in range(3):
            array[name][:, axis] = [float(text) if text else numpy.nan for text in columns[2 + 3 * i + axis]]
    array["temperature"] = [float(text) if text else numpy.nan for text in columns[14]]
    array["status"] = [int(text) if text else 0 for text in columns[15]]
    fields = numpy.zeros(len(rows), "u4")
    # A vector is carried where any of its components is.
    for bit, (first, end) in enumerate(((0, 1), (1, 2), (2, 5), (5, 8), (8, 11), (11, 14), (14, 15), (15, 16))):
        fields |= numpy.array([1 << bit if any(texts) else 0 for texts in zip(*columns[first:end])], "u4")
    array["fields"] = fields
    return array
