// A self test that reports a failure, through the bytes of each product that has one.
#include <gtest/gtest.h>

#include "emulator/faults/fault_kinds.hpp"
#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/protocols/mip/mip_unit.hpp"

namespace imud {
namespace {

class SelfTestFaultsTest : public FaultyRunTest {
 protected:
  static constexpr std::string_view failed =
      "[[fault]]\ntarget = \"device\"\nkind = \"self_test_failed\"\nat_s = 2\nfor_s = 1\n";
  // Calls check(clean, faulty) for each frame that differs, all of which must be in the window, which ends before
  // `end_s` for a status that is collected. Returns their number.
  template <class Check>
  std::size_t differing(const Result& clean, const Result& faulty, double end_s, Check check) {
    EXPECT_EQ(clean.frames.size(), faulty.frames.size());
    std::size_t count = 0;
    for (std::size_t i = 0; i < clean.frames.size(); ++i) {
      const std::string &a = clean.frames[i].bytes, &b = faulty.frames[i].bytes;
      if (a == b) continue;
      const double time_s = seconds(clean.frames[i].time - clean.frames[0].time);
      EXPECT_TRUE(time_s >= 2 && time_s < end_s) << time_s;
      EXPECT_EQ(a.size(), b.size());
      check(a, b);
      ++count;
    }
    return count;
  }
};

TEST_F(SelfTestFaultsTest, InTheStatusOfEachSample) {
  const Result clean = run(""), faulty = run(std::string(failed));
  EXPECT_EQ(differing(clean, faulty, 3,
                      [](const std::string& a, const std::string& b) {
                        // Bit 12 of the status at byte 116, and the CRC behind it.
                        ASSERT_EQ(a[117] ^ b[117], 0x10);
                        ASSERT_EQ(a.substr(0, 117) + a.substr(118, 2), b.substr(0, 117) + b.substr(118, 2));
                      }),
            500U);
}

// Bit 3 of the status of each cluster. The datagram at 3 s has that of two samples, the first of which is in the
// window.
TEST_F(SelfTestFaultsTest, MeasurementChannelsOfAStim300) {
  const std::string unit = "[imu.device]\nstart_up = false\n";
  const Result clean = run("", "stim300", 1, unit), faulty = run(std::string(failed), "stim300", 1, unit);
  EXPECT_EQ(differing(clean, faulty, 3.0001,
                      [](const std::string& a, const std::string& b) {
                        for (std::size_t cluster = 0; cluster < 3; ++cluster)
                          ASSERT_EQ((a[10 + 10 * cluster] ^ b[10 + 10 * cluster]) & 0xFF, 0x08);
                      }),
            1001U);
  ASSERT_EQ(faulty.measurements.size(), clean.measurements.size());
  for (std::size_t i = 0; i < clean.measurements.size(); ++i)
    ASSERT_EQ(faulty.measurements[i].sample.rate, clean.measurements[i].sample.rate) << i;
}

TEST_F(SelfTestFaultsTest, StatusOfUnitsOnACanBus) {
  const struct {
    std::string protocol;
    std::size_t at;
    int bits;
    std::size_t least;
    double end_s;
  } units[] = {{"sbg-can", 4, 0x02, 50, 3}, {"xsens-can", 3, 0x01, 50, 3}, {"dronecan", 4, 0x80, 1, 4}};
  for (const auto& unit : units) {
    SCOPED_TRACE(unit.protocol);
    const Result clean = run("", unit.protocol, 1, ""), faulty = run(std::string(failed), unit.protocol, 1, "");
    EXPECT_GE(differing(clean, faulty, unit.end_s,
                        [&](std::string a, const std::string& b) {
                          ASSERT_LT(unit.at, a.size());
                          a[unit.at] = static_cast<char>(a[unit.at] ^ unit.bits);
                          ASSERT_EQ(a, b);
                        }),
              unit.least);
  }
}

// Built-in test (0x01, 0x05), and continuous built-in test (0x01, 0x08).
TEST(SelfTestFaults, AnswersOfAMipUnit) {
  using namespace mip_test;
  mip_test::Unit unit;
  unit.run(1);
  for (const bool has_failed : {false, true, false}) {
    unit.sample.status = has_failed ? status::self_test_failed : 0;
    unit.run(1);
    const auto first = unit.send(command(0x01, 0x05)), second = unit.send(command(0x01, 0x08));
    ASSERT_EQ(first.size(), 1U);
    ASSERT_EQ(second.size(), 1U);
    EXPECT_EQ(field(first[0], 0x83), (Bytes{0, 0, 0, has_failed})) << "most significant byte first";
    EXPECT_EQ(field(second[0], 0x88)[0], has_failed ? 1 : 0);
    EXPECT_EQ(field(second[0], 0x88).size(), 16U);
  }
}

TEST(SelfTestFaults, OnlyOfProductsThatHaveOne) {
  const FaultKind& kind = *find_fault_kind("self_test_failed", "device");
  EXPECT_EQ(fault_objection(kind, "device", *find_protocol("native"), Settings()), "");
  EXPECT_EQ(fault_objection(kind, "device", *find_protocol("vectornav"), Settings()),
            "vectornav reports no self test; these do: csv, dronecan, mip, native, sbg-can, stim300, xsens-can");
  EXPECT_NE(fault_objection(*find_fault_kind("bus_off", "wire"), "wire", *find_protocol("native"), Settings()), "");
}

}  // namespace
}  // namespace imud
