#include "emulator/watch/status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/control/line_connection.hpp"
#include "emulator/control/socket_path.hpp"
#include "emulator/watch/run_text.hpp"

namespace imud {
namespace {

// A run that was found: its answer, or the reason why there is no answer.
struct Found {
  Instance instance;
  std::string_view state;  // "running", "silent", "killed", "foreign"
  LineConnection connection = {};
  Json answer = Json::object();
};

void ask(Found& found) {
  FileDescriptor socket = connect_to_socket(found.instance.path);
  if (!socket) return;
  found.connection = LineConnection(std::move(socket));
  found.connection.send(json_line({{"jsonrpc", "2.0"}, {"method", "status"}, {"id", 1}}));
}

void take_answer(Found& found, HostTime until) {
  const auto line = found.connection.receive(until);
  const Json response = line ? Json::parse(*line, nullptr, false) : Json();
  if (!response.is_object() || !response.contains("result") || !response["result"].is_object()) return;
  found.state = "running";
  found.answer = response["result"];
}

std::string text(const Found& found) {
  const std::string& name = found.instance.name;
  if (found.state == "killed")
    return fmt::format("{}: does not run: it was killed, and has left {}, which the next run removes\n", name,
                       found.instance.path);
  if (found.state == "foreign")
    return fmt::format("{}: belongs to another user, who can ask it, as root can ({})\n", name, found.instance.path);
  if (found.state == "silent")
    return fmt::format("{} ({})\n", silent_text(name, longest_answer), found.instance.path);
  const Json& run = found.answer;
  const Json none = Json::object();
  const Json& counters = run.contains("counters") ? run["counters"] : none;
  const Json& clients = run.contains("clients") ? run["clients"] : none;
  const std::uint64_t control = clients.value("control", std::uint64_t{1}),
                      web = clients.value("web", std::uint64_t{0});
  std::string out = fmt::format(
      "{}: process {}, since {}, for {}, clock {}, version {}\n  configuration {}\n  clients: {} of the control "
      "socket, {} "
      "of the page\n",
      name, run.value("pid", 0), run.value("started", std::string("?")),
      run_time_text(counters.value("duration_s", 0.0)), run.value("clock", std::string("?")),
      run.value("version", std::string("?")), run.value("config", std::string("?")),
      control - std::min<std::uint64_t>(control, 1), web);  // without the connection of this command
  out += fmt::format("  {}\n", truth_line(counters));
  for (const std::string& line : imu_lines(run, counters)) out += fmt::format("  {}\n", line);
  if (const std::string line = clock_line(counters); !line.empty()) out += fmt::format("  {}\n", line);
  for (const std::string& line : fault_lines(run)) out += fmt::format("  {}\n", line);
  return out;
}

// Returns the text for a terminal, also for an answer whose types this version does not know.
std::string shown(const Found& found) {
  try {
    return printable(text(found));
  } catch (const Json::exception&) {
    return printable(fmt::format("{}: its answer is one that this version does not know\n", found.instance.name));
  }
}

}  // namespace

int show_status(const StatusOptions& options) {
  const Instances instances = find_instances();
  std::vector<Found> all;
  const auto add = [&](const std::vector<Instance>& some, std::string_view state) {
    for (const Instance& one : some)
      if (options.name.empty() || one.name == options.name) all.push_back({one, state});
  };
  add(instances.running, "silent");
  add(instances.killed, "killed");
  add(instances.foreign, "foreign");
  for (Found& found : all)
    if (found.state == "silent") ask(found);
  const HostTime until = host_now() + longest_answer;
  int running = 0, silent = 0;
  for (Found& found : all) {
    if (found.state == "silent") take_answer(found, until);
    running += found.state == "running" ? 1 : 0;
    silent += found.state == "silent" ? 1 : 0;
  }
  if (options.json) {
    Json runs = Json::array();
    for (const Found& found : all) {
      Json run = {{"name", found.instance.name}, {"state", found.state}, {"socket", found.instance.path}};
      run.update(found.answer);
      runs.push_back(std::move(run));
    }
    fmt::print("{}\n", Json({{"runs", std::move(runs)}}).dump(2, ' ', false, Json::error_handler_t::replace));
  } else if (all.empty()) {
    fmt::print(stderr, "imud: {}\n", printable(none_text(instances, options.name)));
  } else {
    for (const Found& found : all) fmt::print("{}", shown(found));
  }
  return running > 0 && silent == 0 ? 0 : 1;
}

}  // namespace imud
