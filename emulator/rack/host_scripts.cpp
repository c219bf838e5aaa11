#include "emulator/rack/host_scripts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emulator/programs/command_output.hpp"

namespace imud {
namespace {

// The begin of a line that begins a section. Output before the first such line, such as a login's, is ignored.
constexpr std::string_view mark = "imud-rack ";
constexpr std::string_view last_section = "end";

// Returns the call that executes a script on a host. sh reads the script from the standard input, because the login
// shell may be another shell.
ProgramCall call_for(const RackHost& host, std::string script, Nanoseconds limit,
                     const std::vector<std::string>& options = {}) {
  if (host.ssh.empty()) return {{"sh", "-s"}, std::move(script)};
  std::vector<std::string> words = {"ssh", "-o", "BatchMode=yes", "-o",
                                    fmt::format("ConnectTimeout={:.0f}", std::ceil(seconds(limit)))};
  words.insert(words.end(), options.begin(), options.end());
  words.insert(words.end(), {"--", host.ssh, "sh -s"});
  return {std::move(words), std::move(script)};
}

// Returns the last three lines of a text as one line.
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

// Returns the reason why a script has failed. `has_begun`: the script has printed a mark.
std::string fault_of(const RackHost& host, const CommandOutput& output, Nanoseconds limit, bool has_begun) {
  const std::string errors = last_lines(output.errors);
  constexpr int not_started = 127, of_ssh = 255;
  if (output.is_late)
    return fmt::format("has not answered within {:g} s{}{}", seconds(limit), errors.empty() ? "" : ": ", errors);
  if (output.exit_code == not_started && !has_begun && !host.ssh.empty())
    return errors.starts_with("ssh:") ? errors + " (Debian: openssh-client)" : errors;
  if (output.exit_code == of_ssh && !has_begun && !host.ssh.empty())
    return fmt::format("not reached: {}; `ssh {}` must log in without a question",
                       errors.empty() ? "ssh gives no reason" : errors, host.ssh);
  return fmt::format("its shell has ended with exit code {}{}{}", output.exit_code, errors.empty() ? "" : ": ",
                     errors);
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
  if (!answer.has(last_section)) answer.fault = fault_of(host, output, limit, !answer.sections.empty());
  return answer;
}

// Passes on only the bytes behind the mark, because a login may print text before the mark.
class BehindMark {
 public:
  explicit BehindMark(const std::function<void(std::string_view)>& receive) : receive_(receive) {}

  void take(std::string_view bytes) {
    if (!has_begun_) {
      before_.append(bytes);
      const std::size_t at = before_.find(begin());
      if (at == before_.npos) return;
      has_begun_ = true;
      bytes = std::string_view(before_).substr(at + begin().size());
    }
    if (!bytes.empty()) receive_(bytes);
  }
  bool has_begun() const noexcept { return has_begun_; }

  static constexpr std::string_view name = "bytes";  // of the section

 private:
  static std::string begin() { return fmt::format("\n{}{}\n", mark, name); }

  const std::function<void(std::string_view)>& receive_;
  std::string before_;
  bool has_begun_ = false;
};

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
  for (std::size_t i = 0; i < hosts.size(); ++i)
    calls.push_back(call_for(hosts[i], scripts[i] + section(last_section), limit));
  const std::vector<CommandOutput> outputs = run_commands(calls, limit, stop);
  std::vector<HostAnswer> answers;
  for (std::size_t i = 0; i < hosts.size(); ++i) answers.push_back(answer_of(hosts[i], outputs[i], limit));
  return answers;
}

std::vector<std::string> download(std::span<const Download> downloads, Nanoseconds limit,
                                  const std::atomic<bool>& stop) {
  constexpr int most_unanswered = 3;
  const std::vector<std::string> alive = {
      "-o", fmt::format("ServerAliveInterval={:.0f}", std::ceil(seconds(limit) / most_unanswered)), "-o",
      fmt::format("ServerAliveCountMax={}", most_unanswered)};
  std::vector<BehindMark> bytes;
  bytes.reserve(downloads.size());
  std::vector<ProgramCall> calls;
  for (const Download& one : downloads) {
    BehindMark& mine = bytes.emplace_back(one.receive);
    calls.push_back(call_for(*one.host, section(BehindMark::name) + one.script, limit, alive));
    calls.back().receive = [&mine](std::string_view text) { mine.take(text); };
  }
  const std::vector<CommandOutput> outputs = run_commands(calls, std::nullopt, stop);
  std::vector<std::string> faults;
  for (std::size_t i = 0; i < downloads.size(); ++i) {
    const bool is_whole = outputs[i].exit_code == 0 && bytes[i].has_begun();
    faults.push_back(is_whole ? "" : fault_of(*downloads[i].host, outputs[i], limit, bytes[i].has_begun()));
  }
  return faults;
}

}  // namespace imud
