#include "protocols/mip/mip.hpp"

#include "core/units.hpp"

namespace imud::mip {

namespace {

constexpr std::string_view ahrs_sensor[] = {"reference_time", "acceleration", "rate",     "delta_angle",
                                            "delta_velocity", "temperature",  "overrange"};
constexpr std::string_view ahrs_filter[] = {"filter_reference_time", "filter_status", "filter_euler"};
constexpr std::string_view ins_sensor[] = {"reference_time", "acceleration", "rate",     "magnetic_field",
                                           "pressure",       "temperature",  "overrange"};
constexpr std::string_view gx5_filter[] = {"filter_gps_time", "filter_status",     "filter_position",
                                           "filter_velocity", "filter_quaternion", "filter_euler"};
constexpr std::string_view cv7_filter[] = {"filter_shared_gps_time", "filter_status",     "filter_position",
                                           "filter_velocity",        "filter_quaternion", "filter_euler"};
constexpr std::string_view gx5_gnss[] = {"gnss_position", "gnss_velocity", "gnss_dop",
                                         "gnss_fix",      "gnss_gps_time", "gnss_utc"};

}  // namespace

// Model numbers are those of mip_sdk, mip_device_models.h. The rates of 4 Hz and 500 Hz, and the densities (GX5:
// 0.005 deg/s/sqrt(Hz), 80 ug/sqrt(Hz); CV7: 0.17 deg/sqrt(h), 0.03 m/s/sqrt(h)) were taken from memory of the data
// sheets.
constinit const std::array<Model, 4> models = {{
    {gx5_25,
     "3dm-gx5-25",
     "3DM-GX5-25",
     "6253-4220",
     "6253.123456",
     "8g, 300d/s",
     500,
     0,
     300 * units::degree,
     8,
     0.005 * units::degree,
     80e-6 * units::standard_gravity,
     ahrs_sensor,
     ahrs_filter,
     {}},
    {gx5_45, "3dm-gx5-45", "3DM-GX5-45", "6251-4220", "6251.123456", "8g, 300d/s", 500, 4, 300 * units::degree, 8,
     0.005 * units::degree, 80e-6 * units::standard_gravity, ins_sensor, gx5_filter, gx5_gnss},
    {cv7_ahrs,
     "3dm-cv7-ahrs",
     "3DM-CV7-AHRS",
     "6286-9968",
     "6286.123456",
     "8g, 500d/s",
     1000,
     0,
     500 * units::degree,
     8,
     0.17 / 60 * units::degree,
     0.03 / 60,
     ahrs_sensor,
     ahrs_filter,
     {}},
    {cv7_ins,
     "3dm-cv7-ins",
     "3DM-CV7-INS",
     "6291-9968",
     "6291.123456",
     "8g, 500d/s",
     1000,
     0,
     500 * units::degree,
     8,
     0.17 / 60 * units::degree,
     0.03 / 60,
     ins_sensor,
     cv7_filter,
     {}},
}};

std::array<std::uint8_t, checksum_size> checksum_of(std::span<const std::byte> bytes) noexcept {
  std::uint8_t a = 0, b = 0;
  for (const std::byte byte : bytes) {
    a = static_cast<std::uint8_t>(a + std::to_integer<unsigned>(byte));
    b = static_cast<std::uint8_t>(b + a);
  }
  return {a, b};
}

std::optional<std::size_t> packet_size(std::span<const std::byte> held) noexcept {
  for (std::size_t i = 0; i < std::min<std::size_t>(held.size(), 2); ++i)
    if (held[i] != std::byte{sync[i]}) return std::nullopt;
  if (held.size() < header_size) return header_size;
  return header_size + std::to_integer<std::size_t>(held[3]) + checksum_size;
}

bool is_intact(std::span<const std::byte> packet) noexcept {
  const auto sums = checksum_of(packet.first(packet.size() - checksum_size));
  return packet[packet.size() - 2] == std::byte{sums[0]} && packet[packet.size() - 1] == std::byte{sums[1]};
}

Packet::Packet(FrameBuffer& out, std::uint8_t set) noexcept : FrameWriter(out, longest) {
  put(sync[0]);
  put(sync[1]);
  put(set);
  put(std::uint8_t{0});
}

void Packet::begin(std::uint8_t descriptor) noexcept {
  field_ = size();
  put(std::uint8_t{0});
  put(descriptor);
}

void Packet::put_padded(std::string_view text, std::size_t width) noexcept {
  for (std::size_t i = 0; i < width; ++i) put(static_cast<std::uint8_t>(i < text.size() ? text[i] : ' '));
}

void Packet::finish() noexcept {
  if (size() <= header_size) return;
  set_byte(3, size() - header_size);
  for (const std::uint8_t sum : checksum_of(written())) put(sum);
  push();
}

}  // namespace imud::mip
