#include "protocols/j1939/address.hpp"

namespace imud::j1939 {

void AddressClaim::power_on(std::uint8_t address, DeviceTime now) noexcept {
  taken_.reset();
  address_ = address;
  claim_at_ = now;
  ready_at_ = now + wait_;
}

void AddressClaim::claim(DeviceTime now, FrameBuffer& out) noexcept {
  send({.pgn = pgn::address_claimed, .source = address_}, name_.word(), out);
  claim_at_.reset();
  if (period_.count() > 0 && address_ != null_address) claim_at_ = now + period_;
}

bool AddressClaim::on_claim(const Message& claim_of_other, DeviceTime now, FrameBuffer& out) noexcept {
  const std::uint8_t source = claim_of_other.header.source;
  if (source >= null_address || claim_of_other.data.size() != 8) return false;
  on_other(source);
  if (source != address_) return false;
  // Two nodes must not have the same NAME. If they do, both move, as ACEINNA's firmware does.
  if (name_.word() < read_little(claim_of_other.data)) {
    claim(now, out);
    return false;
  }
  lose(now, out);
  return true;
}

void AddressClaim::lose(DeviceTime now, FrameBuffer& out) noexcept {
  const std::uint8_t lost = address_;
  address_ = null_address;
  if (name_.arbitrary_address) {
    constexpr unsigned size = pool_end - pool_begin;
    const unsigned next = lost >= pool_begin && lost < pool_end ? lost - pool_begin + 1U : 0U;
    for (unsigned i = 0; i < size && address_ == null_address; ++i) {
      const unsigned candidate = pool_begin + (next + i) % size;
      if (!taken_[candidate]) address_ = static_cast<std::uint8_t>(candidate);
    }
  }
  if (address_ != null_address) {
    claim(now, out);
    ready_at_ = now + wait_;
  } else {
    claim_at_.reset();  // no periodic claim
    on_request(now, out);
  }
}

void AddressClaim::on_request(DeviceTime now, FrameBuffer& out) noexcept {
  if (address_ != null_address) {
    claim(now, out);
  } else if (!claim_at_) {
    // All nodes without an address send with the same identifier. A delay of 0 to 153 ms, which depends on the NAME,
    // keeps their frames apart.
    claim_at_ = now + (1 + (name_.identity & 0xFFU)) * std::chrono::microseconds(600);
  }
}

void AddressClaim::command(std::uint8_t address, DeviceTime now, FrameBuffer& out) noexcept {
  if (address == address_) return;
  address_ = address;
  claim(now, out);
  ready_at_ = now + wait_;
}

void AddressClaim::poll(DeviceTime now, FrameBuffer& out) noexcept {
  if (claim_at_ && *claim_at_ <= now) claim(now, out);
}

void AddressClaim::step_clock(Nanoseconds by) noexcept {
  ready_at_ = ready_at_ + by;
  if (claim_at_) claim_at_ = *claim_at_ + by;
}

}  // namespace imud::j1939
