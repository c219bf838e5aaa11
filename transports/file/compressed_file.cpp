#include "transports/file/compressed_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <new>

namespace imud {
namespace {

class GzipFile final : public CompressedFile {
 public:
  explicit GzipFile(FileDescriptor file) : CompressedFile(std::move(file)) {
    constexpr int gzip_only = 16;
    if (::inflateInit2(&stream_, gzip_only + MAX_WBITS) != Z_OK) throw std::bad_alloc();
  }
  ~GzipFile() override { ::inflateEnd(&stream_); }

 private:
  std::size_t decompress(std::span<std::byte> room) noexcept override {
    const std::span<std::byte> bytes = input();
    if (is_between_members_ && bytes.empty()) return 0;
    if (is_between_members_) ::inflateReset(&stream_);
    stream_.next_in = reinterpret_cast<Bytef*>(bytes.data());
    stream_.avail_in = static_cast<uInt>(bytes.size());
    stream_.next_out = reinterpret_cast<Bytef*>(room.data());
    stream_.avail_out = static_cast<uInt>(room.size());
    const int result = ::inflate(&stream_, Z_NO_FLUSH);
    consume(bytes.size() - stream_.avail_in);
    is_between_members_ = result == Z_STREAM_END;
    if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR)  // Z_BUF_ERROR: more input is needed
      fail(stream_.msg != nullptr ? stream_.msg : "not gzip");
    return room.size() - stream_.avail_out;
  }

  z_stream stream_{};
};

class ZstdFile final : public CompressedFile {
 public:
  explicit ZstdFile(FileDescriptor file) : CompressedFile(std::move(file)), stream_(::ZSTD_createDStream()) {
    if (!stream_) throw std::bad_alloc();
  }

 private:
  std::size_t decompress(std::span<std::byte> room) noexcept override {
    if (is_between_members_ && input().empty()) return 0;
    ZSTD_inBuffer in{input().data(), input().size(), 0};
    ZSTD_outBuffer out{room.data(), room.size(), 0};
    const std::size_t left = ::ZSTD_decompressStream(stream_.get(), &out, &in);
    consume(in.pos);
    if (::ZSTD_isError(left) != 0) fail(::ZSTD_getErrorName(left));
    is_between_members_ = left == 0;
    return out.pos;
  }

  struct Free {
    void operator()(ZSTD_DStream* stream) const noexcept { ::ZSTD_freeDStream(stream); }
  };
  std::unique_ptr<ZSTD_DStream, Free> stream_;
};

}  // namespace

std::unique_ptr<CompressedFile> CompressedFile::open(int fd) {
  struct stat status {};
  std::array<std::uint8_t, 4> begin{};
  if (::fstat(fd, &status) != 0 || !S_ISREG(status.st_mode) ||
      ::pread(fd, begin.data(), begin.size(), 0) != static_cast<ssize_t>(begin.size()))
    return nullptr;
  const bool is_gzip = begin[0] == 0x1F && begin[1] == 0x8B;
  const bool is_zstd = begin == std::array<std::uint8_t, 4>{0x28, 0xB5, 0x2F, 0xFD};
  if (!is_gzip && !is_zstd) return nullptr;
  FileDescriptor file(::fcntl(fd, F_DUPFD_CLOEXEC, 0));
  if (!file) return nullptr;
  std::unique_ptr<CompressedFile> opened;
  if (is_gzip)
    opened = std::make_unique<GzipFile>(std::move(file));
  else
    opened = std::make_unique<ZstdFile>(std::move(file));
  opened->first_.resize(4096);
  if (const ssize_t size = opened->decompress_next(opened->first_); size > 0)
    opened->ahead_ = std::span(opened->first_).first(static_cast<std::size_t>(size));
  return opened;
}

std::string_view CompressedFile::without_suffix(std::string_view path) noexcept {
  for (const std::string_view suffix : {".gz", ".zst"})
    if (path.ends_with(suffix)) path.remove_suffix(suffix.size());
  return path;
}

ssize_t CompressedFile::read(std::span<std::byte> room) noexcept {
  if (ahead_.empty()) return decompress_next(room);
  const std::size_t size = std::min(room.size(), ahead_.size());
  std::memcpy(room.data(), ahead_.data(), size);
  ahead_ = ahead_.subspan(size);
  return static_cast<ssize_t>(size);
}

ssize_t CompressedFile::decompress_next(std::span<std::byte> room) noexcept {
  while (error_.empty()) {
    // This is called without input, too: the library may have kept bytes for which `room` had no place.
    if (const std::size_t size = decompress(room); size > 0) return static_cast<ssize_t>(size);
    if (!error_.empty() || begin_ != end_) continue;
    const ssize_t size = ::read(file_.get(), buffer_.data(), buffer_.size());
    if (size == 0 && is_between_members_) return 0;
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) fail(size == 0 ? "cut short" : ::strerrordesc_np(errno));
    begin_ = 0;
    end_ = static_cast<std::size_t>(std::max<ssize_t>(size, 0));
  }
  return -1;
}

}  // namespace imud
