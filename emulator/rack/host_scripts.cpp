#include "emulator/rack/host_scripts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emulator/programs/command_output.hpp"

namespace imud {
namespace {

// A line that begins a section. What a login prints before the first one is passed over.
constexpr std::string_view mark = "imud-rack ";
constexpr std::string_view last_section = "end";

ProgramCall call_for(const RackHost& host, const std::string& script, Nanoseconds limit) {
  // The script is the standard input of a shell, because the login shell may be another one.
  std::string input = script + section(last_section);
  if (host.ssh.empty()) return {{"sh", "-s"}, std::move(input)};
  return {{"ssh", "-o", "BatchMode=yes", "-o", fmt::format("ConnectTimeout={:.0f}", std::ceil(seconds(limit))), "--",
           host.ssh, "sh -s"},
          std::move(input)};
}

// Returns the last lines of a text as one.
std::string last_lines(std::string_view text) {
  constexpr std::size_t most = 3;
  std::string joined;
  for (std::size_t count = 0; count < most && !text.empty();) {
    const std::size_t end = text.rfind('\n');
    std::string_view line = text.substr(end == text.npos ? 0 : end + 1);
    text = text.substr(0, end == text.npos ? 0 : end);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty()) continue;
    joined = joined.empty() ? std::string(line) : fmt::format("{}; {}", line, joined);
    ++count;
  }
  return joined;
}

HostAnswer answer_of(const RackHost& host, const CommandOutput& output, Nanoseconds limit) {
  HostAnswer answer;
  std::string_view rest = output.output;
  std::string* text = nullptr;
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    if (line.starts_with(mark))
      text = &answer.sections[std::string(line.substr(mark.size()))];
    else if (text != nullptr)
      text->append(line).append("\n");
  }
  if (answer.has(last_section)) return answer;
  const std::string errors = last_lines(output.errors);
  constexpr int not_started = 127, of_ssh = 255;
  if (output.is_late)
    answer.fault =
        fmt::format("has not answered within {:g} s{}{}", seconds(limit), errors.empty() ? "" : ": ", errors);
  else if (output.exit_code == not_started && answer.sections.empty() && !host.ssh.empty())
    answer.fault = errors.starts_with("ssh:") ? errors + " (Debian: openssh-client)" : errors;
  else if (output.exit_code == of_ssh && answer.sections.empty() && !host.ssh.empty())
    answer.fault = fmt::format("not reached: {}; `ssh {}` must log in without a question",
                               errors.empty() ? "ssh gives no reason" : errors, host.ssh);
  else
    answer.fault = fmt::format("its shell has ended with exit code {}{}{}", output.exit_code,
                               errors.empty() ? "" : ": ", errors);
  return answer;
}

}  // namespace

std::string HostAnswer::text(std::string_view section) const {
  const auto found = sections.find(section);
  if (found == sections.end()) return {};
  constexpr std::string_view white = " \t\r\n";
  const std::string& all = found->second;
  const std::size_t begin = all.find_first_not_of(white);
  return begin == all.npos ? std::string() : all.substr(begin, all.find_last_not_of(white) + 1 - begin);
}

std::string section(std::string_view name) { return fmt::format("printf '\\n%s\\n' '{}{}'\n", mark, name); }

std::string systemctl(const RackHost& host) {
  return host.service == RackHost::Service::system ? "systemctl" : "systemctl --user";
}

std::vector<HostAnswer> run_on_hosts(std::span<const RackHost> hosts, std::span<const std::string> scripts,
                                     Nanoseconds limit, const std::atomic<bool>& stop) {
  std::vector<ProgramCall> calls;
  for (std::size_t i = 0; i < hosts.size(); ++i) calls.push_back(call_for(hosts[i], scripts[i], limit));
  const std::vector<CommandOutput> outputs = run_commands(calls, limit, stop);
  std::vector<HostAnswer> answers;
  for (std::size_t i = 0; i < hosts.size(); ++i) answers.push_back(answer_of(hosts[i], outputs[i], limit));
  return answers;
}

}  // namespace imud
