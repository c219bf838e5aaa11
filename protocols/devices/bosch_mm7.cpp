// Bosch MM7.10, automotive inertial sensor. Three messages in this order, little-endian, with one counter and a CRC-8
// SAE J1850 of bytes 0 to 6. bosch_mm7.dbc beside this file describes the same layouts for CAN tools.
//
// Layout, status and the codes of the temperature: Bosch's own receiver,
// bosch-engineering/off_highway_sensor_drivers, off_highway_mm7p10 at 8dd1f70 (receiver.hpp, receiver.cpp). Bosch's
// receiver does not check the CRC, which is from another emulator (IanLyuWellysun/TestSonar). No document of the
// product was at hand. Bosch's receiver negates the roll rate, which "is received negative as per right-hand rule for
// rotation around X axis", and no other number. It needs `axes = "bosch"`; `axes = "right_handed"` is for receivers
// that negate nothing. Bosch's receiver drops a set in which all numbers are zero.
//
// | byte | 0x174            | 0x178     | 0x17C      | number                         |
// |------|------------------|-----------|------------|--------------------------------|
// | 0-1  | yaw rate         | roll rate | pitch rate | u16, 0.005 deg/s, -163.84      |
// | 2    | bits 4-7: status of the rate; of 0x17C, bits 0-3: index of the hardware     |
// | 3    | temperature      | 0         | 0          | u8, 1 degree Celsius, -50      |
// | 4-5  | acceleration y   | x         | z          | u16, 0.000127465 g, -4.1768    |
// | 6    | bits 0-3: counter; bits 4-7: status of the acceleration                     |
// | 7    | CRC of bytes 0-6                                                            |
// The bits of a status are 1: the sensor is not available, 2: failure of the signal, 4: initialisation in progress;
// 0 is good. By assumption, a sample that is no measurement has bit 1, a value beyond its range has bit 2, and bit 4
// is never set. The temperature is FF below -50 degrees, and C9 above 150.
#include <array>

#include "protocols/signals/signal_product.hpp"

namespace imud {
namespace {

constexpr double rate_scale = 0.005, rate_offset = -163.84;                        // deg/s
constexpr double acceleration_scale = 0.000127465, acceleration_offset = -4.1768;  // g

constexpr unsigned not_available = 1, failure = 2, initialising = 4;  // bits of a status

// The status of an axis: `First` is the bit of Sample::status for x.
template <std::uint32_t First, int Axis>
double axis_status(const Reading& reading) noexcept {
  const std::uint32_t status = reading.sample.status;
  return ((status & imud::status::not_valid) != 0 ? not_available : 0U) +
         ((status & First << Axis) != 0 ? failure : 0U);
}
template <std::uint32_t First, int Axis>
void put_axis_status(double value, ReadBack& read) noexcept {
  const auto bits = static_cast<unsigned>(value);
  if ((bits & failure) != 0) read.measurement.sample.status |= First << Axis;
  if ((bits & (not_available | initialising)) != 0) read.measurement.sample.status |= status::not_valid;
  read.measurement.fields |= Measurement::status;
}
template <std::uint32_t First, int Axis>
constexpr MeasuredQuantity axis_quantity = {
    .name = "axis_status", .help = "", .get = axis_status<First, Axis>, .set = put_axis_status<First, Axis>};
constexpr std::uint32_t gyro = status::gyro_saturated_x, accelerometer = status::accelerometer_saturated_x;

// Returns the number for the temperature, or a code if the temperature is beyond the range. The code is read as the
// first degree beyond the range.
constexpr double coldest = -50, hottest = 150;  // degrees Celsius
constexpr double below_coldest = 0xFF, above_hottest = 0xC9;
double temperature_number(const Reading& reading) noexcept {
  const double celsius = reading.sample.temperature_c;
  return celsius > hottest ? above_hottest : celsius >= coldest ? celsius - coldest : below_coldest;
}
void put_temperature_number(double value, ReadBack& read) noexcept {
  const double celsius = value > above_hottest ? coldest - 1 : value + coldest;
  read.measurement.sample.temperature_c = celsius;
  read.measurement.fields |= Measurement::temperature;
}
constexpr MeasuredQuantity temperature = {
    .name = "temperature", .help = "", .get = temperature_number, .set = put_temperature_number};

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
    {.name = "Temperature", .start = 24, .length = 8, .quantity = &temperature},
    {"AY", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_y_g"},
    counter,
    force_status<1>,
    crc};
using RollAx = std::array<CanSignal, 6>;
constexpr RollAx roll_ax_with(std::string_view roll_rate) {
  return {{{"RollRate", 0, 16, intel_unsigned, rate_scale, rate_offset, roll_rate},
           rate_status<0>,
           {"AX", 32, 16, intel_unsigned, acceleration_scale, acceleration_offset, "specific_force_x_g"},
           counter,
           force_status<0>,
           crc}};
}
constexpr RollAx roll_ax = roll_ax_with("-rate_x_deg_per_s"), right_handed_roll_ax = roll_ax_with("rate_x_deg_per_s");
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
using Messages = std::array<SignalProductMessage, 3>;
constexpr Messages messages_with(const RollAx& roll) {
  return {{{"yaw_ay", 0x174, 8, yaw_ay, j1850},
           {"roll_ax", 0x178, 8, roll, j1850},
           {"pitch_az", 0x17C, 8, pitch_az, j1850}}};
}
constexpr Messages messages = messages_with(roll_ax), right_handed_messages = messages_with(right_handed_roll_ax);
// The ranges are the ranges of the fields. No data sheet was at hand: the noise is of the order of similar sensors.
constexpr SignalProduct product_with(std::span<const SignalProductMessage> sent) {
  return {.messages = sent,
          .gyro_noise = 0.01 * units::degree,
          .gyro_max = 163 * units::degree,
          .accelerometer_noise = 200e-6 * units::standard_gravity,
          .accelerometer_max = 4.1 * units::standard_gravity};
}
constexpr SignalProduct table = product_with(messages), right_handed_table = product_with(right_handed_messages);
constexpr std::string_view axes[] = {"bosch", "right_handed"};
constexpr Setting settings[] = {output_rate_setting(100, 200), identifiers_setting(), id_offset_setting(),
                                extended_setting(),
                                text_setting("axes",
                                             "bosch: the roll rate is negative by the right-hand rule, which Bosch's "
                                             "receiver undoes; right_handed: it is positive",
                                             axes[0], axes)};

const SignalProduct& bosch_mm7_table_of(const Settings& chosen) {
  return chosen.text("axes") == axes[0] ? table : right_handed_table;
}

constexpr double rate_lsb = rate_scale * units::degree, force_lsb = acceleration_scale * units::standard_gravity;

}  // namespace

extern constexpr Protocol bosch_mm7_protocol = signal_protocol<bosch_mm7_table_of>({
    .name = "bosch-mm7",
    .summary = "Bosch MM7.10 automotive inertial sensor: three messages with counter and CRC",
    .document = "off_highway_sensor_drivers, off_highway_mm7p10 at 8dd1f70 (Bosch's ROS 2 receiver)",
    .settings = settings,
    .fields = Measurement::counter | Measurement::rate | Measurement::specific_force | Measurement::temperature |
              Measurement::status,
    .resolution = {.rate = rate_lsb, .specific_force = force_lsb, .temperature_c = 1},
    .range = {.rate = 32767 * rate_lsb, .specific_force = 32766 * force_lsb, .temperature_c = 50},
    .counter_bits = 4,
    .status_bits = 0x3F | status::not_valid,
    .has_checksum = true,
    .burst_bits = 6,
    .make_seal = seal_by<reseal>,
    .make = by_table,
    .make_decoder = by_table,
});

}  // namespace imud
