#include "protocols/canopen/pdo.hpp"

#include <numeric>

namespace imud::canopen {
namespace {

constexpr std::size_t largest_payload = 8;
constexpr Nanoseconds timer_unit = std::chrono::milliseconds(1);

// Positions of the objects of PDO `i`.
constexpr std::size_t parameter(unsigned i, unsigned sub) noexcept {
  return find_object(static_cast<std::uint16_t>(0x1800 + i), static_cast<std::uint8_t>(sub));
}
constexpr std::size_t mapping(unsigned i, unsigned sub) noexcept {
  return find_object(static_cast<std::uint16_t>(0x1A00 + i), static_cast<std::uint8_t>(sub));
}

constexpr bool is_event_driven(unsigned type) noexcept { return type >= 254; }
constexpr unsigned at_sync_if_new = 0, last_cyclic = 240, remote_of_sync = 252;

}  // namespace

std::size_t mapped_object(std::uint32_t entry) noexcept {
  const std::size_t position =
      find_object(static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8));
  if (position == object_count || !objects[position].is_mappable) return object_count;
  return mapping_of(objects[position]) == entry ? position : object_count;
}

void TransmitPdos::start() noexcept {
  for (unsigned i = 0; i < tpdos; ++i) start(i);
}

void TransmitPdos::start(unsigned i) noexcept {
  Pdo& pdo = pdos_[i];
  pdo.increments = {};
  pdo.has_sample = false;
  pdo.next.reset();
  pdo.latched.reset();
  const bool awaits_counter = dictionary_[at(0x1019)] != 0 && dictionary_[parameter(i, 6)] != 0;
  pdo.syncs = awaits_counter ? 0 : pdo.type;
}

void TransmitPdos::update() noexcept {
  for (unsigned i = 0; i < tpdos; ++i) {
    Pdo& pdo = pdos_[i];
    const bool was_valid = pdo.is_valid();
    const unsigned type_before = pdo.type;
    const Nanoseconds timer_before = pdo.timer;
    pdo.inhibit = static_cast<std::int64_t>(dictionary_[parameter(i, 3)]) * inhibit_unit;
    pdo.timer = static_cast<std::int64_t>(dictionary_[parameter(i, 5)]) * timer_unit;
    pdo.cob_id = dictionary_.u32(parameter(i, 1));
    pdo.type = dictionary_.u32(parameter(i, 2));
    pdo.mapped_count = 0;
    pdo.size = 0;
    for (unsigned k = 1; k <= dictionary_[mapping(i, 0)]; ++k) {
      const std::size_t position = mapped_object(dictionary_.u32(mapping(i, k)));
      if (position == object_count) continue;
      pdo.mapped[pdo.mapped_count++] = static_cast<std::uint16_t>(position);
      pdo.size += size_of(objects[position].type);
    }
    if (pdo.is_valid() != was_valid || pdo.type != type_before || pdo.timer != timer_before) start(i);
  }
  std::iota(order_.begin(), order_.end(), std::uint8_t{0});
  std::sort(order_.begin(), order_.end(),
            [&](std::uint8_t a, std::uint8_t b) { return pdos_[a].id() < pdos_[b].id(); });
}

Abort TransmitPdos::check(const Object& object, std::uint64_t value) const noexcept {
  const unsigned i = object.index & 0xFFU;
  return object.index < 0x1A00 ? check_communication(i, object.sub, value) : check_mapping(i, object.sub, value);
}

Abort TransmitPdos::check_communication(unsigned i, unsigned sub, std::uint64_t value) const noexcept {
  const bool is_valid = pdos_[i].is_valid();
  switch (sub) {
    case 1: {
      const bool becomes_valid = (value & bit_31) == 0;
      const auto id = static_cast<std::uint32_t>(value & ~std::uint64_t{bit_31 | bit_30});
      if ((value & extended_bit) != 0 || id > can_id_bits) return Abort::value;
      // Bits 0 to 29 cannot change while the PDO is valid.
      if (is_valid && becomes_valid && id != pdos_[i].id()) return Abort::value;
      return becomes_valid && is_restricted(id) ? Abort::value : Abort::none;
    }
    case 2:
      return value > last_cyclic && value < remote_of_sync ? Abort::value : Abort::none;
    case 3:
    case 6:
      return is_valid && value != dictionary_[parameter(i, sub)] ? Abort::state : Abort::none;
    default:
      return Abort::none;
  }
}

// CiA 301, 7.5.2.36.
Abort TransmitPdos::check_mapping(unsigned i, unsigned sub, std::uint64_t value) const noexcept {
  if (pdos_[i].is_valid()) return Abort::state;
  if (sub != 0) {
    if (dictionary_[mapping(i, 0)] != 0) return Abort::state;
    if (value == 0) return Abort::none;
    const std::size_t position =
        find_object(static_cast<std::uint16_t>(value >> 16), static_cast<std::uint8_t>(value >> 8));
    if (position == object_count)
      return has_object(static_cast<std::uint16_t>(value >> 16)) ? Abort::no_subindex : Abort::no_object;
    if (!objects[position].is_mappable) return Abort::not_mappable;
    return mapped_object(static_cast<std::uint32_t>(value)) == object_count ? Abort::mapping_length : Abort::none;
  }
  if (value > largest_mapping) return Abort::mapping_length;
  std::size_t size = 0;
  for (unsigned k = 1; k <= value; ++k) {
    const std::size_t position = mapped_object(dictionary_.u32(mapping(i, k)));
    if (position == object_count) return Abort::no_object;
    size += size_of(objects[position].type);
  }
  return size > largest_payload ? Abort::mapping_length : Abort::none;
}

void TransmitPdos::add(const Sample& sample) noexcept {
  for (Pdo& pdo : pdos_) {
    pdo.increments.add(sample);
    pdo.has_sample = true;
  }
}

void TransmitPdos::on_sample(const Reading& reading, FrameBuffer& out) noexcept {
  const DeviceTime now = reading.sample.time;
  for (const std::uint8_t i : order_) {
    Pdo& pdo = pdos_[i];
    if (!pdo.is_valid() || !is_event_driven(pdo.type) || (pdo.next && now < *pdo.next)) continue;
    transmit(pdo, reading, out);
    // The next time is on the grid of the timer, so that it does not drift.
    const Nanoseconds late = pdo.next ? now - *pdo.next : Nanoseconds{0};
    const DeviceTime timed = pdo.timer > Nanoseconds{0} ? now - late % pdo.timer + pdo.timer : now;
    pdo.next = std::max(timed, now + pdo.inhibit);
  }
}

bool TransmitPdos::is_due_at_sync(unsigned i, unsigned counter) noexcept {
  Pdo& pdo = pdos_[i];
  if (pdo.type == at_sync_if_new) return pdo.has_sample;
  if (pdo.syncs == 0) {
    if (counter != 0 && counter != dictionary_[parameter(i, 6)]) return false;
    pdo.syncs = 1;
  }
  if (--pdo.syncs != 0) return false;
  pdo.syncs = pdo.type;
  return true;
}

void TransmitPdos::on_sync(unsigned counter, const Reading& reading, FrameBuffer& out) noexcept {
  for (const std::uint8_t i : order_) {
    Pdo& pdo = pdos_[i];
    if (!pdo.is_valid()) continue;
    if (pdo.type == remote_of_sync)
      pdo.latched = payload(pdo, reading);
    else if (pdo.type <= last_cyclic && is_due_at_sync(i, counter))
      transmit(pdo, reading, out);
  }
}

void TransmitPdos::on_remote(std::uint32_t id, const Reading& reading, FrameBuffer& out) noexcept {
  for (Pdo& pdo : pdos_) {
    if (!pdo.is_valid() || pdo.id() != id) continue;
    if ((pdo.cob_id & bit_30) != 0) return;
    if (pdo.type == remote_of_sync && pdo.latched)
      transmit(pdo, *pdo.latched, out);
    else if (pdo.type != remote_of_sync)
      transmit(pdo, reading, out);
    return;
  }
}

// Returns the payload, and restarts the increments of the PDO.
TransmitPdos::Payload TransmitPdos::payload(Pdo& pdo, const Reading& reading) const noexcept {
  const Reading own{reading.dictionary, reading.sample, pdo.increments, reading.time_of_day};
  Payload data = {};
  std::size_t used = 0;
  for (unsigned k = 0; k < pdo.mapped_count; ++k) {
    const Object& object = objects[pdo.mapped[k]];
    const std::uint64_t value = object.index == objects[at(0x1001)].index ? error_register_ : measure(object, own);
    const std::size_t size = size_of(object.type);
    write_little(value, std::span(data).subspan(used, size));
    used += size;
  }
  pdo.increments = {};
  pdo.has_sample = false;
  return data;
}

void TransmitPdos::transmit(Pdo& pdo, const Reading& reading, FrameBuffer& out) noexcept {
  transmit(pdo, payload(pdo, reading), out);
}

void TransmitPdos::transmit(const Pdo& pdo, const Payload& data, FrameBuffer& out) const noexcept {
  if (pdo.size != 0) send(pdo.id(), std::span(data).first(pdo.size), out);
}

void TransmitPdos::restart_increments() noexcept {
  for (Pdo& pdo : pdos_) pdo.increments = {};
}

bool TransmitPdos::uses(std::uint32_t id) const noexcept {
  return std::any_of(pdos_.begin(), pdos_.end(), [&](const Pdo& pdo) { return pdo.is_valid() && pdo.id() == id; });
}

void TransmitPdos::step_clock(Nanoseconds by) noexcept {
  for (Pdo& pdo : pdos_)
    if (pdo.next) pdo.next = *pdo.next + by;
}

}  // namespace imud::canopen
