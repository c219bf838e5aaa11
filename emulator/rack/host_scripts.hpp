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
  // The reason why the host was not reached, or has not executed the whole script; empty if it has.
  std::string fault;
  // The output of the script, divided into sections; by the names of the sections.
  std::map<std::string, std::string, std::less<>> sections;

  bool has(std::string_view section) const { return sections.contains(section); }
  // Returns the text of a section without the white space at its ends; empty if it is absent.
  std::string text(std::string_view section) const;
};

// Returns the commands of a script that begin a section of the answer.
std::string section(std::string_view name);

// Returns "systemctl" with the option for the host's service manager (RackHost::Service).
std::string systemctl(const RackHost& host);

// Executes scripts[i] by sh(1) on hosts[i], on all hosts at the same time. The standard error of a script is used
// only in HostAnswer::fault. A script that has not ended after `limit` is cut off. ssh never asks a question
// (BatchMode), and reads ssh_config(5).
std::vector<HostAnswer> run_on_hosts(std::span<const RackHost> hosts, std::span<const std::string> scripts,
                                     Nanoseconds limit, const std::atomic<bool>& stop);

// A script whose output is bytes, and the function that receives these bytes piece by piece.
struct Download {
  const RackHost* host = nullptr;
  std::string script;
  std::function<void(std::string_view)> receive;
};
// Executes the scripts as run_on_hosts() does, but without a limit of the time; ssh ends if its host has been silent
// for `limit`. Returns for each script the reason why its bytes are not whole; empty if they are.
std::vector<std::string> download(std::span<const Download> downloads, Nanoseconds limit,
                                  const std::atomic<bool>& stop);

}  // namespace imud
