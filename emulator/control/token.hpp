// Token: a secret that clients must show, by TCP and HTTP.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace imud {

class Token {
 public:
  static constexpr std::size_t shortest = 16;  // bytes

  // Returns the first line of the file, without spaces at its ends. Throws OpenError if the file cannot be read, if
  // another user can read it, or if the line is shorter than `shortest`.
  static std::string read_secret(const std::string& path);
  static Token read(const std::string& path) { return Token(read_secret(path)); }
  explicit Token(std::string_view secret);

  // Compares in a time that does not depend on where the two differ: by SHA-256 digests, all of whose bytes are
  // compared.
  bool matches(std::string_view shown) const noexcept;

 private:
  std::array<std::uint8_t, 32> digest_;
};

}  // namespace imud
