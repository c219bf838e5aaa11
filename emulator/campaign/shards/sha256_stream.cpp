#include "emulator/campaign/shards/sha256_stream.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sha256.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <new>
#include <optional>

#include "transports/loaded_library.hpp"

namespace imud {

namespace {

constexpr std::size_t digest_size = 32;

std::string hexadecimal(const std::array<std::uint8_t, digest_size>& digest) {
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

class LibmdDigest final : public Sha256Stream::Digest {
 public:
  LibmdDigest() { ::SHA256Init(&context_); }
  void add(std::span<const std::byte> bytes) noexcept override {
    ::SHA256Update(&context_, reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  }
  std::string end() override {
    std::array<std::uint8_t, digest_size> digest;
    ::SHA256Final(digest.data(), &context_);
    return hexadecimal(digest);
  }

 private:
  SHA2_CTX context_;
};

// The functions of OpenSSL 3 (EVP_DigestInit(3ssl)).
struct Openssl {
  void* (*make)() = nullptr;
  void (*free)(void*) = nullptr;
  const void* (*sha256)() = nullptr;
  int (*begin)(void*, const void*, void*) = nullptr;
  int (*add)(void*, const void*, std::size_t) = nullptr;
  int (*end)(void*, unsigned char*, unsigned*) = nullptr;

  // Throws std::runtime_error if the machine has no such library.
  Openssl() {
    const LoadedLibrary library({"libcrypto.so.3"}, "libssl3");
    library.find("EVP_MD_CTX_new", make);
    library.find("EVP_MD_CTX_free", free);
    library.find("EVP_sha256", sha256);
    library.find("EVP_DigestInit_ex", begin);
    library.find("EVP_DigestUpdate", add);
    library.find("EVP_DigestFinal_ex", end);
  }
};

// Returns nullptr if the machine has no such library.
const Openssl* openssl() {
  static const std::optional<Openssl> library = []() -> std::optional<Openssl> {
    try {
      return Openssl();
    } catch (const std::runtime_error&) {
      return std::nullopt;
    }
  }();
  return library ? &*library : nullptr;
}

class OpensslDigest final : public Sha256Stream::Digest {
 public:
  explicit OpensslDigest(const Openssl& library) : library_(library), context_(library.make(), library.free) {
    if (context_ == nullptr || library_.begin(context_.get(), library_.sha256(), nullptr) != 1)
      throw std::bad_alloc();
  }
  void add(std::span<const std::byte> bytes) noexcept override {
    library_.add(context_.get(), bytes.data(), bytes.size());
  }
  std::string end() override {
    std::array<std::uint8_t, digest_size> digest{};
    library_.end(context_.get(), digest.data(), nullptr);
    return hexadecimal(digest);
  }

 private:
  const Openssl& library_;
  const std::unique_ptr<void, void (*)(void*)> context_;
};

std::unique_ptr<Sha256Stream::Digest> make_digest(bool may_use_openssl) {
  const Openssl* const library = may_use_openssl ? openssl() : nullptr;
  if (library == nullptr) return std::make_unique<LibmdDigest>();
  return std::make_unique<OpensslDigest>(*library);
}

constexpr std::size_t held_at_most = 4096;

}  // namespace

Sha256Stream::Sha256Stream(bool may_use_openssl) : digest_(make_digest(may_use_openssl)), held_(held_at_most) {}

void Sha256Stream::add(std::span<const std::byte> bytes) noexcept {
  if (bytes.size() > held_.size() - used_) flush();
  if (bytes.size() > held_.size()) return digest_->add(bytes);
  std::ranges::copy(bytes, held_.begin() + static_cast<std::ptrdiff_t>(used_));
  used_ += bytes.size();
}

void Sha256Stream::flush() noexcept {
  digest_->add(std::span(held_).first(used_));
  used_ = 0;
}

std::string Sha256Stream::end() {
  flush();
  return digest_->end();
}

}  // namespace imud
