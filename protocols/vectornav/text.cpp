// Checksums, words and text messages.
#include <algorithm>
#include <array>
#include <boost/crc.hpp>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "protocols/vectornav/vectornav.hpp"
#include "protocols/wire/fixed_text.hpp"

namespace imud::vectornav {

unsigned xor_of(std::string_view text) noexcept {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  return sum;
}

unsigned crc16(std::span<const std::byte> bytes) noexcept {
  boost::crc_optimal<16, 0x1021, 0, 0, false, false> crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return crc.checksum();
}
unsigned crc16(std::string_view text) noexcept { return crc16(std::as_bytes(std::span(text))); }

bool is_checksum_of(std::string_view body, std::string_view sum) noexcept {
  const auto given = number_in<unsigned>(sum, 16);
  return given && ((sum.size() == 2 && *given == xor_of(body)) || (sum.size() == 4 && *given == crc16(body)));
}

std::size_t write_checksum(std::string_view body, Form form, char* place) noexcept {
  const bool is_short = form == Form::two_digits;
  const unsigned sum = is_short ? xor_of(body) : crc16(body);
  return static_cast<std::size_t>(std::snprintf(place, 16, is_short ? "*%02X\r\n" : "*%04X\r\n", sum));
}

namespace {

// Reseals a text message. Its content is the last number only: a change of another word might give another valid
// word.
std::span<std::byte> reseal_text(std::span<std::byte> frame) noexcept {
  const std::string_view text(reinterpret_cast<const char*>(frame.data()), frame.size());
  const std::size_t star = text.rfind('*');
  if (star == std::string_view::npos || !text.ends_with("\r\n")) return {};
  const std::string_view body = text.substr(1, star - 1);
  const std::size_t digits = text.size() - star - 3;
  if ((digits != 2 && digits != 4) || body.find_first_of("$*\r\n") != std::string_view::npos) return {};
  for (std::size_t end = body.size(); end != std::string_view::npos;) {
    const std::size_t comma = body.rfind(',', end - 1);
    if (comma == std::string_view::npos || comma + 1 >= end) return {};
    const std::string_view word = body.substr(comma + 1, end - comma - 1);
    if (real_in(word)) {
      std::array<char, 16> sum;
      const std::size_t size = write_checksum(body, digits == 2 ? Form::two_digits : Form::four_digits, sum.data());
      std::memcpy(frame.data() + star, sum.data(), size);
      return frame.subspan(comma + 2, word.size());  // after '$' and the comma
    }
    end = comma;
  }
  return {};
}

}  // namespace

std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader&) noexcept {
  if (frame.empty()) return {};
  if (frame[0] == std::byte{'$'}) return reseal_text(frame);
  const auto head = binary_head(frame);
  if (!head || head->fields == 0 || head->size != frame.size()) return {};
  const unsigned crc = crc16(frame.subspan(1, frame.size() - 3));
  frame[frame.size() - 2] = static_cast<std::byte>(crc >> 8);
  frame[frame.size() - 1] = static_cast<std::byte>(crc);
  return frame.subspan(head->fields, frame.size() - 2 - head->fields);
}

Words::Words(std::string_view text) noexcept {
  while (count < words.size()) {
    const std::size_t comma = text.find(',');
    words[count++] = text.substr(0, comma);
    if (comma == std::string_view::npos) return;
    text.remove_prefix(comma + 1);
  }
  ++count;
}

std::optional<double> real_in(std::string_view text) noexcept {
  if (text.starts_with('+')) text.remove_prefix(1);
  return finite_number_in(text);
}

Message& Message::put(std::string_view text) noexcept {
  for (const char c : text)
    if (size_ < text_.size() - 16) text_[size_++] = c;
  return *this;
}
Message& Message::put(double number, const Digits& digits) noexcept {
  std::array<char, 352> text;  // the largest number has 309 digits before its point
  const char* const end = write_fixed(text.data(), text.data() + text.size(), std::abs(number), digits.decimals).ptr;
  const std::string_view magnitude(text.data(), static_cast<std::size_t>(end - text.data()));
  const std::string_view sign = std::signbit(number) ? "-" : digits.has_plus ? "+" : "";
  put(",").put(sign);
  for (std::size_t size = sign.size() + magnitude.size(); size < digits.width; ++size) put("0");
  return put(magnitude);
}
Message& Message::put(const Vector3& vector, const Digits& digits) noexcept {
  for (int i = 0; i < 3; ++i) put(vector[i], digits);
  return *this;
}
void Message::send() noexcept {
  const std::string_view body(text_.data() + 1, size_ - 1);
  size_ += write_checksum(body, form_, text_.data() + size_);
  out_.append(std::as_bytes(std::span(text_).first(size_)), {}, uart_);
}

}  // namespace imud::vectornav
