#include "emulator/report/journal_sink.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cstdint>
#include <cstring>
#include <string_view>
#include <utility>

#include "emulator/report/log.hpp"

namespace imud {
namespace {

// Appends a field. A value with a line feed is preceded by its size, little-endian.
void append(std::string& out, std::string_view name, std::string_view value) {
  out += name;
  if (value.find('\n') == value.npos) {
    out += '=';
  } else {
    out += '\n';
    for (std::uint64_t size = value.size(), i = 0; i < sizeof size; ++i)
      out += static_cast<char>(size >> (8 * i) & 0xFF);
  }
  out += value;
  out += '\n';
}

}  // namespace

int journal_priority(spdlog::level::level_enum level) noexcept {
  constexpr int critical = 2, error = 3, warning = 4, information = 6, debugging = 7;
  switch (level) {
    case spdlog::level::critical:
      return critical;
    case spdlog::level::err:
      return error;
    case spdlog::level::warn:
      return warning;
    case spdlog::level::info:
      return information;
    default:
      return debugging;
  }
}

// libsystemd is not used, because every start of imud would load its libraries.
JournalSink::JournalSink(spdlog::sink_ptr other)
    : other_(std::move(other)), socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {}

void JournalSink::sink_it_(const spdlog::details::log_msg& message) {
  std::string datagram;
  append(datagram, "MESSAGE", {message.payload.data(), message.payload.size()});
  append(datagram, "PRIORITY", fmt::to_string(journal_priority(message.level)));
  append(datagram, "SYSLOG_IDENTIFIER", "imud");
  const LogFields::Values fields = LogFields::now();
  if (!fields.imu.empty()) append(datagram, "IMU", fields.imu);
  if (!fields.counter.empty()) append(datagram, "COUNTER", fields.counter);
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  static_assert(sizeof address.sun_path > std::string_view(socket_path).size());
  std::memcpy(address.sun_path, socket_path, std::strlen(socket_path));
  if (::sendto(socket_.get(), datagram.data(), datagram.size(), MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0)
    other_->log(message);
}

}  // namespace imud
