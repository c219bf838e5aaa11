// What a receiver reports about itself, through the bytes of a MIP unit with a receiver and of a VectorNav.
#include <gtest/gtest.h>

#include <bit>

#include "tests/emulator/faults/faulty_run.hpp"

namespace imud {
namespace {

class GnssFaultsTest : public FaultyRunTest {
 protected:
  static constexpr std::string_view earth = "[earth]\nframe = \"inertial\"\n";
  static std::string gnss_fault(std::string_view kind, std::string_view settings) {
    return fmt::format("[[fault]]\ntarget = \"gnss\"\nkind = \"{}\"\n{}at_s = 2\nfor_s = 1\n{}", kind, settings,
                       earth);
  }
  template <class Number>
  static Number big_endian_at(const std::string& bytes, std::size_t at) {
    std::array<char, sizeof(Number)> reversed;
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), sizeof(Number), reversed.rbegin());
    return std::bit_cast<Number>(reversed);
  }
  static float little_endian_at(const std::string& bytes, std::size_t at) {
    std::array<char, sizeof(float)> all;
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), sizeof(float), all.begin());
    return std::bit_cast<float>(all);
  }
  // Calls check(clean, faulty) for each frame in the window, and compares all others. `begins`: what the frames of
  // interest begin with.
  template <class Check>
  void compare(const Result& clean, const Result& faulty, std::string_view begins, Check check) {
    ASSERT_EQ(clean.frames.size(), faulty.frames.size());
    std::size_t inside = 0;
    for (std::size_t i = 0; i < clean.frames.size(); ++i) {
      const double time_s = seconds(clean.frames[i].time - clean.frames[0].time);
      const std::string &a = clean.frames[i].bytes, &b = faulty.frames[i].bytes;
      if (time_s < 2 || time_s >= 3 || !a.starts_with(begins)) {
        ASSERT_EQ(a, b) << time_s;
        continue;
      }
      ++inside;
      ASSERT_EQ(a.size(), b.size());
      check(a, b);
    }
    EXPECT_GT(inside, 3U);
  }
};

constexpr std::string_view mip_unit =
    "[imu.device]\nmodel = \"3dm-gx5-45\"\ngnss_fields = [\"gnss_fix\", \"gnss_position\", \"gnss_velocity\"]\n"
    "filter_rate_hz = 500\nfilter_fields = [\"filter_position_uncertainty\", \"filter_velocity_uncertainty\"]\n"
    "[imu.navigation]\nsolution = \"truth\"\n";
constexpr std::string_view receivers_packet = "\x75\x65\x81", filters_packet = "\x75\x65\x82";
// Head 4; fix 2 + 6; position 2 + 42; velocity 2 + 34.
constexpr std::size_t satellites_at = 4 + 2 + 1, horizontal_at = 12 + 2 + 32, vertical_at = horizontal_at + 4,
                      speed_accuracy_at = 56 + 2 + 24, course_accuracy_at = speed_accuracy_at + 4;

TEST_F(GnssFaultsTest, FewerSatellites) {
  const std::string unit(mip_unit);
  const Result clean = run(std::string(earth), "mip", 1, unit),
               fewer = run(gnss_fault("satellites", "value = 5\n"), "mip", 1, unit);
  compare(clean, fewer, receivers_packet, [](const std::string& a, std::string b) {
    ASSERT_EQ(a[satellites_at], 12);
    ASSERT_EQ(b[satellites_at], 5);
    b[satellites_at] = 12;
    EXPECT_EQ(a.substr(0, a.size() - 2), b.substr(0, b.size() - 2)) << "all but the checksum";
  });
}

TEST_F(GnssFaultsTest, AccuraciesThatPromiseTooMuch) {
  const std::string unit(mip_unit);
  const Result clean = run(std::string(earth), "mip", 1, unit),
               wrong = run(gnss_fault("accuracy", "factor = 0.125\n"), "mip", 1, unit);
  const auto expect_eighth = [](const std::string& a, const std::string& b, std::initializer_list<std::size_t> all) {
    for (const std::size_t at : all) {
      ASSERT_GT(big_endian_at<float>(a, at), 0) << at;
      ASSERT_EQ(8 * big_endian_at<float>(b, at), big_endian_at<float>(a, at)) << at;
    }
  };
  // The filter's packets leave every 2 ms: the window is exact to one of them.
  for (const std::string_view begins : {receivers_packet, filters_packet}) {
    Result clean_of, wrong_of;
    for (const auto& [from, to] : {std::pair(&clean, &clean_of), std::pair(&wrong, &wrong_of)})
      for (const Sent& frame : from->frames)
        if (frame.bytes.starts_with(begins)) to->frames.push_back(frame);
    compare(clean_of, wrong_of, begins, [&](const std::string& a, const std::string& b) {
      if (begins == receivers_packet)
        expect_eighth(a, b, {horizontal_at, vertical_at, speed_accuracy_at, course_accuracy_at});
      else
        expect_eighth(a, b, {6, 10, 14, 22, 26, 30});
    });
  }
}

// GNSS1 (group 3): satellites, position errors, velocity error.
TEST_F(GnssFaultsTest, ReportedByAVectorNav) {
  const std::string unit =
      "[imu.device]\nmodel = \"vn-200\"\nbaud = 921600\nasync_type = 0\nbinary_1 = \"1,4,08,0608\"\n";
  const Result clean = run(std::string(earth), "vectornav", 1, unit),
               fewer = run(gnss_fault("satellites", "value = 3\n"), "vectornav", 1, unit),
               wrong = run(gnss_fault("accuracy", "factor = 16\n"), "vectornav", 1, unit);
  constexpr std::string_view begins("\xFA\x08\x08\x06", 4);
  compare(clean, fewer, begins, [](const std::string& a, const std::string& b) {
    ASSERT_EQ(a[4], 12);
    ASSERT_EQ(b[4], 3);
    ASSERT_EQ(a.substr(5, 16), b.substr(5, 16));
  });
  compare(clean, wrong, begins, [](const std::string& a, const std::string& b) {
    ASSERT_EQ(a[4], b[4]);
    for (std::size_t at = 5; at < 21; at += 4) ASSERT_EQ(little_endian_at(b, at), 16 * little_endian_at(a, at));
  });
}

}  // namespace
}  // namespace imud
