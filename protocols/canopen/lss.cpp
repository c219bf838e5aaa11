#include "protocols/canopen/lss.hpp"

namespace imud::canopen {
namespace {

// Command specifiers (CiA 305, 6).
enum Command : unsigned {
  switch_global = 0x04,
  configure_node_id = 0x11,
  configure_bit_rate = 0x13,
  store_configuration = 0x17,
  switch_selective = 0x40,  // to 0x43: a number of the identity each
  switched = 0x44,
  identify_first = 0x46,  // vendor, product, revision from, to, serial number from, to
  identify_last = 0x4B,
  identify_unconfigured = 0x4C,
  identified = 0x4F,
  unconfigured_identified = 0x50,
  fastscan = 0x51,
  inquire_identity = 0x5A,  // to 0x5D: a number of the identity each
  inquire_node_id = 0x5E
};

constexpr unsigned numbers = 4;
constexpr unsigned out_of_range = 1, not_supported = 1;

void answer(unsigned command, std::uint32_t value, FrameBuffer& out) noexcept {
  std::array<std::byte, 8> message = {static_cast<std::byte>(command)};
  write_little(value, std::span(message).subspan<1, 4>());
  send(lss_answer_id, message, out);
}

}  // namespace

void LssSlave::power_on() noexcept {
  pending_ = stored_;
  is_configuring_ = false;
  selected_ = identified_ = scanned_ = 0;
}

void LssSlave::receive(std::span<const std::byte, 8> message, unsigned node_id, FrameBuffer& out) noexcept {
  const auto command = std::to_integer<unsigned>(message[0]);
  const auto number = static_cast<std::uint32_t>(read_little(message.subspan<1, 4>()));
  if (command == switch_global) {
    is_configuring_ = message[1] == std::byte{1};
    selected_ = 0;
  } else if (command >= switch_selective && command < switch_selective + numbers) {
    const unsigned which = command - switch_selective;
    if (which == 0) selected_ = 0;
    selected_ = which == selected_ && number == identity_[which] ? selected_ + 1 : 0;
    if (selected_ < numbers || is_configuring_) return;
    selected_ = 0;
    is_configuring_ = true;
    answer(switched, 0, out);
  } else if (command >= identify_first && command <= identify_last) {
    identify(command, number, out);
  } else if (command == identify_unconfigured) {
    if (node_id == unconfigured && pending_.node_id == unconfigured) answer(unconfigured_identified, 0, out);
  } else if (command == fastscan) {
    if (node_id == unconfigured && !is_configuring_) scan(message, out);
  } else if (is_configuring_) {
    configure(command, message, node_id, out);
  }
}

void LssSlave::configure(unsigned command, std::span<const std::byte, 8> message, unsigned node_id,
                         FrameBuffer& out) noexcept {
  const auto first = std::to_integer<unsigned>(message[1]), second = std::to_integer<unsigned>(message[2]);
  switch (command) {
    case configure_node_id: {
      const bool is_valid = (first >= 1 && first <= last_node_id) || first == unconfigured;
      if (is_valid) pending_.node_id = first;
      return answer(command, is_valid ? 0 : out_of_range, out);
    }
    case configure_bit_rate: {
      constexpr unsigned last_rate = 8, reserved_rate = 5;
      const bool is_valid = first == 0 && second <= last_rate && second != reserved_rate;
      if (is_valid) pending_.bit_rate = second;
      return answer(command, is_valid ? 0 : not_supported, out);
    }
    case store_configuration:
      stored_ = pending_;
      return answer(command, 0, out);
    case inquire_node_id:
      return answer(command, node_id, out);
    default:
      if (command >= inquire_identity && command < inquire_identity + numbers)
        answer(command, identity_[command - inquire_identity], out);
  }
}

void LssSlave::identify(unsigned command, std::uint32_t number, FrameBuffer& out) noexcept {
  constexpr unsigned steps = identify_last - identify_first + 1;
  const unsigned step = command - identify_first;
  if (step == 0) identified_ = 0;
  const std::array<bool, steps> matches = {number == identity_[0], number == identity_[1], number <= identity_[2],
                                           number >= identity_[2], number <= identity_[3], number >= identity_[3]};
  identified_ = step == identified_ && matches[step] ? identified_ + 1 : 0;
  if (identified_ < steps) return;
  identified_ = 0;
  answer(identified, 0, out);
}

void LssSlave::scan(std::span<const std::byte, 8> message, FrameBuffer& out) noexcept {
  constexpr unsigned begin_scan = 0x80, bits = 32;
  const auto number = static_cast<std::uint32_t>(read_little(message.subspan<1, 4>()));
  const auto bit = std::to_integer<unsigned>(message[5]), which = std::to_integer<unsigned>(message[6]),
             next = std::to_integer<unsigned>(message[7]);
  if (bit == begin_scan) {
    scanned_ = 0;
    return answer(identified, 0, out);
  }
  if (bit >= bits || which >= numbers || next >= numbers || which != scanned_) return;
  if ((number ^ identity_[which]) >> bit != 0) return;
  answer(identified, 0, out);
  if (bit != 0) return;
  is_configuring_ = next < which;
  scanned_ = next;
}

}  // namespace imud::canopen
