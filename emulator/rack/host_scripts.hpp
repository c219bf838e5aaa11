// HostScripts: runs a shell script on each host of a rack, by ssh.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"
#include "emulator/rack/rack_hosts.hpp"

namespace imud {

struct HostAnswer {
  // Why the host was not reached, or has not executed all; empty if it has.
  std::string fault;
  // The output of the script, by the names of its sections.
  std::map<std::string, std::string, std::less<>> sections;

  bool has(std::string_view section) const { return sections.contains(section); }
  // Returns the text of a section without the white space at its ends; empty if it is absent.
  std::string text(std::string_view section) const;
};

// Returns the commands that begin a section of the answer.
std::string section(std::string_view name);

// Returns "systemctl" with the option of the host's manager.
std::string systemctl(const RackHost& host);

// Executes scripts[i] by sh(1) on hosts[i], on all at the same time; their standard error counts as their output only
// if they fail. A host that has not ended after `limit` is cut off. ssh never asks for anything (BatchMode), and has
// its options from ssh_config(5).
std::vector<HostAnswer> run_on_hosts(std::span<const RackHost> hosts, std::span<const std::string> scripts,
                                     Nanoseconds limit, const std::atomic<bool>& stop);

// A script whose output is bytes, and what receives them piece by piece.
struct Download {
  const RackHost* host = nullptr;
  std::string script;
  std::function<void(std::string_view)> receive;
};
// Executes the scripts as run_on_hosts() does, however long that takes; ssh ends if its host has been silent for
// `limit`. Returns for each why its bytes are not whole; empty if they are.
std::vector<std::string> download(std::span<const Download> downloads, Nanoseconds limit,
                                  const std::atomic<bool>& stop);

}  // namespace imud
