// Fields that are found by a capture at rest and one turned by hand: their values are the truth, in axes of their
// own.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "tests/support/text.hpp"
#include "tests/tools/find/find_unit.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tools/find/field_search.hpp"
#include "tools/find/found_description.hpp"

namespace imud {
namespace {

struct FoundFields {
  FoundFrames frames;
  std::string text;  // the description

  std::size_t count() const {
    std::size_t count = 0;
    for (const FoundMessage& message : frames.messages) count += message.fields.size();
    return count;
  }
};

FoundFields fields_of(const std::vector<std::byte>& turned, const std::vector<std::byte>& rest,
                      double rate_hz = 100) {
  std::vector<std::byte> stream = turned;
  stream.insert(stream.end(), rest.begin(), rest.end());
  auto found = find_frames(stream, turned.size());
  if (!found) return {};
  DescriptionText text{"test", rate_hz};
  text.remarks = find_fields(*found, stream, turned.size(), rate_hz);
  std::string description = describe_frames(*found, stream, text);
  return {std::move(*found), std::move(description)};
}

FoundFields shipped_fields(std::string_view name, double rate_hz = 100) {
  return fields_of(shipped_capture(name, Handling::turned, 3000).bytes,
                   shipped_capture(name, Handling::rest, 1000).bytes, rate_hz);
}

// What a description reads from a capture.
std::vector<Measurement> decoded(const std::string& description, const std::vector<std::byte>& bytes) {
  Line line = frame_line(description);
  Recording recording;
  line.decoder->feed({bytes, {}}, recording);
  line.decoder->finish(recording);
  return std::move(recording.measurements);
}

// Returns the axes and signs in which `found` is `truth`: a column for each axis of the truth.
Eigen::Matrix3d axes_between(const std::vector<Vector3>& found, const std::vector<Vector3>& truth) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index j = 0; j < 3; ++j)
      for (const double sign : {1.0, -1.0}) {
        double squares = 0;
        for (std::size_t k = 0; k < found.size(); ++k) squares += std::pow(found[k](i) - sign * truth[k](j), 2);
        if (squares >= least) continue;
        least = squares;
        axes.row(i).setZero();
        axes(i, j) = sign;
      }
  }
  return axes;
}

void expect_truth(const std::vector<Measurement>& all, const std::vector<Sample>& truth, double tolerance) {
  ASSERT_EQ(all.size(), truth.size());
  std::vector<Vector3> force, true_force, rate, true_rate;
  const bool has_rate = (all.front().fields & Measurement::rate) != 0;
  ASSERT_TRUE(has_rate || (all.front().fields & Measurement::delta_angle) != 0);
  for (std::size_t k = 0; k < all.size(); ++k) {
    force.push_back(all[k].sample.specific_force);
    true_force.push_back(truth[k].specific_force);
    rate.push_back(has_rate ? all[k].sample.rate : all[k].sample.delta_angle);
    true_rate.push_back(has_rate ? truth[k].rate : truth[k].delta_angle);
  }
  const Eigen::Matrix3d axes = axes_between(force, true_force);
  EXPECT_EQ(axes.cwiseAbs().rowwise().sum(), Vector3::Ones());
  EXPECT_EQ(axes.cwiseAbs().colwise().sum().transpose(), Vector3::Ones());
  // Rates turn with the axes; where these are left-handed, or the sign of the specific force is, they change theirs.
  const Eigen::Matrix3d turned = axes_between(rate, true_rate);
  EXPECT_EQ(turned, axes * axes.determinant());
  for (std::size_t k = 0; k < all.size(); ++k) {
    ASSERT_LT((force[k] - axes * true_force[k]).norm(), tolerance * true_force[k].norm() + 0.02) << k;
    ASSERT_LT((rate[k] - turned * true_rate[k]).norm(), tolerance * true_rate[k].norm() + (has_rate ? 1e-3 : 1e-5))
        << k;
  }
}

TEST(FindFields, ValuesAreTheTruth) {
  // These have a usual scale, which is taken; so the tolerance is the rounding of the fields.
  for (const std::string_view shipped :
       {"dmu", "gx3", "hipnuc", "inertiallabs", "isb-imu", "openimu", "sensaition", "kvh1750", "um7", "stdbin"}) {
    SCOPED_TRACE(shipped);
    const FoundFields found = shipped_fields(shipped);
    const auto turned = handled_samples(Handling::turned, 3000, 100);
    expect_truth(decoded(found.text, shipped_capture(shipped, Handling::turned, 3000).bytes), turned, 1e-4);
    // What is right for these captures is right for another one.
    const auto other = handled_samples(Handling::turned, 500, 100, 7);
    Line line(protocol_named("frame"), frame_settings(read_frames(std::string(shipped))));
    expect_truth(decoded(found.text, capture_of(line, other).bytes), other, 1e-4);
  }
}

TEST(FindFields, MeasuresScalesThatAreNotUsual) {
  const FoundFields found = shipped_fields("hg4930", 100.0 * 5 / 6);  // sent with five of six samples
  ASSERT_EQ(found.frames.messages.size(), 2U);
  const FoundMessage& control = found.frames.messages[0];
  ASSERT_EQ(control.fields.size(), 6U) << found.text;
  for (const FoundField& field : control.fields) {
    const bool is_rate = field.name.starts_with("rate_");
    EXPECT_EQ(field.name, fmt::format("{}_{}_{}", is_rate ? "rate" : "specific_force",
                                      static_cast<char>('x' + (field.at - 2) % 6 / 2), is_rate ? "deg_per_s" : "g"));
    EXPECT_EQ(field.type.bytes, 2U);
    EXPECT_FALSE(field.is_negative);
    const double exact =
        is_rate ? 600 / 0x1p20 / units::degree : 600 / 0x1p14 * units::foot / units::standard_gravity;
    EXPECT_NEAR(field.lsb_value, exact, 0.006 * exact) << field.name;
  }
  EXPECT_TRUE(contains(found.text, "no usual figure is within that")) << found.text;
  // The other message has the same numbers, and increments.
  EXPECT_TRUE(contains(found.text, "delta_angle_z_rad:i32*2^-33 le")) << found.text;
  EXPECT_TRUE(contains(found.text, "+- 0.")) << found.text;
}

TEST(FindFields, FindsForcesWithoutRates) {
  const FoundFields found = shipped_fields("bno08x-rvc");
  EXPECT_TRUE(contains(found.text, "specific_force_x_g:i16*0.001 le")) << found.text;
  EXPECT_TRUE(contains(found.text, "No angular rate was found")) << found.text;
  EXPECT_EQ(found.count(), 3U);
}

// Without a rate the unit of angular rates is not known, and none is given.
TEST(FindFields, NeedsTheRateForRates) {
  const auto turned = shipped_capture("gx3", Handling::turned, 3000).bytes;
  const auto rest = shipped_capture("gx3", Handling::rest, 3000).bytes;
  const FoundFields found = fields_of(turned, rest, 0);
  EXPECT_EQ(found.count(), 3U) << found.text;
  EXPECT_TRUE(contains(found.text, "--rate-hz gives the unit")) << found.text;
}

// Offset binary in the other byte order, other axes, and a temperature, which stays a candidate.
std::string integer_description() {
  return one_message(
      "@begin\n55 AA\nalive_counter:u8\nrate_z_deg_per_s:i16*0.02\n-rate_x_deg_per_s:i16*0.02\n"
      "rate_y_deg_per_s:i16*0.02\nspecific_force_x_g:u16*2^-12-8 be\nspecific_force_y_g:u16*2^-12-8 be\n"
      "specific_force_z_g:u16*2^-12-8 be\ntemperature_c:i16*0.002\ncheck:sum8:@begin..");
}

std::vector<std::byte> captured(const std::string& description, std::span<const Sample> samples,
                                unsigned damaged_one_in = 0) {
  Line line = frame_line(description);
  const Capture capture = capture_of(line, samples);
  return damaged_one_in == 0 ? capture.bytes : damaged(capture, damaged_one_in);
}

void expect_integers(const FoundFields& found) {
  for (const char* element :
       {"\"rate_z_deg_per_s:i16*0.02 le\"", "\"-rate_x_deg_per_s:i16*0.02 le\"", "\"rate_y_deg_per_s:i16*0.02 le\"",
        "\"specific_force_x_g:u16*2^-12-8 be\"", "\"specific_force_z_g:u16*2^-12-8 be\""})
    EXPECT_TRUE(contains(found.text, element)) << element << "\n" << found.text;
  EXPECT_EQ(found.count(), 6U);
}

TEST(FindFields, FindsOffsetBinaryAndOtherAxes) {
  const auto turned = handled_samples(Handling::turned, 3000, 100), rest = handled_samples(Handling::rest, 1000, 100);
  const FoundFields found = fields_of(captured(integer_description(), turned), captured(integer_description(), rest));
  expect_integers(found);
  EXPECT_TRUE(contains(found.text, "bytes 15-16: i16 le from 157")) << found.text;
  EXPECT_TRUE(contains(found.text, "a temperature?")) << found.text;
  expect_truth(decoded(found.text, captured(integer_description(), turned)), turned, 1e-4);
}

TEST(FindFields, FindsFieldsInDamagedCaptures) {
  const auto turned = handled_samples(Handling::turned, 3000, 100), rest = handled_samples(Handling::rest, 1000, 100);
  expect_integers(fields_of(captured(integer_description(), turned, 25), captured(integer_description(), rest, 25)));
}

// Sensors are turned about x and y, by angles that leave z nearly vertical.
std::vector<Sample> tilted(std::size_t count) {
  std::vector<Sample> samples = handled_samples(Handling::rest, count, 100);
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise;
  Vector3 up = Vector3::UnitZ();
  for (std::size_t k = 0; k < count; ++k) {
    const double t = 0.01 * static_cast<double>(k);
    const Vector3 rate(0.6 * std::cos(1.5 * t), 0.5 * std::cos(1.1 * t), 0);
    up = Eigen::AngleAxisd(-0.01 * rate.norm(), rate.normalized()) * up;
    samples[k].rate = rate + 5e-4 * Vector3(noise(random), noise(random), noise(random));
    samples[k].specific_force = -units::standard_gravity * up;
  }
  return samples;
}

TEST(FindFields, SaysWhichScaleIsNotObserved) {
  const auto turned = tilted(3000), rest = handled_samples(Handling::rest, 1000, 100);
  const FoundFields found = fields_of(captured(integer_description(), turned), captured(integer_description(), rest));
  EXPECT_TRUE(contains(found.text, "not observed: scale and sign of z")) << found.text;
  EXPECT_FALSE(contains(found.text, "not observed: scale and sign of x")) << found.text;
  EXPECT_TRUE(contains(found.text, "\"-rate_x_deg_per_s:i16*0.02 le\"")) << found.text;
}

TEST(FindFields, FindsNothingWhereNothingTurns) {
  const auto rest = handled_samples(Handling::rest, 1000, 100);
  auto yawed = handled_samples(Handling::rest, 1000, 100, 2);
  for (std::size_t k = 0; k < yawed.size(); ++k) {
    yawed[k].specific_force = {0, 0, -units::standard_gravity};
    yawed[k].rate.z() = std::sin(0.01 * static_cast<double>(k));
  }
  const auto at_rest = captured(integer_description(), rest);
  for (const auto& samples : {yawed, handled_samples(Handling::rest, 1000, 100, 3)}) {
    const FoundFields found = fields_of(captured(integer_description(), samples), at_rest);
    EXPECT_EQ(found.count(), 0U) << found.text;
    EXPECT_TRUE(contains(found.text, "No specific force was found")) << found.text;
  }
}

// Bytes without a meaning, in frames with a check, yield no field.
TEST(FindFields, FindsNothingInRandomBytes) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    std::mt19937_64 random(seed);
    const auto capture = [&](std::size_t count) {
      std::vector<std::byte> stream;
      for (std::size_t k = 0; k < count; ++k) {
        std::vector<std::byte> frame = {std::byte{0x5A}, std::byte{0xC3}};
        const std::vector<std::byte> data = random_bytes(40, random);
        frame.insert(frame.end(), data.begin(), data.end());
        std::byte sum{0};
        for (const std::byte one : frame) sum ^= one;
        frame.push_back(sum);
        stream.insert(stream.end(), frame.begin(), frame.end());
      }
      return stream;
    };
    const FoundFields found = fields_of(capture(seed % 2 == 0 ? 60 : 2000), capture(seed % 2 == 0 ? 40 : 500));
    ASSERT_EQ(found.frames.messages.size(), 1U);
    EXPECT_EQ(found.count(), 0U) << found.text;
    EXPECT_FALSE(contains(found.text, "the turn moves it")) << found.text;
  }
}

// A magnetic field turns with the sensor, too: both candidates are named.
TEST(FindFields, NamesTheMagneticFieldAsACandidate) {
  auto turned = handled_samples(Handling::turned, 3000, 100);
  Vector3 field = Vector3(2, 0.3, 4.5) * 1e-5;
  for (Sample& sample : turned) {
    sample.magnetic_field = field;
    field = Eigen::AngleAxisd(-0.01 * sample.rate.norm(), sample.rate.normalized()) * field;
  }
  const std::string description = one_message(
      "@begin\n55 AA\nrate_x_deg_per_s:i16*0.02\nrate_y_deg_per_s:i16*0.02\nrate_z_deg_per_s:i16*0.02\n"
      "magnetic_field_x_nt:i16*3.7\nmagnetic_field_y_nt:i16*3.7\nmagnetic_field_z_nt:i16*3.7\n"
      "specific_force_x_mg:i16\nspecific_force_y_mg:i16\nspecific_force_z_mg:i16\ncheck:crc16/xmodem:@begin..");
  auto rest = handled_samples(Handling::rest, 1000, 100);
  for (Sample& sample : rest) sample.magnetic_field = Vector3(2, 0.3, 4.5) * 1e-5;
  const FoundFields found = fields_of(captured(description, turned), captured(description, rest));
  EXPECT_TRUE(contains(found.text, "a magnetic field, or it is the specific force: shake it")) << found.text;
  EXPECT_TRUE(contains(found.text, "\"specific_force_x_g:i16*0.001 le\"")) << found.text;
  EXPECT_TRUE(contains(found.text, "\"rate_x_deg_per_s:i16*0.02 le\"")) << found.text;
  EXPECT_EQ(found.count(), 6U);
}

TEST(FindFields, ACommandPrintsADescriptionThatIsRead) {
  const ScratchFolder folder;
  const auto keep = [&](const char* name, const std::string& text) {
    std::ofstream(folder / name, std::ios::binary) << text;
    return folder / name;
  };
  const auto raw = [](const std::vector<std::byte>& bytes) {
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  const std::string rest = keep("rest.bin", raw(shipped_capture("hipnuc", Handling::rest, 500).bytes));
  const std::string turned = keep("turned.bin", raw(shipped_capture("hipnuc", Handling::turned, 2000).bytes));
  const auto found = run_program("imu-decode", {"--find-check", rest, "--turned", turned, "--rate-hz", "100"});
  ASSERT_EQ(found.exit_code, 0) << found.errors;
  EXPECT_TRUE(contains(found.output, "\"specific_force_x_g:f32 le\"")) << found.output;
  const std::string mine = keep("mine.toml", found.output);
  const auto decoded = run_program(
      "imu-decode", {"frame", "file:" + turned, "--frame-file", mine, "--quiet", "--require", "gaps=0,checksum=0"});
  EXPECT_EQ(decoded.exit_code, 0) << decoded.errors;
  const std::string config = keep("imud.toml",
                                  "clock = \"fast\"\n[truth]\nport = \"file:truth.csv\"\nformat = \"csv\"\n[[imu]]\n"
                                  "name = \"imu1\"\nprotocol = \"frame\"\nrate_hz = 100\nport = \"file:out.bin\"\n"
                                  "device.frame_file = \"" +
                                      mine +
                                      "\"\ngyro.max_rad_per_s = 10\n"
                                      "accelerometer.max_m_per_s2 = 100\n");
  const auto checked = run_program("imud", {"check", config});
  EXPECT_EQ(checked.exit_code, 0) << checked.errors;
  EXPECT_EQ(run_program("imu-decode", {"--turned", turned, "native", "file:x"}).exit_code, 2);
}

}  // namespace
}  // namespace imud
