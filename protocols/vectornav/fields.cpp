// The fields of binary frames: one table for the device, its registers and the decoder.
#include <chrono>

#include "protocols/vectornav/quantities.hpp"

namespace imud::vectornav {
namespace {

using Put = void (*)(const Quantities& now, BinaryFrame& frame);

template <auto Quantity>
void integer(const Quantities& now, BinaryFrame& frame) {
  frame.put((now.*Quantity)());
}
template <auto Quantity>
void real(const Quantities& now, BinaryFrame& frame) {
  frame.put_float((now.*Quantity)());
}
template <auto Quantity>
void floats(const Quantities& now, BinaryFrame& frame) {
  frame.put_floats((now.*Quantity)());
}
template <auto Quantity>
void doubles(const Quantities& now, BinaryFrame& frame) {
  frame.put_doubles((now.*Quantity)());
}
// Writes several quantities one after another.
template <Put... Parts>
void all(const Quantities& now, BinaryFrame& frame) {
  (Parts(now, frame), ...);
}

void quaternion(const Quantities& now, BinaryFrame& frame) {
  const Quaternion q = now.tared_q();
  for (const double part : {q.x(), q.y(), q.z(), q.w()}) frame.put_float(part);
}

void matrix(const Quantities& now, BinaryFrame& frame) {  // in column-major order
  const Matrix3 dcm_PL = now.tared_q().conjugate().toRotationMatrix();
  for (int column = 0; column < 3; ++column) frame.put_floats(dcm_PL.col(column));
}

void utc(const Quantities& now, BinaryFrame& frame) {
  if (now.gps_ns() == 0) return;
  namespace chrono = std::chrono;
  const auto utc = utc_from_gps(static_cast<std::int64_t>(now.gps_ns()));
  const auto day = chrono::floor<chrono::days>(utc);
  const chrono::year_month_day date{day};
  const chrono::hh_mm_ss time{chrono::floor<chrono::milliseconds>(utc - day)};
  frame.put(static_cast<std::int8_t>(static_cast<int>(date.year()) - 2000));
  frame.put(static_cast<std::uint8_t>(static_cast<unsigned>(date.month())));
  frame.put(static_cast<std::uint8_t>(static_cast<unsigned>(date.day())));
  frame.put(static_cast<std::uint8_t>(time.hours().count()));
  frame.put(static_cast<std::uint8_t>(time.minutes().count()));
  frame.put(static_cast<std::uint8_t>(time.seconds().count()));
  frame.put(static_cast<std::uint16_t>(time.subseconds().count()));
}

void gnss_time_info(const Quantities& now, BinaryFrame& frame) {
  frame.put(now.time_status());
  frame.put(static_cast<std::int8_t>(gps_leap_s));
}

void dilutions(const Quantities& now, BinaryFrame& frame) {
  const Dilution& of = now.dilution();
  for (const float one : {of.geometric, of.position, of.time, of.vertical, of.horizontal, of.north, of.east})
    frame.put_float(one);
}

using Q = Quantities;
constexpr Put raw_inertial = all<floats<&Q::raw_acceleration>, floats<&Q::raw_rate>>;
constexpr Put sensors = all<real<&Q::temperature_c>, real<&Q::pressure_kpa>>;
constexpr Put delta_theta = all<real<&Q::dt>, floats<&Q::delta_angle_deg>>;

struct BinaryField {
  Group group;
  unsigned bit;
  std::uint8_t size;  // in bytes (vnproglib, Packet::BinaryGroupLengths)
  Put put = nullptr;  // nullptr: zeros, because the device does not know the field
};

// GNSS2 has the fields of GNSS1.
constexpr BinaryField fields[] = {
    {common, 0, 8, integer<&Q::since_start_ns>},
    {common, 1, 8, integer<&Q::gps_ns>},
    {common, 2, 8, integer<&Q::since_sync_in_ns>},
    {common, 3, 12, floats<&Q::tared_ypr_deg>},
    {common, 4, 16, quaternion},
    {common, 5, 12, floats<&Q::rate>},
    {common, 6, 24, doubles<&Q::lla>},
    {common, 7, 12, floats<&Q::v_L>},
    {common, 8, 12, floats<&Q::acceleration>},
    {common, 9, 24, raw_inertial},
    {common, 10, 20, all<floats<&Q::magnetic>, sensors>},
    {common, 11, 28, all<delta_theta, floats<&Q::delta_velocity>>},
    {common, 12, 2, integer<&Q::ins_status>},
    {common, 13, 4, integer<&Q::sync_in_count>},
    {common, 14, 8, integer<&Q::since_pulse_ns>},

    {time_group, 0, 8, integer<&Q::since_start_ns>},
    {time_group, 1, 8, integer<&Q::gps_ns>},
    {time_group, 2, 8, integer<&Q::time_of_week_ns>},
    {time_group, 3, 2, integer<&Q::week>},
    {time_group, 4, 8, integer<&Q::since_sync_in_ns>},
    {time_group, 5, 8, integer<&Q::since_pulse_ns>},
    {time_group, 6, 8, utc},
    {time_group, 7, 4, integer<&Q::sync_in_count>},
    {time_group, 8, 4, integer<&Q::sync_out_count>},
    {time_group, 9, 1, integer<&Q::time_status>},

    {imu, 0, 2},  // status
    {imu, 1, 12, floats<&Q::raw_magnetic>},
    {imu, 2, 12, floats<&Q::raw_acceleration>},
    {imu, 3, 12, floats<&Q::raw_rate>},
    {imu, 4, 4, real<&Q::temperature_c>},
    {imu, 5, 4, real<&Q::pressure_kpa>},
    {imu, 6, 16, delta_theta},
    {imu, 7, 12, floats<&Q::delta_velocity>},
    {imu, 8, 12, floats<&Q::magnetic>},
    {imu, 9, 12, floats<&Q::acceleration>},
    {imu, 10, 12, floats<&Q::rate>},
    {imu, 11, 2, integer<&Q::saturation>},
    {imu, 12, 40, all<floats<&Q::raw_magnetic>, raw_inertial, real<&Q::temperature_c>>},

    {gnss1, 0, 8, utc},
    {gnss1, 1, 8, integer<&Q::time_of_week_ns>},
    {gnss1, 2, 2, integer<&Q::week>},
    {gnss1, 3, 1, integer<&Q::satellites>},
    {gnss1, 4, 1, integer<&Q::fix>},
    {gnss1, 5, 24, doubles<&Q::lla>},
    {gnss1, 6, 24, doubles<&Q::r_E>},
    {gnss1, 7, 12, floats<&Q::v_L>},
    {gnss1, 8, 12, floats<&Q::v_E>},
    {gnss1, 9, 12, floats<&Q::position_errors_m>},
    {gnss1, 10, 4, real<&Q::velocity_error_m_per_s>},
    {gnss1, 11, 4, real<&Q::time_error_s>},
    {gnss1, 12, 2, gnss_time_info},
    {gnss1, 13, 28, dilutions},

    {attitude, 0, 2, integer<&Q::vpe_status>},
    {attitude, 1, 12, floats<&Q::tared_ypr_deg>},
    {attitude, 2, 16, quaternion},
    {attitude, 3, 36, matrix},
    {attitude, 4, 12, floats<&Q::magnetic_L>},
    {attitude, 5, 12, floats<&Q::acceleration_L>},
    {attitude, 6, 12, floats<&Q::linear_P>},
    {attitude, 7, 12, floats<&Q::linear_L>},
    {attitude, 8, 12, floats<&Q::ypr_error_deg>},
    {attitude, 9, 12},
    {attitude, 10, 28},
    {attitude, 11, 24},
    {attitude, 12, 12},

    {ins, 0, 2, integer<&Q::ins_status>},
    {ins, 1, 24, doubles<&Q::lla>},
    {ins, 2, 24, doubles<&Q::r_E>},
    {ins, 3, 12, floats<&Q::v_P>},
    {ins, 4, 12, floats<&Q::v_L>},
    {ins, 5, 12, floats<&Q::v_E>},
    {ins, 6, 12, floats<&Q::magnetic_E>},
    {ins, 7, 12, floats<&Q::acceleration_E>},
    {ins, 8, 12, floats<&Q::linear_E>},
    {ins, 9, 4, real<&Q::position_error_m>},
    {ins, 10, 4, real<&Q::velocity_error_m_per_s>},
    {ins, 11, 68},
    {ins, 12, 64},
};

// The index in the table of each group's first field. The fields of a group are in the order of their bits.
constexpr std::array<std::size_t, groups + 1> first_of_group = [] {
  std::array<std::size_t, groups + 1> first = {};
  for (unsigned g = 0; g <= groups; ++g)
    for (const BinaryField& field : fields) first[g] += field.group < g;
  return first;
}();
static_assert([] {
  for (std::size_t i = 0; i < std::size(fields); ++i)
    if (first_of_group[fields[i].group] + fields[i].bit != i) return false;
  return true;
}());

const BinaryField* find(unsigned group, unsigned bit) noexcept {
  if (group == gnss2) group = gnss1;
  if (group >= groups || bit >= first_of_group[group + 1] - first_of_group[group]) return nullptr;
  return &fields[first_of_group[group] + bit];
}

bool is_known(unsigned group, const Quantities& now) noexcept {
  if (group != gnss1 && group != gnss2) return true;
  return now.has_fix() && now.has_receiver(group == gnss1 ? 1 : 2);
}

}  // namespace

std::size_t field_size(unsigned group, unsigned bit) noexcept {
  const BinaryField* field = find(group, bit);
  return field != nullptr ? field->size : 0;
}

void put_fields(const BinaryOutput& output, const Reading& reading, const Sums& sums, BinaryFrame& frame) noexcept {
  const Quantities solution(reading, sums), receiver = Quantities::of_receiver(reading, sums);
  for (unsigned group = 0; group < groups; ++group) {
    const Quantities& now = group == gnss1 || group == gnss2 ? receiver : solution;
    for (unsigned bit = 0; bit < mask_bits; ++bit) {
      if ((output.masks[group] >> bit & 1U) == 0) continue;
      const BinaryField* field = find(group, bit);
      if (field == nullptr) continue;
      const std::size_t end = frame.size() + field->size;
      if (field->put != nullptr && is_known(group, now)) field->put(now, frame);
      frame.fill(end);
    }
  }
}

}  // namespace imud::vectornav
