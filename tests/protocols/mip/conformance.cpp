// The configurations in which MIP devices are tested, and the inputs from which their fuzz test starts.
#include "tests/protocols/conformance.hpp"

#include <string>
#include <string_view>

#include "protocols/mip/mip.hpp"

namespace imud::mip {
namespace {

using namespace std::string_view_literals;

constexpr void add_time(Protocol& entry) {
  entry.fields |= Measurement::time | Measurement::temperature | Measurement::status;
}
constexpr void add_increments(Protocol& entry) {
  add_time(entry);
  entry.fields |= Measurement::delta_angle | Measurement::delta_velocity;
}

constexpr ConformanceSettings conformance_settings[] = {
    {"sensor_rate_hz=1000"},
    {"model=3dm-gx5-45 sensor_rate_hz=1000"},
    {"model=3dm-cv7-ahrs sensor_rate_hz=1000 filter_fields=", add_increments},
    {"model=3dm-cv7-ins sensor_rate_hz=1000 filter_fields=", add_time},
    {"model=3dm-gq7 sensor_rate_hz=1000 filter_fields= gnss_fields="},
    {"sensor_rate_hz=1000 sensor_fields=delta_velocity,overrange,rate filter_fields=",
     [](Protocol& entry) { entry.fields = Measurement::delta_velocity | Measurement::status | Measurement::rate; }},
};

// Each body is a descriptor set, then the fields.
constexpr std::string_view host_bodies[] = {
    "\x01\x02\x01"sv,
    "\x01\x02\x02"sv,
    "\x01\x02\x03"sv,
    "\x01\x02\x04"sv,
    "\x01\x02\x06"sv,
    "\x01\x08\x09\x01\x01\x00\x01\xC2\x00"sv,
    "\x01\x02\x7E"sv,
    "\x0C\x02\x06"sv,
    "\x0C\x0E\x0F\x01\x80\x03\xD5\x00\x0A\x04\x00\x0A\x05\x00\x0A"sv,
    "\x0C\x08\x0D\x80\x00\x03\xD5\x04\x05"sv,
    "\x0C\x05\x11\x01\x80\x00"sv,
    "\x0C\x03\x30\x03"sv,
    "\x0C\x07\x40\x01\x00\x0E\x10\x00"sv,
    "\x0C\x0A\x08\x01\x02\x04\x00\x01\x05\x00\x01"sv,
    "\x0C\x03\x08\x02"sv,
    "\x0C\x04\x01\x00\x00"sv,
    "\x0D\x02\x01"sv,
    "\x0C\x04\x39\x03\xE8"sv,
    "\x0C\x03\x38\x02"sv,
    "\x0C\x0F\x38\x01\x3F\x80\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00"sv,
    "\x0C\x0F\x37\x01\x00\x00\x00\x00\x00\x00\x00\x00\x3F\x80\x00\x00"sv,
    "\x0C\x19\x2E\x01\x01\x02\x82\x05\x01\x01\x3F\xE8\x00\x00\x00\x00\x00\x00\xBF\xE8\x00\x00\x00\x00\x00\x00"sv,
    "\x0C\x0B\x2F\x01\x02\x01\x02\x82\x00\x00\x01\xD0"sv,
    "\x0C\x05\x2B\x01\x01\x01"sv,
    "\x0C\x04\x2B\x03\x00"sv,
    "\x0C\x13\x32\x01\x3F\x35\x04\xF3\x00\x00\x00\x00\x00\x00\x00\x00\x3F\x35\x04\xF3"sv,
    "\x0C\x03\x33\x02"sv,
    "\x0D\x0F\x11\x01\x00\x00\x00\x00\x00\x00\x00\x00\x3F\xC9\x0F\xDA"sv,
    "\x0D\x04\x18\x01\x04"sv,
    "\x0D\x03\x18\x02"sv,
    "\x0D\x06\x50\x01\x00\x05\x01"sv,
    "\x0D\x05\x50\x03\xFF\xFF"sv,
    "\x0D\x06\x03\x3F\x80\x00\x00"sv,
    "\x13\x1E\x01\x01\x03\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x3F\xC0\x00\x00"sv,
    "\x13\x05\x01\x02\x03\x01"sv,
    "\x01\x08\x72\x01\x01\x00\x00\x09\x68"sv,
    "\x01\x08\x72\x01\x02\x00\x04\x3C\x51"sv,
    "\x0C\x04\x0F\x03\x00"sv,
    "\x0C\x0A\x09\x01\x02\x03\x00\x01\x0B\x00\x01"sv,
    "\x0C\x04\x28\x01\x03"sv,
    "\x0C\x07\x41\x01\x01\x02\x01\x00"sv,
    "\x0C\x05\x42\x01\x02\x01"sv,
    "\x0C\x05\x64\x18\x6D\x02"sv,
    "\x0C\x0B\x0D\xA0\x00\x06\x02\x03\xD0\xD3\xD5\xD7"sv};
constexpr std::string_view ping[] = {"\x01\x02\x01"sv};

std::string framed(std::string_view body) {
  if (body.empty()) return {};
  std::string packet = "ue";
  packet += body[0];
  packet += static_cast<char>(body.size() - 1);
  packet += body.substr(1);
  for (const std::uint8_t sum : checksum_of(std::as_bytes(std::span(packet)))) packet += static_cast<char>(sum);
  return packet;
}
const Conformance conformance(
    "mip",
    {.settings = conformance_settings,
     .host = {
         .frame = framed, .bodies = host_bodies, .revive = ping, .last = ping[0], .answer = "\x04\xF1\x01\x00"sv}});

}  // namespace
}  // namespace imud::mip
