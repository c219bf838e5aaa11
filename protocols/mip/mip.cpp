#include "protocols/mip/mip.hpp"

#include "core/units.hpp"

namespace imud::mip {
namespace {

constexpr std::string_view gx5_sensor[] = {"acceleration", "rate", "magnetic_field", "pressure"};
constexpr std::string_view ahrs_sensor[] = {"reference_time", "acceleration", "rate",     "delta_angle",
                                            "delta_velocity", "temperature",  "overrange"};
constexpr std::string_view ahrs_filter[] = {"filter_reference_time", "filter_status", "filter_euler"};
constexpr std::string_view ins_sensor[] = {"reference_time", "acceleration", "rate",     "magnetic_field",
                                           "pressure",       "temperature",  "overrange"};
constexpr std::string_view ins_filter[] = {"filter_shared_gps_time", "filter_status",     "filter_position",
                                           "filter_velocity",        "filter_quaternion", "filter_euler"};
constexpr std::string_view gq7_filter[] = {"filter_shared_gps_time", "filter_status", "filter_position",
                                           "filter_velocity", "filter_quaternion"};
constexpr std::string_view gq7_gnss[] = {"gnss_position", "gnss_velocity", "gnss_dop", "gnss_fix"};

// The properties that the models of a series share.
constexpr Model gx5_series = {.options = "8g, 300d/s",
                              .filter_hz = 500,
                              .gyro_max = 300 * units::degree,
                              .preset = "3dm-gx5-25",
                              .gyro_noise = 0.005 * units::degree,
                              .accelerometer_noise = 80e-6 * units::standard_gravity};
constexpr Model gx5_45_series = [] {
  Model series = gx5_series;
  series.receivers = {gnss};
  series.gnss_hz = 4;
  return series;
}();
constexpr Model cv7_series = {.options = "8g, 500d/s",
                              .filter_hz = 1000,
                              .gyro_max = 500 * units::degree,
                              .preset = "3dm-cv7",
                              .gyro_noise = 0.17 / 60 * units::degree,
                              .accelerometer_noise = 0.03 / 60};
constexpr Model gq7_series = {.options = "8g, 300d/s",
                              .receivers = {gnss_1, gnss_2},
                              .filter_hz = 1000,
                              .gnss_hz = 2,
                              .filter_stream_hz = 40,
                              .gyro_max = 300 * units::degree,
                              .preset = "3dm-cv7",
                              .gyro_noise = 0.15 / 60 * units::degree,
                              .accelerometer_noise = 0.02 / 60,
                              .gnss_fields = gq7_gnss};

constexpr Model model(Model series, unsigned bit, std::string_view keyword, std::string_view name,
                      std::string_view number, std::string_view serial,
                      std::span<const std::string_view> sensor_fields,
                      std::span<const std::string_view> filter_fields = {}) {
  series.bit = bit;
  series.keyword = keyword;
  series.name = name;
  series.number = number;
  series.serial = serial;
  series.sensor_fields = sensor_fields;
  series.filter_fields = filter_fields;
  return series;
}

}  // namespace

// Model numbers are from mip_sdk, mip_device_models.h. The base rates of the GQ7 and the CV7 are from their manuals
// (Protocol Support), the filter's 500 Hz of the GX5 from the GX5-45's manual (8500-0064 C, 4.2.9). The receiver's 4
// Hz, and the densities (GX5: 0.005 deg/s/sqrt(Hz), 80 ug/sqrt(Hz); CV7: 0.17 deg/sqrt(h), 0.03 m/s/sqrt(h); GQ7:
// 0.15 deg/sqrt(h), 0.02 m/s/sqrt(h)) were taken from memory of the data sheets.
//
// No manual at hand lists the streams of a unit as delivered. The GX5 streams only fields that imu_3dm_gx4 accepts
// before it has configured the unit. The GQ7 streams the fields that ArduPilot needs, at 115200 bit/s: packets of the
// receivers delay a filter packet by 15 ms. A filter packet 44 ms after the last is late.
constinit const std::array<Model, 5> models = {{
    model(gx5_series, gx5_25, "3dm-gx5-25", "3DM-GX5-25", "6253-4220", "6253.123456", gx5_sensor),
    model(gx5_45_series, gx5_45, "3dm-gx5-45", "3DM-GX5-45", "6251-4220", "6251.123456", gx5_sensor),
    model(cv7_series, cv7_ahrs, "3dm-cv7-ahrs", "3DM-CV7-AHRS", "6286-9968", "6286.123456", ahrs_sensor, ahrs_filter),
    model(cv7_series, cv7_ins, "3dm-cv7-ins", "3DM-CV7-INS", "6291-9968", "6291.123456", ins_sensor, ins_filter),
    model(gq7_series, gq7, "3dm-gq7", "3DM-GQ7", "6284-4220", "6284.123456", gx5_sensor, gq7_filter),
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

std::span<std::byte> reseal(std::span<std::byte> packet, const CanHeader&) noexcept {
  const auto size = packet_size(packet);
  if (!size || *size != packet.size() || !for_each_field(packet, [](auto...) {})) return {};
  const std::span<std::byte> sealed = packet.first(packet.size() - checksum_size);
  const auto sums = checksum_of(sealed);
  packet[packet.size() - 2] = std::byte{sums[0]};
  packet[packet.size() - 1] = std::byte{sums[1]};
  return sealed.subspan(header_size);
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
