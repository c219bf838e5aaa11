// Random changes of good records of every truth format, in random pieces of a stream or as datagrams, between polls,
// acknowledgements and ends of the stream. No bytes make a decoder crash, hang or allocate, and each truth is in
// range. The environment variable IMUD_FUZZ_INPUTS sets the number of inputs for each case. Seeds are fixed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <ostream>
#include <random>
#include <string>

#include "protocols/native_truth.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/hex_bytes.hpp"
#include "tests/support/random_changes.hpp"

namespace imud {
namespace {

struct TruthFuzzCase {
  std::string format;
  std::vector<std::pair<std::string, std::string>> settings;  // as Settings::set_text() takes them
  std::string records;                                        // good ones; empty: none are known
};

void PrintTo(const TruthFuzzCase& fuzzed, std::ostream* out) { *out << fuzzed.format; }

// A HIL_STATE_QUATERNION of mavlink/c_library_v2 at 7e16bc0, see truth_mavlink_test.cpp.
constexpr std::string_view mavlink_reference =
    "fd4000000b01c873000015cd5b07000000000000803f0000000000000000000000000ad7233c0ad7a3bc8fc2f53c00de391a80157dd4a086"
    "0100640038ff2c01dc054006010002002bfcb92a";

std::string bytes_of_hex(std::string_view hex) {
  std::string bytes;
  for (const std::byte byte : hex_bytes(hex)) bytes += static_cast<char>(byte);
  return bytes;
}

std::string native_records() {
  std::array<std::byte, native_truth_size> datagram;
  encode_native_truth(Truth(), datagram);
  return {reinterpret_cast<const char*>(datagram.data()), datagram.size()};
}

// Returns a record of `size` bytes that are 0, but for `bytes` from `offset` on, and perhaps others.
std::string zeros_but(std::size_t size, std::size_t offset, std::string_view bytes, std::size_t offset2 = 0,
                      std::string_view bytes2 = {}) {
  std::string record(size, '\0');
  return record.replace(offset, bytes.size(), bytes).replace(offset2, bytes2.size(), bytes2);
}

// Every format has a case; the formats named here have good records.
std::vector<TruthFuzzCase> truth_fuzz_cases() {
  const std::string json =
      R"({"time_s": 1.5, "q_NB_w": 1, "q_NB_x": 0, "q_NB_y": 0, "q_NB_z": 0, "p_rpm": 1, )"
      R"("q_rpm": 2, "r_rpm": 3, "latitude_deg": 47, "longitude_deg": 8, "utm": [1, {"a": null}]})";
  const std::string map = "time_s=t,yaw_deg=a.0,pitch_deg=a.1,roll_deg=a.2,temperature_c=b.c";
  std::vector<TruthFuzzCase> cases = {
      {"native", {}, native_records()},
      {"csv",
       {},
       "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z\n7,0,0,0,1,2,3\n"
       "time_s;q_NB_w;q_NB_x;q_NB_y;q_NB_z;acceleration_x_g;acceleration_y_g;acceleration_z_g\n1;1;0;0;0;1;2;3\n"
       "utc,yaw_deg,pitch_deg,roll_deg,latitude_deg,longitude_deg,v_north_kt,v_east_kt,v_up_kt\n"
       "2026-01-31T12:00:00Z,1,2,3,47,8,100,0,-1\n"},
      {"csv", {{"columns", "time_s=t,p_deg_per_s=P,q_deg_per_s=Q,r_deg_per_s=R"}}, "t\tP\tQ\tR\n1\t2\t3\t4\n"},
      {"csv", {{"columns", "time_s=0,yaw_deg=3,pitch_deg=2,roll_deg=1"}, {"body", "flu"}}, "1 2 3 4\n1,2,\"3\",4\n"},
      {"json", {}, json + "\n" + json + "\n"},
      {"json", {{"columns", map}}, "{\"t\": 1, \"a\": [1, 2, 3.5e1], \"b\": {\"c\": \"20\"}}\n"},
      {"ardupilot-json",
       {},
       "\n{\"timestamp\": 12.5, \"imu\": {\"gyro\": [0.01, 0.02, 0.03], \"accel_body\": [0.1, 0.2, -9.8]}, "
       "\"position\": [1.0, 2.0, -3.0], \"attitude\": [0.1, -0.2, 3.0], \"velocity\": [4.0, 5.0, -6.0]}\n"},
      {"jsbsim",
       {},
       "<LABELS> ,Time,lat-geod-rad,long-gc-rad,epa-rad,phi-rad,theta-rad,psi-rad,pi-rad sec,qi-rad sec,ri-rad sec\n"
       "1,0.5,0.1,0,0.1,0.2,0.3,0.01,0.02,0.03\n"},
      {"tum", {}, "# timestamp\n1305031098.6659 1.3563 0.6305 1.6380 0.6132 0.5962 -0.3311 -0.3986\n"},
      {"euroc", {}, "1403636580838555648,4.6,-1.7,0.7,0.534108,-0.153029,-0.827383,-0.082152,-0.02,0.03,0.8\n"},
      {"flightgear", {}, "12.3450\t0.001000\t-0.002000\t0.003000\t0.10000\t0.20000\t-9.80000\n"},
      {"flightgear",
       {{"protocol", "insgns-truth"}},
       "0.0000\t0.820304748437\t0.139626340160\t-500.000\t10.0\t0.0\t0.0\t1.57080\t0.00000\t0.00000\n"},
      {"42",
       {},
       "TIME 2024-099-00:00:00.01\nSC[0].qn = [0 0 0 1]\nSC[0].wn = [0.1 0.2 0.3]\nSC[0].PosR = [1 2 3]\n"
       "SC[1].qn = [0 0 0 1]\nSC[1].wn = [0.1 0.2 0.3]\nOrb[0].PosN = [7e6 0 0]\n[ENDMSG]\n"},
      {"struct", {{"fields", "time_s:f64,yaw_deg:f32,pitch_deg:f32,roll_deg:f32"}}, std::string(20, '\0')},
      {"struct",
       {{"fields", "time_ms:u32,yaw_deg:i16,pitch_deg:i16,roll_deg:i16"}, {"magic", "CAFE"}, {"checksum", "sum8"}},
       zeros_but(13, 0, "\xCA\xFE", 12, "\xC8")},
      {"fgnetfdm", {{"time", "arrival"}}, zeros_but(408, 3, "\x18")},
      {"betaflight", {}, zeros_but(144, 62, "\xF0\x3F")},
      {"basilisk", {}, std::string(280, '\0')},
      {"dis", {}, zeros_but(144, 0, std::string_view("\7\1\1\1\0\0\0\0\0\x90", 10), 48, "\x41\x58\x6A")},
      {"mavlink", {}, bytes_of_hex(mavlink_reference)},
  };
  for (const TruthFormat* format : truth_formats()) {
    const auto is_it = [&](const TruthFuzzCase& fuzzed) { return fuzzed.format == format->name; };
    if (std::ranges::none_of(cases, is_it)) cases.push_back({std::string(format->name), {}, {}});
  }
  return cases;
}

class TruthFuzz : public testing::TestWithParam<TruthFuzzCase> {};
INSTANTIATE_TEST_SUITE_P(Cases, TruthFuzz, testing::ValuesIn(truth_fuzz_cases()));

TEST_P(TruthFuzz, AnyBytesDoNoHarm) {
  const TruthFormat* format = find_truth_format(GetParam().format);
  ASSERT_NE(format, nullptr);
  Settings settings(format->settings);
  for (const auto& [key, value] : GetParam().settings) settings.set_text(key, value);
  const auto decoder = format->make(settings);
  constexpr std::string_view pieces[] = {
      ",",      ";",   "\t",   " ",   "\n", "\"", ".", "-",   "e9",  "nan",  "inf", "1e9",   "1e99",         "0",
      "{",      "}",   "[",    "]",   ":",  "#",  "=", "\\u", "SC[", "\r\n", "\\",  "TIME ", "\xEF\xBB\xBF", "time_s",
      "q_NB_w", "yaw", "_deg", "true"};
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 15'000;
  std::mt19937_64 random(7);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  const auto out = std::make_unique<FrameBuffer>();
  std::array<char, 300> remark;
  Truth truth;
  std::size_t accepted = 0, refused = 0;
  for (long input = 0; input < inputs; ++input) {
    std::string text = GetParam().records;
    if (text.empty() || below(16) == 0)
      for (std::size_t i = below(500); i > 0; --i) text += static_cast<char>(random());
    for (std::size_t changes = below(4); changes > 0 && !text.empty(); --changes)
      change_randomly(text, 20, pieces, random);
    const bool is_datagram = !format->delimits_itself || below(2) == 0;
    const std::uint64_t before = allocations();
    std::size_t records = 0;
    for (std::string_view rest = text; !rest.empty();) {
      const std::size_t size = is_datagram ? rest.size() : 1 + below(rest.size());
      decoder->feed(std::as_bytes(std::span(rest.substr(0, size))),
                    is_datagram ? TruthInput::datagram : TruthInput::stream, HostTime{input});
      rest.remove_prefix(size);
      while (const auto result = decoder->next(truth)) {
        const std::span<char> room = std::span(remark).first(below(remark.size()));
        if (below(8) == 0 && decoder->describe(*result, room) > room.size()) FAIL() << text;
        if (++records > 20 * text.size() + 20) FAIL() << "next() returns something without end: " << text;
        if (result != TruthResult::ok) {
          refused += result == TruthResult::no_state ? 0U : 1U;
          continue;
        }
        ++accepted;
        if (!is_finite(truth) || !is_in_range(truth)) FAIL() << text;
        out->clear();
        if (truth.acknowledge) decoder->acknowledge(truth, truth.time, 1, *out);
      }
    }
    out->clear();
    const auto deadline = decoder->deadline();
    if (deadline && below(2) == 0) decoder->poll(*deadline, *out);
    if (below(100) == 0) decoder->start(HostTime{input});
    if (below(10) == 0) decoder->finish();
    ASSERT_EQ(allocations(), before) << text;
  }
  EXPECT_GT(refused, static_cast<std::size_t>(inputs / 20));
  EXPECT_GE(accepted, GetParam().records.empty() ? 0U : static_cast<std::size_t>(inputs / 20));
}

}  // namespace
}  // namespace imud
