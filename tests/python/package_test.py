#!/usr/bin/env python3
"""The package of tools/python, as it is installed, on what the programs write and on captures of Wireshark's tools."""
import shutil
import struct
import subprocess
import sys
import unittest

import numpy

from support import FLIGHT, SOURCE, RunTest, run

sys.path.insert(0, str(SOURCE / "tools" / "python"))
import imud  # noqa: E402

IMU = "name = 'b'\nrate_hz = 100\nprotocol = '{protocol}'\nmodel = 'vn-100'\ngyro.max_rad_per_s = 10\n" \
      "accelerometer.max_m_per_s2 = 200\nport = 'file:{folder}/b.bin'\n"


def block(kind, body, order="<"):
    size = len(body) + 12
    return struct.pack(order + "II", kind, size) + body + struct.pack(order + "I", size)


def option(code, value, order="<"):
    return struct.pack(order + "HH", code, len(value)) + value + bytes(-len(value) % 4)


def section(order="<"):
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(name, resolution, link_type=147, order="<", offset=None):
    options = option(2, name, order) + option(9, bytes([resolution]), order)
    if offset is not None:
        options += option(14, struct.pack(order + "q", offset), order)
    return block(1, struct.pack(order + "HHI", link_type, 0, 0) + options + bytes(4), order)


def packet(number, time, data, order="<", options=b""):
    head = struct.pack(order + "IIIII", number, time >> 32, time & 0xFFFFFFFF, len(data), len(data))
    return block(6, head + data + bytes(-len(data) % 4) + options, order)


class Package(RunTest):
    def measurements(self, protocol="native"):
        config = self.config(IMU.format(protocol=protocol, folder=self.folder))
        run("imud", "replay", config, FLIGHT, "-q", "--summary", self.folder / "s.json")
        text, _ = run("imu-decode", protocol, f"file:{self.folder}/b.bin", "--npy", self.folder / "b.npy", "--hdf5",
                      self.folder / "b.h5", "--truth", config, FLIGHT)
        (self.folder / "b.csv").write_text(text)
        return config

    def test_it_installs_without_network(self):
        source = shutil.copytree(SOURCE / "tools" / "python", self.folder / "source")
        subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-build-isolation", "--no-deps",
                        "--target", self.folder / "site", source], check=True, capture_output=True)
        version = subprocess.run([sys.executable, "-c", "import imud, importlib.metadata as m; print(imud.__file__, "
                                  "m.version('imud'))"], env={"PYTHONPATH": str(self.folder / "site")},
                                 capture_output=True, text=True, check=True).stdout.split()
        self.assertEqual(version[0], str(self.folder / "site" / "imud" / "__init__.py"))
        self.assertEqual(f"imud {version[1]}\n", run("imud", "--version")[0])

    def test_csv_npy_and_hdf5_are_the_same_array(self):
        self.measurements()
        csv, npy, hdf5 = (imud.load(self.folder / f"b.{suffix}") for suffix in ("csv", "npy", "h5"))
        self.assertEqual(csv.shape, (1001,))
        self.assertEqual(npy.tobytes(), hdf5.tobytes())
        self.assertEqual(npy.dtype, hdf5.dtype)
        for name in csv.dtype.names:
            numpy.testing.assert_array_equal(csv[name], npy[name])
        self.assertLess(abs(npy["gyro"] - npy["true_gyro"]).max(), 0.02)
        self.assertIsInstance(imud.load(self.folder / "b.npy", mmap_mode="r"), numpy.memmap)
        self.assertEqual(imud.load_summary(self.folder / "s.json")["imus"][0]["samples"], 1001)

    def test_csv_without_some_quantities(self):
        path = self.folder / "a.csv"
        header = ",".join(imud.measurements.CSV_COLUMNS)
        path.write_text(header + "\n,,1,2,3,,,,,,,,,,,\n5,6,,,,,,,,,,7,8,9,10,11\n7,8,,,3,1,,2,,,,,,,,\n12,")
        array = imud.load(path)
        run("imu-decode", "csv", f"file:{path}", "--quiet", "--npy", self.folder / "a.npy")
        self.assertEqual(array.tobytes(), imud.load(self.folder / "a.npy").tobytes())
        path.write_text(header + "\n")
        self.assertEqual(imud.load(path).shape, (0,))
        self.assertNotIn("incl", imud.load(path).dtype.names)

    def test_csv_of_inclinometers(self):
        path = self.folder / "i.csv"
        path.write_text(",".join(imud.measurements.CSV_COLUMNS) + ",incl_x,incl_y,incl_z\n5,6" + "," * 14 + ",1,-2,0.5\n,7" + "," * 17 + "\n")
        array = imud.load(path)
        numpy.testing.assert_array_equal(array["incl"], [[1, -2, 0.5], [numpy.nan] * 3])
        self.assertEqual(list(array["counter"]), [6, 7])
        for protocol, more in (("stim300", ""), ("csv", "rate_hz = 200\nmodel = 'stim300'\n[imu.inclinometer]\n")):
            data = self.folder / f"{protocol}.bin"
            config = self.config(f"protocol = '{protocol}'\nport = 'file:{data}'\n{more}")
            run("imud", "replay", config, FLIGHT, "-q")
            path.write_text(run("imu-decode", protocol, f"file:{data}", "--inclination")[0])
            array = imud.load(path)
            self.assertGreater(len(array), 1000)
            difference = abs(array["incl"][100:] - array["accel"][100:]).mean(axis=0)
            self.assertTrue((difference > 1e-4).all() and (difference < 1).all(), difference)

    def test_other_content_is_an_error_that_names_it(self):
        path = self.folder / "a.csv"
        path.write_text("time,x\n1,2\n")
        with self.assertRaisesRegex(ValueError, "begins with 'time,x'; give a CSV with the columns time_ns,"):
            imud.load(path)
        path.write_text(",".join(imud.measurements.CSV_COLUMNS) + "\n1,2\n3,4\n")
        with self.assertRaisesRegex(ValueError, "a.csv:2: has 2 columns, not 16"):
            imud.load(path)
        numpy.save(self.folder / "a.npy", numpy.zeros(3))
        with self.assertRaisesRegex(ValueError, "has no field time_ns"):
            imud.load(self.folder / "a.npy")

    def test_a_record_of_wireshark(self):
        """The flight as pcapng, by editcap: the packets and their times are those of the pcap."""
        pcap = (SOURCE / "tests/captures/jsbsim_c172_10s.pcap").read_bytes()
        path = self.folder / "flight.pcapng"
        subprocess.run(["editcap", "-F", "pcapng", SOURCE / "tests/captures/jsbsim_c172_10s.pcap", path], check=True)
        record = imud.load_record(path)
        self.assertFalse(record.is_cut_short)
        unit = {0xA1B2C3D4: 1000, 0xA1B23C4D: 1}[struct.unpack_from("<I", pcap)[0]]
        at, packets = 24, []
        while at < len(pcap):
            s, fraction, size, _ = struct.unpack_from("<IIII", pcap, at)
            packets.append((s * 1_000_000_000 + fraction * unit, pcap[at + 16:at + 16 + size]))
            at += 16 + size
        self.assertGreater(len(packets), 2000)
        self.assertEqual([(packet.time_ns, packet.data) for packet in record.packets], packets)

    def test_interfaces_resolutions_and_sections(self):
        path = self.folder / "a.pcapng"
        comment = option(1, b"hello") + option(2, struct.pack("<I", 2)) + bytes(4)
        first = section() + interface(b"truth", 9, 147) + interface(b"imu1", 6, 148, offset=100) + \
            packet(1, 1_500_000, b"abcde", options=comment) + \
            packet(0, (1 << 40) + 7, b"")
        second = section(">") + interface(b"can0", 0x80 | 10, 227, ">") + packet(0, 1536, b"xyz", ">") + \
            block(5, bytes(12), ">") + block(3, struct.pack(">I", 2) + b"hi\0\0", ">")
        path.write_bytes(first + second)
        record = imud.load_record(path)
        self.assertEqual([(i.name, i.link_type) for i in record.interfaces], [("truth", 147), ("imu1", 148), ("can0", 227)])
        self.assertEqual([(p.interface.name, p.time_ns, p.data) for p in record.packets],
                         [("imu1", 101_500_000_000, b"abcde"), ("truth", (1 << 40) + 7, b""),
                          ("can0", 1_500_000_000, b"xyz"), ("can0", None, b"hi")])
        self.assertEqual(record.packets[0].options, {1: [b"hello"], 2: [struct.pack("<I", 2)]})
        self.assertEqual([p.data for p in record.of("imu1")], [b"abcde"])
        with self.assertRaisesRegex(KeyError, "there is no interface 'imu2'; there are truth, imu1, can0"):
            record.of("imu2")

    def test_a_record_that_is_cut_anywhere_has_its_whole_packets(self):
        path = self.folder / "a.pcapng"
        blocks = [section(), interface(b"imu1", 9)] + [packet(0, i, bytes([i] * i)) for i in range(5)]
        whole = b"".join(blocks)
        for size in range(1, len(whole)):
            path.write_bytes(whole[:size])
            record = imud.load_record(path)
            ends = [sum(map(len, blocks[:i + 1])) for i in range(len(blocks))]
            self.assertEqual(record.is_cut_short, size not in ends)
            self.assertEqual(len(record.packets), sum(end <= size for end in ends[2:]))

    def test_damage_is_an_error_that_names_it(self):
        path = self.folder / "a.pcapng"
        for content, fault in [
            (b"\xd4\xc3\xb2\xa1" + bytes(20), "is no pcapng file; a pcap becomes one by"),
            (section()[:8] + bytes(4) + section()[12:], "has no byte-order magic"),
            (section() + struct.pack("<III", 6, 13, 0), "at byte 28 has the impossible length 13"),
            (section() + interface(b"x", 9)[:-4] + bytes(4), "does not end with its length"),
            (section() + packet(0, 1, b""), "at byte 28 is damaged"),
            (section() + interface(b"x", 9) + block(6, struct.pack("<IIIII", 0, 0, 0, 99, 99)), "99 captured bytes exceed"),
        ]:
            path.write_bytes(content)
            with self.assertRaisesRegex(ValueError, fault):
                imud.load_record(path)

    def test_plots_a_run(self):
        self.measurements()
        array = imud.load(self.folder / "b.npy")
        figure = imud.plot(array, self.folder / "b.png")
        self.assertEqual(len(figure.axes), 4)
        self.assertGreater((self.folder / "b.png").stat().st_size, 10_000)
        with self.assertRaisesRegex(ValueError, "give one run of it"):
            imud.plot(numpy.stack([array, array]))


if __name__ == "__main__":
    unittest.main()
