// The text messages: one table for the stream, the measurement registers and the load of the line.
#include <algorithm>
#include <array>
#include <cstdio>

#include "protocols/vectornav/quantities.hpp"

namespace imud::vectornav {
namespace {

constexpr Digits angle = {3, 8, true}, rates = {6, 10, true}, speed = {3, 8, true}, metres = {3, 10, true},
                 accelerations = {3, 7, true}, magnetics = {4, 8, true}, r_E = {3, 12, true},
                 metres_heave = {3, 8, true};

void put_hexadecimal(unsigned bits, const char* format, Message& message) noexcept {
  std::array<char, 8> text;
  std::snprintf(text.data(), text.size(), format, bits & 0xFFFFU);
  message.put(text.data());
}

using Part = void (*)(const Quantities& now, Message& message);
using Q = Quantities;

// Writes a vector in one of the forms above.
template <auto Quantity, const Digits& Format>
void vector(const Q& now, Message& message) {
  message.put((now.*Quantity)(), Format);
}

void quaternion(const Q& now, Message& message) {
  const Quaternion q = now.tared_q();
  for (const double part : {q.x(), q.y(), q.z(), q.w()}) message.put(part, {6, 9, true});
}
void lla(const Q& now, Message& message) {
  message.put(now.lla()[0], {8, 12, true}).put(now.lla()[1], {8, 13, true}).put(now.lla()[2], metres);
}
void gps_time(const Q& now, Message& message) { message.put(now.time_of_week_s(), {6, 13}).put(now.week(), {0, 4}); }
void fix(const Q& now, Message& message) { message.put(now.fix(), {}).put(now.satellites(), {0, 2}); }
void gnss_errors(const Q& now, Message& message) {
  message.put(now.position_errors_m(), speed).put(now.velocity_error_m_per_s(), speed);
  std::array<char, 24> time_error;
  std::snprintf(time_error.data(), time_error.size(), ",%.2E", now.time_error_s());
  message.put(time_error.data());
}
void ins_status(const Q& now, Message& message) { put_hexadecimal(now.ins_status(), ",%04X", message); }
void ins_errors(const Q& now, Message& message) {
  message.put(now.ins_attitude_error_deg(), {1, 4}).put(now.position_error_m(), {1, 4});
  message.put(now.velocity_error_m_per_s(), {2, 4});
}
void environment(const Q& now, Message& message) {
  message.put(now.temperature_c(), {1, 5, true}).put(now.pressure_kpa(), {3, 8, true});
}
void increments(const Q& now, Message& message) {
  message.put(now.dt(), {6, 9, true}).put(now.delta_angle_deg(), angle).put(now.delta_velocity(), speed);
}

// Firmware 3 (SDK 0.99, Interface/Registers.hpp). The sea is calm: heave, heave rate and delayed heave are zero.
void heave(const Q&, Message& message) { message.put(Vector3::Zero(), metres_heave); }
void sync_status(const Q& now, Message& message) {
  for (const std::uint32_t number : {now.sync_in_count(), now.since_sync_in_us(), now.sync_out_count()})
    message.put(number, {});
}
// Writes for receiver A, then for B: the number of satellites for the position, the number for the baseline, and the
// carrier-to-noise density in dBHz; then the two numbers of satellites that both receivers have.
void signal_health(const Q& now, Message& message) {
  const double satellites = now.satellites(), density = now.has_fix() ? 50 : 0;
  for (const double number :
       {satellites, satellites, density, satellites, satellites, density, satellites, satellites})
    message.put(number, {1});
}
void compass_startup(const Q& now, Message& message) {
  message.put(now.has_fix() ? 100 : 0, {}).put(now.has_fix() ? now.tared_ypr_deg()[0] : 0, angle);
}

constexpr Part ypr = vector<&Q::tared_ypr_deg, angle>;
constexpr Part magnetic = vector<&Q::magnetic, magnetics>;
constexpr Part acceleration = vector<&Q::acceleration, accelerations>;
constexpr Part rate = vector<&Q::rate, rates>;
constexpr Part linear_P = vector<&Q::linear_P, accelerations>;
constexpr Part linear_L = vector<&Q::linear_L, accelerations>;
constexpr Part raw_magnetic = vector<&Q::raw_magnetic, magnetics>;
constexpr Part raw_acceleration = vector<&Q::raw_acceleration, accelerations>;
constexpr Part raw_rate = vector<&Q::raw_rate, rates>;
constexpr Part ecef = vector<&Q::r_E, r_E>;
constexpr Part v_L = vector<&Q::v_L, speed>;
constexpr Part v_E = vector<&Q::v_E, speed>;

constexpr unsigned register_only = 1000;  // added to the register's number, the type of a register without message
struct MessageType {
  unsigned type;
  std::string_view name;  // empty: a register without a message
  unsigned register_id;   // the register of the same content
  Since since;
  std::size_t size;  // of the longest message, from '$' to LF, with a checksum of two digits
  std::array<Part, 6> parts;
  bool has_increments = false;  // the sums restart after the message
};
constexpr MessageType messages[] = {
    {1, "VNYPR", 8, {}, 38, {ypr}},
    {2, "VNQTN", 9, {}, 51, {quaternion}},
    {8, "VNQMR", 15, {}, 135, {quaternion, magnetic, acceleration, rate}},
    {10, "VNMAG", 17, {}, 38, {magnetic}},
    {11, "VNACC", 18, {}, 35, {acceleration}},
    {12, "VNGYR", 19, {}, 44, {rate}},
    {13, "VNMAR", 20, {}, 95, {magnetic, acceleration, rate}},
    {14, "VNYMR", 27, {}, 122, {ypr, magnetic, acceleration, rate}},
    {16, "VNYBA", 239, {}, 95, {ypr, linear_P, rate}},
    {17, "VNYIA", 240, {}, 95, {ypr, linear_L, rate}},
    {19, "VNIMU", 54, {}, 110, {raw_magnetic, raw_acceleration, raw_rate, environment}},
    {20, "VNGPS", 58, {1}, 145, {gps_time, fix, lla, v_L, gnss_errors}},
    {21, "VNGPE", 59, {1}, 146, {gps_time, fix, ecef, v_E, gnss_errors}},
    {22, "VNINS", 63, {1}, 142, {gps_time, ins_status, ypr, lla, v_L, ins_errors}},
    {23, "VNINE", 64, {1}, 143, {gps_time, ins_status, ypr, ecef, v_E, ins_errors}},
    {28, "VNISL", 72, {1}, 160, {ypr, lla, v_L, acceleration, rate}},
    {29, "VNISE", 73, {1}, 161, {ypr, ecef, v_E, acceleration, rate}},
    {30, "VNDTV", 80, {}, 75, {increments}, true},
    {32, "VNG2S", 103, {2}, 145, {gps_time, fix, lla, v_L, gnss_errors}},
    {33, "VNG2E", 104, {2}, 146, {gps_time, fix, ecef, v_E, gnss_errors}},
    {34, "VNHVE", 115, {0, firmware_3}, 38, {heave}},
    {register_only + 33, "", 33, {}, 0, {sync_status}},
    {register_only + 86, "", 86, {2, firmware_3}, 0, {signal_health}},
    {register_only + 98, "", 98, {2, firmware_3}, 0, {compass_startup}},
};

// Returns true if the register reports measurements of the receivers, not the solution: VNGPS, VNGPE, VNG2S, VNG2E,
// the health of the compass's signals, and the start-up of the compass.
constexpr bool is_of_receivers(unsigned register_id) noexcept {
  constexpr std::array<unsigned, 6> all = {58, 59, 86, 98, 103, 104};
  return std::find(all.begin(), all.end(), register_id) != all.end();
}

const MessageType* find(unsigned type) noexcept {
  for (const MessageType& message : messages)
    if (message.type == type) return &message;
  return nullptr;
}

}  // namespace

bool is_measured(unsigned type, const Model& model) noexcept {
  const MessageType* known = find(type);
  return known != nullptr && known->since.includes(model);
}

std::string_view name_of(unsigned type, const Model& model) noexcept {
  return is_measured(type, model) ? find(type)->name : "";
}

std::size_t size_of(unsigned type) noexcept {
  const MessageType* known = find(type);
  return known != nullptr ? known->size : 0;
}

unsigned type_of_register(unsigned id) noexcept {
  for (const MessageType& message : messages)
    if (message.register_id == id) return message.type;
  return 0;
}

void put_measurement(unsigned type, const Reading& reading, Sums& sums, Message& message) noexcept {
  const MessageType* known = find(type);
  if (known == nullptr) return;
  const Quantities now =
      is_of_receivers(known->register_id) ? Quantities::of_receiver(reading, sums) : Quantities(reading, sums);
  for (const Part put : known->parts)
    if (put != nullptr) put(now, message);
  if (known->has_increments) sums = {};
}

void put_appended(double count_mode, double status_mode, const Reading& reading, Message& message) noexcept {
  const Sums none;
  const Quantities now(reading, none);
  if (status_mode != 0) put_hexadecimal(status_mode == 2 ? now.ins_status() : now.vpe_status(), ",S%04X", message);
  const std::array<std::uint32_t, 5> counts = {0, now.sync_in_count(), now.since_sync_in_us(), now.sync_out_count(),
                                               now.since_pulse_us()};
  const auto mode = static_cast<std::size_t>(count_mode);
  if (mode == 0) return;
  std::array<char, 16> text;
  std::snprintf(text.data(), text.size(), ",T%u", mode < counts.size() ? counts[mode] : 0U);
  message.put(text.data());
}

}  // namespace imud::vectornav
