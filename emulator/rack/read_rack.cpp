#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <string_view>

#include "emulator/config/config_text.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/rack/rack_hosts.hpp"

namespace imud {
namespace {

constexpr std::string_view letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_";

bool has_only(std::string_view text, std::string_view characters) {
  return !text.empty() && text.find_first_not_of(characters) == text.npos;
}

// Reads the configurations of a host, whose paths begin at the folder of the rack's file.
std::vector<RackRun> read_runs(TableReader& table, const std::string& folder) {
  constexpr std::size_t longest_name = 40;  // as control.name
  std::vector<RackRun> runs;
  require(table, "runs", "the configurations that imud runs there, such as [\"nose.toml\"]");
  const toml::node* node = table.node("runs");
  if (node == nullptr) return runs;
  const toml::array* list = node->as_array();
  if (list == nullptr || list->empty() || !list->is_homogeneous<std::string>()) {
    table.fault("runs", "give a list of configurations, such as [\"nose.toml\", \"tail.toml\"]");
    return runs;
  }
  for (const toml::node& item : *list) {
    const std::filesystem::path path = item.as_string()->get();
    RackRun run{path.stem().string(), (std::filesystem::path(folder) / path).string()};
    if (path.extension() != ".toml")
      table.fault("runs", fmt::format("{}: give a file NAME.toml, which imud@NAME runs", path.string()));
    else if (!has_only(run.name, letters) || run.name.front() == '-' || run.name.size() > longest_name)
      table.fault("runs",
                  fmt::format("{}: its name becomes that of the run, imud@NAME: give up to {} letters, digits, "
                              "- and _",
                              path.string(), longest_name));
    else if (std::ranges::find(runs, run.name, &RackRun::name) != runs.end())
      table.fault("runs", fmt::format("{}: another run of this host has the name {}, too; rename the file",
                                      path.string(), run.name));
    runs.push_back(std::move(run));
  }
  return runs;
}

RackHost read_host(TableReader& table, const std::string& folder) {
  using enum RackHost::Service;
  RackHost host;
  require(table, "name", "what people call the host, such as \"bench1\"");
  host.name = table.text("name", "");
  if (is_text(table, "name") && (!has_only(host.name, std::string(letters) + ".") || host.name.front() == '-'))
    table.fault("name", "give letters, digits, -, _ and dots, such as \"bench1\"");
  const bool is_local = table.flag("local", false);
  host.ssh = table.text("ssh", is_local ? "" : host.name);
  if (is_local && !host.ssh.empty())
    table.fault("ssh", "without effect with local = true, which runs imud on this machine; omit one of the two");
  else if (!is_local && is_text(table, "ssh") && (host.ssh.empty() || host.ssh.front() == '-'))
    table.fault("ssh", "give what ssh takes as its destination, such as \"root@bench1\", or local = true");
  host.service = table.choice<RackHost::Service>("service", {{system, "system"}, {user, "user"}}, system);
  host.runs = read_runs(table, folder);
  table.finish();
  return host;
}

}  // namespace

Rack read_rack(const std::string& path) {
  Faults faults(path);
  const ConfigText text = read_config_text(path, {}, faults);
  toml::table unused;
  TableReader table(&text.root, "", 0, faults, unused);
  Rack rack;
  rack.file = path;
  rack.time_limit = nanoseconds(table.real("time_limit_s", 10, 1, 3600));
  const std::string folder = path == "-" ? "." : std::filesystem::path(path).parent_path().string();
  if (!table.has("host")) table.fault("host", "missing; give at least one [[host]]");
  std::set<std::string> names;                      // of the hosts so far
  std::map<std::string, std::string> destinations;  // the names of these hosts
  for (TableReader& one : children(table, "host", "host")) {
    RackHost host = read_host(one, folder);
    if (!names.insert(host.name).second && !host.name.empty())
      one.fault("name", "another host has this name; give another");
    if (const auto [at, is_new] = destinations.emplace(host.ssh, host.name); !is_new)
      one.fault(host.ssh.empty() ? "local" : "ssh",
                fmt::format("the same machine as host {}; give all its runs there", at->second));
    rack.hosts.push_back(std::move(host));
  }
  if (rack.hosts.empty() && table.has("host") && faults.all().empty())
    table.fault("host", "give at least one [[host]]");
  table.finish();
  if (!faults.all().empty()) throw ConfigError(faults.by_line());
  return rack;
}

}  // namespace imud
