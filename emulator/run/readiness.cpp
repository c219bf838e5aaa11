#include "emulator/run/readiness.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

// Returns the ports that no process reads.
std::vector<std::string> unread_ports(Engine& engine, const Config& config) {
  std::vector<std::string> unread;
  for (std::size_t i = 0; i < config.imus.size(); ++i) {
    Channel& channel = *engine.channels()[i];
    // Checks whether the port has a reader. Does not read a host's bytes.
    const auto check = [&](DeviceLine& line, const std::string& port) {
      line.port->flush();
      if (line.port->state() == PortState::no_reader) unread.push_back(port);
    };
    const ImuConfig& imu = config.imus[i];
    for (std::size_t uart = 0; DeviceLine & line : channel.lines.all())
      check(line, uart++ == 0 ? imu.port : imu.second_port);
    for (std::size_t copy = 0; DeviceLine & line : channel.lines.copies().lines()) check(line, imu.also[copy++]);
    channel.publish();
  }
  return unread;
}

}  // namespace

// `@` begins an abstract address. libsystemd is not used, because every start of imud would load its libraries.
void notify_manager(std::string_view state) {
  const char* const path = std::getenv("NOTIFY_SOCKET");
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  if (path == nullptr || (path[0] != '/' && path[0] != '@') || std::strlen(path) >= sizeof address.sun_path) return;
  std::memcpy(address.sun_path, path, std::strlen(path));
  if (path[0] == '@') address.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + std::strlen(path));
  const FileDescriptor socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ::sendto(socket.get(), state.data(), state.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address), size);
}

void report_ready(const ChosenPorts& chosen, std::optional<int> ready_fd) {
  std::string ports;
  for (const auto& [key, port] : chosen) ports += fmt::format(", {} is {}", key, port);
  spdlog::info("ready{}", ports);
  notify_manager("READY=1");
  if (!ready_fd) return;
  const FileDescriptor descriptor(*ready_fd);
  constexpr std::string_view ready = "ready\n";
  if (::write(descriptor.get(), ready.data(), ready.size()) < 0)
    spdlog::warn("--ready-fd {}: cannot be written: {}", *ready_fd, strerrordesc_np(errno));
}

void report_reloading() { notify_manager(fmt::format("RELOADING=1\nMONOTONIC_USEC={}", host_now().ns / 1000)); }

void report_reloaded() { notify_manager("READY=1"); }

void report_stopping() { notify_manager("STOPPING=1"); }

void wait_for_readers(Engine& engine, const Config& config, boost::asio::io_context& io,
                      const std::function<bool()>& stopped) {
  constexpr auto pause = std::chrono::milliseconds(10);
  std::vector<std::string> reported;
  for (;;) {
    std::vector<std::string> unread = unread_ports(engine, config);
    if (unread.empty() || stopped()) break;
    if (unread != reported) spdlog::info("waiting for a reader of {}", fmt::join(unread, ", "));
    reported = std::move(unread);
    io.run_for(pause);
  }
  io.restart();
}

}  // namespace imud
