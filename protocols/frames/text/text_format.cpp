#include "protocols/frames/text/text_format.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "core/numbers/number_text.hpp"
#include "protocols/frames/layout/frame_element.hpp"
#include "protocols/frames/layout/frame_parts.hpp"
#include "protocols/wire/fixed_text.hpp"

namespace imud {
namespace {

constexpr std::size_t longest_choice = 16;  // characters of a text
constexpr std::size_t most_choices = 8;
constexpr int most_digits = 16;  // hexadecimal
constexpr std::string_view decimal_digits = "0123456789";

// Removes the characters of `set` at the beginning of the text, and returns them.
std::string_view take_while(std::string_view& text, std::string_view set) noexcept {
  const std::string_view taken = text.substr(0, std::min(text.find_first_not_of(set), text.size()));
  text.remove_prefix(taken.size());
  return taken;
}

bool take_word(std::string_view& text, std::string_view word) noexcept {
  if (!text.starts_with(word)) return false;
  text.remove_prefix(word.size());
  return true;
}

std::int64_t power_of_ten(int exponent) noexcept {
  std::int64_t power = 1;
  while (exponent-- > 0) power *= 10;
  return power;
}

// Writes `digits` decimal digits of the number.
char* write_digits(std::int64_t number, int digits, char* out) noexcept {
  for (int i = digits - 1; i >= 0; --i, number /= 10) out[i] = static_cast<char>('0' + number % 10);
  return out + digits;
}

[[noreturn]] void refuse_format(const std::string& text) {
  refuse_element("\"" + text +
                 "\" is no format; give one like 6.2f, +07.3f, .4e, d, 03d or 04X, a pattern such as hhmmss.ss or "
                 "ddmm.mmmm, or texts such as N/S");
}

}  // namespace

TextFormat TextFormat::take(std::string_view& text) {
  TextFormat format;
  if (!format.take_choice(text) && !format.take_pattern(text)) format.take_number(text);
  format.may_be_empty_ = take_word(text, "?");
  return format;
}

// Reads TEXT/TEXT or TEXT/TEXT/TEXT/..., which have no LSB.
bool TextFormat::take_choice(std::string_view& text) {
  const std::size_t slash = text.find('/');
  if (slash == text.npos || text.find('*') < slash) return false;
  const std::size_t end = std::min(text.find('?'), text.size());
  if (end < slash) return false;
  kind_ = Kind::choice;
  each_part(text.substr(0, end), '/', [this](std::string_view one) { texts_.emplace_back(one); });
  if (texts_.size() == 2) std::swap(texts_[0], texts_[1]);  // N/S: the first one is for values above 0
  const auto is_bad = [this](const std::string& one) {
    return one.empty() || one.size() > longest_choice || std::ranges::any_of(texts_, [&](const std::string& other) {
             return &other != &one && other.starts_with(one) && (other != one || texts_.size() == 2);
           });
  };
  if (texts_.size() > most_choices || std::ranges::any_of(texts_, is_bad))
    refuse_element(
        "a choice is two texts of 1 to 16 characters that begin differently, such as N/S, or up to 8 texts "
        "for the values 0, 1, 2 ...");
  if (std::ranges::any_of(texts_, [](const std::string& one) { return one.find('*') != std::string::npos; }))
    refuse_element("a choice of texts has no LSB");
  text.remove_prefix(end);
  return true;
}

// Reads hhmmss.ss or ddmm.mmmm.
bool TextFormat::take_pattern(std::string_view& text) {
  const bool has_colons = text.starts_with("hh:mm:ss");
  if (has_colons || text.starts_with("hhmmss")) {
    kind_ = Kind::clock;
    has_colons_ = has_colons;
    text.remove_prefix(has_colons ? 8 : 6);
  } else if (text.starts_with("ddmm") || text.starts_with("dddmm")) {
    kind_ = Kind::degrees;
    width_ = text.starts_with("ddd") ? 3 : 2;
    text.remove_prefix(static_cast<std::size_t>(width_) + 2);
  } else {
    return false;
  }
  decimals_ = 0;
  if (!take_word(text, ".")) return true;
  decimals_ = static_cast<int>(take_while(text, kind_ == Kind::clock ? "s" : "m").size());
  if (decimals_ == 0 || decimals_ > 9)
    refuse_element("after the point of a pattern come 1 to 9 decimals, as in hhmmss.ss or ddmm.mmmm");
  return true;
}

// Reads [FLAGS][WIDTH][.DECIMALS]LETTER.
void TextFormat::take_number(std::string_view& text) {
  const std::string whole(text);
  const std::string_view flags = take_while(text, "+ 0");
  has_plus_ = flags.find('+') != flags.npos;
  has_blank_ = flags.find(' ') != flags.npos;
  has_zeros_ = flags.find('0') != flags.npos;
  if (const std::string_view digits = take_while(text, decimal_digits); !digits.empty())
    width_ = number_in<int>(digits).value_or(widest + 1);
  const bool has_point = take_word(text, ".");
  if (has_point) decimals_ = number_in<int>(take_while(text, decimal_digits)).value_or(most_decimals + 1);
  if (width_ > widest || decimals_ > most_decimals)
    refuse_element("a format has at most " + std::to_string(widest) + " characters and " +
                   std::to_string(most_decimals) + " decimals");
  if (text.empty()) refuse_format(whole);
  switch (const char letter = text.front()) {
    case 'f':
      kind_ = Kind::fixed;
      break;
    case 'e':
      kind_ = Kind::scientific;
      break;
    case 'd':
      kind_ = Kind::integer;
      break;
    case 'X':
    case 'x':
      kind_ = Kind::hexadecimal;
      is_lower_ = letter == 'x';
      break;
    default:
      refuse_format(whole);
  }
  text.remove_prefix(1);
  if (is_integer() && has_point) refuse_element("an integer has no decimals");
  if (kind_ == Kind::hexadecimal && (width_ == 0 || width_ > most_digits || has_plus_ || has_blank_))
    refuse_element("hexadecimal digits are given by their number, 1 to 16, as in 04X");
}

TextFormat::Value TextFormat::value() const noexcept {
  return kind_ == Kind::clock ? Value::seconds : kind_ == Kind::degrees ? Value::degrees : Value::named;
}

std::size_t TextFormat::fixed_size() const noexcept {
  switch (kind_) {
    case Kind::hexadecimal:
    case Kind::clock:
    case Kind::degrees:
      return longest();
    case Kind::choice:
      return std::ranges::all_of(texts_, [this](const std::string& one) { return one.size() == texts_[0].size(); })
                 ? texts_[0].size()
                 : 0;
    default:
      return has_zeros_ ? static_cast<std::size_t>(width_) : 0;
  }
}

double TextFormat::step() const noexcept {
  if (kind_ == Kind::fixed) return 1 / static_cast<double>(power_of_ten(decimals_));
  return is_integer() ? 1 : 0;
}

std::optional<std::size_t> TextFormat::chosen(std::string_view text) const noexcept {
  if (kind_ != Kind::choice) return std::nullopt;
  for (const std::string_view one : texts_) {
    const std::size_t size = std::min(one.size(), text.size());
    if (text.substr(0, size) == one.substr(0, size)) return size;
  }
  return std::nullopt;
}

std::uint64_t TextFormat::choice_value(std::string_view text) const noexcept {
  const auto found = std::ranges::find(texts_, text);
  return found == texts_.end() ? 0 : static_cast<std::uint64_t>(found - texts_.begin());
}

std::size_t TextFormat::longest() const noexcept {
  const auto size = [this]() -> int {
    const int decimals = decimals_ == 0 ? 0 : decimals_ + 1;
    switch (kind_) {
      case Kind::fixed:
        return std::max(width_, 1 + 16 + decimals);
      case Kind::scientific:
        return std::max(width_, 1 + 1 + decimals + 5);
      case Kind::integer:
        return std::max(width_, 1 + 20);
      case Kind::hexadecimal:
        return width_;
      case Kind::clock:
        return (has_colons_ ? 8 : 6) + decimals;
      case Kind::degrees:
        return width_ + 2 + decimals;
      case Kind::choice:
        return static_cast<int>(std::ranges::max_element(texts_, {}, &std::string::size)->size());
    }
    return 0;
  };
  return static_cast<std::size_t>(size());
}

std::uint64_t TextFormat::period() const noexcept {
  return kind_ == Kind::hexadecimal && width_ < most_digits ? std::uint64_t{1} << 4 * width_ : 0;
}

bool TextFormat::may_have(char c) const noexcept {
  const bool is_digit = c >= '0' && c <= '9';
  switch (kind_) {
    case Kind::fixed:
      return is_digit || c == '.' || c == '-' || c == '+' || c == ' ';
    case Kind::scientific:
      return is_digit || c == '.' || c == '-' || c == '+' || c == ' ' || c == 'e';
    case Kind::integer:
      return is_digit || c == '-' || c == '+' || c == ' ';
    case Kind::hexadecimal:
      return is_digit || (is_lower_ ? c >= 'a' && c <= 'f' : c >= 'A' && c <= 'F');
    case Kind::clock:
    case Kind::degrees:
      return is_digit || c == '.' || (has_colons_ && c == ':');
    case Kind::choice:
      return std::ranges::any_of(texts_, [c](const std::string& one) { return one.find(c) != std::string::npos; });
  }
  return false;
}

// Writes the sign and the digits, in the width.
std::size_t TextFormat::pad(bool is_negative, std::string_view digits, char* out) const noexcept {
  char* at = out;
  const char sign = is_negative ? '-' : has_plus_ ? '+' : has_blank_ ? ' ' : '\0';
  const auto used = static_cast<int>(digits.size()) + (sign != '\0' ? 1 : 0);
  const int missing = std::max(0, width_ - used);
  if (!has_zeros_) at = std::fill_n(at, missing, ' ');
  if (sign != '\0') *at++ = sign;
  if (has_zeros_) at = std::fill_n(at, missing, '0');
  at = std::ranges::copy(digits, at).out;
  return static_cast<std::size_t>(at - out);
}

std::size_t TextFormat::write(std::uint64_t number, char* out) const noexcept {
  if (kind_ == Kind::hexadecimal) {
    const char* const digits = is_lower_ ? "0123456789abcdef" : "0123456789ABCDEF";
    for (int i = width_ - 1; i >= 0; --i, number >>= 4) out[i] = digits[number & 15U];
    return static_cast<std::size_t>(width_);
  }
  char digits[24];
  const auto end = std::to_chars(digits, std::end(digits), number).ptr;
  return pad(false, {digits, end}, out);
}

// Writes a time of day, or an angle in degrees and minutes.
std::size_t TextFormat::write_sexagesimal(double number, char* out, bool& is_saturated) const noexcept {
  const std::int64_t scale = power_of_ten(decimals_), minute = 60 * scale;
  char* at = out;
  std::int64_t rest = 0;  // below the minutes' place
  if (kind_ == Kind::clock) {
    const std::int64_t day = 24 * 60 * minute;
    // The last half step of a day is not rounded up, because a date beside the time is still the old one.
    const std::int64_t nearest =
        std::llround((number - 86400 * std::floor(number / 86400)) * static_cast<double>(scale));
    const std::int64_t ticks = std::min(nearest, day - 1);
    at = write_digits(ticks / (60 * minute), 2, at);
    if (has_colons_) *at++ = ':';
    at = write_digits(ticks / minute % 60, 2, at);
    if (has_colons_) *at++ = ':';
    rest = ticks % minute;
  } else {
    const std::int64_t most = (width_ == 2 ? 100 : 1000) * minute - 1;
    const double wanted = std::abs(number) * static_cast<double>(minute);
    is_saturated = is_saturated || !(wanted < static_cast<double>(most) + 0.5);
    const std::int64_t ticks = wanted < static_cast<double>(most) ? std::llround(wanted) : most;
    at = write_digits(ticks / minute, width_, at);
    rest = ticks % minute;
  }
  at = write_digits(rest / scale, 2, at);
  if (decimals_ > 0) {
    *at++ = '.';
    at = write_digits(rest % scale, decimals_, at);
  }
  return static_cast<std::size_t>(at - out);
}

std::size_t TextFormat::write(double number, char* out, bool& is_saturated) const noexcept {
  if (kind_ == Kind::choice) {
    const double last = static_cast<double>(texts_.size() - 1);
    const double value = texts_.size() == 2 ? (number > 0 ? 1 : 0)
                         : number > 0       ? std::min(std::round(number), last)
                                            : 0;
    const std::string& text = texts_[static_cast<std::size_t>(value)];
    return static_cast<std::size_t>(std::ranges::copy(text, out).out - out);
  }
  const double most = kind_ == Kind::hexadecimal ? std::min(std::ldexp(1.0, 4 * width_ - 1) - 1, largest) : largest;
  const double least = kind_ == Kind::hexadecimal ? -most - 1 : -most;
  const double margin = is_integer() ? 0.5 : 0;
  is_saturated = !(number >= least - margin && number <= most + margin);
  const double limited = (number > least ? std::min(number, most) : least) + 0.0;  // never -0
  char digits[64];
  char* end = digits;
  switch (kind_) {
    case Kind::clock:
    case Kind::degrees:
      return write_sexagesimal(limited, out, is_saturated);
    case Kind::hexadecimal:
      return write(static_cast<std::uint64_t>(std::llround(limited)), out);
    case Kind::integer: {
      const long long rounded = std::llround(limited);
      end = std::to_chars(digits, std::end(digits), std::abs(rounded)).ptr;
      return pad(rounded < 0, {digits, end}, out);
    }
    case Kind::scientific:
      end = std::to_chars(digits, std::end(digits), std::abs(limited), std::chars_format::scientific, decimals_).ptr;
      break;
    default:
      end = write_fixed(digits, std::end(digits), std::abs(limited), decimals_).ptr;
  }
  return pad(limited < 0, {digits, end}, out);
}

std::optional<std::uint64_t> TextFormat::read_integer(std::string_view text) const noexcept {
  return number_in<std::uint64_t>(text.substr(std::min(text.find_first_not_of(" +"), text.size())),
                                  kind_ == Kind::hexadecimal ? 16 : 10);
}

std::optional<double> TextFormat::read(std::string_view text) const noexcept {
  if (kind_ == Kind::hexadecimal) {
    const auto bits = number_in<std::uint64_t>(text, 16);
    if (!bits) return std::nullopt;
    const int unused = 64 - 4 * width_;
    return static_cast<double>(static_cast<std::int64_t>(*bits << unused) >> unused);
  }
  if (value() != Value::named || kind_ == Kind::choice) return std::nullopt;
  return number_in<double>(text.substr(std::min(text.find_first_not_of(" +"), text.size())));
}

std::optional<double> TextFormat::read_sexagesimal(std::string_view text) const noexcept {
  if (value() == Value::named) return std::nullopt;
  const std::size_t first = kind_ == Kind::clock ? 2 : static_cast<std::size_t>(width_), colon = has_colons_ ? 1 : 0;
  if (text.size() < first + colon + 2) return std::nullopt;
  const auto whole = number_in<unsigned>(text.substr(0, first));
  text.remove_prefix(first + colon);
  if (kind_ == Kind::degrees) {
    const auto minutes = number_in<double>(text);
    return whole && minutes ? std::optional(*whole + *minutes / 60) : std::nullopt;
  }
  const auto minutes = number_in<unsigned>(text.substr(0, 2));
  const auto rest = number_in<double>(text.substr(std::min(text.size(), 2 + colon)));
  return whole && minutes && rest ? std::optional(3600.0 * *whole + 60.0 * *minutes + *rest) : std::nullopt;
}

bool TextFormat::matches(std::string_view text) const noexcept {
  if (text.empty()) return may_be_empty_;
  if (text.size() > longest()) return false;
  switch (kind_) {
    case Kind::choice:
      return std::ranges::find(texts_, text) != texts_.end();
    case Kind::hexadecimal:
      return text.size() == longest();
    case Kind::clock:
    case Kind::degrees: {
      if (text.size() != longest()) return false;
      const std::size_t whole = text.size() - (decimals_ == 0 ? 0 : static_cast<std::size_t>(decimals_) + 1);
      return decimals_ == 0 || text[whole] == '.';
    }
    default:
      return read(text).has_value();
  }
}

}  // namespace imud
