#include "emulator/control/line_connection.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>

namespace imud {

std::string silent_text(std::string_view name, Nanoseconds limit) {
  return fmt::format("{}: has not answered within {} s: its process is stopped or too busy, or ends", name,
                     seconds(limit));
}

bool LineConnection::send(std::string line) {
  line += '\n';
  for (std::size_t sent = 0; sent < line.size();) {
    const ssize_t n = ::send(socket_.get(), line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      socket_.reset();
      return false;
    }
    sent += static_cast<std::size_t>(n);
  }
  return true;
}

std::optional<std::string> LineConnection::receive(std::optional<HostTime> until) {
  for (;;) {
    if (const std::size_t end = waiting_.find('\n'); end != waiting_.npos) {
      std::string line = waiting_.substr(0, end);
      waiting_.erase(0, end + 1);
      return line;
    }
    if (!socket_) return std::nullopt;
    if (until) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(std::max(*until - host_now(), Nanoseconds(0)));
      pollfd ready{socket_.get(), POLLIN, 0};
      const int n = ::poll(&ready, 1, static_cast<int>(left.count()));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return std::nullopt;
    }
    std::array<char, 16 * 1024> bytes;
    const ssize_t n = ::recv(socket_.get(), bytes.data(), bytes.size(), 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      socket_.reset();
      return std::nullopt;
    }
    waiting_.append(bytes.data(), static_cast<std::size_t>(n));
  }
}

}  // namespace imud
