#include "transports/can/slcan_text.hpp"

#include <algorithm>
#include <utility>

#include "core/numbers/number_text.hpp"
#include "transports/can/can_dlc.hpp"

namespace imud {
namespace {

constexpr std::uint32_t standard_ids = 0x7FF, extended_ids = 0x1FFF'FFFF;
constexpr std::size_t classic_bytes = 8, fd_bytes = 64;
constexpr std::string_view digits = "0123456789ABCDEF";

// The letter by which a line begins: in lower case for an identifier of 11 bits, except that an FD frame without
// bit rate switch has d and D, and an FD frame with bit rate switch has b and B.
constexpr char letter_of(const CanHeader& header) noexcept {
  const char letter = header.remote ? 'r' : !header.fd ? 't' : header.bit_rate_switch ? 'b' : 'd';
  return static_cast<char>(header.extended ? letter - 'a' + 'A' : letter);
}

}  // namespace

std::size_t write_slcan(const Frame& frame, std::span<char, max_slcan_line> line) noexcept {
  const CanHeader& can = frame.can;
  const std::size_t size = frame.bytes.size();
  if (can.error || (can.fd && can.remote) || can.id > (can.extended ? extended_ids : standard_ids) ||
      size > (can.fd ? fd_bytes : classic_bytes))
    return 0;
  std::size_t at = 0;
  line[at++] = letter_of(can);
  for (int shift = can.extended ? 28 : 8; shift >= 0; shift -= 4)
    line[at++] = digits[(can.id >> static_cast<unsigned>(shift)) & 15U];
  line[at++] = digits[dlc_of(size)];
  const std::size_t length = can.remote ? 0 : fd_length(size);
  for (std::size_t i = 0; i < length; ++i) {
    const auto byte = i < size ? std::to_integer<unsigned>(frame.bytes[i]) : 0U;
    line[at++] = digits[byte >> 4U];
    line[at++] = digits[byte & 15U];
  }
  line[at++] = '\r';
  return at;
}

SlcanReader::Result SlcanReader::feed(char byte) noexcept {
  constexpr char bell = '\a';
  if (byte == '\n') return Result::nothing;
  if (byte != '\r' && byte != bell) {
    if (length_ < longest) line_[length_] = byte;
    length_ = std::min(length_ + 1, longest + 1);
    return Result::nothing;
  }
  const std::size_t length = std::exchange(length_, 0);
  if (byte == bell) return Result::refusal;
  return length > longest ? Result::malformed : read_line({line_.data(), length});
}

SlcanReader::Result SlcanReader::read_line(std::string_view line) noexcept {
  if (line.empty()) return Result::nothing;  // an acknowledgement
  // All other lines carry no frame: a frame was queued (z, Z), answers, and reports of errors.
  constexpr std::string_view frames = "tTrRdDbB", others = "zZFVvNEse";
  if (frames.find(line.front()) != frames.npos) return read_frame(line) ? Result::frame : Result::malformed;
  return others.find(line.front()) != others.npos ? Result::nothing : Result::malformed;
}

bool SlcanReader::read_frame(std::string_view line) noexcept {
  const char letter = line.front();
  header_ = {};
  size_ = 0;
  data_.fill(std::byte{0});
  header_.extended = letter >= 'A' && letter <= 'Z';
  const char kind = static_cast<char>(header_.extended ? letter - 'A' + 'a' : letter);
  header_.remote = kind == 'r';
  header_.fd = kind == 'd' || kind == 'b';
  header_.bit_rate_switch = kind == 'b';
  const std::size_t id_size = header_.extended ? 8 : 3;
  if (line.size() < id_size + 2) return false;
  const auto id = number_in<std::uint32_t>(line.substr(1, id_size), 16);
  const auto dlc = number_in<std::uint8_t>(line.substr(1 + id_size, 1), 16);
  if (!id || *id > (header_.extended ? extended_ids : standard_ids) || !dlc) return false;
  header_.id = *id;
  line.remove_prefix(id_size + 2);
  size_ = header_.fd ? fd_lengths[*dlc] : std::min<std::size_t>(*dlc, classic_bytes);
  const std::size_t length = header_.remote ? 0 : size_;
  if (line.size() < 2 * length) return false;
  for (std::size_t i = 0; i < length; ++i) {
    const auto byte = number_in<std::uint8_t>(line.substr(2 * i, 2), 16);
    if (!byte) return false;
    data_[i] = std::byte{*byte};
  }
  line.remove_prefix(2 * length);
  // A time stamp follows, in ms of a minute or in us. It is ignored: the time of arrival at this host replaces it.
  constexpr std::size_t short_stamp = 4, long_stamp = 8;
  return line.empty() ||
         ((line.size() == short_stamp || line.size() == long_stamp) && number_in<std::uint32_t>(line, 16));
}

}  // namespace imud
