// The text messages of NASA's 42, by TCP or as datagrams: lines from "TIME yyyy-ddd-hh:mm:ss.s" to "[ENDMSG]".
//
//   SC[i].qn = [q1 q2 q3 q4]  attitude of body 0 relative to N, scalar last: v_N = q v_B, by products of quaternions
//   SC[i].wn                  its rate relative to N, in B, rad/s
//   SC[i].PosR, SC[i].VelR    the centre of mass relative to its reference orbit, in N, m and m/s
//   Orb[k].PosN, Orb[k].VelN  the reference orbit, m and m/s; vehicle i has Orb[i], or the only orbit
//   SC[i].bvb                 magnetic field in B, T
//   SC[i].Accel[k].TrueAcc    (fork nasa-itc/42) specific force, m/s^2; used if 0, 1 and 2 are there, as x, y and z
//
// qn and wn are required; other lines are not used. The truth of vehicle i has the stream i. Time is counted from the
// first message of a connection. N is inertial; if positions are given, its origin is the centre of the Earth. If a
// message lacks exactly one line that the message before had, it is refused, because the name of this line is
// probably damaged. The next message may lack the same line.
//
// Without TrueAcc the specific force is 0, as in free fall without thrust and drag. It must not be derived from the
// positions: 42's orbit moves in steps of 2^-23 s, so that positions at 100 Hz, differentiated twice, are wrong by
// 9 m/s^2.
//
// After each message on TCP, 42 waits for "Ack" and a zero byte. This answer is sent when the samples have been sent,
// or at once if a message has no truth.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "protocols/quantities/columns.hpp"
#include "protocols/quantities/line_truth_decoder.hpp"
#include "protocols/quantities/remark_writer.hpp"
#include "protocols/quantities/truth_quantities.hpp"

namespace imud {
namespace {

constexpr std::size_t most_indices = 16;  // vehicles, and orbits; others are not used
constexpr std::array<char, 4> ack = {'A', 'c', 'k', '\0'};

// A vector of a message.
template <std::size_t Size>
struct Numbers {
  std::array<double, Size> values = {};
  bool is_given = false;

  Vector3 vector() const noexcept { return {values[0], values[1], values[2]}; }
};

struct Vehicle {
  Numbers<4> qn;
  Numbers<3> wn, position, velocity, magnetic_field;
  std::array<Numbers<1>, 3> acceleration;
};
struct Orbit {
  Numbers<3> position, velocity;
};

// The lines that a message has, as bits for each vehicle and for each orbit.
struct Lines {
  std::array<std::uint8_t, most_indices> vehicles = {}, orbits = {};
};
constexpr std::string_view vehicle_lines[] = {
    "qn", "wn", "PosR", "VelR", "bvb", "Accel[0].TrueAcc", "Accel[1].TrueAcc", "Accel[2].TrueAcc"};
constexpr std::string_view orbit_lines[] = {"PosN", "VelN"};

// Removes `head` from the begin of `text`. Returns false if the text does not begin with `head`.
bool take_text(std::string_view& text, std::string_view head) noexcept {
  if (!text.starts_with(head)) return false;
  text.remove_prefix(head.size());
  return true;
}

// Removes an index and "]." from the begin of `text`. Returns most_indices if the text does not begin so, or if the
// index is too large.
std::size_t take_index(std::string_view& text) noexcept {
  const std::size_t end = text.find(']');
  const auto index = parse_integer(text.substr(0, end));
  if (end == text.npos || !index || *index < 0 || *index >= static_cast<std::int64_t>(most_indices))
    return most_indices;
  text.remove_prefix(end + 1);
  return take_text(text, ".") ? static_cast<std::size_t>(*index) : most_indices;
}

class Nasa42Decoder final : public LineTruthDecoder {
 public:
  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept override {
    is_stream_ = input == TruthInput::stream;
    arrival_ = arrival;
    LineTruthDecoder::feed(bytes, input, arrival);
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    while (next_vehicle_ < most_indices)
      if (const auto result = convert(next_vehicle_++, truth)) return result;
    return LineTruthDecoder::next(truth);
  }
  void finish() noexcept override {
    const std::uint64_t before = losses_.cut_short;
    LineTruthDecoder::finish();
    if (lines_ > 0) {
      if (losses_.cut_short == before) losses_.cut_short_by = 0;
      losses_.cut_short = before + 1;
      losses_.cut_short_lines = lines_;
    }
    begin_message();
    had_ = {};
    origin_ns_.reset();
    owed_ = false;
  }
  std::optional<HostTime> deadline() const noexcept override {
    return owed_ ? std::optional(arrival_) : std::nullopt;
  }
  void poll(HostTime, FrameBuffer& out) noexcept override {
    if (std::exchange(owed_, false)) out.append(std::as_bytes(std::span(ack)));
  }
  void acknowledge(const Truth&, TruthTime, std::uint64_t, FrameBuffer& out) noexcept override {
    out.append(std::as_bytes(std::span(ack)));
  }

  TruthFrame frame() const noexcept override { return {.kind = TruthFrame::Kind::inertial}; }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    switch (result) {
      case TruthResult::not_this_kind:
        (out << "no line of 42: ").quote(line_);
        break;
      case TruthResult::bad_number:
        (out << "a line whose numbers are none, too many or too few: ").quote(line_);
        break;
      case TruthResult::too_short:
        if (lost_lines_ > 0) {
          out << "a message ended after " << lost_lines_ << " lines without [ENDMSG]; the next began with ";
          out.quote(line_, 64);
          break;
        }
        if (!lacking_.empty()) {
          out << "a message lacks " << lacking_of_ << "[" << lacking_index_ << "]." << lacking_
              << ", which the one before had";
          break;
        }
        out << "a message lacks TIME, or for each vehicle qn or wn; enable them in 42's Inp_IPC.txt by the prefix "
               "\"SC\"";
        break;
      case TruthResult::not_finite:
      case TruthResult::out_of_range:
        out << "vehicle " << next_vehicle_ - 1
            << " has a number that is not finite, or too large, or qn is no rotation";
        break;
      default:
        break;
    }
    return out.size();
  }

 private:
  void begin_message() noexcept {
    vehicles_ = {};
    orbits_ = {};
    orbit_count_ = 0;
    has_time_ = is_bad_ = false;
    lines_ = 0;
    next_vehicle_ = most_indices;
  }

  TruthResult decode(std::string_view line, Truth& truth) noexcept override {
    line_ = trim(line);
    std::string_view text = line_;
    lost_lines_ = 0;
    lacking_ = {};
    if (text.empty()) return TruthResult::no_state;
    if (text == "[ENDMSG]") return end_message(truth);
    bool is_read = true;
    if (take_text(text, "TIME ")) {
      lost_lines_ = is_bad_ ? 0 : lines_;
      begin_message();
      lines_ = 1;
      has_time_ = is_read = time_.set(utc_, text) == TruthResult::ok;
    } else if (lines_ += lines_ > 0 ? 1 : 0; take_text(text, "SC[")) {
      is_read = read_vehicle(text);
    } else if (take_text(text, "Orb[")) {
      is_read = read_orbit(text);
    } else if (text.find('=') == text.npos && text.front() != '[') {
      return TruthResult::not_this_kind;
    }
    is_bad_ = is_bad_ || !is_read;
    if (lost_lines_ > 0 && is_read) return TruthResult::too_short;
    return is_read ? TruthResult::no_state : TruthResult::bad_number;
  }

  // Ends a message. If a line was refused, this was counted already.
  TruthResult end_message(Truth& truth) noexcept {
    lines_ = 0;
    const bool is_bad = std::exchange(is_bad_, false), has_time = std::exchange(has_time_, false);
    std::size_t first = most_indices;
    bool any_truth = false;
    if (has_time && !is_bad && lacks_a_line()) {
      owed_ = is_stream_;
      return TruthResult::too_short;
    }
    if (has_time && !is_bad) {
      if (!origin_ns_) origin_ns_ = time_.time_ns();
      for (std::size_t i = most_indices; i-- > 0;)
        if (const auto result = convert(i, truth)) {
          first = i;
          any_truth = any_truth || result == TruthResult::ok;
        }
    }
    owed_ = is_stream_ && !any_truth;
    if (first == most_indices) return is_bad ? TruthResult::no_state : TruthResult::too_short;
    next_vehicle_ = first + 1;
    return *convert(first, truth);
  }

  Lines lines() const noexcept {
    Lines all;
    for (std::size_t i = 0; i < most_indices; ++i) {
      const Vehicle& v = vehicles_[i];
      const bool of_vehicle[] = {v.qn.is_given,
                                 v.wn.is_given,
                                 v.position.is_given,
                                 v.velocity.is_given,
                                 v.magnetic_field.is_given,
                                 v.acceleration[0].is_given,
                                 v.acceleration[1].is_given,
                                 v.acceleration[2].is_given};
      const bool of_orbit[] = {orbits_[i].position.is_given, orbits_[i].velocity.is_given};
      all.vehicles[i] = bits(of_vehicle);
      all.orbits[i] = bits(of_orbit);
    }
    return all;
  }
  static std::uint8_t bits(std::span<const bool> given) noexcept {
    unsigned all = 0;
    for (std::size_t i = 0; i < given.size(); ++i) all |= given[i] ? 1U << i : 0U;
    return static_cast<std::uint8_t>(all);
  }

  // Returns whether the message lacks exactly one line that the message before had. Sets the name of this line.
  bool lacks_a_line() noexcept {
    const Lines has = lines(), had = std::exchange(had_, has);
    std::size_t count = 0;
    const auto compare = [&](std::size_t index, unsigned missing, std::string_view of,
                             std::span<const std::string_view> names) {
      for (std::size_t i = 0; i < names.size(); ++i) {
        if ((missing >> i & 1U) == 0) continue;
        ++count;
        lacking_ = names[i];
        lacking_of_ = of;
        lacking_index_ = index;
      }
    };
    for (std::size_t i = 0; i < most_indices; ++i) {
      compare(i, had.vehicles[i] & ~unsigned{has.vehicles[i]}, "SC", vehicle_lines);
      compare(i, had.orbits[i] & ~unsigned{has.orbits[i]}, "Orb", orbit_lines);
    }
    if (count != 1) lacking_ = {};
    return count == 1;
  }

  // Reads "name = [numbers]". Returns false if the number of numbers is wrong.
  template <std::size_t Size>
  static bool read(std::string_view text, Numbers<Size>& numbers) noexcept {
    text = trim(text.substr(std::min(text.find('='), text.size() - 1) + 1));
    if (Size > 1) {
      if (!take_text(text, "[") || !text.ends_with(']')) return false;
      text.remove_suffix(1);
    }
    for (double& value : numbers.values) {
      text = trim(text);
      const std::size_t end = text.find_first_of(" \t");
      const auto number = parse_real(text.substr(0, end));
      if (!number) return false;
      value = *number;
      text.remove_prefix(std::min(end, text.size()));
    }
    numbers.is_given = trim(text).empty();
    return numbers.is_given;
  }

  bool read_vehicle(std::string_view text) noexcept {
    const std::size_t index = take_index(text);
    if (index == most_indices) return true;
    Vehicle& vehicle = vehicles_[index];
    if (text.starts_with("qn ")) return read(text, vehicle.qn);
    if (text.starts_with("wn ")) return read(text, vehicle.wn);
    if (text.starts_with("PosR ")) return read(text, vehicle.position);
    if (text.starts_with("VelR ")) return read(text, vehicle.velocity);
    if (text.starts_with("bvb ")) return read(text, vehicle.magnetic_field);
    if (!take_text(text, "Accel[")) return true;
    const std::size_t axis = take_index(text);
    return axis >= vehicle.acceleration.size() || !text.starts_with("TrueAcc ") ||
           read(text, vehicle.acceleration[axis]);
  }

  bool read_orbit(std::string_view text) noexcept {
    const std::size_t index = take_index(text);
    if (index == most_indices) return true;
    orbit_count_ = std::max(orbit_count_, index + 1);
    if (text.starts_with("PosN ")) return read(text, orbits_[index].position);
    return !text.starts_with("VelN ") || read(text, orbits_[index].velocity);
  }

  // Returns nullopt if the message does not have this vehicle.
  std::optional<TruthResult> convert(std::size_t index, Truth& truth) const noexcept {
    const Vehicle& vehicle = vehicles_[index];
    if (!vehicle.qn.is_given || !vehicle.wn.is_given) return std::nullopt;
    constexpr double largest_defect = 0.02;  // of the quaternion's squared length
    truth = {};
    truth.stream = static_cast<std::uint32_t>(index);
    truth.acknowledge = is_stream_;
    if (__builtin_sub_overflow(time_.time_ns(), origin_ns_.value_or(0), &truth.time.ns))
      return TruthResult::out_of_range;
    const auto& q = vehicle.qn.values;
    truth.q_NB = Quaternion(q[3], q[0], q[1], q[2]);
    const double length = truth.q_NB.squaredNorm();
    if (!std::isfinite(length)) return TruthResult::not_finite;
    if (std::abs(length - 1.0) > largest_defect) return TruthResult::out_of_range;
    truth.q_NB.normalize();
    truth.omega_BN_B = vehicle.wn.vector();
    const Orbit& orbit = orbits_[orbit_count_ == 1 ? 0 : index];
    truth.has_position = vehicle.position.is_given && orbit.position.is_given;
    if (truth.has_position) truth.r_BN_N = orbit.position.vector() + vehicle.position.vector();
    truth.has_velocity = vehicle.velocity.is_given && orbit.velocity.is_given;
    if (truth.has_velocity) truth.v_BN_N = orbit.velocity.vector() + vehicle.velocity.vector();
    truth.has_magnetic_field = vehicle.magnetic_field.is_given;
    if (truth.has_magnetic_field) truth.magnetic_field_B = vehicle.magnetic_field.vector();
    truth.has_specific_force = true;
    const auto& [x, y, z] = vehicle.acceleration;
    if (x.is_given && y.is_given && z.is_given) truth.specific_force_B = {x.values[0], y.values[0], z.values[0]};
    if (!is_finite(truth)) return TruthResult::not_finite;
    return is_in_range(truth) ? TruthResult::ok : TruthResult::out_of_range;
  }

  const TruthField utc_ = find_truth_field("utc").value();
  std::array<Vehicle, most_indices> vehicles_ = {};
  std::array<Orbit, most_indices> orbits_ = {};
  std::size_t orbit_count_ = 0;  // the largest index, plus 1
  TruthReading time_;
  Lines had_;                              // of the message before
  std::string_view lacking_, lacking_of_;  // the line that this message lacks
  std::size_t lacking_index_ = 0;
  bool has_time_ = false, is_bad_ = false;
  std::size_t lines_ = 0;       // of the message so far
  std::size_t lost_lines_ = 0;  // of the message before, which did not end
  std::size_t next_vehicle_ = most_indices;
  std::optional<std::int64_t> origin_ns_;
  std::string_view line_;
  bool is_stream_ = false;
  bool owed_ = false;  // an acknowledgement of a message without truth
  HostTime arrival_;
};

}  // namespace

extern constexpr TruthFormat nasa_42_truth_format = {
    .name = "42",
    .summary = "text messages of NASA's 42: attitude, rate and orbit of each spacecraft; Ack on TCP",
    .document = "42, commit 11e3cc3, Source/AutoCode/TxRxIPC.c",
    .delimits_itself = true,
    .acknowledges = true,
    .make = [](const Settings&) -> std::unique_ptr<TruthDecoder> { return std::make_unique<Nasa42Decoder>(); },
    .force_from = "SC[i].Accel[0].TrueAcc to SC[i].Accel[2].TrueAcc",
    .way = TruthFormat::Way::connection,
    .example_port = "127.0.0.1:10001",
};

}  // namespace imud
