#include "emulator/control/token.hpp"

#include <fmt/format.h>
#include <sha256.h>
#include <sys/stat.h>

#include <fstream>

#include "emulator/ground/text_file.hpp"

namespace imud {
namespace {

std::array<std::uint8_t, SHA256_DIGEST_LENGTH> digest_of(std::string_view text) noexcept {
  std::array<std::uint8_t, SHA256_DIGEST_LENGTH> digest;
  SHA2_CTX context;
  SHA256Init(&context);
  SHA256Update(&context, reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  SHA256Final(digest.data(), &context);
  return digest;
}

}  // namespace

Token::Token(std::string_view secret) : digest_(digest_of(secret)) {}

std::string Token::read_secret(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) throw OpenError(fmt::format("{}: the token cannot be read", path));
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    throw OpenError(fmt::format("{}: others can read the token: chmod 600 {}", path, path));
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  constexpr std::string_view spaces = " \t\r";
  const std::size_t first = line.find_first_not_of(spaces), last = line.find_last_not_of(spaces);
  std::string secret = first == line.npos ? std::string() : line.substr(first, last + 1 - first);
  if (secret.size() < shortest)
    throw OpenError(
        fmt::format("{}: the token in its first line must have at least {} characters, such as "
                    "`openssl rand -hex 16` prints",
                    path, shortest));
  return secret;
}

bool Token::matches(std::string_view shown) const noexcept {
  const auto other = digest_of(shown);
  unsigned difference = 0;
  for (std::size_t i = 0; i < digest_.size(); ++i) difference |= static_cast<unsigned>(digest_[i] ^ other[i]);
  return difference == 0;
}

}  // namespace imud
