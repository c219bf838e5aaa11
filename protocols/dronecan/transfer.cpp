#include "protocols/dronecan/transfer.hpp"

#include <algorithm>
#include <boost/crc.hpp>
#include <boost/endian/conversion.hpp>
#include <utility>

#include "protocols/wire/deadlines.hpp"

namespace imud::dronecan {
namespace {

// Returns the CRC of a transfer of several frames.
unsigned crc_of(const DataType& type, std::span<const std::byte> payload) noexcept {
  boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false> crc;
  const std::uint64_t signature = boost::endian::native_to_little(type.signature);
  crc.process_bytes(&signature, sizeof signature);
  crc.process_bytes(payload.data(), payload.size());
  return crc.checksum();
}

}  // namespace

Identifier Identifier::parse(std::uint32_t id) noexcept {
  Identifier identifier;
  identifier.priority = id >> 24 & 0x1FU;
  identifier.source = id & 0x7FU;
  identifier.is_service = (id & 0x80U) != 0;
  if (identifier.is_service) {
    identifier.type = id >> 16 & 0xFFU;
    identifier.is_request = (id & 0x8000U) != 0;
    identifier.destination = id >> 8 & 0x7FU;
  } else if (identifier.source == anonymous) {
    identifier.discriminator = id >> 10 & 0x3FFFU;
    identifier.type = id >> 8 & 3U;
  } else {
    identifier.type = id >> 8 & 0xFFFFU;
  }
  return identifier;
}

CanHeader Identifier::header() const noexcept {
  std::uint32_t id = priority << 24 | source;
  if (is_service)
    id |= type << 16 | (is_request ? 0x8000U : 0U) | destination << 8 | 0x80U;
  else if (source == anonymous)
    id |= discriminator << 10 | (type & 3U) << 8;
  else
    id |= type << 8;
  return {.id = id, .extended = true};
}

Tail Tail::parse(std::byte tail) noexcept {
  const auto bits = std::to_integer<unsigned>(tail);
  return {(bits & 0x80U) != 0, (bits & 0x40U) != 0, (bits & 0x20U) != 0, bits & 0x1FU};
}

std::byte Tail::byte() const noexcept {
  return static_cast<std::byte>((is_first ? 0x80U : 0U) | (is_last ? 0x40U : 0U) | (toggle ? 0x20U : 0U) |
                                transfer_id);
}

std::size_t send(const Identifier& identifier, const DataType& type, unsigned transfer_id,
                 std::span<const std::byte> payload, FrameBuffer& out) noexcept {
  const std::size_t frames = frame_count(payload.size());
  if (out.frames().size() + frames > FrameBuffer::max_frames || out.room(payload.size() + 2 + frames).empty())
    return 0;
  const unsigned crc = frames > 1 ? crc_of(type, payload) : 0;
  Tail tail{true, false, false, transfer_id};
  for (std::size_t i = 0; i < frames; ++i) {
    const std::span<std::byte> room = out.room(std::min(payload.size() + 2, frame_data) + 1);
    std::size_t size = 0;
    if (frames > 1 && i == 0) {
      room[size++] = static_cast<std::byte>(crc & 0xFFU);
      room[size++] = static_cast<std::byte>(crc >> 8);
    }
    const std::size_t data = std::min(payload.size(), frame_data - size);
    std::copy_n(payload.begin(), data, room.begin() + static_cast<std::ptrdiff_t>(size));
    payload = payload.subspan(data);
    size += data;
    tail.is_last = i + 1 == frames;
    room[size++] = tail.byte();
    out.push(size, identifier.header());
    tail.is_first = false;
    tail.toggle = !tail.toggle;
  }
  return frames;
}

std::span<std::byte> reseal_transfer(std::span<std::byte> data, const DataType& type) noexcept {
  constexpr std::size_t with_tail = frame_data + 1, crc_size = 2;
  const std::size_t frames = (data.size() + with_tail - 1) / with_tail;
  std::array<std::byte, longest_transfer> payload;
  std::size_t size = 0;
  if (frames < 2 || data.size() - frames > payload.size()) return {};
  const unsigned transfer_id = Tail::parse(data[frame_data]).transfer_id;
  for (std::size_t i = 0; i < frames; ++i) {
    const std::span<const std::byte> frame =
        data.subspan(with_tail * i, std::min(with_tail, data.size() - with_tail * i));
    if (frame.back() != Tail{i == 0, i + 1 == frames, i % 2 == 1, transfer_id}.byte()) return {};
    const std::span<const std::byte> content = frame.subspan(i == 0 ? crc_size : 0);
    size = static_cast<std::size_t>(
        std::copy(content.begin(), content.end() - 1, payload.begin() + static_cast<std::ptrdiff_t>(size)) -
        payload.begin());
  }
  const unsigned crc = crc_of(type, std::span(payload).first(size));
  data[0] = static_cast<std::byte>(crc & 0xFFU);
  data[1] = static_cast<std::byte>(crc >> 8);
  return data.subspan(crc_size, data.size() - crc_size - 1);
}

bool Reception::append(std::span<const std::byte> data) noexcept {
  if (data.size() > bytes_.size() - size_) return false;
  std::copy(data.begin(), data.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += data.size();
  return true;
}

bool Reception::feed(std::span<const std::byte> frame, const DataType& type, DecodeErrors& errors) noexcept {
  if (frame.empty() || frame.size() > frame_data + 1) return false;
  const Tail tail = Tail::parse(frame.back());
  std::span<const std::byte> data = frame.first(frame.size() - 1);
  const bool is_full = tail.is_last || data.size() == frame_data;
  if (tail.is_first) {
    errors.incomplete += is_active_;
    toggle_ = false;
    transfer_id_ = tail.transfer_id;
    size_ = 0;
    if (!tail.is_last && is_full) {
      crc_ = std::to_integer<unsigned>(data[0]) | std::to_integer<unsigned>(data[1]) << 8;
      data = data.subspan(2);
    }
  } else if (!is_active_ || tail.transfer_id != transfer_id_ || tail.toggle != toggle_) {
    return false;
  }
  const bool is_good = is_full && tail.toggle == toggle_ && append(data);
  toggle_ = !toggle_;
  is_active_ = is_good && !tail.is_last;
  if (!is_good) {
    ++errors.malformed;
    return false;
  }
  if (!tail.is_last) return false;
  if (!tail.is_first && crc_of(type, payload()) != crc_) {
    ++errors.checksum;
    return false;
  }
  return true;
}

Receiver::Slot* Receiver::slot_of(const Identifier& identifier, bool is_first) noexcept {
  const auto is_same = [&](const Slot& slot) {
    return slot.source == identifier.source && slot.type == identifier.type &&
           slot.is_service == identifier.is_service;
  };
  auto slot = std::find_if(slots_.begin(), slots_.end(), is_same);
  if (slot == slots_.end()) {
    if (!is_first) return nullptr;
    slot = std::min_element(slots_.begin(), slots_.end(), [](const Slot& a, const Slot& b) {
      return std::pair(a.source != anonymous, a.used) < std::pair(b.source != anonymous, b.used);
    });
    errors_.incomplete += slot->reception.is_active();
    slot->source = identifier.source;
    slot->type = identifier.type;
    slot->is_service = identifier.is_service;
    slot->reception.clear();
    slot->last_transfer_id.reset();
  }
  slot->used = ++frames_;
  return &*slot;
}

std::optional<std::span<const std::byte>> Receiver::feed(const Identifier& identifier, const DataType& type,
                                                         std::span<const std::byte> frame, DeviceTime now) noexcept {
  if (frame.empty()) return std::nullopt;
  poll(now);
  const Tail tail = Tail::parse(frame.back());
  Slot* slot = slot_of(identifier, tail.is_first);
  if (slot == nullptr) return std::nullopt;
  if (tail.is_first) {
    if (slot->last_transfer_id == tail.transfer_id && now - slot->last_time < transfer_timeout) return std::nullopt;
    slot->begin = now;
  }
  const bool is_complete = slot->reception.feed(frame, type, errors_);
  find_deadline();
  if (!is_complete) return std::nullopt;
  slot->last_transfer_id = tail.transfer_id;
  slot->last_time = now;
  return slot->reception.payload();
}

void Receiver::find_deadline() noexcept {
  deadline_.reset();
  for (const Slot& slot : slots_)
    if (slot.reception.is_active()) deadline_ = earlier(deadline_, slot.begin + transfer_timeout);
}

void Receiver::poll(DeviceTime now) noexcept {
  if (!deadline_ || now < *deadline_) return;
  for (Slot& slot : slots_) {
    if (!slot.reception.is_active() || now - slot.begin < transfer_timeout) continue;
    slot.reception.clear();
    ++timed_out_;
  }
  find_deadline();
}

void Receiver::step_clock(Nanoseconds by) noexcept {
  for (Slot& slot : slots_) {
    slot.begin = slot.begin + by;
    slot.last_time = slot.last_time + by;
  }
  find_deadline();
}

void Receiver::clear() noexcept {
  for (Slot& slot : slots_) {
    slot.source = anonymous;
    slot.reception.clear();
    slot.last_transfer_id.reset();
  }
  find_deadline();
}

}  // namespace imud::dronecan
