// Prints frames of the J1939 unit, one a line, for j1939_decoders_test.py: {"frame": "ID#HEX" as candump writes it,
// "values": {NAME IN THE DBC FILE: TRUE VALUE, ...}}; those of a transfer to a node: {"frame": ...};
// and the text that it transfers: {"text": ...}.
#include <cstdio>
#include <random>
#include <string>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

void print_values(const char* name, const Vector3& v, double unit) {
  for (int i = 0; i < 3; ++i) std::printf("\"%s_%c\": %.17g, ", name, "xyz"[i], v[i] / unit);
}

void dump(const char* settings) {
  using units::degree;
  const Protocol& protocol = protocol_named("j1939");
  Line line(protocol, settings_of(protocol, settings));
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> part(-1, 1);
  std::vector<Sample> samples = random_samples(100, protocol, random);
  for (Sample& sample : samples) {
    const double yaw = 3 * part(random), pitch = 1.5 * part(random), roll = 3 * part(random);
    sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(yaw, pitch, roll).transpose());
    sample.status = 0;
    sample.rate = Vector3(part(random), part(random), part(random)) * 260 * degree;  // some are beyond the range
    sample.specific_force = Vector3(part(random), part(random), part(random)) * 330;
    sample.magnetic_field = Vector3(part(random), part(random), part(random)) * 8e-4;
    sample.navigation.latitude = 1.5 * part(random);
    sample.navigation.longitude = 3 * part(random);
    for (const Frame& frame : line.encode(sample)) {
      std::printf("{\"frame\": \"%s\", \"values\": {", can_text(frame).c_str());
      print_values("gyro", sample.rate, degree);
      print_values("accel", sample.specific_force, 1);
      print_values("mag", sample.magnetic_field, 1e-4);
      std::printf("\"pitch\": %.17g, \"roll\": %.17g, \"latitude\": %.17g, \"longitude\": %.17g}}\n", pitch / degree,
                  roll / degree, sample.navigation.latitude / degree, sample.navigation.longitude / degree);
    }
  }
}

// The unit's identification, which node 0x21 requests.
void dump_transfer() {
  const Protocol& protocol = protocol_named("j1939");
  const auto device = protocol.make(settings_of(protocol, "claim_wait_ms=0 identification=j1939"));
  const auto out = std::make_unique<FrameBuffer>();
  device->poll({}, *out);
  const auto print = [](const Frame& frame) { std::printf("{\"frame\": \"%s\"}\n", can_text(frame).c_str()); };
  for (const Frame& frame : out->frames()) print(frame);
  const char* const requests = "18EA8021#C5FD00 1CEC8021#110401FFFFC5FD00 1CEC8021#131C0004FFC5FD00";
  each_frame(requests, [&](const Frame& request) {
    print(request);
    out->clear();
    device->receive(request, {}, *out);
    for (const Frame& frame : out->frames()) print(frame);
  });
  std::printf("{\"text\": \"OpenIMU335RI*1**IMU*ACEINNA*\"}\n");
}

}  // namespace
}  // namespace imud

int main() {
  imud::dump("claim_wait_ms=0 packet_types=ssi2,ari,accs,ari_hr,accs_hr,ssi");
  imud::dump("claim_wait_ms=0 model=openimu300ri packet_types=mag,position");
  imud::dump_transfer();
}
