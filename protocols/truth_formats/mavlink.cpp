// MAVLink 1 and 2: the state of a simulator as HIL_STATE_QUATERNION (115), HIL_STATE (90), or SIM_STATE (108) with
// the time of the SYSTEM_TIME (2) before it. All other messages are ignored, and signatures are not verified.
//
// | version | frame                                                                                               |
// |---------|-----------------------------------------------------------------------------------------------------|
// | 1       | FE, length, sequence, system, component, id, payload, CRC                                           |
// | 2       | FD, length, incompatible and compatible flags, sequence, system, component, id (3 bytes), payload   |
// |         | without its last zeros, CRC, signature of 13 bytes if flag 1 is set                                 |
//
// The CRC is CRC-16/MCRF4XX of all bytes but the first, followed by CRC_EXTRA, a byte that is computed from the
// message's definition. CRC_EXTRA is not known for messages that are not used here. Such a message is accepted if
// another message or nothing follows it, and if its CRC is wrong for each id that is used.
//
// Attitude and rates are of front-right-down. The rate counts as relative to the Earth; the Earth's rate is added.
// time_usec is the time since boot, or since 1970; in the second case, time is counted from the first message.
// HIL_STATE_QUATERNION and HIL_STATE have a resolution of 1 mg, 1 cm/s, 1 mm and 1e-7 degree. The setting
// `acceleration` states whether their acceleration is specific force (as PX4 reads it) or the derivative of velocity.
//
// imud sends no heartbeat. As far as is known, PX4 and ArduPilot need none to send these messages to a configured
// address.
//
// Sources: mavlink.io, "Packet Serialization"; message_definitions/v1.0/common.xml.
#include <algorithm>
#include <array>
#include <boost/crc.hpp>
#include <cstring>
#include <string>

#include "protocols/quantities/packed_truth.hpp"
#include "protocols/wire/record_search.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

constexpr std::string_view acceleration_choices[] = {"specific_force", "coordinate", "none"};
constexpr Setting settings[] = {
    text_setting("acceleration",
                 "meaning of xacc to zacc: specific force; the derivative of the velocity, from which gravity is "
                 "subtracted; or not used",
                 "specific_force", acceleration_choices),
};

// The payloads in the order of the wire. The time is read separately.
constexpr std::string_view hil_state_quaternion[] = {
    "_:8",
    "q_LB_{w,x,y,z}:f32",
    "{p,q,r}_BE_rad_per_s:f32",
    "{latitude,longitude}_deg_e7:i32",
    "height_mm:i32",
    "v_{north,east,down}_cm_per_s:i16",
    "_:4",  // airspeeds
    "specific_force_{x,y,z}_mg:i16",
};
constexpr std::string_view hil_state[] = {
    "_:8",
    "{roll,pitch,yaw}_rad:f32",
    "{p,q,r}_BE_rad_per_s:f32",
    "{latitude,longitude}_deg_e7:i32",
    "height_mm:i32",
    "v_{north,east,down}_cm_per_s:i16",
    "specific_force_{x,y,z}_mg:i16",
};
// lat and lon, float32 degrees, are not used if the message has the extension lat_int and lon_int.
constexpr std::string_view sim_state_place = "{latitude,longitude}_deg:f32";
constexpr std::string_view sim_state[] = {
    "q_LB_{w,x,y,z}:f32",
    "_:12",  // Euler angles
    "specific_force_{x,y,z}_m_per_s2:f32",
    "{p,q,r}_BE_rad_per_s:f32",
    sim_state_place,
    "height_m:f32",
    "_:8",  // standard deviations
    "v_{north,east,down}_m_per_s:f32",
};
constexpr std::string_view sim_state_extension = "{latitude,longitude}_deg_e7:i32";

enum Id : std::uint32_t { system_time_id = 2, hil_state_id = 90, sim_state_id = 108, hil_state_quaternion_id = 115 };
struct Message {
  Id id;
  std::uint8_t crc_extra;
  std::uint8_t size, extended_size;  // bytes of the payload: of version 1, and with extensions
};
constexpr Message messages[] = {{system_time_id, 137, 12, 12},
                                {hil_state_id, 183, 56, 56},
                                {sim_state_id, 32, 84, 92},
                                {hil_state_quaternion_id, 4, 64, 64}};

constexpr std::byte first_1{0xFE}, first_2{0xFD};
constexpr std::size_t header_1 = 6, header_2 = 10, crc_size = 2, signature_size = 13, most_payload = 255;
constexpr std::size_t longest = header_2 + most_payload + crc_size + signature_size;
constexpr unsigned signed_flag = 1;

std::uint16_t crc_of(std::span<const std::byte> bytes, std::uint8_t extra) {
  boost::crc_optimal<16, 0x1021, 0xFFFF, 0, true, true> crc;  // CRC-16/MCRF4XX
  crc.process_bytes(bytes.data(), bytes.size());
  crc.process_byte(extra);
  return static_cast<std::uint16_t>(crc.checksum());
}

PackedTruth make_truth(std::vector<std::string_view> fields, const std::string& acceleration) {
  constexpr std::string_view force = "specific_force";
  const auto found = std::ranges::find_if(fields, [&](std::string_view field) { return field.starts_with(force); });
  const std::string relative_to_earth = "acceleration" + std::string(found->substr(force.size()));
  if (acceleration == acceleration_choices[1]) *found = relative_to_earth;
  if (acceleration == acceleration_choices[2]) *found = found->ends_with("i16") ? "_:6" : "_:12";
  return {PackedLayout(fields, boost::endian::order::little), {}, false};
}

class MavlinkTruthDecoder final : public TruthDecoder {
 public:
  explicit MavlinkTruthDecoder(const std::string& acceleration)
      : quaternion_(make_truth({std::begin(hil_state_quaternion), std::end(hil_state_quaternion)}, acceleration)),
        euler_(make_truth({std::begin(hil_state), std::end(hil_state)}, acceleration)),
        sim_(make_truth({std::begin(sim_state), std::end(sim_state)}, acceleration)),
        sim_extended_(make_truth(extended(), acceleration)) {}

  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime) noexcept override {
    is_datagram_ = input == TruthInput::datagram;
    if (is_datagram_) search_.finish();
    is_silent_ = is_datagram_;
    search_.feed(bytes);
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    refused_ = nullptr;
    const auto found = search_.next([this](std::span<const std::byte> held) { return parse(held); });
    if (!found && !std::exchange(is_silent_, false)) return std::nullopt;
    is_silent_ = false;
    if (!found) return verdict_ = TruthResult::too_short;
    return found->empty() ? verdict_ : decode(*found, truth);
  }
  void finish() noexcept override {
    if (const std::size_t size = search_.finish(); size > 0) {
      ++losses_.cut_short;
      losses_.cut_short_by = size;
    }
  }
  TruthFrame frame() const noexcept override { return quaternion_.frame(); }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    if (refused_ != nullptr)
      refused_->describe(out);
    else if (result == TruthResult::out_of_range)
      out << "SIM_STATE has no time: send SYSTEM_TIME before each, and HIL_STATE_QUATERNION in its place if you can";
    else if (result == TruthResult::too_short)
      out << "a frame is longer than the datagram";
    else if (result == TruthResult::not_this_kind)
      out << "these bytes are no MAVLink frame, which begins with FE or FD";
    else if (result == TruthResult::bad_checksum)
      out << "the CRC of message " << bad_id_ << " is wrong: noise, or another definition of the message";
    return out.size();
  }

 private:
  static std::vector<std::string_view> extended() {
    std::vector<std::string_view> fields(std::begin(sim_state), std::end(sim_state));
    *std::ranges::find(fields, sim_state_place) = "_:8";
    fields.push_back(sim_state_extension);
    return fields;
  }
  static std::size_t header_of(std::span<const std::byte> frame) noexcept {
    return frame[0] == first_2 ? header_2 : header_1;
  }
  static std::uint32_t id_of(std::span<const std::byte> frame) noexcept {
    return static_cast<std::uint32_t>(frame[0] == first_2 ? read_little(frame.subspan(7, 3))
                                                          : read_little(frame.subspan(5, 1)));
  }
  static const Message* message_of(std::uint32_t id) noexcept {
    for (const Message& message : messages)
      if (message.id == id) return &message;
    return nullptr;
  }

  // Returns the message with whose id the CRC of the frame would be right; nullptr if there is none. `frame`: has an
  // unknown id, which may be damaged.
  static const Message* message_with_damaged_id(std::span<const std::byte> frame) noexcept {
    const bool is_2 = frame[0] == first_2;
    const std::size_t id_at = is_2 ? 7 : 5, header = header_of(frame),
                      length = std::to_integer<std::size_t>(frame[1]);
    std::array<std::byte, longest> copy;
    const std::span<std::byte> checked = std::span(copy).first(header + length);
    std::memcpy(checked.data(), frame.data(), checked.size());
    for (const Message& message : messages) {
      write_little(message.id, checked.subspan(id_at, header - id_at));
      if (crc_of(checked.subspan(1), message.crc_extra) == read_little(frame.subspan(header + length, crc_size)))
        return &message;
    }
    return nullptr;
  }

  std::size_t refuse(TruthResult verdict) noexcept {
    verdict_ = verdict;
    return RecordSearch::reject;
  }
  // A datagram has no more bytes to come.
  std::size_t incomplete() noexcept {
    return is_datagram_ && search_.sees_all() ? refuse(TruthResult::too_short) : RecordSearch::need_more;
  }
  std::size_t parse(std::span<const std::byte> held) noexcept {
    if (held[0] != first_1 && held[0] != first_2) return refuse(TruthResult::not_this_kind);
    const std::size_t header = header_of(held);
    if (held.size() < header) return incomplete();
    const auto length = std::to_integer<std::size_t>(held[1]);
    const unsigned flags = header == header_2 ? std::to_integer<unsigned>(held[2]) : 0U;
    if ((flags & ~signed_flag) != 0) return refuse(TruthResult::not_this_kind);
    const std::size_t size = header + length + crc_size + (flags == signed_flag ? signature_size : 0);
    const std::uint32_t id = id_of(held);
    const Message* message = message_of(id);
    if (message != nullptr && (header == header_1 ? length != message->size : length > message->extended_size))
      return refuse(TruthResult::not_this_kind);
    if (held.size() < size) return incomplete();
    if (message == nullptr) {
      if (const Message* meant = message_with_damaged_id(held.first(size))) {
        bad_id_ = meant->id;
        return refuse(TruthResult::bad_checksum);
      }
      if (held.size() == size) return is_datagram_ && search_.sees_all() ? size : RecordSearch::need_more;
      if (held[size] != first_1 && held[size] != first_2) return refuse(TruthResult::not_this_kind);
    } else if (read_little(held.subspan(header + length, crc_size)) !=
               crc_of(held.subspan(1, header - 1 + length), message->crc_extra)) {
      bad_id_ = id;
      return refuse(TruthResult::bad_checksum);
    }
    return size;
  }

  TruthResult decode(std::span<const std::byte> frame, Truth& truth) noexcept {
    const Message* message = message_of(id_of(frame));
    if (message == nullptr) return TruthResult::no_state;
    const std::size_t header = header_of(frame);
    const std::span<const std::byte> given = frame.subspan(header, std::to_integer<std::size_t>(frame[1]));
    std::array<std::byte, most_payload> payload = {};
    std::memcpy(payload.data(), given.data(), given.size());
    if (message->id == system_time_id) {
      constexpr std::int64_t ns_per_ms = 1'000'000;
      const auto boot_ms = static_cast<std::int64_t>(read_little(std::span(payload).subspan(8, 4)));
      sim_time_ns_ = boot_time_.of(boot_ms * ns_per_ms);
      return TruthResult::no_state;
    }
    if (message->id == sim_state_id) {
      if (!sim_time_ns_) return TruthResult::out_of_range;
      const bool is_extended = read_little(std::span(payload).subspan(84, 8)) != 0;
      return convert(is_extended ? sim_extended_ : sim_, payload, *std::exchange(sim_time_ns_, std::nullopt), frame,
                     truth);
    }
    // A time in this millennium counts as a time since 1970.
    constexpr std::uint64_t year_2001_us = 978'307'200'000'000,
                            latest_us = static_cast<std::uint64_t>(truth_limit::time_ns / 1e3);
    constexpr std::int64_t ns_per_us = 1000;
    const std::uint64_t time_us = read_little(std::span(payload).first(8));
    if (!origin_us_) origin_us_ = time_us >= year_2001_us ? time_us : 0;
    const std::int64_t ns = static_cast<std::int64_t>(std::min(time_us, latest_us)) -
                            static_cast<std::int64_t>(std::min(*origin_us_, latest_us));
    return convert(message->id == hil_state_id ? euler_ : quaternion_, payload, ns * ns_per_us, frame, truth);
  }
  TruthResult convert(PackedTruth& packed, std::span<const std::byte> payload, std::int64_t ns,
                      std::span<const std::byte> frame, Truth& truth) noexcept {
    const TruthResult result = packed.convert_at(payload, ns, truth);
    truth.stream = std::to_integer<std::uint32_t>(frame[header_of(frame) == header_2 ? 5 : 3]);
    refused_ = result == TruthResult::ok ? nullptr : &packed;
    return result;
  }

  PackedTruth quaternion_, euler_, sim_, sim_extended_;
  RecordSearch search_{longest + 1};
  bool is_datagram_ = false;
  bool is_silent_ = false;  // no result of the present datagram was returned yet
  TruthResult verdict_ = TruthResult::ok;
  std::uint32_t bad_id_ = 0;
  const PackedTruth* refused_ = nullptr;
  std::optional<std::uint64_t> origin_us_;
  static constexpr std::int64_t boot_time_round = (std::int64_t{1} << 32) * 1'000'000;
  WrappingTime boot_time_{boot_time_round};
  std::optional<std::int64_t> sim_time_ns_;  // of a SYSTEM_TIME that no SIM_STATE has used
};

}  // namespace

extern constexpr TruthFormat mavlink_truth_format = {
    .name = "mavlink",
    .summary = "MAVLink 1 and 2: HIL_STATE_QUATERNION, HIL_STATE, and SIM_STATE with SYSTEM_TIME",
    .document = "mavlink.io, Packet Serialization; common.xml",
    .delimits_itself = true,
    .settings = settings,
    .make = [](const Settings& chosen) -> std::unique_ptr<TruthDecoder> {
      return std::make_unique<MavlinkTruthDecoder>(chosen.text("acceleration"));
    },
    .force_from = "xacc to zacc, which each message has: set acceleration = \"specific_force\" or \"coordinate\"",
};

}  // namespace imud
