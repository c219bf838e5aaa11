#include "emulator/report/pty_readers.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <charconv>
#include <filesystem>
#include <fstream>
#include <map>
#include <system_error>
#include <utility>

#include "transports/port.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

// Returns the process of /proc/NUMBER/stat: "NUMBER (NAME) STATE PARENT ..." (proc(5)); its name is empty if it has
// ended.
TerminalClient process_of(pid_t process) {
  std::ifstream file(fmt::format("/proc/{}/stat", process));
  std::string text;
  std::getline(file, text);
  const std::size_t begin = text.find('('), end = text.rfind(')');
  if (begin == text.npos || end == text.npos || end + 4 > text.size()) return {};
  TerminalClient client{.process = process, .name = text.substr(begin + 1, end - begin - 1)};
  std::from_chars(text.data() + end + 4, text.data() + text.size(), client.parent);
  return client;
}

bool has_open(pid_t process, const std::string& terminal) {
  std::error_code error;
  for (fs::directory_iterator fd(fmt::format("/proc/{}/fd", process), error), none; !error && fd != none;
       fd.increment(error)) {
    std::error_code unreadable;
    if (fs::read_symlink(fd->path(), unreadable) == terminal && !unreadable) return true;
  }
  return false;
}

}  // namespace

std::vector<TerminalClient> terminal_clients(const std::string& terminal) {
  std::map<pid_t, TerminalClient> holders;
  std::error_code error;
  for (fs::directory_iterator entry("/proc", error), none; !error && entry != none; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    pid_t process = 0;
    const auto [end, fault] = std::from_chars(name.data(), name.data() + name.size(), process);
    if (fault != std::errc() || end != name.data() + name.size() || !has_open(process, terminal)) continue;
    if (TerminalClient client = process_of(process); !client.name.empty())
      holders.emplace(process, std::move(client));
  }
  std::vector<TerminalClient> clients;
  for (const auto& [process, client] : holders) {
    bool is_inherited = false;
    constexpr int most = 100;  // generations
    pid_t ancestor = client.parent;
    for (int i = 0; i < most && ancestor > 1 && !is_inherited; ++i) {
      is_inherited = holders.contains(ancestor);
      ancestor = process_of(ancestor).parent;
    }
    if (!is_inherited && client.name != "imud") clients.push_back(client);
  }
  return clients;
}

void PtyReaders::watch(const Config& config) {
  const std::vector<Pty> before = std::exchange(ptys_, {});
  const auto add = [&](const std::string& imu, const std::string& port) {
    const Transport* transport = transport_of(port);
    if (transport == nullptr || !transport->makes_link) return;
    ptys_.push_back({imu, port, PortSpec::parse(port).address});
    for (const Pty& pty : before)
      if (pty.imu == imu && pty.port == port) ptys_.back().is_reported = pty.is_reported;
  };
  for (const ImuConfig& imu : config.imus)
    for (const auto& [key, port] : ports_of(imu)) add(imu.name, port);
}

void PtyReaders::update(HostTime now) {
  if (now < next_) return;
  next_ = now + period;
  for (Pty& pty : ptys_) {
    if (pty.is_reported) continue;
    std::error_code error;
    const fs::path terminal = fs::read_symlink(pty.link, error);
    if (error) continue;
    const std::vector<TerminalClient> clients = terminal_clients(terminal.string());
    if (clients.size() < 2) continue;
    pty.is_reported = true;
    std::vector<std::string> names;
    for (const TerminalClient& client : clients) names.push_back(fmt::format("{} ({})", client.name, client.process));
    spdlog::warn(
        "{}: {} programs have {} open, {}: each byte reaches only one of them; give one a port of its own by also = "
        "[\"pty:...\"] in [[imu]] (reported once)",
        pty.imu, clients.size(), pty.port, fmt::join(names, " and "));
  }
}

}  // namespace imud
