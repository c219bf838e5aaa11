// Packing and unpacking of signals.
#include "protocols/signals/can_signals.hpp"

#include <gtest/gtest.h>

#include <cfloat>
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

std::string hex(std::span<const std::byte> bytes) {
  std::string text;
  char digits[3];
  for (const std::byte byte : bytes) {
    std::snprintf(digits, sizeof digits, "%02X", std::to_integer<unsigned>(byte));
    text += digits;
  }
  return text;
}

std::string encoded(std::size_t size, std::initializer_list<CanSignal> signals, const Sample& sample,
                    std::uint64_t count = 0, const MessageChecksum& checksum = {}) {
  const CanSignalCodec codec(size, {signals.begin(), signals.size()}, checksum);
  std::vector<std::byte> bytes(size, std::byte{0xEE});
  codec.encode({sample}, count, bytes);
  EXPECT_TRUE(codec.has_good_checksum(bytes));
  return hex(bytes);
}

Sample sample_of(double rate_x, double rate_y = 0) {
  Sample sample;
  sample.rate = {rate_x, rate_y, 0};
  return sample;
}

// Reference: python3-canmatrix 0.9.5, Frame.encode() of the same signals.
TEST(CanSignalsTest, BitsAreNumberedAsInADbcFile) {
  const struct {
    unsigned start, length;
    bool motorola;
    std::uint64_t number;
    const char* bytes;
  } cases[] = {
      {0, 16, false, 0x1234, "3412000000000000"},
      {7, 16, true, 0x1234, "1234000000000000"},
      {4, 12, false, 0xABC, "C0AB000000000000"},
      {3, 12, true, 0xABC, "0ABC000000000000"},
      {13, 7, false, 0x55, "00A00A0000000000"},
      {13, 7, true, 0x55, "002A800000000000"},
      {63, 1, false, 1, "0000000000000080"},
      {56, 1, true, 1, "0000000000000001"},
      {0, 64, false, 0x0102030405060708, "0807060504030201"},
      {7, 64, true, 0x0102030405060708, "0102030405060708"},
      {30, 3, true, 5, "0000005000000000"},
      {9, 22, false, 0x2AAAAA, "0054555500000000"},
  };
  for (const auto& one : cases) {
    std::vector<std::byte> bytes(8);
    write_bits(bytes, one.start, one.length, one.motorola, one.number);
    EXPECT_EQ(hex(bytes), one.bytes) << one.start << ' ' << one.length << ' ' << one.motorola;
    EXPECT_EQ(read_bits(bytes, one.start, one.length, one.motorola), one.number);
    // A field keeps all other bits, and takes none of them.
    std::vector<std::byte> ones(8, std::byte{0xFF});
    write_bits(ones, one.start, one.length, one.motorola, ~one.number);
    for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(ones[i], ~bytes[i]);
  }
}

TEST(CanSignalsTest, EveryFieldIsReadAsItWasWritten) {
  std::mt19937_64 random(5);
  std::size_t fields = 0;
  for (const bool motorola : {false, true})
    for (unsigned start = 0; start < 96; ++start)
      for (unsigned length = 1; length <= 64; ++length) {
        // The bits in the order of their weight, by the definition of a DBC file.
        std::vector<unsigned> bits = {start};
        while (bits.size() < length)
          bits.push_back(!motorola ? bits.back() + 1 : bits.back() % 8 == 0 ? bits.back() + 15 : bits.back() - 1);
        if (*std::ranges::max_element(bits) >= 96) continue;
        if (motorola) std::ranges::reverse(bits);
        ++fields;
        std::vector<std::byte> bytes = random_bytes(12, random);
        const std::vector<std::byte> before = bytes;
        const std::uint64_t number = random();
        write_bits(bytes, start, length, motorola, number);
        const std::uint64_t read = read_bits(bytes, start, length, motorola);
        for (unsigned i = 0; i < 96; ++i) {
          const auto bit_of = [i](const std::vector<std::byte>& all) {
            return std::to_integer<unsigned>(all[i / 8]) >> i % 8 & 1U;
          };
          const auto found = std::ranges::find(bits, i);
          if (found == bits.end()) {
            ASSERT_EQ(bit_of(bytes), bit_of(before));
            continue;
          }
          const auto weight = static_cast<unsigned>(found - bits.begin());
          ASSERT_EQ(bit_of(bytes), number >> weight & 1U);
          ASSERT_EQ(read >> weight & 1U, number >> weight & 1U);
        }
      }
  EXPECT_GT(fields, 5000U);
}

TEST(CanSignalsTest, ValuesAreRoundedToNearestAndSaturate) {
  const CanSignal rate = {"R", 0, 16, intel_signed, 0.5, 0, "rate_x_rad_per_s"};
  EXPECT_EQ(encoded(2, {rate}, sample_of(1)), "0200");
  EXPECT_EQ(encoded(2, {rate}, sample_of(1.24)), "0200");
  EXPECT_EQ(encoded(2, {rate}, sample_of(1.25)), "0300");
  EXPECT_EQ(encoded(2, {rate}, sample_of(-1.25)), "FDFF");
  EXPECT_EQ(encoded(2, {rate}, sample_of(1e9)), "FF7F");
  EXPECT_EQ(encoded(2, {rate}, sample_of(-DBL_MAX)), "0080");
  EXPECT_EQ(encoded(2, {rate}, sample_of(std::nan(""))), "0080");
  const CanSignal limited = {"R", 0, 16, intel_signed, 0.5, 0, "rate_x_rad_per_s", nullptr, 0, -100, 100.2};
  EXPECT_EQ(encoded(2, {limited}, sample_of(1e9)), "C800");
  EXPECT_EQ(encoded(2, {limited}, sample_of(-1e9)), "38FF");
  const CanSignal with_offset = {"R", 7, 8, motorola_unsigned, 2, -100, "rate_x_deg_per_s"};
  EXPECT_EQ(encoded(1, {with_offset}, sample_of(0)), "32");
  EXPECT_EQ(encoded(1, {with_offset}, sample_of(units::degree)), "33");  // a half, away from zero
  EXPECT_EQ(encoded(1, {with_offset}, sample_of(-units::degree)), "31");
  EXPECT_EQ(encoded(1, {with_offset}, sample_of(-10)), "00");
  EXPECT_EQ(encoded(1, {with_offset}, sample_of(10)), "FF");
  const CanSignal falling = {"R", 0, 8, intel_signed, -1, 0, "rate_x_rad_per_s"};
  EXPECT_EQ(encoded(1, {falling}, sample_of(3)), "FD");
  const CanSignal negated = {"R", 0, 8, intel_signed, 1, 0, "-rate_x_rad_per_s"};
  EXPECT_EQ(encoded(1, {negated}, sample_of(3)), "FD");
  const CanSignal wide = {"R", 0, 64, intel_unsigned, 1, 0, "rate_x_rad_per_s"};
  EXPECT_EQ(encoded(8, {wide}, sample_of(1e30)), "00F8FFFFFFFFFFFF");  // the largest double below 2^64
  EXPECT_EQ(encoded(8, {wide}, sample_of(-1)), "0000000000000000");
  const CanSignal wide_signed = {"R", 0, 64, intel_signed, 1, 0, "rate_x_rad_per_s"};
  EXPECT_EQ(encoded(8, {wide_signed}, sample_of(1e30)), "00FCFFFFFFFFFF7F");
  EXPECT_EQ(encoded(8, {wide_signed}, sample_of(-1e30)), "0000000000000080");
}

TEST(CanSignalsTest, FloatsAreSentAsTheyAre) {
  const CanSignal single = {"R", 0, 32, {false, SignalFormat::float32}, 1, 0, "rate_x_rad_per_s"};
  EXPECT_EQ(encoded(4, {single}, sample_of(1.5)), "0000C03F");
  const CanSignal big_endian = {"R", 7, 64, {true, SignalFormat::float64}, 1, 0, "rate_x_rad_per_s"};
  EXPECT_EQ(encoded(8, {big_endian}, sample_of(-1.5)), "BFF8000000000000");
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double never : {infinity, -infinity, std::nan("")}) {
    const bool is_high = never > 0;
    EXPECT_EQ(encoded(4, {single}, sample_of(never)), is_high ? "FFFF7F7F" : "FFFF7FFF");
    EXPECT_EQ(encoded(8, {big_endian}, sample_of(never)), is_high ? "7FEFFFFFFFFFFFFF" : "FFEFFFFFFFFFFFFF");
  }
  const CanSignal limited = {"R", 0,  32,  {false, SignalFormat::float32}, 2, 10, "rate_x_rad_per_s", nullptr,
                             0,   -1, 12.5};
  EXPECT_EQ(encoded(4, {limited}, sample_of(13)), "0000A03F");  // 12.5 = 2 * 1.25 + 10
  EXPECT_EQ(encoded(4, {limited}, sample_of(-3)), "0000B0C0");  // -1 = 2 * -5.5 + 10
  EXPECT_EQ(encoded(4, {limited}, sample_of(0)), "0000A0C0");   // 0 = 2 * -5 + 10
}

TEST(CanSignalsTest, ClocksCountersAndStatusWrap) {
  Sample sample;
  sample.time.ns = (std::int64_t{1} << 32) * 1000 + 1'499'600;
  sample.counter = 0x12345;
  sample.status = 0xABCDE;
  EXPECT_EQ(encoded(4, {{"T", 0, 32, intel_unsigned, 1, 0, "time_us"}}, sample), "DC050000");
  EXPECT_EQ(encoded(4, {{"T", 7, 32, motorola_unsigned, 100, 0, "time_us"}}, sample), "028F5C38");
  EXPECT_EQ(encoded(1, {{"C", 0, 8, intel_unsigned, 1, 0, "sample_counter"}}, sample), "45");
  EXPECT_EQ(encoded(1, {{"S", 0, 8, intel_unsigned, 1, 0, "status"}}, sample), "DE");
}

TEST(CanSignalsTest, ConstantsAreWrittenFirst) {
  EXPECT_EQ(encoded(2,
                    {{"R", 0, 8, intel_signed, 1, 0, "rate_x_rad_per_s"},
                     {.name = "Both", .start = 0, .length = 16, .initial = 0xABCD}},
                    sample_of(3)),
            "03AB");
}

TEST(CanSignalsTest, AliveCountersGoToTheEndOfTheirProfile) {
  const CanSignal sum = {"S", 0, 8, intel_unsigned, 1, 0, checksum_source};
  const CanSignal counter = {"C", 8, 4, intel_unsigned, 1, 0, alive_counter_source};
  const CanSignal nibble = {"N", 12, 4, intel_unsigned, 1, 0, data_id_nibble_source};
  const MessageChecksum p01{.profile = ChecksumProfile::e2e_p01, .mode = DataIdMode::nibble, .data_id = 0x123};
  const auto message = [&](std::uint64_t count, const MessageChecksum& checksum) {
    return encoded(8, {sum, counter, nibble}, {}, count, checksum);
  };
  EXPECT_EQ(message(0, p01), "2A10000000000000");  // as in message_checksum_test.cpp
  EXPECT_EQ(message(1, p01), "7711000000000000");
  EXPECT_EQ(message(14, p01).substr(2, 2), "1E");
  EXPECT_EQ(message(15, p01), message(0, p01));
  const MessageChecksum p02{.profile = ChecksumProfile::e2e_p02};
  EXPECT_EQ(message(15, p02).substr(2, 2), "0F");
  EXPECT_EQ(message(16, p02), message(0, p02));
}

TEST(CanSignalsTest, ADamagedMessageIsRefused) {
  const CanSignal signals[] = {{"S", 0, 8, intel_unsigned, 1, 0, checksum_source},
                               {"C", 8, 4, intel_unsigned, 1, 0, alive_counter_source}};
  const CanSignalCodec codec(8, signals, {.profile = ChecksumProfile::e2e_p01, .data_id = 7});
  std::vector<std::byte> bytes(8);
  codec.encode({Sample{}}, 3, bytes);
  ASSERT_TRUE(codec.has_good_checksum(bytes));
  for (std::size_t i = 0; i < 64; ++i) {
    bytes[i / 8] ^= static_cast<std::byte>(1U << i % 8);
    EXPECT_FALSE(codec.has_good_checksum(bytes)) << i;
    bytes[i / 8] ^= static_cast<std::byte>(1U << i % 8);
  }
  // The counter 15 is not valid, even with its checksum.
  bytes[1] = std::byte{15};
  bytes[0] =
      static_cast<std::byte>(MessageChecksum{.profile = ChecksumProfile::e2e_p01, .data_id = 7}.of(bytes, 0, 15));
  EXPECT_FALSE(codec.has_good_checksum(bytes));
}

TEST(CanSignalsTest, AMultiplexedMessageHasOnePageAfterAnother) {
  constexpr PageRange two[] = {{2, 2}}, seven[] = {{7, 7}};
  const CanSignal mux = {.name = "M", .length = 8};
  const CanSignal x = {"X", 8, 8, intel_signed, 1, 0, "rate_x_rad_per_s", nullptr, 0, 0, 0, seven, "M"};
  const CanSignal y = {"Y", 8, 8, intel_signed, 1, 0, "rate_y_rad_per_s", nullptr, 0, 0, 0, two, "M"};
  const Sample sample = sample_of(1, -1);
  EXPECT_EQ(encoded(2, {mux, x, y}, sample, 0), "02FF");
  EXPECT_EQ(encoded(2, {mux, x, y}, sample, 1), "0701");
  EXPECT_EQ(encoded(2, {mux, x, y}, sample, 2), "02FF");
}

TEST(CanSignalsTest, AFaultyTableIsRefused) {
  const auto refusal = [](std::size_t size, std::initializer_list<CanSignal> signals,
                          const MessageChecksum& checksum = {}) -> std::string {
    try {
      CanSignalCodec(size, {signals.begin(), signals.size()}, checksum);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const CanSignal rate = {"R", 0, 16, intel_signed, 1, 0, "rate_x_rad_per_s"};
  EXPECT_EQ(refusal(2, {rate}), "");
  EXPECT_EQ(refusal(1, {rate}), "R: exceeds the 1 bytes of its message");
  EXPECT_EQ(refusal(8, {{"R", 0xFFFF'FFFF, 1}}), "R: exceeds the 8 bytes of its message");
  EXPECT_EQ(refusal(8, {{"R", 56, 9, motorola_signed}}), "R: exceeds the 8 bytes of its message");
  EXPECT_EQ(refusal(8, {{"R", 0, 0}}), "R: must have 1 to 64 bits");
  EXPECT_EQ(refusal(8, {{"R", 0, 65}}), "R: must have 1 to 64 bits");
  EXPECT_EQ(refusal(8, {rate, {"Q", 8, 16, intel_signed, 1, 0, "rate_y_rad_per_s"}}), "Q: overlaps another signal");
  EXPECT_EQ(refusal(8, {{"R", 0, 16, intel_signed, 0, 0, "rate_x_rad_per_s"}}),
            "R: the scale must be finite and not 0, the offset finite");
  EXPECT_NE(refusal(8, {{"R", 0, 16, intel_signed, 1, 0, "rate_x_volt"}}).find("rate_x_rad_per_s, "),
            std::string::npos);
  EXPECT_NE(refusal(8, {{"T", 0, 16, intel_unsigned, 0.3, 0, "time_ns"}}), "");
  EXPECT_NE(refusal(8, {{"C", 0, 8, intel_unsigned, 1, 0, checksum_source}}), "") << "of which kind?";
  const MessageChecksum j1850{.profile = ChecksumProfile::j1850}, p01{.profile = ChecksumProfile::e2e_p01};
  EXPECT_EQ(refusal(8, {{"C", 0, 8, intel_unsigned, 1, 0, checksum_source}}, j1850), "");
  EXPECT_EQ(refusal(8, {{"C", 7, 8, motorola_unsigned, 1, 0, checksum_source}}, j1850), "");
  EXPECT_EQ(refusal(8, {{"C", 4, 8, intel_unsigned, 1, 0, checksum_source}}, j1850), "C: must be a whole byte");
  EXPECT_NE(refusal(8, {rate}, j1850), "") << "where is it?";
  EXPECT_EQ(refusal(8, {{"C", 0, 8, intel_unsigned, 1, 0, checksum_source}}, p01),
            "C: its profile needs a signal that is alive_counter");
  constexpr PageRange seven[] = {{7, 7}}, two[] = {{2, 2}}, reversed[] = {{7, 6}};
  const auto on = [](std::span<const PageRange> pages, std::string_view multiplexor) {
    return CanSignal{"X", 8, 8, intel_signed, 1, 0, "rate_x_rad_per_s", nullptr, 0, 0, 0, pages, multiplexor};
  };
  const CanSignal narrow = {.name = "M", .length = 2}, wide = {.name = "M", .length = 8};
  EXPECT_EQ(refusal(8, {on(seven, "M")}), "X: its message has no multiplexor");
  EXPECT_EQ(refusal(8, {on(seven, "M"), wide}), "");
  EXPECT_EQ(refusal(8, {on(seven, "M"), narrow}), "X: its multiplexor does not have the value 7");
  EXPECT_EQ(refusal(8, {on(reversed, "M"), wide}), "X: its multiplexor does not have the value 6");
  EXPECT_EQ(refusal(8, {on(seven, "X")}), "X: its multiplexor depends on itself");
  CanSignal assigned = wide;
  assigned.source = "status";
  EXPECT_EQ(refusal(8, {on(seven, "M"), assigned}), "M: selects the page, and so has no value of its own");
  CanSignal real = wide;
  real.length = 32;
  real.encoding.format = SignalFormat::float32;
  EXPECT_EQ(refusal(8, {on(seven, "M"), real}), "M: a multiplexor must be an integer");
  const auto again = [](std::span<const PageRange> pages, std::string_view multiplexor) {
    return CanSignal{"Y", 12, 8, intel_signed, 1, 0, "rate_y_rad_per_s", nullptr, 0, 0, 0, pages, multiplexor};
  };
  EXPECT_EQ(refusal(8, {wide, on(seven, "M"), again(two, "M")}), "") << "never in one message";
  EXPECT_EQ(refusal(8, {wide, on(seven, "M"), again(seven, "M")}), "Y: overlaps another signal");
  EXPECT_EQ(refusal(8, {wide, on(seven, "M"), {.name = "N", .start = 56, .length = 8}, again(two, "N")}),
            "Y: overlaps another signal")
      << "of independent multiplexors";
  CanSignal sum = {"C", 24, 8, intel_unsigned, 1, 0, checksum_source};
  CanSignal counter = {"A", 32, 4, intel_unsigned, 1, 0, alive_counter_source};
  EXPECT_EQ(refusal(8, {wide, on(seven, "M"), sum, counter}, p01), "");
  counter.pages = seven;
  counter.multiplexor = "M";
  EXPECT_EQ(refusal(8, {wide, on(seven, "M"), sum, counter}, p01), "C: its counter must not depend on a multiplexor");
  sum.pages = seven;
  sum.multiplexor = "M";
  EXPECT_EQ(refusal(8, {wide, on(seven, "M"), sum, counter}, p01), "C: must not depend on a multiplexor");
}

// Each quantity that a Measurement can hold is read back as it was sent.
TEST(CanSignalsTest, EveryQuantityIsReadBack) {
  Sample sample;
  sample.rate = {1, 2, 3};
  sample.specific_force = {4, 5, 6};
  sample.temperature_c = 7;
  std::size_t read_back = 0;
  for (const MeasuredQuantity& quantity : measured_quantities()) {
    std::string name(quantity.name);
    if (!quantity.units.empty()) name += quantity.units.back().suffix;
    const CanSignal signals[] = {{"S", 0, 64, {false, SignalFormat::float64}, 0.25, 3, name}};
    if (quantity.kind != MeasuredQuantity::Kind::number) continue;
    const CanSignalCodec codec(8, signals);
    std::vector<std::byte> bytes(8);
    const Reading reading{sample, {8, 9, 10}, {11, 12, 13}, Quaternion(0.6, 0.8, 0, 0), 0.5};
    codec.encode(reading, 0, bytes);
    ReadBack read;
    ASSERT_TRUE(codec.decode(bytes, read));
    if (quantity.set == nullptr) continue;
    ++read_back;
    ReadBack expected;
    quantity.set(quantity.get(reading), expected);
    const Sample &a = read.measurement.sample, &b = expected.measurement.sample;
    EXPECT_EQ(read.components, expected.components) << name;
    EXPECT_TRUE(a.rate.isApprox(b.rate, 1e-14) && a.specific_force.isApprox(b.specific_force, 1e-14) &&
                a.delta_angle.isApprox(b.delta_angle, 1e-14) && a.delta_velocity.isApprox(b.delta_velocity, 1e-14))
        << name;
    EXPECT_NEAR(a.temperature_c, b.temperature_c, 1e-12) << name;
  }
  EXPECT_EQ(read_back, 13U);
}

// A multiplexor on a page of another one turns once in each round of the other: every combination is sent, also where
// the numbers of their pages have a common divisor.
TEST(CanSignalsTest, EveryPageOfANestedMultiplexorIsSent) {
  constexpr PageRange pages[] = {{0, 3}};
  for (const unsigned outer : {1U, 2U, 4U}) {
    const PageRange outer_pages[] = {{0, outer - 1}};
    const CanSignal top = {.name = "M", .start = 0, .length = 8};
    const CanSignal nested = {.name = "N", .start = 8, .length = 8, .pages = outer_pages, .multiplexor = "M"};
    const CanSignal x = {"X", 16, 8, intel_signed, 1, 0, "rate_x_rad_per_s", nullptr, 0, 0, 0, pages, "N"};
    std::set<std::string> seen;
    for (unsigned count = 0; count < 4 * outer; ++count)
      seen.insert(encoded(3, {top, nested, x}, sample_of(1), count).substr(0, 4));
    EXPECT_EQ(seen.size(), 4 * outer) << outer;
  }
}

}  // namespace
}  // namespace imud
