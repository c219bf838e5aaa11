// One flight by different ways gives the same rate and specific force, each within the resolution of its format.
//
// The flight is tests/captures/jsbsim_two_ways.pcap.gz; its expected values are jsbsim_two_ways.csv.gz, from which
// the other ways are made here.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <bit>
#include <charconv>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/pose/pose_fit.hpp"
#include "protocols/truth_format.hpp"

namespace imud {
namespace {

std::string unpacked(const std::string& name) {
  const gzFile file = ::gzopen((std::string(IMUD_SOURCE_DIR "/tests/captures/") + name).c_str(), "rb");
  if (file == nullptr) throw std::runtime_error("no file " + name);
  std::string all;
  char piece[65536];
  for (int size = 0; (size = ::gzread(file, piece, sizeof piece)) > 0;)
    all.append(piece, static_cast<std::size_t>(size));
  ::gzclose(file);
  return all;
}

// A row of the expected values.
struct ExpectedRow {
  std::int64_t time_ns = 0;
  Vector3 gyro, force_at_centre, force_at_eye, r_BN_N;
  double q_NB[4] = {};  // x y z w
};

std::vector<ExpectedRow> expected_rows() {
  const std::string text = unpacked("jsbsim_two_ways.csv.gz");
  std::vector<ExpectedRow> rows;
  for (std::size_t at = text.find('\n') + 1; at < text.size(); at = text.find('\n', at) + 1) {
    const char *next = text.data() + at, *const end = text.data() + text.size();
    ExpectedRow row;
    next = std::from_chars(next, end, row.time_ns).ptr;
    const auto take = [&](double& number) { next = std::from_chars(next + 1, end, number).ptr; };
    for (Vector3* vector : {&row.gyro, &row.force_at_centre, &row.force_at_eye, &row.r_BN_N})
      for (int i = 0; i < 3; ++i) take((*vector)[i]);
    for (double& number : row.q_NB) take(number);
    rows.push_back(row);
  }
  return rows;
}

// The payloads of a port, in a nanosecond pcap of Ethernet frames.
std::vector<std::string> datagrams_of(std::uint16_t wanted_port) {
  const std::string pcap = unpacked("jsbsim_two_ways.pcap.gz");
  constexpr std::size_t file_header = 24, record_header = 16, length_offset = 8, port_offset = 36,
                        payload_offset = 42;
  std::vector<std::string> all;
  for (std::size_t at = file_header; at + record_header < pcap.size();) {
    std::uint32_t length = 0;
    std::memcpy(&length, pcap.data() + at + length_offset, sizeof length);
    const std::string packet = pcap.substr(at + record_header, length);
    const unsigned port =
        static_cast<unsigned char>(packet[port_offset]) * 256U + static_cast<unsigned char>(packet[port_offset + 1]);
    if (port == wanted_port) all.push_back(packet.substr(payload_offset));
    at += record_header + length;
  }
  return all;
}

using TextSettings = std::map<std::string, std::string>;

// Decodes datagrams, or a stream in pieces.
std::vector<Truth> truths_by(std::string_view name, const TextSettings& given, const std::vector<std::string>& input,
                             TruthInput kind = TruthInput::datagram) {
  const TruthFormat& format = *find_truth_format(name);
  Settings settings(format.settings);
  for (const auto& [key, text] : given) settings.set_text(key, text);
  const auto decoder = format.make(settings);
  std::vector<Truth> truths;
  for (const std::string& piece : input) {
    decoder->feed(std::as_bytes(std::span(piece)), kind, {});
    Truth truth;
    while (const auto result = decoder->next(truth))
      if (*result == TruthResult::ok)
        truths.push_back(truth);
      else
        EXPECT_EQ(*result, TruthResult::no_state) << name;
  }
  return truths;
}

// Derives what is missing, as the daemon does; JSBSim's gravitation is central with J2.
std::vector<Truth> fitted(const std::vector<Truth>& poses) {
  PoseFit fit({.gravitation = {.kind = GravitationModel::Kind::j2}});
  std::vector<Truth> truths;
  Truth truth;
  for (const Truth& pose : poses) {
    fit.push(pose);
    while (fit.next(truth)) truths.push_back(truth);
  }
  fit.finish();
  while (fit.next(truth)) truths.push_back(truth);
  return truths;
}

template <class Number>
void pack(std::string& record, double value) {
  const auto bytes = std::bit_cast<std::array<char, sizeof(Number)>>(static_cast<Number>(value));
  record.append(bytes.data(), bytes.size());
}

// Attitude, rate and force in the numbers of `Number`, after the time.
template <class Number>
std::vector<Truth> by_struct(const std::vector<ExpectedRow>& rows) {
  const std::string type = sizeof(Number) == 4 ? "f32" : "f64";
  std::string fields = "time_ns:i64";
  for (const char* name : {"q_NB_x", "q_NB_y", "q_NB_z", "q_NB_w", "p_rad_per_s", "q_rad_per_s", "r_rad_per_s",
                           "specific_force_x_m_per_s2", "specific_force_y_m_per_s2", "specific_force_z_m_per_s2"})
    fields += fmt::format(",{}:{}", name, type);
  std::vector<std::string> records;
  for (const ExpectedRow& row : rows) {
    std::string record(sizeof row.time_ns, '\0');
    std::memcpy(record.data(), &row.time_ns, sizeof row.time_ns);
    for (const double number : row.q_NB) pack<Number>(record, number);
    for (int i = 0; i < 3; ++i) pack<Number>(record, row.gyro[i]);
    for (int i = 0; i < 3; ++i) pack<Number>(record, row.force_at_centre[i]);
    records.push_back(record);
  }
  return truths_by("struct", {{"fields", fields}}, records);
}

std::vector<Truth> by_json(const std::vector<ExpectedRow>& rows) {
  std::vector<std::string> lines;
  for (const ExpectedRow& row : rows)
    lines.push_back(fmt::format(
        R"({{"time_ns": {}, "q_NB_x": {}, "q_NB_y": {}, "q_NB_z": {}, "q_NB_w": {}, "p_rad_per_s": {}, )"
        R"("q_rad_per_s": {}, "r_rad_per_s": {}, "specific_force_x_m_per_s2": {}, "specific_force_y_m_per_s2": {}, )"
        R"("specific_force_z_m_per_s2": {}}})"
        "\n",
        row.time_ns, row.q_NB[0], row.q_NB[1], row.q_NB[2], row.q_NB[3], row.gyro[0], row.gyro[1], row.gyro[2],
        row.force_at_centre[0], row.force_at_centre[1], row.force_at_centre[2]));
  return truths_by("json", {}, lines, TruthInput::stream);
}

std::vector<Truth> by_poses(const std::vector<ExpectedRow>& rows) {
  std::vector<std::string> lines;
  for (const ExpectedRow& row : rows)
    lines.push_back(fmt::format("{}.{:09} {} {} {} {} {} {} {}\n", row.time_ns / 1'000'000'000,
                                row.time_ns % 1'000'000'000, row.r_BN_N[0], row.r_BN_N[1], row.r_BN_N[2], row.q_NB[0],
                                row.q_NB[1], row.q_NB[2], row.q_NB[3]));
  return fitted(truths_by("tum", {{"level", "ned"}}, lines, TruthInput::stream));
}

// Half an LSB of float32 of a number below `most`.
constexpr double half_lsb(double most) { return most * 0x1p-24; }

struct Way {
  std::string_view name;
  std::function<std::vector<Truth>(const std::vector<ExpectedRow>&)> truths;
  Vector3 ExpectedRow::*force;
  double rate_bound, force_bound;  // rad/s, m/s^2; largest difference of a component
  std::size_t at_ends = 0;         // truths at either end that are left out
};

// JSBSim's force at the eye point is that of the step of 1 ms before, which differs from that of the instant most at
// the steps of the controls: by 1.11e-2 m/s^2 in this piece, the same in text and FGNetFDM.
constexpr double step_before = 1.12e-2;
// The Euler rates of FGNetFDM are float32, below 1 rad/s, and two of them are in each body rate; the angles that turn
// them, below 4 rad, are multiplied by rates below 0.5 rad/s.
constexpr double fdm_rate = 2 * half_lsb(1.0) + 0.5 * half_lsb(4.0);
constexpr double fdm_force = half_lsb(64.0) * 0.3048;  // ft/s^2
// The fit of +-30 ms smooths the steps of the controls; measured 9.1e-5 rad/s, 1.04e-3 m/s^2.
constexpr double fit_rate = 1e-4, fit_force = 1.2e-3;

const Way ways[] = {
    {"text", [](const auto&) { return truths_by("jsbsim", {}, datagrams_of(15140)); }, &ExpectedRow::force_at_eye,
     1e-15, step_before},
    {"fgnetfdm", [](const auto&) { return truths_by("fgnetfdm", {}, datagrams_of(15550)); },
     &ExpectedRow::force_at_eye, fdm_rate, step_before + fdm_force},
    {"struct, f64", by_struct<double>, &ExpectedRow::force_at_centre, 0, 0},
    {"struct, f32", by_struct<float>, &ExpectedRow::force_at_centre, half_lsb(1.0), half_lsb(16.0)},
    {"json", by_json, &ExpectedRow::force_at_centre, 0, 0},
    {"tum", by_poses, &ExpectedRow::force_at_centre, fit_rate, fit_force, 4},
};

TEST(TruthTwoWays, GiveTheSameRateAndForce) {
  const std::vector<ExpectedRow> rows = expected_rows();
  ASSERT_EQ(rows.size(), 151U);
  for (const Way& way : ways) {
    SCOPED_TRACE(way.name);
    const std::vector<Truth> truths = way.truths(rows);
    ASSERT_EQ(truths.size(), rows.size());
    double rate = 0, force = 0;
    for (std::size_t i = way.at_ends; i + way.at_ends < rows.size(); ++i) {
      constexpr double truncated_us = 1001;
      ASSERT_NEAR(static_cast<double>(truths[i].time.ns), static_cast<double>(rows[i].time_ns), truncated_us);
      ASSERT_TRUE(truths[i].has_rate && truths[i].has_specific_force);
      rate = std::max(rate, (truths[i].omega_BN_B - rows[i].gyro).lpNorm<Eigen::Infinity>());
      force = std::max(force, (truths[i].specific_force_B - rows[i].*way.force).lpNorm<Eigen::Infinity>());
    }
    EXPECT_LE(rate, way.rate_bound);
    EXPECT_LE(force, way.force_bound);
  }
}

// Text and FGNetFDM have the force of the same step: they differ by the resolution of float32 alone.
TEST(TruthTwoWays, TextAndFgnetfdmHaveTheSameForce) {
  const std::vector<Truth> text = ways[0].truths({}), fdm = ways[1].truths({});
  ASSERT_EQ(text.size(), fdm.size());
  for (std::size_t i = 0; i < text.size(); ++i)
    EXPECT_LE((text[i].specific_force_B - fdm[i].specific_force_B).lpNorm<Eigen::Infinity>(), fdm_force) << i;
}

}  // namespace
}  // namespace imud
