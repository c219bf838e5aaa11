// draft-ietf-opsawg-pcapng-01, sections 3.1, 3.5, 4.1, 4.2 and 4.3.
#include "transports/capture/pcapng_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace imud {
namespace {

constexpr std::uint32_t section_header = 0x0A0D0D0A, interface_description = 1, enhanced_packet = 6;
constexpr std::uint32_t magic = 0x1A2B3C4D, swapped_magic = 0x4D3C2B1A;
constexpr std::size_t block_head = 8, block_tail = 4;
constexpr std::string_view right = "right would be a pcapng file, as imud --record and Wireshark write";

std::size_t padded(std::size_t size) noexcept { return (size + 3) / 4 * 4; }

}  // namespace

PcapngReader::PcapngReader(const PortSpec& spec) : file_(spec) {
  if (!file_.is_regular()) return;
  constexpr std::size_t head = 12;
  if (!fill(head) || !begin_section(buffer_.first(head)))
    throw spec.error(fmt::format("does not begin with a pcapng section header; {}", right));
}

std::uint16_t PcapngReader::u16(Bytes bytes, std::size_t at) const noexcept {
  std::uint16_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return swapped_ ? static_cast<std::uint16_t>(value << 8 | value >> 8) : value;
}

std::uint32_t PcapngReader::u32(Bytes bytes, std::size_t at) const noexcept {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return swapped_ ? __builtin_bswap32(value) : value;
}

// Returns false if fewer than `size` bytes are available now.
bool PcapngReader::fill(std::size_t size) noexcept {
  if (end_ - begin_ >= size) return true;
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= std::exchange(begin_, 0);
  while (end_ < size) {
    const std::size_t read = file_.read(buffer_.subspan(end_));
    if (read == 0) return false;
    end_ += read;
  }
  return true;
}

void PcapngReader::end(std::string_view what) noexcept {
  at_end_ = true;
  if (what.empty()) return;
  const auto written = fmt::format_to_n(warning_.data(), warning_.size(), "{} after block {}", what, blocks_);
  warning_size_ = std::min(written.size, warning_.size());
}

// Returns the body of the next block that fits into the buffer. Treats the file as ended where it cannot be read
// further.
std::optional<PcapngReader::Bytes> PcapngReader::next_block(std::uint32_t& type) noexcept {
  constexpr int most = 1024;  // blocks that are skipped in one call, so that the caller can do other work
  for (int i = 0; i < most && !at_end_; ++i) {
    while (skip_ > 0) {
      if (begin_ == end_ && !fill(1)) break;
      const std::size_t skipped = std::min(skip_, end_ - begin_);
      begin_ += skipped;
      skip_ -= skipped;
    }
    constexpr std::size_t head = 12;  // every block has as much
    if (skip_ > 0 || !fill(head)) {
      if (!file_.at_end()) return std::nullopt;
      const bool is_whole = skip_ == 0 && begin_ == end_;
      end(!file_.end_warning().empty() ? file_.end_warning() : is_whole ? "" : "cut short");
      return std::nullopt;
    }
    const Bytes start = buffer_.subspan(begin_, head);
    if (u32(start, 0) == section_header && !begin_section(start)) {
      end("damaged");
      return std::nullopt;
    }
    type = u32(start, 0);
    const std::size_t length = u32(start, 4);
    if (length < head || length % 4 != 0 || (blocks_ == 0 && type != section_header)) {
      end("damaged");
      return std::nullopt;
    }
    if (length > longest_block) {
      if (type == enhanced_packet) ++skipped_;
      ++blocks_;
      skip_ = length;
      continue;
    }
    if (!fill(length)) {
      if (!file_.at_end()) return std::nullopt;
      end("cut short");
      return std::nullopt;
    }
    const Bytes block = buffer_.subspan(begin_, length);
    if (u32(block, length - block_tail) != length) {
      end("damaged");
      return std::nullopt;
    }
    begin_ += length;
    ++blocks_;
    return block.subspan(block_head, length - block_head - block_tail);
  }
  return std::nullopt;
}

std::optional<PcapngPacket> PcapngReader::next() noexcept {
  std::uint32_t type = 0;
  while (const auto body = next_block(type)) {
    if (type == interface_description)
      add_interface(*body);
    else if (type == enhanced_packet)
      if (const auto found = packet(*body)) return found;
  }
  return std::nullopt;
}

// `start`: the first 12 bytes of its block. Returns false if the block has no valid byte order mark.
bool PcapngReader::begin_section(Bytes start) noexcept {
  swapped_ = false;
  const std::uint32_t order = u32(start, 8);
  if (u32(start, 0) != section_header || (order != magic && order != swapped_magic)) return false;
  swapped_ = order == swapped_magic;
  interfaces_.clear();
  clocks_.clear();
  return true;
}

void PcapngReader::add_interface(Bytes body) noexcept {
  constexpr std::size_t head = 8;
  constexpr std::uint16_t if_name = 2, if_tsresol = 9, if_tsoffset = 14;
  if (body.size() < head || interfaces_.size() == most_interfaces) return;
  PcapngInterface interface {
    u16(body, 0), {}
  };
  Clock clock;
  for (Bytes options = body.subspan(head); options.size() >= 4;) {
    const std::uint16_t code = u16(options, 0);
    const std::size_t size = u16(options, 2);
    options = options.subspan(4);
    if (code == 0 || size > options.size()) break;
    if (code == if_name)
      interface.name.assign(reinterpret_cast<const char*>(options.data()), size);
    else if (code == if_tsresol && size == 1)
      clock.resolution = std::to_integer<std::uint8_t>(options[0]);
    else if (code == if_tsoffset && size == 8)
      clock.offset_s = static_cast<std::int64_t>(std::uint64_t{u32(options, swapped_ ? 0 : 4)} << 32 |
                                                 u32(options, swapped_ ? 4 : 0));
    options = options.subspan(std::min(padded(size), options.size()));
  }
  interfaces_.push_back(std::move(interface));
  clocks_.push_back(clock);
}

// A time that does not fit wraps around.
std::int64_t PcapngReader::time_ns(std::uint64_t time, const Clock& clock) const noexcept {
  constexpr std::uint64_t ns_per_s = 1'000'000'000;
  const unsigned exponent = clock.resolution & 0x7FU;
  const bool is_binary = (clock.resolution & 0x80U) != 0;
  std::uint64_t ns = 0;
  if (is_binary) {
    constexpr unsigned kept = 34;  // bits of the fraction; with a factor of 1e9 they fit into 64
    const std::uint64_t s = exponent < 64 ? time >> exponent : 0;
    const std::uint64_t rest = exponent < 64 ? time - (s << exponent) : time;
    const unsigned shift = std::min(exponent - std::min(exponent, kept), 63U);
    ns = s * ns_per_s + ((rest >> shift) * ns_per_s >> std::min(exponent - shift, 63U));
  } else {
    ns = time;
    for (unsigned i = exponent; i < 9; ++i) ns *= 10;
    for (unsigned i = 9; i < exponent && ns != 0; ++i) ns /= 10;
  }
  return static_cast<std::int64_t>(ns + static_cast<std::uint64_t>(clock.offset_s) * ns_per_s);
}

std::optional<PcapngPacket> PcapngReader::packet(Bytes body) noexcept {
  constexpr std::size_t head = 20;
  if (body.size() < head) return std::nullopt;
  PcapngPacket packet;
  packet.interface = u32(body, 0);
  const std::uint64_t time = std::uint64_t{u32(body, 4)} << 32 | u32(body, 8);
  const std::size_t size = u32(body, 12);
  if (packet.interface >= interfaces_.size() || size > body.size() - head) {
    ++skipped_;
    return std::nullopt;
  }
  packet.time_ns = time_ns(time, clocks_[packet.interface]);
  packet.bytes = body.subspan(head, size);
  constexpr std::uint16_t epb_flags = 2;
  for (Bytes options = body.subspan(std::min(head + padded(size), body.size())); options.size() >= 4;) {
    const std::uint16_t code = u16(options, 0);
    const std::size_t length = u16(options, 2);
    options = options.subspan(4);
    if (code == 0 || length > options.size()) break;
    if (code == epb_flags && length == 4)
      if (const std::uint32_t flags = u32(options, 0) & 3U; flags < 3)
        packet.direction = static_cast<PacketDirection>(flags);
    options = options.subspan(std::min(padded(length), options.size()));
  }
  return packet;
}

}  // namespace imud
