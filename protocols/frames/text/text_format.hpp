// TextFormat: the format in which a message has a number as text, for writing and reading.
//
// | format                | text                                                                                |
// |-----------------------|-------------------------------------------------------------------------------------|
// | 6.2f, +07.3f, .4e     | as printf() has it: flags + (sign), blank (place of a sign), 0 (zeros); width; decimals |
// | d, 03d, +5d           | rounded to an integer                                                               |
// | 04X, 8x               | so many hexadecimal digits, negative numbers in two's complement                    |
// | hhmmss, hhmmss.ss     | a time of day, also hh:mm:ss                                                        |
// | ddmm.mmmm, dddmm.mm   | the magnitude of an angle, in degrees and minutes                                   |
// | N/S, A/V, 1/0         | one text where the value is above 0, the other where it is not                      |
// | N/E/A                 | three texts or more, for the values 0, 1, 2 ...                                     |
// | ?                     | after any of them: nothing while the sample is not valid, or the place is not known |
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace imud {

class TextFormat {
 public:
  static constexpr int widest = 32;  // characters that a width may ask for
  static constexpr int most_decimals = 15;
  // The magnitude at which numbers saturate. Hexadecimal numbers, choices and angles saturate earlier.
  static constexpr double largest = 1e15;

  // Reads a format at the beginning of `text`, and removes its characters. Throws std::invalid_argument.
  static TextFormat take(std::string_view& text);

  // The unit of the number: the unit in its name, seconds of the day, or degrees.
  enum class Value : std::uint8_t { named, seconds, degrees };
  Value value() const noexcept;
  // Returns the number of characters of all texts; 0 if it is not constant. Numbers with leading zeros count as
  // constant, although a number that does not fit into its width is longer.
  std::size_t fixed_size() const noexcept;
  // Returns the step between adjacent numbers; 0 if the step is not constant.
  double step() const noexcept;
  int width() const noexcept { return width_; }  // characters at least
  std::size_t longest() const noexcept;          // characters, 1 to 64
  bool may_be_empty() const noexcept { return may_be_empty_; }
  // Returns true for a format whose text length depends on the number.
  bool is_number() const noexcept {
    return kind_ == Kind::fixed || kind_ == Kind::scientific || kind_ == Kind::integer;
  }
  // For a choice of two texts: returns true if `text` is the text for values above 0.
  bool is_above(std::string_view text) const noexcept { return choice_value(text) == 1 && texts_.size() == 2; }
  // Returns the value for which a choice has the text; of equal texts, the lowest value. Returns 0 if the format
  // is no choice.
  std::uint64_t choice_value(std::string_view text) const noexcept;
  // Returns true for formats of integers. A hexadecimal integer without a modulus has period() as its modulus.
  bool is_integer() const noexcept { return kind_ == Kind::integer || kind_ == Kind::hexadecimal; }
  std::uint64_t period() const noexcept;  // 16^digits of hexadecimal digits; 0: 2^64
  // Returns true if a text may have the character.
  bool may_have(char c) const noexcept;

  // Writes a number to `out`, which must have longest() characters, and returns the number of characters. Sets
  // `is_saturated` if the number is beyond the range of the format. A NaN is written as the lowest number.
  std::size_t write(double number, char* out, bool& is_saturated) const noexcept;
  // Does the same for a counter, an integer whose low digits are written.
  std::size_t write(std::uint64_t number, char* out) const noexcept;

  // Return the number in a text; read_integer() only if is_integer(). Return nullopt if the text does not have the
  // format, or no number.
  std::optional<double> read(std::string_view text) const noexcept;
  std::optional<std::uint64_t> read_integer(std::string_view text) const noexcept;
  // Returns the seconds of the day, or the degrees without sign; nullopt if the format is neither a time nor an
  // angle, or the text has no such number.
  std::optional<double> read_sexagesimal(std::string_view text) const noexcept;
  // Returns true if the text has the format.
  bool matches(std::string_view text) const noexcept;
  // Returns the size of the choice's text with which `text` begins. If `text` is only the begin of such a text,
  // returns the size of `text`. Returns nullopt if the format is no choice, or if `text` begins with none of its
  // texts.
  std::optional<std::size_t> chosen(std::string_view text) const noexcept;

 private:
  enum class Kind : std::uint8_t { fixed, scientific, integer, hexadecimal, clock, degrees, choice };
  bool take_choice(std::string_view& text);
  bool take_pattern(std::string_view& text);
  void take_number(std::string_view& text);
  std::size_t pad(bool is_negative, std::string_view digits, char* out) const noexcept;
  std::size_t write_sexagesimal(double number, char* out, bool& is_saturated) const noexcept;

  Kind kind_ = Kind::fixed;
  bool has_plus_ = false, has_blank_ = false, has_zeros_ = false, is_lower_ = false, has_colons_ = false;
  bool may_be_empty_ = false;
  int width_ = 0;  // of hexadecimal: digits; of degrees: of the degrees
  int decimals_ = 6;
  std::vector<std::string> texts_;  // of a choice, by value; of two texts the second is for values above 0
};

}  // namespace imud
