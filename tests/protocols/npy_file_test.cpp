#include "protocols/measurements/npy_file.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <random>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/text.hpp"

namespace imud {
namespace {

std::string npy_file(std::string header, std::span<const double> values, char version = 1, bool big = false) {
  header += '\n';
  std::string file = "\x93NUMPY";
  file += version;
  file += '\0';
  for (unsigned i = 0; i < (version == 1 ? 2U : 4U); ++i) file += static_cast<char>(header.size() >> (8 * i));
  file += header;
  for (const double value : values)
    for (unsigned i = 0; i < 8; ++i)
      file += static_cast<char>(std::bit_cast<std::uint64_t>(value) >> (8 * (big ? 7 - i : i)));
  return file;
}

struct NpyArray {
  std::size_t rows = 0, columns = 0;
  std::vector<double> values;  // row by row
};

NpyArray read(const std::string& file) {
  std::istringstream in(file);
  NpyRows rows(in);
  NpyArray array{rows.rows(), rows.columns(), {}};
  for (auto row = rows.next(); !row.empty(); row = rows.next())
    array.values.insert(array.values.end(), row.begin(), row.end());
  return array;
}

std::string fault_of(const std::string& file) {
  try {
    read(file);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "none";
}

const std::vector<double> six = {1.5, -2, 3e-300, 4, 5, 6};
const std::string good = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }";

TEST(NpyFile, EveryVersionAndByteOrder) {
  for (const char version : {'\x01', '\x02', '\x03'}) {
    const NpyArray array = read(npy_file(good, six, version));
    EXPECT_EQ(array.rows, 3U);
    EXPECT_EQ(array.columns, 2U);
    EXPECT_EQ(array.values, six);
  }
  EXPECT_EQ(read(npy_file("{'descr': '>f8', 'fortran_order': False, 'shape': (6,), }", six, 1, true)).values, six);
  EXPECT_EQ(read(npy_file("{'descr': '<f8', 'fortran_order': True, 'shape': (6,), }", six)).columns, 1U);
}

TEST(NpyFile, OtherContentIsRefused) {
  const struct {
    std::string file;
    std::string_view fault;
  } cases[] = {
      {"", "this is no NumPy file"},
      {npy_file(good, six).substr(0, 7), "ends within its header"},
      {npy_file(good, six).substr(0, 30), "ends within its header"},
      {npy_file(good, six, 4), "version 4"},
      {npy_file(good, std::span(six).first(5)), "ends before row 3"},
      {npy_file(good, six) + "x", "more data than its shape"},
      {npy_file("{'fortran_order': False, 'shape': (3, 2), }", six), "has no 'descr'"},
      {npy_file("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }", six), "'<f4', not float64"},
      {npy_file("{'descr': [('x', '<f8')], 'fortran_order': False, 'shape': (3,), }", six), "not float64"},
      {npy_file("{'descr': '<f8', 'fortran_order': True, 'shape': (3, 2), }", six), "Fortran order"},
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (), }", six), "0 dimensions"},
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 2, 3), }", six), "3 dimensions"},
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 2), }", {}), "it is empty"},
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (-3, 2), }", six), "no tuple of numbers"},
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2", six), "no tuple"},
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999999999999999,), }", six), "no tuple"},
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (18446744073709551615, 2), }", six),
       "its shape is"},
      // It must not allocate what is not there.
      {npy_file("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 2), }", six), "ends before row"},
  };
  for (const auto& [file, fault] : cases) {
    EXPECT_TRUE(contains(fault_of(file), fault)) << fault_of(file) << "\nlacks: " << fault;
    EXPECT_TRUE(contains(fault_of(file), "; right would be ")) << fault_of(file);
  }
}

// Whatever the bytes, the reader returns an array of that shape, or throws an error with the remedy.
TEST(NpyFile, DamagedFilesAreRefusedOrRead) {
  std::mt19937_64 random(1);
  const std::string file = npy_file(good, six);
  int refused = 0, accepted = 0;
  for (int round = 0; round < 20'000; ++round) {
    std::string damaged = file;
    const auto changes = 1 + random() % 4;
    for (std::uint64_t i = 0; i < changes && !damaged.empty(); ++i) {
      const std::size_t at = random() % std::min<std::size_t>(damaged.size(), 90);
      switch (random() % 4) {
        case 0:
          damaged[at] = static_cast<char>(random());
          break;
        case 1:
          damaged[at] = "0123456789,()'{}:<>f8 "[random() % 22];
          break;
        case 2:
          damaged.erase(at, 1 + random() % 8);
          break;
        default:
          damaged.insert(at, damaged.substr(random() % damaged.size(), random() % 8));
      }
    }
    try {
      const NpyArray array = read(damaged);
      ASSERT_EQ(array.values.size(), array.rows * array.columns);
      ++accepted;
    } catch (const std::runtime_error& error) {
      ASSERT_TRUE(contains(error.what(), "right would be")) << error.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, 10'000);
  EXPECT_GT(accepted, 100);
}

}  // namespace
}  // namespace imud
