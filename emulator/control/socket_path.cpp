#include "emulator/control/socket_path.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <set>
#include <string_view>

#include "emulator/ground/text_file.hpp"

namespace imud {
namespace {

constexpr const char* service_folder = "/run/imud";  // of imud@.service
constexpr std::string_view prefix = "imud-", suffix = ".sock";

std::optional<sockaddr_un> address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) return std::nullopt;
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

// A folder in which nobody else can put or replace files. In /tmp another user may have made one of that name.
bool is_own_folder(const std::string& path) {
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode) && status.st_uid == ::geteuid() &&
         (status.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

bool is_file_of(const std::string& path, dev_t device, ino_t inode) {
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0 && status.st_dev == device && status.st_ino == inode;
}

// Opens and locks the folder of `path`, so that two instances that start together do not replace each other's
// socket.
FileDescriptor locked_folder_of(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  FileDescriptor descriptor(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (descriptor) ::flock(descriptor.get(), LOCK_EX);
  return descriptor;
}

// Returns the files with the name of a socket, by path.
std::vector<Instance> sockets_in(const std::string& folder) {
  std::vector<Instance> all;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string file = entry.path().filename().string();
    if (file.starts_with(prefix) && file.ends_with(suffix) && file.size() > prefix.size() + suffix.size())
      all.push_back({file.substr(prefix.size(), file.size() - prefix.size() - suffix.size()), entry.path().string()});
  }
  std::sort(all.begin(), all.end(), [](const Instance& a, const Instance& b) { return a.path < b.path; });
  return all;
}

// Removes the sockets on which no process listens.
void remove_stale(const std::string& folder) {
  const FileDescriptor lock = locked_folder_of(folder + "/");
  std::error_code error;
  for (const Instance& one : sockets_in(folder))
    if (is_socket(std::filesystem::symlink_status(one.path, error)) && !connect_to_socket(one.path) &&
        errno == ECONNREFUSED)
      ::unlink(one.path.c_str());
}

std::string names_text(const std::vector<Instance>& all) {
  std::string names;
  for (const Instance& one : all) names += (names.empty() ? "" : ", ") + one.name;
  return names;
}

}  // namespace

std::vector<std::string> socket_folders() {
  std::vector<std::string> folders;
  // A unit may have several folders, separated by colons (systemd.exec(5)).
  if (const char* unit = std::getenv("RUNTIME_DIRECTORY")) {
    const std::string_view all = unit;
    if (!all.empty()) folders.emplace_back(all.substr(0, all.find(':')));
  }
  if (const char* user = std::getenv("XDG_RUNTIME_DIR"); user != nullptr && *user == '/') folders.emplace_back(user);
  if (::geteuid() == 0) folders.emplace_back(service_folder);
  folders.push_back(fmt::format("/tmp/imud-{}", ::geteuid()));
  return folders;
}

std::string socket_path(const std::string& folder, const std::string& name) {
  return fmt::format("{}/{}{}{}", folder, prefix, name, suffix);
}

FileDescriptor connect_to_socket(const std::string& path) {
  const auto address = address_of(path);
  if (!address) {
    errno = ENAMETOOLONG;
    return {};
  }
  FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  // The timeout limits connect(), too (unix_stream_connect() of the kernel): a stopped process accepts nothing.
  const timeval longest{.tv_sec = 1, .tv_usec = 0}, none{};
  if (socket) ::setsockopt(socket.get(), SOL_SOCKET, SO_SNDTIMEO, &longest, sizeof longest);
  if (!socket || ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0)
    return {};
  ::setsockopt(socket.get(), SOL_SOCKET, SO_SNDTIMEO, &none, sizeof none);
  return socket;
}

ControlSocketFile::ControlSocketFile(const std::string& path) : path_(path) {
  const auto fail = [&](std::string_view what) { throw OpenError(fmt::format("{}: {}", path, what)); };
  const auto address = address_of(path);
  if (!address) fail(fmt::format("a socket's path has 1 to {} bytes", sizeof(sockaddr_un::sun_path) - 1));
  const FileDescriptor lock = locked_folder_of(path);
  if (!lock) fail(fmt::format("its folder: {}", std::strerror(errno)));
  struct stat status {};
  if (::lstat(path.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode)) fail("there is something that is no socket");
    if (connect_to_socket(path) || errno != ECONNREFUSED)
      fail("another imud listens there, or a socket of another user");
    if (::unlink(path.c_str()) != 0) fail(std::strerror(errno));
  }
  socket_.reset(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  // On Linux the file gets the mode of the descriptor (unix_bind() of the kernel).
  if (!socket_ || ::fchmod(socket_.get(), S_IRUSR | S_IWUSR) != 0 ||
      ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0)
    fail(std::strerror(errno));
  constexpr int waiting = 128;
  if (::lstat(path.c_str(), &status) != 0 || ::listen(socket_.get(), waiting) != 0) fail(std::strerror(errno));
  device_ = status.st_dev;
  inode_ = status.st_ino;
}

ControlSocketFile ControlSocketFile::in_folder(const std::string& name) {
  std::string faults;
  for (const std::string& folder : socket_folders()) {
    ::mkdir(folder.c_str(), S_IRWXU);
    if (!is_own_folder(folder)) {
      faults += fmt::format("{}{}: no folder of this user alone", faults.empty() ? "" : "; ", folder);
      continue;
    }
    remove_stale(folder);
    const std::string path = socket_path(folder, name);
    // If an instance of that name runs, the other folders are not tried.
    if (connect_to_socket(path)) throw OpenError(fmt::format("{}: an imud of that name runs already", path));
    try {
      return ControlSocketFile(path);
    } catch (const OpenError& error) {
      faults += fmt::format("{}{}", faults.empty() ? "" : "; ", error.what());
    }
  }
  throw OpenError(faults);
}

ControlSocketFile::~ControlSocketFile() {
  if (inode_ == 0 || path_.empty()) return;
  const FileDescriptor lock = locked_folder_of(path_);
  if (is_file_of(path_, device_, inode_)) ::unlink(path_.c_str());
}

int ControlSocketFile::release() noexcept {
  const int descriptor = ::fcntl(socket_.get(), F_DUPFD_CLOEXEC, 0);
  socket_.reset();
  return descriptor;
}

Instances find_instances() {
  Instances found;
  std::set<std::string> folders;
  std::vector<std::string> all = socket_folders();
  all.push_back(service_folder);
  for (const std::string& folder : all) {
    // In /tmp another user may have made it; the user of a service may own one in /run.
    if ((!folder.starts_with("/run/") && !is_own_folder(folder)) || !folders.insert(folder).second) continue;
    for (Instance& one : sockets_in(folder)) {
      const int error = connect_to_socket(one.path) ? 0 : errno;
      if (error != 0 && error != EAGAIN && error != ECONNREFUSED && error != EACCES) continue;
      auto& kind = error == ECONNREFUSED ? found.killed : error == EACCES ? found.foreign : found.running;
      kind.push_back(std::move(one));
    }
  }
  return found;
}

const Instance* Instances::running_by_name(const std::string& name) const {
  if (name.empty()) return running.size() == 1 ? &running[0] : nullptr;
  const auto found = std::ranges::find(running, name, &Instance::name);
  return found == running.end() ? nullptr : &*found;
}

std::string none_text(const Instances& found, const std::string& name) {
  for (const Instance& one : found.killed)
    if (one.name == name)
      return fmt::format("{} does not run: it was killed, and has left {}, which the next run removes", name,
                         one.path);
  if (found.running.empty()) {
    std::string text = fmt::format(
        "no imud of this user runs{}: start one by imud run; one with [control] socket = \"none\" is not shown",
        name.empty() ? "" : ", so that none is named " + name);
    if (!found.killed.empty()) text += fmt::format("; killed were: {}", names_text(found.killed));
    return text;
  }
  if (name.empty()) return fmt::format("several run; choose one by --name: {}", names_text(found.running));
  return fmt::format("there is no {}; those that run: {}", name, names_text(found.running));
}

}  // namespace imud
