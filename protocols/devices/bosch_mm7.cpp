// Bosch MM7.10, automotive inertial sensor. Three messages in this order, little-endian, with one counter and a CRC-8
// SAE J1850 of bytes 0 to 6. bosch_mm7.dbc beside this file describes the same layouts for CAN tools.
//
// Layout: Bosch's own receiver, off_highway_sensor_drivers (off_highway_mm7p10), and an emulator of others
// (IanLyuWellysun/TestSonar), from which the CRC is: Bosch's receiver does not check it. No document of the product
// was at hand. The receiver negates the roll rate; the sign here is that of the sensor's own axes. It takes a set of
// which all numbers are zero for none.
//
// | byte | 0x174            | 0x178     | 0x17C      | number                         |
// |------|------------------|-----------|------------|--------------------------------|
// | 0-1  | yaw rate         | roll rate | pitch rate | u16, 0.005 deg/s, -163.84      |
// | 2    | bits 4-7: status of the rate; of 0x17C, bits 0-3: index of the hardware     |
// | 3    | temperature      | 0         | 0          | u8, 1 degree Celsius, -50      |
// | 4-5  | acceleration y   | x         | z          | u16, 0.000127465 g, -4.1768    |
// | 6    | bits 0-3: counter; bits 4-7: status of the acceleration                     |
// | 7    | CRC of bytes 0-6                                                            |
// The status is 0 while the value is good. Its other values are not known; here they are 1 for a value beyond the
// range, 2 for one that is not valid, 3 for both.
#include "protocols/signal_product.hpp"

namespace imud {

namespace {

constexpr double rate_scale = 0.005, rate_offset = -163.84;                        // deg/s
constexpr double acceleration_scale = 0.000127465, acceleration_offset = -4.1768;  // g

// The status of an axis: `First` is the bit of Sample::status for x.
template <std::uint32_t First, int Axis>
double axis_status(const Reading& reading) noexcept {
  const std::uint32_t status = reading.sample.status;
  return ((status & First << Axis) != 0 ? 1 : 0) + ((status & imud::status::not_valid) != 0 ? 2 : 0);
}
template <std::uint32_t First, int Axis>
void put_axis_status(double value, ReadBack& read) noexcept {
  if (value == 1 || value == 3) read.measurement.sample.status |= First << Axis;
  if (value == 2 || value == 3) read.measurement.sample.status |= status::not_valid;
  read.measurement.fields |= Measurement::status;
}
template <std::uint32_t First, int Axis>
constexpr MeasuredQuantity axis_quantity = {
    .name = "axis_status", .help = "", .get = axis_status<First, Axis>, .set = put_axis_status<First, Axis>};
constexpr std::uint32_t gyro = status::gyro_saturated_x, accelerometer = status::accelerometer_saturated_x;

template <int Axis>
constexpr CanSignal rate_status = {
    .name = "RateStatus", .start = 20, .length = 4, .quantity = &axis_quantity<gyro, Axis>};
template <int Axis>
constexpr CanSignal force_status = {
    .name = "AccelerationStatus", .start = 52, .length = 4, .quantity = &axis_quantity<accelerometer, Axis>};
constexpr CanSignal counter = {"Counter", 48, 4, intel_unsigned, 1, 0, "sample_counter"};
constexpr CanSignal crc = {"CRC", 56, 8, intel_unsigned, 1, 0, checksum_source};

constexpr CanSignal yaw_ay[] = {
    {"YawRate", 0, 16, intel_unsigned, rate_scale, rate_offset, "rate_z_deg_per_s"},
    rate_status<2>,
    {"Temperature", 24, 8, intel_unsigned, 1, -50, "temperature_c"},
    {"AY", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_y_g"},
    counter,
    force_status<1>,
    crc};
constexpr CanSignal roll_ax[] = {
    {"RollRate", 0, 16, intel_unsigned, rate_scale, rate_offset, "rate_x_deg_per_s"},
    rate_status<0>,
    {"AX", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_x_g"},
    counter,
    force_status<0>,
    crc};
constexpr CanSignal pitch_az[] = {
    {"PitchRate", 0, 16, intel_unsigned, rate_scale, rate_offset, "rate_y_deg_per_s"},
    {.name = "HardwareIndex", .start = 16, .length = 4},
    rate_status<1>,
    {"AZ", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_z_g"},
    counter,
    force_status<2>,
    crc};

constexpr MessageChecksum j1850 = {.profile = ChecksumProfile::j1850};
std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader&) noexcept {
  constexpr std::size_t at = 7;
  if (frame.size() != at + 1) return {};
  frame[at] = static_cast<std::byte>(j1850.of(frame, at, 0));
  return frame.first(at);
}
constexpr SignalProductMessage messages[] = {{"yaw_ay", 0x174, 8, yaw_ay, j1850},
                                             {"roll_ax", 0x178, 8, roll_ax, j1850},
                                             {"pitch_az", 0x17C, 8, pitch_az, j1850}};
// Ranges of the fields; noise of the same order as that of similar sensors, as no data sheet was at hand.
constexpr SignalProduct table = {.messages = messages,
                                 .gyro_noise = 0.01 * units::degree,
                                 .gyro_max = 163 * units::degree,
                                 .accelerometer_noise = 200e-6 * units::standard_gravity,
                                 .accelerometer_max = 4.1 * units::standard_gravity};
constexpr Setting settings[] = {output_rate_setting(100, 200), identifiers_setting(), id_offset_setting(),
                                extended_setting()};

constexpr double rate_lsb = rate_scale * units::degree, force_lsb = acceleration_scale * units::standard_gravity;

}  // namespace

extern const Protocol bosch_mm7_protocol;
constexpr Protocol bosch_mm7_protocol = signal_protocol<table>({
    .name = "bosch-mm7",
    .summary = "Bosch MM7.10 automotive inertial sensor: three messages with counter and CRC",
    .document = "off_highway_sensor_drivers, off_highway_mm7p10 (Bosch's ROS 2 receiver)",
    .settings = settings,
    .fields = Measurement::counter | Measurement::rate | Measurement::specific_force | Measurement::temperature |
              Measurement::status,
    .resolution = {.rate = rate_lsb, .specific_force = force_lsb, .temperature_c = 1},
    .range = {.rate = 32767 * rate_lsb, .specific_force = 32766 * force_lsb, .temperature_c = 50},
    .counter_bits = 4,
    .status_bits = 0x3F | status::not_valid,
    .has_checksum = true,
    .burst_bits = 6,
    .reseal = reseal,
});

}  // namespace imud
