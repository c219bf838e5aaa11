// Checksums, words and text messages.
#include <algorithm>
#include <boost/crc.hpp>
#include <cmath>
#include <cstdio>

#include "protocols/vectornav/vectornav.hpp"

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
  const auto number = number_in<double>(text);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

Message& Message::put(std::string_view text) noexcept {
  for (const char c : text)
    if (size_ < text_.size() - 16) text_[size_++] = c;
  return *this;
}
Message& Message::put(double number, const char* format) noexcept {
  std::array<char, 40> digits;
  const int size = std::snprintf(digits.data(), digits.size(), format, number);
  return put(",").put({digits.data(), static_cast<std::size_t>(std::clamp(size, 0, 39))});
}
Message& Message::put(const Vector3& vector, const char* format) noexcept {
  for (int i = 0; i < 3; ++i) put(vector[i], format);
  return *this;
}
void Message::send() noexcept {
  const std::string_view body(text_.data() + 1, size_ - 1);
  const bool is_short = form_ == Form::two_digits;
  const unsigned sum = is_short ? xor_of(body) : crc16(body);
  size_ +=
      static_cast<std::size_t>(std::snprintf(text_.data() + size_, 16, is_short ? "*%02X\r\n" : "*%04X\r\n", sum));
  out_.append(std::as_bytes(std::span(text_).first(size_)), {}, uart_);
}

}  // namespace imud::vectornav
