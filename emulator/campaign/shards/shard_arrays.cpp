#include "emulator/campaign/shards/shard_arrays.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "core/numbers/number_text.hpp"
#include "protocols/measurements/measurement_row.hpp"
#include "transports/file/output_path.hpp"

namespace imud {

namespace {

[[noreturn]] void fail_at(const std::filesystem::path& path, int error) {
  throw std::runtime_error(fmt::format("{}: {}", path.string(), std::strerror(error)));
}

// Reads until `bytes` is full. Returns false at the end of the file, or after an error.
bool read_at(int file, std::span<std::byte> bytes, std::uint64_t offset) noexcept {
  while (!bytes.empty()) {
    const ssize_t size = ::pread(file, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(size));
    offset += static_cast<std::uint64_t>(size);
  }
  return true;
}

}  // namespace

std::uint64_t ArrayShape::block_bytes() const noexcept { return rows * row_size(false); }

std::vector<std::byte> rows_without_value(std::uint64_t count) {
  const MeasurementRow none{Measurement{}};
  const auto bytes = std::as_bytes(std::span(&none, 1)).first(row_size(false));
  std::vector<std::byte> rows;
  rows.reserve(count * bytes.size());
  for (std::uint64_t i = 0; i < count; ++i) rows.insert(rows.end(), bytes.begin(), bytes.end());
  return rows;
}

std::string array_name(const CaseRange& shard) {
  return std::filesystem::path(shard_name(shard)).replace_extension(".rows").string();
}

std::optional<CaseRange> cases_of_array(std::string_view name) noexcept {
  constexpr std::string_view suffix = ".rows";
  if (!name.ends_with(suffix)) return std::nullopt;
  name.remove_suffix(suffix.size());
  const auto cases = range_in<std::uint64_t>(name, "-");
  return cases ? std::optional(CaseRange{cases->first, cases->second}) : std::nullopt;
}

std::optional<ArrayDigest> digest_of_array(const std::filesystem::path& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file) return std::nullopt;
  constexpr std::size_t piece = 1 << 18;
  std::vector<std::byte> held(piece);
  Sha256Stream digest;
  ArrayDigest found;
  while (true) {
    const ssize_t size = ::read(file.get(), held.data(), held.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return std::nullopt;
    if (size == 0) break;
    digest.add(std::span(held).first(static_cast<std::size_t>(size)));
    found.bytes += static_cast<std::uint64_t>(size);
  }
  found.sha256 = digest.end();
  return found;
}

std::filesystem::path ShardArrays::temporary(const CaseRange& shard) const {
  TemporaryFile file = mine_;
  file.name = TemporaryFile::of_shard(shard).name + "-rows";  // it claims no shard
  return folder_ / file.file_name();
}

FileDescriptor ShardArrays::open(const CaseRange& shard) const {
  constexpr mode_t mode = 0666;
  const std::filesystem::path path = temporary(shard);
  FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, mode));
  if (!file) fail_at(path, errno);
  return file;
}

std::uint64_t ShardArrays::place(const CaseRange& shard, std::size_t imu, std::uint64_t index) const noexcept {
  return (imu * shard.size() + index - shard.first) * shape_.block_bytes();
}

ShardArrays::Write ShardArrays::writer(const CaseRange& shard, std::uint64_t index) const {
  if (!are_asked_for()) return nullptr;
  return [this, shard, index, file = std::shared_ptr<FileDescriptor>()](std::size_t imu,
                                                                        std::span<const std::byte> rows) mutable {
    if (imu >= shape_.imus.size() || rows.size() != shape_.block_bytes())
      throw std::runtime_error("the arrays of the case have another shape than those of the first case");
    if (!file) file = std::make_shared<FileDescriptor>(open(shard));
    if (const int error = write_whole_at(file->get(), rows, place(shard, imu, index)); error != 0)
      fail_at(temporary(shard), error);
  };
}

void ShardArrays::clear(const CaseRange& shard, std::uint64_t index) const {
  const std::vector<std::byte> rows = rows_without_value(shape_.rows);
  const Write write = writer(shard, index);
  for (std::size_t imu = 0; imu < shape_.imus.size(); ++imu) write(imu, rows);
}

void ShardArrays::keep(const CaseRange& shard, std::uint64_t index) const {
  const std::filesystem::path path = folder_ / array_name(shard);
  const FileDescriptor from(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!from) fail_at(path, errno);
  std::vector<std::byte> rows(shape_.block_bytes());
  const Write write = writer(shard, index);
  for (std::size_t imu = 0; imu < shape_.imus.size(); ++imu) {
    if (!read_at(from.get(), rows, place(shard, imu, index)))
      throw std::runtime_error(fmt::format("{} has changed since this began; try again", path.string()));
    write(imu, rows);
  }
}

// No row has zeros alone, not even one without a value: a file that was removed and created again has such.
bool ShardArrays::lacks_cases(int file, const CaseRange& shard) const {
  std::vector<std::byte> row(row_size(false));
  for (std::size_t imu = 0; imu < shape_.imus.size(); ++imu)
    for (std::uint64_t index = shard.first; index <= shard.last; ++index)
      if (!read_at(file, row, place(shard, imu, index)) ||
          std::ranges::all_of(row, [](std::byte byte) { return byte == std::byte{0}; }))
        return true;
  return false;
}

std::optional<ArrayDigest> ShardArrays::commit(const CaseRange& shard) const {
  const std::filesystem::path from = temporary(shard), to = folder_ / array_name(shard);
  const FileDescriptor file(::open(from.c_str(), O_RDWR | O_CLOEXEC));
  if (!file && errno == ENOENT) return std::nullopt;
  if (!file) fail_at(from, errno);
  if (lacks_cases(file.get(), shard)) {
    release(shard);
    return std::nullopt;
  }
  if (::fsync(file.get()) != 0) fail_at(from, errno);
  std::optional<ArrayDigest> digest = digest_of_array(from);
  if (!digest) return std::nullopt;
  if (::rename(from.c_str(), to.c_str()) != 0) {
    if (errno == ENOENT) return std::nullopt;
    fail_at(to, errno);
  }
  return digest;
}

void ShardArrays::release(const CaseRange& shard) const noexcept {
  if (are_asked_for()) ::unlink(temporary(shard).c_str());
}

}  // namespace imud
