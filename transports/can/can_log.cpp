// Formats: candump(1) and log2asc(1) of can-utils; Vector's "CAN/LIN/... logging ASC" has no public document. Its
// lines are as log2asc writes them and asc2log reads them.
#include "transports/can/can_log.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>

#include <algorithm>

#include "core/numbers/number_text.hpp"
#include "transports/can/can_dlc.hpp"

namespace imud {
namespace {

constexpr std::string_view blanks = " \t\r\n";

// The bits of an FD line's flags in an ASC log.
constexpr unsigned asc_remote = 0x10, asc_fd = 0x1000, asc_bit_rate_switch = 0x2000;

// Parses "seconds.fraction"; digits below a nanosecond are ignored. Returns nullopt for any other text.
std::optional<Nanoseconds> time_in(std::string_view text) noexcept {
  constexpr std::uint64_t most_seconds = 9'000'000'000;
  constexpr std::size_t digits = 9;
  const std::size_t dot = std::min(text.find('.'), text.size());
  const std::string_view decimals = dot == text.size() ? "0" : text.substr(dot + 1, digits);
  const auto whole = number_in<std::uint64_t>(text.substr(0, dot));
  auto fraction = number_in<std::uint64_t>(decimals);
  if (!whole || *whole > most_seconds || !fraction) return std::nullopt;
  for (std::size_t i = decimals.size(); i < digits; ++i) *fraction *= 10;
  return Nanoseconds{static_cast<std::int64_t>(*whole * 1'000'000'000 + *fraction)};
}

// `format`: FMT_COMPILE(), because a log may have a line for each frame of a run.
template <class Format, class... Values>
char* append(char* at, const Format& format, Values&&... values) noexcept {
  return fmt::format_to(at, format, std::forward<Values>(values)...);
}

// Appends the last `count` digits of `number`, leading zeros included.
template <unsigned base>
char* append_digits(char* at, std::uint64_t number, std::size_t count) noexcept {
  for (std::size_t i = count; i > 0; number /= base) at[--i] = "0123456789ABCDEF"[number % base];
  return at + count;
}

// Appends `bytes` as hexadecimal digits; `is_apart`: a blank before each.
char* append_data(char* at, std::span<const std::byte> bytes, bool is_apart) noexcept {
  for (const std::byte byte : bytes) {
    if (is_apart) *at++ = ' ';
    at = append_digits<16>(at, std::to_integer<std::uint8_t>(byte), 2);
  }
  return at;
}

bool is_of_a_bus(const Frame& frame) noexcept {
  const CanHeader& can = frame.can;
  if (can.error)
    return can.id <= CAN_ERR_MASK && !can.extended && !can.fd && !can.remote && frame.bytes.size() <= CAN_MAX_DLEN;
  return can.id <= (can.extended ? CAN_EFF_MASK : CAN_SFF_MASK) && !(can.fd && can.remote) &&
         frame.bytes.size() <= (can.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
}

}  // namespace

std::string_view can_log_header(CanLogFormat format) noexcept {
  // The date is that to which the times of a candump log count, whatever the host's clock.
  return format == CanLogFormat::asc ? "date Thu Jan  1 00:00:00 1970\nbase hex  timestamps absolute\n"
                                       "no internal events logged\n"
                                     : "";
}

unsigned channel_of(std::string_view interface) noexcept {
  const std::size_t digits = interface.find_last_not_of("0123456789") + 1;
  const auto number = number_in<unsigned>(interface.substr(digits));
  return number ? *number + 1 : 1;
}

std::size_t write_can_log(CanLogFormat format, const Frame& frame, Nanoseconds time, std::string_view interface,
                          std::span<char, max_can_log_line> line) noexcept {
  if (!is_of_a_bus(frame)) return 0;
  const CanHeader& can = frame.can;
  const std::int64_t us = std::max<std::int64_t>(0, time.count() / 1000), second = us / 1'000'000,
                     rest = us % 1'000'000;
  const std::size_t size = frame.bytes.size(), length = can.fd ? fd_length(size) : size;
  char* at = line.data();
  const auto append_padded = [&](bool is_apart) {
    at = append_data(at, frame.bytes, is_apart);
    constexpr std::array<std::byte, CANFD_MAX_DLEN> zeros{};
    at = append_data(at, std::span(zeros).first(length - size), is_apart);
  };
  if (format == CanLogFormat::candump) {
    // An int64_t of ns has at most ten digits of seconds.
    *at++ = '(';
    at = append_digits<10>(at, static_cast<std::uint64_t>(second), 10);
    *at++ = '.';
    at = append_digits<10>(at, static_cast<std::uint64_t>(rest), 6);
    *at++ = ')';
    *at++ = ' ';
    at = std::copy(interface.begin(), interface.end(), at);
    *at++ = ' ';
    at = append_digits<16>(at, can.error ? CAN_ERR_FLAG | can.id : can.id, can.extended || can.error ? 8 : 3);
    *at++ = '#';
    if (can.remote)
      at = size > 0 ? append(at, FMT_COMPILE("R{}"), size) : append(at, FMT_COMPILE("R"));
    else if (can.fd)
      at = append(at, FMT_COMPILE("#{:X}"), can.bit_rate_switch ? CANFD_BRS : 0);
    if (!can.remote) append_padded(false);
  } else {
    at = append(at, FMT_COMPILE("{:4}.{:06} "), second, rest);
    const unsigned channel = channel_of(interface);
    if (can.error) {
      at = append(at, FMT_COMPILE("{:<2} ErrorFrame"), channel);
    } else if (can.fd) {
      at = append(at, FMT_COMPILE("CANFD {:3} Rx{:11X}{}{:33} {} 0 {:x} {:2}"), channel, can.id,
                  can.extended ? 'x' : ' ', "", can.bit_rate_switch ? 1 : 0, dlc_of(size), length);
      append_padded(true);
      // Duration, length and the fields after the flags are not known; can-utils writes the same numbers.
      at = append(at, FMT_COMPILE(" {:>8} {:>4} {:8X} 0 0 0 0 0"), 130000, 130,
                  asc_fd | (can.bit_rate_switch ? asc_bit_rate_switch : 0));
    } else {
      char* const id = append(at, FMT_COMPILE("{:<2} {:X}{}"), channel, can.id, can.extended ? "x" : "");
      constexpr std::ptrdiff_t columns = 3 + 15;  // of channel and identifier
      at = std::fill_n(id, std::max<std::ptrdiff_t>(0, columns - (id - at)), ' ');
      at = append(at, FMT_COMPILE(" Rx   {} {}"), can.remote ? 'r' : 'd', size);
      if (!can.remote) append_padded(true);
    }
  }
  *at++ = '\n';
  return static_cast<std::size_t>(at - line.data());
}

// The words of a line.
class CanLogReader::Words {
 public:
  explicit Words(std::string_view line) noexcept : rest_(line) {}
  // Returns the next word; empty if there is none.
  std::string_view next() noexcept {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(blanks), rest_.size()));
    const std::string_view word = rest_.substr(0, rest_.find_first_of(blanks));
    rest_.remove_prefix(word.size());
    return word;
  }

 private:
  std::string_view rest_;
};

CanLogReader::Line CanLogReader::read(std::string_view line) noexcept {
  line.remove_prefix(std::min(line.find_first_not_of(blanks), line.size()));
  header_ = {};
  size_ = 0;
  data_.fill(std::byte{0});
  return line.starts_with('(') ? read_candump(line) : read_asc(line);
}

// (1436509052.249713) can0 044#2A366C2BBA
CanLogReader::Line CanLogReader::read_candump(std::string_view line) noexcept {
  Words words(line);
  std::string_view stamp = words.next();
  if (!stamp.ends_with(')')) return Line::malformed;
  const auto time = time_in(stamp.substr(1, stamp.size() - 2));
  if (!time) return Line::malformed;
  time_ = *time;
  const std::string_view interface = words.next(), text = words.next();
  const std::size_t mark = text.find('#');
  if (mark == text.npos) return Line::malformed;
  if (interface_ && interface != *interface_) return Line::other;

  constexpr std::size_t short_id = 3, long_id = 8;
  const std::string_view id = text.substr(0, mark);
  const auto number = number_in<std::uint32_t>(id, 16);
  if ((id.size() != short_id && id.size() != long_id) || !number) return Line::malformed;
  header_.error = (*number & CAN_ERR_FLAG) != 0;
  header_.extended = id.size() == long_id && !header_.error;
  if (*number > (header_.error ? CAN_ERR_FLAG | CAN_ERR_MASK : header_.extended ? CAN_EFF_MASK : CAN_SFF_MASK))
    return Line::malformed;
  header_.id = *number & CAN_EFF_MASK;

  std::string_view body = text.substr(mark + 1);
  if (body.starts_with('R')) {
    header_.remote = true;
    body.remove_prefix(1);
    size_ = body.empty() ? 0 : number_in<std::size_t>(body.substr(0, body.find('_')), 16).value_or(CAN_MAX_DLEN + 1);
    return size_ <= CAN_MAX_DLEN ? Line::frame : Line::malformed;
  }
  if (body.starts_with('#')) {
    const auto flags = number_in<unsigned>(body.substr(1, 1), 16);
    if (!flags) return Line::malformed;
    header_.fd = true;
    header_.bit_rate_switch = (*flags & CANFD_BRS) != 0;
    body.remove_prefix(2);
  }
  body = body.substr(0, body.find('_'));  // a length code above 8 of a classic frame
  const std::size_t most = header_.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN;
  while (!body.empty()) {
    const auto byte = number_in<std::uint8_t>(body.substr(0, 2), 16);
    if (size_ == most || body.size() < 2 || !byte) return Line::malformed;
    data_[size_++] = std::byte{*byte};
    body.remove_prefix(2);
    if (body.starts_with('.')) body.remove_prefix(1);
  }
  return header_.fd && size_ != fd_length(size_) ? Line::malformed : Line::frame;
}

//    0.002367 1  390x            Rx   d 8 17 00 14 00 C0 00 08 00
//    0.003000 CANFD   1 Rx        123  Name                             1 0 9 12 11 22 ... 130000  130     3000 0 0 0
//    0 0
CanLogReader::Line CanLogReader::read_asc(std::string_view line) noexcept {
  Words words(line);
  const std::string_view first = words.next();
  if (first == "base") {
    decimal_ = words.next() == "dec";
    relative_ = words.next() == "timestamps" && words.next() == "relative";
    last_ = {};
    return Line::other;
  }
  const auto stamp = time_in(first);
  if (!stamp) return Line::other;
  time_ = last_ = relative_ ? last_ + std::min(*stamp, Nanoseconds::max() - last_) : *stamp;
  const std::string_view kind = words.next();
  if (kind == "CANFD") return has_channel(words.next()) ? read_fd(words) : Line::other;
  return has_channel(kind) ? read_classic(words) : Line::other;
}

CanLogReader::Line CanLogReader::read_classic(Words& words) noexcept {
  const int base = decimal_ ? 10 : 16;
  const std::string_view id = words.next();
  if (id == "ErrorFrame") {
    header_.error = true;
    header_.id = CAN_ERR_BUSERROR;
    size_ = CAN_ERR_DLC;
    return Line::frame;
  }
  const bool has_id = read_id(id, base);
  const std::string_view direction = words.next(), kind = words.next();
  if (!has_id || !(direction == "Rx" || direction == "Tx") || !(kind == "d" || kind == "r")) return Line::other;
  const std::string_view length = words.next();
  header_.remote = kind == "r";
  const auto size = number_in<std::size_t>(header_.remote && length.empty() ? "0" : length, 16);
  if (!size) return Line::malformed;
  size_ = std::min<std::size_t>(*size, CAN_MAX_DLEN);
  return header_.remote || read_data(words, size_, base) ? Line::frame : Line::malformed;
}

CanLogReader::Line CanLogReader::read_fd(Words& words) noexcept {
  const std::string_view direction = words.next();
  if (!(direction == "Rx" || direction == "Tx") || !read_id(words.next(), 16)) return Line::malformed;
  std::string_view bit_rate_switch = words.next();
  if (bit_rate_switch != "0" && bit_rate_switch != "1") bit_rate_switch = words.next();  // after a name
  words.next();                                                                          // the error state
  const auto dlc = number_in<unsigned>(words.next(), 16);
  const auto size = number_in<std::size_t>(words.next());
  if (!dlc || *dlc >= fd_lengths.size() || !size || *size > CANFD_MAX_DLEN || *size != fd_length(*size) ||
      !read_data(words, *size, 16))
    return Line::malformed;
  words.next();  // duration
  words.next();  // length
  const auto flags = number_in<unsigned>(words.next(), 16);
  if (!flags) return Line::malformed;
  size_ = *size;
  header_.fd = (*flags & asc_fd) != 0;
  header_.bit_rate_switch = header_.fd && (*flags & asc_bit_rate_switch) != 0;
  header_.remote = !header_.fd && (*flags & asc_remote) != 0;
  if (header_.remote) size_ = std::min<std::size_t>(*dlc, CAN_MAX_DLEN);
  return header_.fd || size_ <= CAN_MAX_DLEN ? Line::frame : Line::malformed;
}

bool CanLogReader::read_id(std::string_view text, int base) noexcept {
  header_.extended = text.ends_with('x') || text.ends_with('X');
  if (header_.extended) text.remove_suffix(1);
  const auto id = number_in<std::uint32_t>(text, base);
  header_.id = id.value_or(0);
  return id && header_.id <= (header_.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
}

bool CanLogReader::read_data(Words& words, std::size_t size, int base) noexcept {
  for (std::size_t i = 0; i < size; ++i) {
    const auto byte = number_in<std::uint8_t>(words.next(), base);
    if (!byte) return false;
    data_[i] = std::byte{*byte};
  }
  return true;
}

bool CanLogReader::has_channel(std::string_view channel) const noexcept {
  const auto number = number_in<unsigned>(channel);
  return number && (!interface_ || *number == channel_of(*interface_));
}

}  // namespace imud
