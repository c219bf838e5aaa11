#include "protocols/dronecan/allocation.hpp"

#include <algorithm>
#include <boost/crc.hpp>

namespace imud::dronecan {

namespace {

using namespace std::chrono_literals;

constexpr std::size_t longest_part = 6;  // bytes of the unique id in a request

std::uint32_t hash(const UniqueId& unique_id) noexcept {
  boost::crc_32_type crc;
  crc.process_bytes(unique_id.data(), unique_id.size());
  return crc.checksum();
}

}  // namespace

unsigned discriminator_of(const UniqueId& unique_id) noexcept { return hash(unique_id) & 0x3FFFU; }

Allocation::Allocation(const UniqueId& unique_id) noexcept : unique_id_(unique_id), random_(hash(unique_id)) {}

Nanoseconds Allocation::random(Nanoseconds shortest, Nanoseconds longest) noexcept {
  return shortest + Nanoseconds(random_() % static_cast<std::uint64_t>((longest - shortest).count() + 1));
}

void Allocation::wait(DeviceTime now) noexcept {
  if (!request_) return;
  request_ = now + random(600ms, 1000ms);
  follow_up_.reset();
}

void Allocation::start(DeviceTime now) noexcept {
  request_ = now;
  wait(now);
}

std::optional<DeviceTime> Allocation::deadline() const noexcept {
  return request_ && follow_up_ ? std::min(request_, follow_up_) : request_;
}

Payload Allocation::poll(DeviceTime now) noexcept {
  const std::size_t begin = follow_up_ && *follow_up_ <= now ? known_ : 0;
  wait(now);
  Payload request;
  request.put_byte(begin == 0 ? 1 : 0);  // node id, 7 bits: any; whether this is the first part
  for (std::size_t i = begin; i < std::min(begin + longest_part, unique_id_.size()); ++i)
    request.put_byte(unique_id_[i]);
  return request;
}

std::optional<unsigned> Allocation::receive(std::span<const std::byte> message, DeviceTime now) noexcept {
  if (!request_) return std::nullopt;
  wait(now);
  if (message.size() < 2 || message.size() > 1 + unique_id_.size()) return std::nullopt;
  const std::span<const std::byte> part = message.subspan(1);
  if (!std::equal(part.begin(), part.end(), std::as_bytes(std::span(unique_id_)).begin())) return std::nullopt;
  if (part.size() < unique_id_.size()) {
    known_ = part.size();
    follow_up_ = now + random(1us, 400ms);
    return std::nullopt;
  }
  const unsigned node_id = std::to_integer<unsigned>(message[0]) >> 1;
  return node_id != anonymous ? std::optional(node_id) : std::nullopt;
}

void Allocation::step_clock(Nanoseconds by) noexcept {
  if (request_) *request_ = *request_ + by;
  if (follow_up_) *follow_up_ = *follow_up_ + by;
}

}  // namespace imud::dronecan
