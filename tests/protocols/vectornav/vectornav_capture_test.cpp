// A real VN-100: what it sent is decoded, and encoded to the same bytes.
#include <gtest/gtest.h>

#include <cmath>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "protocols/wire/frame_writer.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace vectornav_test;

std::string bytes(std::string_view hexadecimal) {
  std::string all;
  for (std::size_t i = 0; i + 1 < hexadecimal.size(); i += 2)
    all += static_cast<char>(std::stoi(std::string(hexadecimal.substr(i, 2)), nullptr, 16));
  return all;
}
std::string text(const char* line) { return line; }

// github.com/winksaville/rw-vn100 4c70450, test-data/both-streams.bin, bytes 46 to 949, as they follow one another: a
// VN-100 with firmware 3.1.0.0 at rest, whose UART 2 has VNYMR at 40 Hz and the output "2,4,01,0739" (TimeStartup,
// YawPitchRoll, Quaternion, AngularRate, Accel, Imu, MagPres).
const std::vector<std::string> captured = {
    text("$VNYMR,-085.598,+075.006,+063.630,-00.5524,+00.4386,+00.9056,+08.979,-02.179,-01.097,+00.000710,+00.000105,"
         "-00.000486*65\r\n"),
    bytes("fa0139073065d926f60a00008432abc2ef02964232847e42fe8928bf6c74c3bd438a313fa69b8dbe00a59939508ea5bae0ac"
          "163a1eed0f4140620ac028a389bf1eed0f4140620ac028a389bfa76aa23cf068f4bc94302cbc367d0dbf5d45e03e62fe673f"
          "299c064294d8ca429e60"),
    bytes("fa01390718952527f60a00007232abc2c3029642a3837e42db8928bf7475c3bd388a313f6b9c8dbec0fd93b9001c8c370050"
          "14b7f04e10412a9e09c0bbc985bff04e10412a9e09c0bbc985bfc4b49d3c0aede9bcdec035bca0120ebf2437de3e69ec673f"
          "d7a3064294d8ca4299e7"),
    bytes("fa01390758e07127f60a0000ef30abc2cf029642e7857e420e8a28bf9777c3bddf89313f0b9d8dbe20af2a3a806da83900c8"
          "143841780f412d9d0ac028ba88bf41780f412d9d0ac028ba88bfba5aa53c9e6ee7bceb0635bc3e920dbfed01e13ec1c5673f"
          "d7a3064294d8ca424b1c"),
    bytes("fa013907b027be27f60a00004e31abc20d039642af857e421f8a28bfa977c3bdf689313f439c8dbe804418b900c616b8580b"
          "80baa4c00f4197e008c05c9687bfa4c00f4197e008c05c9687bf39d59e3cea5beabc9e9d45bc82b80dbf2db7e03ef29f673f"
          "289c064288d6ca425fb1"),
    bytes("fa013907f0720a28f60a00008832abc24a039642df837e42088a28bf8677c3bd3c8a313f599b8dbec072ef39004e4cb9607e"
          "a0b9f0101041cc5d0ac0641489bff0101041cc5d0ac0641489bff6c2a33c16a9ebbcd49f3abc65a20dbf205ede3e4c9e673f"
          "299c0642b9deca4288cc"),
    text("$VNYMR,-085.599,+075.006,+063.629,-00.5533,+00.4343,+00.9048,+09.004,-02.162,-01.071,+00.000457,-00.000195,"
         "-00.000306*6C\r\n"),
    bytes("fa01390718c25628f60a0000f532abc243039642cc827e42e78928bf4a78c3bd4e8a313f829b8dbe60d76abae02436ba2067"
          "20baacfd0f41c0fc09c07a9789bfacfd0f41c0fc09c07a9789bfe8ad983c65c1efbcc1a13fbca2d80dbf8d36de3ee124683f"
          "d7a3064261e5ca42ece4"),
};

// The fields of a binary frame.
struct Fields {
  explicit Fields(const std::string& frame)
      : reader_(std::as_bytes(std::span(frame)).subspan(4)),
        time_ns(reader_.take<std::uint64_t>()),
        ypr_deg(reader_.take_floats()),
        q_vector(reader_.take_floats()),
        q_scalar(static_cast<double>(reader_.take<float>())),
        rate(reader_.take_floats()),
        acceleration(reader_.take_floats()),
        raw_acceleration(reader_.take_floats()),
        raw_rate(reader_.take_floats()),
        magnetic_gauss(reader_.take_floats()),
        temperature_c(static_cast<double>(reader_.take<float>())),
        pressure_kpa(static_cast<double>(reader_.take<float>())) {}

 private:
  FieldReader<boost::endian::order::little> reader_;

 public:
  std::uint64_t time_ns;
  Vector3 ypr_deg, q_vector;
  double q_scalar;
  Vector3 rate, acceleration, raw_acceleration, raw_rate, magnetic_gauss;
  double temperature_c, pressure_kpa;
};

Quaternion q_of(const Vector3& ypr_deg) {
  const Vector3 ypr = units::degree * ypr_deg;
  return Quaternion(dcm_from_yaw_pitch_roll(ypr[0], ypr[1], ypr[2]).transpose());
}

// Makes the binary frame of a unit that has this attitude, and otherwise the fields' values.
std::string encoded(const Fields& fields, const Quaternion& q_LP) {
  Unit unit({{"uart", std::int64_t{2}},
             {"baud", std::int64_t{921600}},
             {"async_type", std::int64_t{0}},
             {"binary_1", std::string("2,4,01,0739")}});
  // The unit's filter has estimated the bias of its gyros; here register 84 removes it.
  const Vector3 bias = fields.raw_rate - fields.rate;
  char body[160];
  std::snprintf(body, sizeof body, "VNWRG,84,1,0,0,0,1,0,0,0,1,%.17g,%.17g,%.17g", bias[0], bias[1], bias[2]);
  EXPECT_EQ(unit.ask(body), with_xor(body));
  unit.now = unit.now + Nanoseconds(static_cast<std::int64_t>(fields.time_ns));
  unit.sample.q_LP = q_LP;
  unit.sample.rate = fields.raw_rate;
  unit.sample.specific_force = fields.raw_acceleration;
  unit.sample.magnetic_field = 1e-4 * fields.magnetic_gauss;
  unit.sample.temperature_c = fields.temperature_c;
  unit.sample.pressure = 1e3 * fields.pressure_kpa;
  return unit.run(1).at(0);
}

// The unit computes in single precision, so that its angles differ from those of its quaternion by some 5 units in
// the last place. Therefore the frame is encoded with either attitude: each gives the bytes of its own field, and all
// others are the same.
TEST(VectorNavCapture, BinaryFramesAreEncodedToTheSameBytes) {
  constexpr std::size_t ypr_at = 12, ypr_size = 12, crc_size = 2;
  int frames = 0;
  for (const std::string& frame : captured) {
    if (frame[0] == '$') continue;
    ++frames;
    const Fields fields(frame);
    const Quaternion q(fields.q_scalar, fields.q_vector[0], fields.q_vector[1], fields.q_vector[2]);
    EXPECT_LT(
        (yaw_pitch_roll_from_dcm(q.normalized().conjugate().toRotationMatrix()) / units::degree - fields.ypr_deg)
            .cwiseAbs()
            .maxCoeff(),
        5e-5)
        << "the same attitude twice";
    std::string again = encoded(fields, q);
    ASSERT_EQ(again.size(), frame.size());
    again.replace(ypr_at, ypr_size, encoded(fields, q_of(fields.ypr_deg)), ypr_at, ypr_size);
    const unsigned crc = crc16(std::string_view(again).substr(1, again.size() - 1 - crc_size));
    again[again.size() - 2] = static_cast<char>(crc >> 8);
    again[again.size() - 1] = static_cast<char>(crc);
    EXPECT_EQ(again, frame) << frames;
  }
  EXPECT_EQ(frames, 6);
}

TEST(VectorNavCapture, TextIsEncodedToTheSameBytes) {
  int lines = 0;
  for (const std::string& line : captured) {
    if (line[0] != '$') continue;
    ++lines;
    std::array<double, 12> numbers{};
    std::size_t at = line.find(',');
    for (double& number : numbers) {
      number = std::stod(line.substr(at + 1));
      at = line.find(',', at + 1);
    }
    const auto vector = [&](std::size_t i) { return Vector3(numbers[i], numbers[i + 1], numbers[i + 2]); };
    Unit unit({{"uart", std::int64_t{2}}, {"firmware", std::string("3.1.0.0")}});
    unit.sample.q_LP = q_of(vector(0));
    unit.sample.magnetic_field = 1e-4 * vector(3);
    unit.sample.specific_force = vector(6);
    unit.sample.rate = vector(9);
    EXPECT_EQ(unit.run(1).at(0), line);
  }
  EXPECT_EQ(lines, 2);
}

// However the stream arrives.
TEST(VectorNavCapture, TheStreamIsDecoded) {
  std::string stream;
  for (const std::string& one : captured) stream += one;
  const Protocol& protocol = *find_protocol("vectornav");
  for (const std::size_t size : {1U, 7U, 110U, 1000U}) {
    const auto decoder = protocol.make_decoder(Settings(protocol.settings));
    Recording recording;
    for (std::size_t at = 0; at < stream.size(); at += size)
      decoder->feed({std::as_bytes(std::span(stream)).subspan(at, std::min(size, stream.size() - at))}, recording);
    decoder->finish(recording);
    ASSERT_EQ(recording.measurements.size(), captured.size());
    EXPECT_EQ(decoder->errors().skipped_bytes, 0U);
    EXPECT_EQ(decoder->errors().checksum, 0U);
    const Sample& text_sample = recording.measurements[0].sample;
    EXPECT_EQ(text_sample.rate, Vector3(0.000710, 0.000105, -0.000486));
    EXPECT_EQ(text_sample.specific_force, Vector3(8.979, -2.179, -1.097));
    for (std::size_t i = 0; i < captured.size(); ++i) {
      if (captured[i][0] == '$') continue;
      const Fields fields(captured[i]);
      const Measurement& m = recording.measurements[i];
      EXPECT_EQ(m.fields, Measurement::time | Measurement::rate | Measurement::specific_force);
      EXPECT_EQ(m.sample.time.ns, static_cast<std::int64_t>(fields.time_ns));
      EXPECT_EQ(m.sample.rate, fields.rate);
      EXPECT_EQ(m.sample.specific_force, fields.acceleration);
    }
    EXPECT_EQ((recording.measurements[2].sample.time - recording.measurements[1].sample.time).count(), 4'993'000)
        << "200 Hz";
  }
}

}  // namespace
}  // namespace imud
