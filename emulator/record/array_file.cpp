#include "emulator/record/array_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "emulator/ground/text_file.hpp"
#include "transports/file/output_path.hpp"

namespace imud {

namespace {

constexpr std::string_view magic = "imudpart";

}  // namespace

ArrayFile::ArrayFile(std::string path, std::span<const MeasurementColumn> columns)
    : path_(std::move(path)), columns_(columns) {
  if (const std::string fault = foreign_link_fault(path_); !fault.empty()) throw OpenError(fault);
  const auto target = FileReplacement::target(path_);
  if (!target) throw OpenError(path_ + ": the rows of an array are written in any order; give a regular file");
  const PortSpec spec{"npy", path_, {}};
  try {
    file_ = std::make_unique<FileReplacement>(spec, *target, FileReplacement::LeftBehind::go_on);
  } catch (const PortError& error) {
    throw OpenError(std::string(error.what()).substr(spec.scheme.size() + 1));
  }
}

std::string ArrayFile::incomplete_path() const {
  return fmt::format("{}{}", FileReplacement::target(path_).value_or(path_), FileReplacement::suffix);
}

// Reads the trailer of a FILE.incomplete that was left behind: sets marks_ and end_, and returns the trailer's text.
// Returns an empty text if there is no valid trailer.
std::string ArrayFile::read_trailer() {
  struct stat status {};
  const int file = file_->descriptor();
  if (!file_->goes_on() || ::fstat(file, &status) != 0) return {};
  const auto size = static_cast<std::uint64_t>(status.st_size);
  std::array<char, locator_size> locator{};
  std::uint64_t begin = 0, length = 0;
  const auto read = [&](void* to, std::uint64_t count, std::uint64_t at) {
    return ::pread(file, to, count, static_cast<off_t>(at)) == static_cast<ssize_t>(count);
  };
  if (size < locator_size || !read(locator.data(), locator_size, size - locator_size)) return {};
  std::memcpy(&begin, locator.data() + magic.size(), sizeof begin);
  if (std::string_view(locator.data(), magic.size()) != magic || begin > size - locator_size - sizeof length)
    return {};
  const std::uint64_t rest = size - locator_size - sizeof length - begin;
  if (!read(&length, sizeof length, begin) || length > rest) return {};
  std::string text(length, '\0');
  marks_.resize(rest - length);
  if (!read(text.data(), length, begin + sizeof length) ||
      !read(marks_.data(), marks_.size(), begin + sizeof length + length))
    return {};
  end_ = begin;
  return text;
}

std::string ArrayFile::begin(std::span<const std::uint64_t> shape, std::size_t row_size, std::string_view text,
                             std::uint64_t parts) {
  std::uint64_t bytes = row_size;
  for (const std::uint64_t size : shape) bytes *= size;
  const std::uint64_t end = first_row() + bytes;
  const std::uint64_t length = text.size();
  trailer_size_ = sizeof length + length + parts + locator_size;
  if (const std::string left = read_trailer(); !left.empty()) {
    if (left == text && end_ == end && marks_.size() == parts) return {};
    return left;
  }
  file_->keep(false);
  end_ = end;
  marks_.assign(parts, 0);
  const int file = file_->descriptor();
  // An empty file is not truncated, because ext4 writes a truncated file to the disk before it returns from close(2).
  struct stat old {};
  if (::fstat(file, &old) != 0 || (old.st_size != 0 && ::ftruncate(file, 0) != 0) ||
      ::ftruncate(file, static_cast<off_t>(end_ + trailer_size_)) != 0)
    error_ = errno;
  std::string trailer(reinterpret_cast<const char*>(&length), sizeof length);
  trailer.append(text);
  write_at(std::as_bytes(std::span(trailer)), end_);
  std::string locator(magic);
  locator.append(reinterpret_cast<const char*>(&end_), sizeof end_);
  write_at(std::as_bytes(std::span(locator)), end_ + trailer_size_ - locator_size);
  const std::string header = npy_header(columns_, shape);
  write_at(std::as_bytes(std::span(header)), 0);
  return {};
}

void ArrayFile::write(std::span<const std::byte> bytes, std::uint64_t offset) noexcept {
  write_at(bytes, first_row() + offset);
}

void ArrayFile::mark(std::uint64_t part) noexcept {
  marks_[part] = 1;
  write_at(std::as_bytes(std::span(marks_).subspan(part, 1)), marks_at() + part);
}

void ArrayFile::check() const {
  if (error_ != 0) throw std::runtime_error(fmt::format("{}: {}", path_, std::strerror(error_)));
}

void ArrayFile::keep(std::span<const std::byte> row) noexcept {
  file_->keep();
  const std::uint64_t part = marks_.empty() ? 0 : (end_ - first_row()) / marks_.size();
  if (part == 0 || row.empty()) return;
  constexpr std::size_t at_once = 4096;
  std::vector<std::byte> rows;
  for (std::size_t i = 0; i < std::min<std::uint64_t>(at_once, part / row.size()); ++i)
    rows.insert(rows.end(), row.begin(), row.end());
  for (std::uint64_t i = 0; i < marks_.size(); ++i) {
    if (is_done(i)) continue;
    for (std::uint64_t at = 0; at < part; at += rows.size())
      write(std::span(rows).first(std::min<std::uint64_t>(rows.size(), part - at)), i * part + at);
  }
}

void ArrayFile::commit() {
  if (error_ == 0 && ::ftruncate(file_->descriptor(), static_cast<off_t>(end_)) != 0) error_ = errno;
  check();
  file_->commit();
}

void ArrayFile::write_at(std::span<const std::byte> bytes, std::uint64_t offset) noexcept {
  if (error_ == 0) error_ = write_whole_at(file_->descriptor(), bytes, offset);
}

}  // namespace imud
