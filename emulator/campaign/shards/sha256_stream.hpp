// Sha256Stream: the SHA-256 (FIPS 180-4) of bytes that come in pieces.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace imud {

// Uses OpenSSL's library, which has the processor's SHA instructions, if the machine has this library; otherwise
// libmd, which takes seven times as long. add() collects short pieces, and allocates nothing. One thread.
class Sha256Stream {
 public:
  // `may_use_openssl`: false: libmd is used in any case.
  explicit Sha256Stream(bool may_use_openssl = true);

  void add(std::span<const std::byte> bytes) noexcept;
  void add(std::string_view text) noexcept { add(std::as_bytes(std::span(text))); }
  // Returns the digest of all bytes in hexadecimal. add() must not be called afterwards.
  std::string end();

  // A digest by one of the two libraries.
  class Digest {
   public:
    virtual ~Digest() = default;
    virtual void add(std::span<const std::byte> bytes) noexcept = 0;
    virtual std::string end() = 0;
  };

 private:
  void flush() noexcept;

  std::unique_ptr<Digest> digest_;
  std::vector<std::byte> held_;
  std::size_t used_ = 0;  // bytes of held_
};

}  // namespace imud
