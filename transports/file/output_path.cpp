#include "transports/file/output_path.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <system_error>

namespace imud {
namespace {

bool others_can_write(const std::filesystem::path& folder) {
  struct stat status {};
  return ::stat(folder.c_str(), &status) == 0 && (status.st_mode & (S_IWGRP | S_IWOTH)) != 0;
}

}  // namespace

std::string foreign_link(const std::string& path, uid_t user) {
  constexpr int most_links = 40;  // as in Linux
  std::filesystem::path next = path;
  for (int i = 0; i < most_links; ++i) {
    std::filesystem::path walked, folder;
    bool is_link = false;
    for (const std::filesystem::path& part : next) {
      folder = walked.empty() ? "." : walked;
      walked /= part;
      struct stat status {};
      if (::lstat(walked.c_str(), &status) != 0) return {};
      is_link = S_ISLNK(status.st_mode);
      if (is_link && status.st_uid != 0 && status.st_uid != user && others_can_write(folder)) return walked.string();
    }
    if (!is_link) return {};
    std::error_code error;
    next = folder / std::filesystem::read_symlink(walked, error);
    if (error) return {};
  }
  return {};
}

std::string foreign_link_fault(const std::string& path) {
  const std::string link = foreign_link(path);
  return link.empty() ? link
                      : link +
                            " is a symbolic link that another user has made in a folder which others can write; "
                            "give another path";
}

bool is_standard_output(const std::string& path) {
  return path == "-" || path == "/dev/stdout" || path == "/dev/fd/1" || path == "/proc/self/fd/1";
}

int write_whole(int file, std::span<const std::byte> bytes) noexcept {
  while (!bytes.empty()) {
    const ssize_t size = ::write(file, bytes.data(), bytes.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return errno;
    bytes = bytes.subspan(static_cast<std::size_t>(size));
  }
  return 0;
}

int write_whole_at(int file, std::span<const std::byte> bytes, std::uint64_t offset) noexcept {
  while (!bytes.empty()) {
    const ssize_t size = ::pwrite(file, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return errno;
    bytes = bytes.subspan(static_cast<std::size_t>(size));
    offset += static_cast<std::uint64_t>(size);
  }
  return 0;
}

void open_closed_streams() noexcept {
  int file = 0;
  while (file >= 0 && file <= STDERR_FILENO) file = ::open("/dev/null", O_RDWR);  // the lowest that is free
  if (file >= 0) ::close(file);
}

int flush_standard_output() noexcept {
  errno = 0;
  std::cout.flush();
  const bool good = std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good();
  if (good || errno == EPIPE) return 0;
  return errno == 0 ? EIO : errno;
}

}  // namespace imud
