#include "protocols/canopen/emergency.hpp"

namespace imud::canopen {
namespace {

// Error codes (CiA 301, table 26), and bits of the error register, whose bit 0 is set with every error. Range errors
// have the manufacturer's codes.
struct Kind {
  std::uint16_t code;
  std::uint8_t bit;
};
constexpr std::uint8_t generic = 0x01, communication = 0x10, manufacturer = 0x80;
constexpr std::array<Kind, static_cast<std::size_t>(Error::count)> kinds = {{{0xFF01, manufacturer},
                                                                             {0xFF02, manufacturer},
                                                                             {0x5000, manufacturer},
                                                                             {0x8130, communication},
                                                                             {0x8130, communication},
                                                                             {0x8100, communication},
                                                                             {0x8240, communication}}};

}  // namespace

void Emergencies::reset() noexcept {
  errors_ = {};
  inhibited_until_.reset();
  alarms_.clear(Alarm::emergency);
}

void Emergencies::set(Error error, bool exists, std::uint32_t detail) noexcept {
  One& one = errors_[static_cast<std::size_t>(error)];
  if (exists && !one.exists) {
    one.has_begun = true;
    one.detail = detail;
  }
  one.exists = exists;
}

void Emergencies::set_for_once(Error error) noexcept {
  set(error, true);
  set(error, false);
}

void Emergencies::report(bool may_send, DeviceTime now, FrameBuffer& out) noexcept {
  may_send = may_send && (dictionary_.u32(at(0x1014)) & bit_31) == 0;
  const Nanoseconds inhibit = static_cast<std::int64_t>(dictionary_[at(0x1015)]) * inhibit_unit;
  for (std::size_t i = 0; i < errors_.size();) {
    One& one = errors_[i];
    const auto error = static_cast<Error>(i);
    if (one.is_reported) one.has_begun = false;  // an error that has ended and begun again counts as going on
    const bool ends = one.is_reported && !one.exists;
    if (!one.has_begun && !ends) {
      ++i;
      continue;
    }
    if (may_send && inhibited_until_ && now < *inhibited_until_) {
      alarms_.set(Alarm::emergency, *inhibited_until_);
      return;
    }
    if (one.has_begun) record(error, one);
    if (may_send) {
      transmit(error, one, out);
      inhibited_until_ = now + inhibit;
    }
    one.is_reported = one.has_begun;
    one.has_begun = false;
  }
}

void Emergencies::record(Error error, const One& one) noexcept {
  std::copy_backward(history_.begin(), history_.end() - 1, history_.end());
  history_[0] = kinds[static_cast<std::size_t>(error)].code | one.detail << 16;
  history_size_ = std::min(history_size_ + 1, history_.size());
}

void Emergencies::transmit(Error error, const One& one, FrameBuffer& out) const noexcept {
  std::array<std::byte, 8> message = {};
  const std::span all(message);
  write_little(one.has_begun ? kinds[static_cast<std::size_t>(error)].code : 0U, all.first<2>());
  message[2] = static_cast<std::byte>(error_register());
  message[3] = static_cast<std::byte>(error);
  write_little(one.detail, all.last<4>());
  send(dictionary_.u32(at(0x1014)) & can_id_bits, all, out);
}

std::uint8_t Emergencies::error_register() const noexcept {
  std::uint8_t bits = 0;
  for (std::size_t i = 0; i < errors_.size(); ++i)
    if (errors_[i].exists || errors_[i].has_begun) bits = static_cast<std::uint8_t>(bits | kinds[i].bit | generic);
  return bits;
}

}  // namespace imud::canopen
