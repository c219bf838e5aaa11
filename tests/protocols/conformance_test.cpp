// Checks what every entry of the protocol table declares (protocols/protocol.hpp). Random inputs come from fixed
// seeds: no check is statistical.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <string>
#include <utility>

#include "protocols/signals/signal_device.hpp"
#include "tests/protocols/conformance_cases.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/table_names.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

// --- The value of decode(encode(x))
// ----------------------------------------------------------------------------------

// `what` names the quantity.
void expect_near(double got, double sent, double lsb, double range, const std::string& what) {
  SCOPED_TRACE(what);
  if (std::abs(sent) > range) {
    EXPECT_EQ(std::signbit(got), std::signbit(sent));
    EXPECT_GE(std::abs(got), range - lsb) << "sent " << sent;
  } else if (lsb == 0.0) {
    EXPECT_EQ(std::bit_cast<std::uint64_t>(got), std::bit_cast<std::uint64_t>(sent)) << got << ", sent " << sent;
  } else {
    // A decimal LSB is not an exact double: the last bits of the product may differ.
    EXPECT_LE(std::abs(got - sent), 0.5 * lsb + 4e-16 * std::abs(sent)) << got << ", sent " << sent;
  }
}

void expect_near(const Vector3& got, const Vector3& sent, double lsb, double range, const std::string& what) {
  for (int i = 0; i < 3; ++i) expect_near(got[i], sent[i], lsb, range, what + "[" + std::to_string(i) + "]");
}

void expect_same_time(std::int64_t got, std::int64_t sent, const Protocol& protocol) {
  std::int64_t difference = got - sent;
  if (const std::int64_t period = protocol.time_period_ns; period != 0) {
    difference %= period;
    if (difference > period / 2) difference -= period;
    if (difference < -period / 2) difference += period;
  }
  EXPECT_LE(std::abs(static_cast<double>(difference)), 0.5 * protocol.resolution.time_s * 1e9)
      << got << ", sent " << sent;
}

void expect_carried(const Measurement& measurement, const Sample& sent, const Protocol& protocol) {
  const Sample& got = measurement.sample;
  const auto& [time_s, rate, specific_force, delta_angle, delta_velocity, temperature_c] = protocol.resolution;
  EXPECT_EQ(measurement.fields, protocol.fields);
  if (protocol.fields & Measurement::time) expect_same_time(got.time.ns, sent.stamp().ns, protocol);
  if (protocol.fields & Measurement::counter) {
    const std::uint64_t mask = protocol.counter_bits == 64 ? ~0ULL : (1ULL << protocol.counter_bits) - 1;
    EXPECT_EQ(got.counter, sent.counter & mask);
  }
  if (protocol.fields & Measurement::rate) {
    Vector3 measured = got.rate;
    if (protocol.name == "bosch-mm5") {
      EXPECT_TRUE(std::isnan(got.rate.y()));  // it sends no rate about y
      measured.y() = sent.rate.y();
    }
    expect_near(measured, sent.rate, rate, protocol.range.rate, "rate");
  }
  if (protocol.fields & Measurement::specific_force)
    expect_near(got.specific_force, sent.specific_force, specific_force, protocol.range.specific_force,
                "specific force");
  if (protocol.fields & Measurement::delta_angle)
    expect_near(got.delta_angle, sent.delta_angle, delta_angle, protocol.range.delta_angle, "delta-angle");
  if (protocol.fields & Measurement::delta_velocity)
    expect_near(got.delta_velocity, sent.delta_velocity, delta_velocity, protocol.range.delta_velocity,
                "delta-velocity");
  if (protocol.fields & Measurement::temperature)
    expect_near(got.temperature_c, sent.temperature_c, temperature_c, protocol.range.temperature_c, "temperature");
  if (protocol.fields & Measurement::status) {
    EXPECT_EQ(got.status & protocol.status_bits, sent.status & protocol.status_bits);
  }
}

void expect_same(const std::vector<Measurement>& got, const std::vector<Measurement>& wanted) {
  const auto bits = [](const Vector3& v) {
    return std::bit_cast<std::array<std::uint64_t, 3>>(std::array{v.x(), v.y(), v.z()});
  };
  ASSERT_EQ(got.size(), wanted.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    const Sample& a = got[i].sample;
    const Sample& b = wanted[i].sample;
    ASSERT_EQ(got[i].fields, wanted[i].fields);
    ASSERT_EQ(a.time, b.time);
    ASSERT_EQ(a.counter, b.counter);
    ASSERT_EQ(bits(a.rate), bits(b.rate));
    ASSERT_EQ(bits(a.specific_force), bits(b.specific_force));
    ASSERT_EQ(bits(a.delta_angle), bits(b.delta_angle));
    ASSERT_EQ(bits(a.delta_velocity), bits(b.delta_velocity));
    ASSERT_EQ(std::bit_cast<std::uint64_t>(a.temperature_c), std::bit_cast<std::uint64_t>(b.temperature_c));
    ASSERT_EQ(a.status, b.status);
  }
}

// Zeros of both signs, ends of the ranges and beyond, half an LSB, the smallest double.
std::vector<Sample> extreme_samples(const Protocol& protocol) {
  const auto& range = protocol.range;
  const auto& lsb = protocol.resolution;
  const auto twice = [](double x) { return x > DBL_MAX / 2 ? DBL_MAX : 2 * x; };
  std::vector<Sample> samples;
  const auto add = [&](double rate, double specific_force, double delta_angle, double delta_velocity,
                       double celsius) {
    Sample sample;
    sample.time.ns = static_cast<std::int64_t>(samples.size()) * 10'000'000;
    sample.counter = ~std::uint64_t{0} - samples.size();
    sample.rate = Vector3(rate, -rate, 0.0);
    sample.specific_force = Vector3(-0.0, specific_force, -specific_force);
    sample.delta_angle = Vector3(-delta_angle, 0.0, delta_angle);
    sample.delta_velocity = Vector3::Constant(-delta_velocity);
    sample.temperature_c = samples.size() % 2 == 0 ? celsius : -celsius;
    sample.status = samples.size() % 2 == 0 ? ~0U : 0U;
    samples.push_back(sample);
  };
  for (int i = 0; i < 2; ++i) {
    add(0, 0, 0, 0, 0);
    add(5e-324, 5e-324, 5e-324, 5e-324, 5e-324);
    add(range.rate, range.specific_force, range.delta_angle, range.delta_velocity, range.temperature_c);
    add(twice(range.rate), twice(range.specific_force), twice(range.delta_angle), twice(range.delta_velocity),
        twice(range.temperature_c));
    add(DBL_MAX, DBL_MAX, DBL_MAX, DBL_MAX, DBL_MAX);
    for (const double steps : {0.5, 1.0, 1.5, 2.5, 127.5, 128.5})
      add(steps * lsb.rate, steps * lsb.specific_force, steps * lsb.delta_angle, steps * lsb.delta_velocity,
          steps * lsb.temperature_c);
  }
  return samples;
}

// --- The table
// -------------------------------------------------------------------------------------------------------

TEST(ProtocolTable, HoldsOneEntryPerFileByItsName) {
  EXPECT_EQ(names_of(protocols()), names_from_files("protocols/devices"));
  for (const Protocol* protocol : protocols()) {
    EXPECT_EQ(find_protocol(protocol->name), protocol);
    EXPECT_TRUE(protocol->make != nullptr && protocol->make_decoder != nullptr) << protocol->name;
  }
  EXPECT_EQ(find_protocol("no such protocol"), nullptr);
}

// --- Each entry
// ------------------------------------------------------------------------------------------------------

class Conformance : public testing::TestWithParam<ConformanceCase> {
 protected:
  const Protocol& protocol() const { return GetParam().protocol; }

  Line line_{protocol(), GetParam().settings};
  std::mt19937_64 random_{20240229};
};
class ByteLinkConformance : public Conformance {};

INSTANTIATE_TEST_SUITE_P(Protocols, Conformance,
                         testing::ValuesIn(conformance_cases([](const Protocol&) { return true; })), case_name);
INSTANTIATE_TEST_SUITE_P(Protocols, ByteLinkConformance, testing::ValuesIn(conformance_cases([](const Protocol& p) {
                           return p.link == Link::bytes;
                         })),
                         case_name);

TEST_P(Conformance, DescribesItself) {
  for (const std::string_view text : {protocol().summary, protocol().document}) {
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.find('\n'), std::string_view::npos);
  }
  EXPECT_TRUE(protocol().has_checksum || protocol().burst_bits == 0);
  // A product whose messages are described by signals counts those that saturate. Only `dbc` reports their number.
  const bool has_signals = dynamic_cast<const SignalDevice*>(line_.device.get()) != nullptr;
  if (!has_signals || !protocol().counters.empty()) {
    EXPECT_EQ(line_.device->counts().size(), protocol().counters.size());
  }
}

TEST_P(Conformance, WhatIsDecodedIsWhatWasEncoded) {
  std::vector<Sample> samples = random_samples(2000, protocol(), random_);
  for (Sample& sample : samples)  // the stamp alone is off
    sample.stamp_error_ns = static_cast<std::int32_t>(sample.time.ns % 400'000) - 200'000;
  for (const Sample& sample : extreme_samples(protocol())) {
    samples.push_back(sample);
    samples.back().time = samples[samples.size() - 2].time + Nanoseconds{10'000'000};
  }
  for (const Sample& sample : samples) {
    Recording recording;
    for (const Frame& frame : line_.encode(sample)) line_.decoder->feed(frame, recording);
    ASSERT_EQ(recording.measurements.size(), 1U);
    expect_carried(recording.measurements[0], sample, protocol());
    if (HasFailure()) return;
  }
  const DecodeErrors& errors = line_.decoder->errors();
  EXPECT_EQ(errors.checksum + errors.malformed + errors.incomplete + errors.skipped_bytes, 0U);
}

TEST_P(Conformance, AllocatesNothingOnceMade) {
  const std::vector<Sample> samples = random_samples(500, protocol(), random_);
  const std::vector<std::byte> garbage = random_bytes(100'000, random_);
  const auto replies = std::make_unique<FrameBuffer>();
  Recording recording(10'000);
  const std::uint64_t before = allocations();
  for (const Sample& sample : samples)
    for (const Frame& frame : line_.encode(sample)) line_.decoder->feed(frame, recording);
  line_.decoder->feed({garbage}, recording);
  line_.device->receive({garbage}, samples.back().time, *replies);
  line_.decoder->finish(recording);
  EXPECT_EQ(allocations() - before, 0U);
  EXPECT_GE(recording.measurements.size(), samples.size());
}

// Garbage, then good frames: only the first sample after the garbage may be lost.
TEST_P(Conformance, DecodesOnAfterAnyBytes) {
  std::vector<Sample> samples = random_samples(50, protocol(), random_);
  const Nanoseconds span = samples.back().time - DeviceTime{};
  const std::vector<StoredFrame> pattern = line_.encode_all(samples);
  const auto replies = std::make_unique<FrameBuffer>();
  Recording recording(100'000);
  for (int round = 0; round < 80; ++round) {
    for (int i = 0; i < 30; ++i) {
      StoredFrame frame = pattern[random_() % pattern.size()];  // so that the identifier and the beginning are right
      if (random_() % 4 == 0) frame.bytes = random_bytes(random_() % 300, random_);
      if (frame.bytes.size() > 4)
        for (std::size_t k = random_() % 4; k > 0; --k)
          frame.bytes[random_() % frame.bytes.size()] = static_cast<std::byte>(random_());
      if (random_() % 4 == 0) frame.bytes.resize(random_() % (frame.bytes.size() + 1));
      frame.can.fd ^= random_() % 8 == 0;
      frame.can.remote ^= random_() % 8 == 0;
      frame.can.extended ^= random_() % 8 == 0;
      if (random_() % 8 == 0) frame.can.id ^= static_cast<std::uint32_t>(random_() % 8);
      line_.decoder->feed(frame.view(), recording);
      replies->clear();
      line_.device->receive(frame.view(), samples.back().time, *replies);
    }
    recording.measurements.clear();
    for (Sample& sample : samples) sample.time = sample.time + span;
    line_.feed(line_.encode_all(samples), recording);
    ASSERT_GE(recording.measurements.size(), samples.size() - 1);
    for (std::size_t i = 1; i < samples.size(); ++i)
      expect_carried(recording.measurements[recording.measurements.size() - i], samples[samples.size() - i],
                     protocol());
    if (HasFailure()) return;
  }
}

TEST_P(ByteLinkConformance, AnyChunkingGivesTheSame) {
  const std::vector<std::byte> stream = concatenated(line_.encode_all(random_samples(300, protocol(), random_)));
  Recording whole;
  line_.decoder->feed({stream}, whole);
  ASSERT_EQ(whole.measurements.size(), 300U);
  for (const std::size_t chunk_max : {1U, 2U, 7U, 64U, 130U, 1000U, 5000U}) {
    Line other(protocol(), GetParam().settings);
    Recording pieces;
    for (std::span<const std::byte> rest = stream; !rest.empty();) {
      const std::size_t size = std::min<std::size_t>(1 + random_() % chunk_max, rest.size());
      other.decoder->feed({rest.first(size)}, pieces);
      rest = rest.subspan(size);
    }
    expect_same(pieces.measurements, whole.measurements);
  }
}

// The frames of one sample, with bits that are wrong.
class Flipper {
 public:
  Flipper(const ConformanceCase& one, std::mt19937_64& random) : line_(one.protocol, one.settings) {
    frames_ = line_.encode_all(random_samples(1, one.protocol, random));
  }

  std::size_t frame_count() const { return frames_.size(); }
  std::size_t bit_count(std::size_t frame) const { return 8 * frames_[frame].bytes.size(); }
  void flip(std::size_t frame, std::size_t bit) {
    frames_[frame].bytes[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
  }
  // Returns the number of measurements that the frames now yield.
  std::size_t measurements() {
    Recording recording(2);
    line_.feed(frames_, recording);
    line_.decoder->finish(recording);
    return recording.measurements.size();
  }

 private:
  Line line_;
  std::vector<StoredFrame> frames_;
};

// With a checksum every error is detected, without one some are not: an entry cannot hide its checksum from the test.
TEST_P(Conformance, AChecksumRefusesEveryOneBitError) {
  std::size_t accepted = 0;
  for (int round = 0; round < 5; ++round) {
    Flipper flipper(GetParam(), random_);
    ASSERT_EQ(flipper.measurements(), 1U);
    for (std::size_t frame = 0; frame < flipper.frame_count(); ++frame)
      for (std::size_t bit = 0; bit < flipper.bit_count(frame); ++bit) {
        flipper.flip(frame, bit);
        const std::size_t measurements = flipper.measurements();
        if (protocol().has_checksum) {
          ASSERT_EQ(measurements, 0U) << "frame " << frame << ", bit " << bit;
        }
        accepted += measurements;
        flipper.flip(frame, bit);
      }
    ASSERT_EQ(flipper.measurements(), 1U);
  }
  EXPECT_EQ(accepted == 0, protocol().has_checksum);
}

// Every position and length, with errors at both ends, and in between no bits, all bits or some bits in error.
TEST_P(Conformance, AChecksumRefusesEveryBurst) {
  Flipper flipper(GetParam(), random_);
  std::size_t bursts = 0;
  for (std::size_t frame = 0; frame < flipper.frame_count(); ++frame)
    for (std::size_t length = 2; length <= protocol().burst_bits; ++length)
      for (std::size_t begin = 0; begin + length <= flipper.bit_count(frame); ++begin) {
        const std::uint64_t filling = std::array{std::uint64_t{0}, ~std::uint64_t{0}, random_()}[bursts++ % 3];
        const std::uint64_t pattern = filling | 1U | std::uint64_t{1} << (length - 1);
        const auto apply = [&] {
          for (std::size_t i = 0; i < length; ++i)
            if (pattern >> i & 1U) flipper.flip(frame, begin + i);
        };
        apply();
        ASSERT_EQ(flipper.measurements(), 0U) << "frame " << frame << ", bits " << begin << " + " << length;
        apply();
      }
  ASSERT_EQ(flipper.measurements(), 1U);
  EXPECT_EQ(bursts > 500, protocol().has_checksum);
}

// Each frame with any one bit of its content changed is accepted with a new checksum, and each frame with the
// checksum of another content is not.
TEST_P(Conformance, AChecksumCanBeWrittenAnew) {
  const std::unique_ptr<FrameSeal> seal = make_seal(protocol(), GetParam().settings);
  if (protocol().link == Link::bytes && protocol().has_checksum) {
    ASSERT_NE(seal, nullptr);
  }
  if (seal == nullptr) return;
  const std::vector<StoredFrame> frames = line_.encode_all(random_samples(1, protocol(), random_));
  std::vector<Frame> views;
  for (const StoredFrame& frame : frames) views.push_back(frame.view());
  // Decodes the frames with `other` in place of the frames from `i` to before `end`.
  const auto decode = [&](std::size_t i, std::size_t end, std::span<const std::byte> other) {
    Line line(protocol(), GetParam().settings);
    Recording recording(4);
    for (std::size_t k = 0; k < frames.size(); ++k) {
      if (k < i || k >= end) {
        line.decoder->feed(views[k], recording);
        continue;
      }
      line.decoder->feed(Frame{other.first(frames[k].bytes.size()), frames[k].can}, recording);
      other = other.subspan(frames[k].bytes.size());
    }
    line.decoder->finish(recording);
    return std::pair(line.decoder->errors(), recording.measurements.size());
  };
  std::size_t changes = 0;
  for (std::size_t i = 0, end = 0; i < frames.size(); i = end) {
    end = i + seal->transfer(std::span(views).subspan(i));
    ASSERT_LE(end, frames.size());
    for (std::size_t n = 1; n < end - i; ++n)
      EXPECT_EQ(seal->transfer(std::span(views).subspan(i, n)), 1U) << "the rest of the transfer is missing";
    const std::vector<std::byte> original = concatenated(std::span(frames).subspan(i, end - i));
    const CanHeader& can = frames[i].can;
    std::vector<std::byte> frame = original;
    const std::span<const std::byte> content = seal->reseal(frame, can);
    if (content.empty() && protocol().link == Link::can && end == i + 1) continue;  // only a longer transfer has one
    ASSERT_FALSE(content.empty());
    ASSERT_EQ(frame, original) << "the checksum was another";
    const std::ptrdiff_t begin = content.data() - frame.data();
    const std::size_t size = content.size();
    for (std::size_t bit = 0; bit < 8 * size; ++bit) {
      const auto mask = static_cast<std::byte>(1U << bit % 8);
      const std::size_t at = static_cast<std::size_t>(begin) + bit / 8;
      std::vector<std::byte> changed = original;
      changed[at] ^= mask;
      const std::span<const std::byte> same = seal->reseal(changed, can);
      if (same.data() != changed.data() + begin || same.size() != size) continue;  // another frame
      if (((changed[at] ^ original[at]) & mask) == std::byte{0}) continue;         // a bit of the checksum
      ++changes;
      std::vector<std::byte> refused = changed;
      refused[at] ^= mask;
      EXPECT_EQ(decode(i, end, changed).first.checksum, 0U) << "bit " << bit;
      EXPECT_EQ(decode(i, end, changed).first.skipped_bytes, 0U) << "bit " << bit;
      const auto [errors, measurements] = decode(i, end, refused);
      EXPECT_EQ(measurements, 0U) << "bit " << bit;
      EXPECT_GT(errors.checksum, 0U) << "bit " << bit;
      if (HasFailure()) return;
    }
    std::vector<std::byte> part(original.begin(), original.end() - 1);
    EXPECT_TRUE(seal->reseal(part, can).empty());
    EXPECT_TRUE(std::equal(part.begin(), part.end(), original.begin()));
  }
  EXPECT_GT(changes, 8U);
  EXPECT_TRUE(seal->reseal({}, {}).empty());
}

}  // namespace
}  // namespace imud
