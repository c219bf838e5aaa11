#include "transports/uart/pty_pair.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <optional>
#include <tuple>
#include <utility>

namespace imud {
namespace {

constexpr std::string_view slaves = "/dev/pts/";

// Returns true if the pty that `link` points to still belongs to the process that made the link. The kernel reuses a
// number as soon as it is free, so a pty that is younger than the link is another process's. I/O does not change
// st_ctim.
bool is_served(const std::string& link) noexcept {
  struct stat made {
  }, pty{};
  if (::lstat(link.c_str(), &made) != 0 || ::stat(link.c_str(), &pty) != 0) return false;
  return std::tie(pty.st_ctim.tv_sec, pty.st_ctim.tv_nsec) <= std::tie(made.st_mtim.tv_sec, made.st_mtim.tv_nsec);
}

PortError failed(const PortSpec& spec, std::string_view what) {
  return spec.error(fmt::format("{}: {}", what, std::strerror(errno)));
}

std::optional<int> number_of(const FileDescriptor& master) noexcept {
  int number = 0;
  if (!master || ::ioctl(master.get(), TIOCGPTN, &number) != 0) return std::nullopt;
  return number;
}

std::string slave_of(const PortSpec& spec, const FileDescriptor& master) {
  const auto number = number_of(master);
  if (!number) throw failed(spec, "cannot make a pty");
  return fmt::format("{}{}", slaves, *number);
}

// Returns no descriptor, with errno, on failure.
FileDescriptor open_master() noexcept {
  FileDescriptor master(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (master && (::grantpt(master.get()) != 0 || ::unlockpt(master.get()) != 0)) master.reset();
  return master;
}

FileDescriptor new_master(const PortSpec& spec) {
  FileDescriptor master = open_master();
  if (!master) throw failed(spec, "cannot make a pty");
  return master;
}

}  // namespace

bool make_raw(int fd) noexcept {
  termios line{};
  if (::tcgetattr(fd, &line) != 0) return false;
  ::cfmakeraw(&line);
  return ::tcsetattr(fd, TCSANOW, &line) == 0;
}

PtyPair::PtyPair(const PortSpec& spec) : PtyPair(spec, new_master(spec)) {
  const FileDescriptor slave = open_slave();
  if (!slave || !make_raw(slave.get())) throw failed(spec, slave_);
}

PtyPair::PtyPair(const PortSpec& spec, FileDescriptor master)
    : master_(std::move(master)), slave_(slave_of(spec, master_)) {}

bool PtyPair::replace(FileDescriptor master) noexcept {
  const auto number = number_of(master);
  if (!number) return false;
  std::array<char, 16> digits{};
  const char* end = std::to_chars(digits.data(), digits.data() + digits.size(), *number).ptr;
  slave_.resize(slaves.size());  // short enough for no allocation
  slave_.append(digits.data(), static_cast<std::size_t>(end - digits.data()));
  master_ = std::move(master);
  return true;
}

void PtyPair::hang_up() noexcept {
  std::array<char, 32> target{};
  const ssize_t size = link_.empty() ? 0 : ::readlink(link_.c_str(), target.data(), target.size());
  if (size > 0 && std::string_view(target.data(), static_cast<std::size_t>(size)) == slave_) ::unlink(link_.c_str());
  master_.reset();
}

bool PtyPair::renew() noexcept {
  if (!replace(open_master())) return false;
  const FileDescriptor slave = open_slave();
  if (slave && make_raw(slave.get())) return true;
  master_.reset();
  return false;
}

bool PtyPair::renew_link() const noexcept { return link_.empty() || ::symlink(slave_.c_str(), link_.c_str()) == 0; }

PtyPair::~PtyPair() {
  if (link_.empty()) return;
  std::error_code error;
  if (std::filesystem::read_symlink(link_, error) == slave_) std::filesystem::remove(link_, error);
}

FileDescriptor PtyPair::open_slave() const noexcept {
  return FileDescriptor(::open(slave_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
}

void PtyPair::make_link(const PortSpec& spec, bool replace_served) {
  namespace fs = std::filesystem;
  const std::string& link = spec.address;
  std::error_code error;
  const fs::file_status old = fs::symlink_status(link, error);
  if (fs::is_symlink(old)) {
    const std::string target = fs::read_symlink(link, error).string();
    if (!target.starts_with(slaves))
      throw spec.error(fmt::format("is a link to {}, not to a pty; it is left alone, choose another name", target));
    if (target != slave_ && !replace_served && is_served(link))
      throw spec.error(fmt::format(
          "another process serves it ({}); stop that one, choose another name, or remove the link", target));
  } else if (fs::exists(old)) {
    throw spec.error("exists and is not a link; it is left alone, choose another name");
  }

  // The new link replaces the old one in one step.
  const std::string fresh = fmt::format("{}.{}.{}", link, ::getpid(), slave_.substr(slaves.size()));
  fs::create_symlink(slave_, fresh, error);
  if (!error) fs::rename(fresh, link, error);
  if (error) {
    std::error_code ignored;
    fs::remove(fresh, ignored);
    throw spec.error(fmt::format("cannot make the link: {}", error.message()));
  }
  link_ = link;
}

}  // namespace imud
