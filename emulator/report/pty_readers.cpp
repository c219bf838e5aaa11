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

#include "core/numbers/number_text.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

// Returns the process of /proc/NUMBER/stat: "NUMBER (NAME) STATE PARENT ..." (proc(5)); its name is empty if the
// process has ended.
TerminalClient process_of(const fs::path& proc, pid_t process) {
  std::ifstream file(proc / fmt::format("{}/stat", process));
  std::string text;
  std::getline(file, text);
  const std::size_t begin = text.find('('), end = text.rfind(')');
  if (begin == text.npos || end == text.npos || end + 4 > text.size()) return {};
  TerminalClient client{.process = process, .name = text.substr(begin + 1, end - begin - 1)};
  std::from_chars(text.data() + end + 4, text.data() + text.size(), client.parent);
  return client;
}

using Holders = std::map<pid_t, TerminalClient>;

// Returns, for each terminal that is a key of `terminals`, the processes that have it open.
std::map<std::string, Holders> holders_of(const TerminalClients& terminals, const fs::path& proc) {
  std::map<std::string, Holders> holders;
  std::error_code error;
  for (fs::directory_iterator entry(proc, error), none; !error && entry != none; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    const auto process = number_in<pid_t>(name);
    if (!process) continue;
    std::error_code unreadable;
    for (fs::directory_iterator fd(entry->path() / "fd", unreadable); !unreadable && fd != none;
         fd.increment(unreadable)) {
      const fs::path file = fs::read_symlink(fd->path(), unreadable);
      if (unreadable || !terminals.contains(file.native()) || holders[file.native()].contains(*process)) continue;
      if (TerminalClient client = process_of(proc, *process); !client.name.empty())
        holders[file.native()].emplace(*process, std::move(client));
    }
  }
  return holders;
}

// Leaves out imud, and processes that have inherited the terminal.
std::vector<TerminalClient> programs_among(const Holders& holders, const fs::path& proc) {
  std::vector<TerminalClient> clients;
  for (const auto& [process, client] : holders) {
    bool is_inherited = false;
    constexpr int most = 100;  // generations
    pid_t ancestor = client.parent;
    for (int i = 0; i < most && ancestor > 1 && !is_inherited; ++i) {
      is_inherited = holders.contains(ancestor);
      ancestor = process_of(proc, ancestor).parent;
    }
    if (!is_inherited && client.name != "imud") clients.push_back(client);
  }
  return clients;
}

}  // namespace

void find_terminal_clients(TerminalClients& clients, const fs::path& proc) {
  if (clients.empty()) return;
  const std::map<std::string, Holders> holders = holders_of(clients, proc);
  for (auto& [terminal, programs] : clients) {
    const auto found = holders.find(terminal);
    programs = found == holders.end() ? std::vector<TerminalClient>() : programs_among(found->second, proc);
  }
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
  // The names of the terminals, in the order of the ptys; a link that is absent has none.
  std::vector<std::string> terminals;
  TerminalClients all;
  for (const Pty& pty : ptys_) {
    std::error_code error;
    terminals.push_back(pty.is_reported ? std::string() : fs::read_symlink(pty.link, error).string());
    if (!terminals.back().empty()) all.try_emplace(terminals.back());
  }
  find_terminal_clients(all);
  for (std::size_t i = 0; i < ptys_.size(); ++i) {
    if (terminals[i].empty()) continue;
    Pty& pty = ptys_[i];
    const std::vector<TerminalClient>& clients = all[terminals[i]];
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
