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

void Allocation::start(DeviceTime now) noexcept {
  timers_.clear();
  timers_.set(Timer::request, now + random(600ms, 1000ms));
}

void Allocation::wait(DeviceTime now) noexcept {
  if (timers_[Timer::request]) start(now);
}

Payload Allocation::poll(DeviceTime now) noexcept {
  const auto due = timers_.take(now);
  const std::size_t begin = due && due->reason == Timer::follow_up ? known_ : 0;
  start(now);
  Payload request;
  request.put_byte(begin == 0 ? 1 : 0);  // node id, 7 bits: any; whether this is the first part
  for (std::size_t i = begin; i < std::min(begin + longest_part, unique_id_.size()); ++i)
    request.put_byte(unique_id_[i]);
  return request;
}

std::optional<unsigned> Allocation::receive(std::span<const std::byte> message, DeviceTime now) noexcept {
  if (!timers_[Timer::request]) return std::nullopt;
  wait(now);
  if (message.size() < 2 || message.size() > 1 + unique_id_.size()) return std::nullopt;
  const std::span<const std::byte> part = message.subspan(1);
  if (!std::equal(part.begin(), part.end(), std::as_bytes(std::span(unique_id_)).begin())) return std::nullopt;
  if (part.size() < unique_id_.size()) {
    known_ = part.size();
    timers_.set(Timer::follow_up, now + random(1us, 400ms));
    return std::nullopt;
  }
  const unsigned node_id = std::to_integer<unsigned>(message[0]) >> 1;
  return node_id != anonymous ? std::optional(node_id) : std::nullopt;
}

}  // namespace imud::dronecan
