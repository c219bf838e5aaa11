#include "emulator/rack/rack_service.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <sstream>

#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/rack/host_scripts.hpp"
#include "emulator/rack/rack_check.hpp"
#include "emulator/seeds/worker_processes.hpp"
#include "emulator/watch/run_text.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// systemd aborts the start or the stop of a unit after 90 s (DefaultTimeoutStartSec). The other 5 s are for its
// answer.
constexpr Nanoseconds longest_job = 95s;

// Returns the begin of a script, which sets $folder to the folder of the configurations.
std::string folder_script(const RackHost& host) {
  std::string script = host.service == RackHost::Service::system ? "folder=/etc/imud\n"
                                                                 : "folder=${XDG_CONFIG_HOME:-$HOME/.config}/imud\n";
  return script + "umask 022\nmkdir -p \"$folder\" || exit 1\n";
}

// Returns a script that writes a configuration to a new file $new, beside the file $file that it shall replace, and
// with the mode and the owner of $file.
std::string write_script(const RackRun& run, const std::string& content) {
  const std::string name = shell_word(run.name);
  return fmt::format(
      "file=$folder/{0}.toml\nnew=$folder/.{0}.rack.toml\nrm -f \"$new\"\n[ ! -f \"$file\" ] || cp -p \"$file\" "
      "\"$new\" || exit 1\nprintf %s {1} > \"$new\" || exit 1\n",
      name, shell_word(content));
}

// Returns a script that checks a host without changing anything.
std::string preparation(const RackHost& host, const std::vector<std::string>& contents) {
  std::string script = section("version") + "imud --version || exit 1\n" + folder_script(host);
  for (std::size_t i = 0; i < host.runs.size(); ++i) {
    const RackRun& run = host.runs[i];
    script += section("check " + run.name) + write_script(run, contents[i]);
    script += fmt::format(
        "imud check \"$new\" --set control.name={0} 2>&1 > /dev/null || {{\n{1}}}\n"
        "if {2} is-active --quiet {3} && ! cmp -s \"$new\" \"$file\"; then\n{4}fi\nrm -f \"$new\"\n",
        shell_word(run.name), section("wrong " + run.name), systemctl(host), shell_word(run.text()),
        section("other " + run.name));
  }
  return script;
}

std::string units_of(const RackHost& host) {
  std::string units;
  for (const RackRun& run : host.runs) units += " " + shell_word(run.text());
  return units;
}

std::string start_script(const RackHost& host, const std::vector<std::string>& contents) {
  std::string script = folder_script(host);
  for (std::size_t i = 0; i < host.runs.size(); ++i)
    script += write_script(host.runs[i], contents[i]) +
              "if cmp -s \"$new\" \"$file\"; then rm -f \"$new\"; else mv -f \"$new\" \"$file\" || exit 1; fi\n";
  script += section("systemctl") + systemctl(host) + " start" + units_of(host) + " 2>&1\n";
  for (const RackRun& run : host.runs) {
    const std::string unit = shell_word(run.text());
    script += fmt::format(
        "if {0} is-active --quiet {1}; then\n{2}else\n{3}{0} status --no-pager --lines=5 {1} 2>&1 | tail -n 5\nfi\n",
        systemctl(host), unit, section("started " + run.name), section("failed " + run.name));
  }
  return script;
}

std::string stop_script(const RackHost& host) {
  std::string script = section("systemctl") + systemctl(host) + " stop" + units_of(host) + " 2>&1\n";
  for (const RackRun& run : host.runs)  // no section if systemd does not answer: the run may not have stopped
    script += fmt::format("case $({} is-active {}) in inactive | failed)\n{};;\nesac\n", systemctl(host),
                          shell_word(run.text()), section("stopped " + run.name));
  return script;
}

// Replaces the path of the copy that the host has checked by the path of the file on this machine.
std::string with_local_name(std::string text, const RackRun& run) {
  const std::string copy = fmt::format(".{}.rack.toml", run.name);
  for (std::size_t at = 0; (at = text.find(copy, at)) != text.npos;) {
    const std::size_t before = text.find_last_of(" \n\t", at);  // the whole path
    const std::size_t begin = before == text.npos ? 0 : before + 1;
    text.replace(begin, at + copy.size() - begin, run.file);
    at = begin + run.file.size();  // the file's own path may contain the name of the copy
  }
  return text;
}

std::vector<HostAnswer> ask(const Rack& rack, const std::vector<std::string>& scripts, Nanoseconds limit) {
  return run_on_hosts(rack.hosts, scripts, limit, workers_stop());
}

std::string lines_of(const std::string& text, std::string_view before) {
  std::string all;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    if (!line.empty()) all += fmt::format("{}{}\n", before, line);
  return all;
}

// Returns every reason for which no run is to be started.
std::string objections(const Rack& rack, const std::vector<HostAnswer>& answers) {
  std::string all;
  std::map<std::string, std::vector<std::string>> versions;
  for (std::size_t i = 0; i < rack.hosts.size(); ++i) {
    const RackHost& host = rack.hosts[i];
    const HostAnswer& answer = answers[i];
    if (!answer.fault.empty())
      all += fmt::format("{}: {}{}\n", host.name, answer.fault,
                         answer.has("version") && answer.text("version").empty() ? "; install imud there" : "");
    if (const std::string version = answer.text("version"); !version.empty()) versions[version].push_back(host.name);
    for (const RackRun& run : host.runs) {
      if (answer.has("wrong " + run.name))
        all += fmt::format("{}: {} is refused there:\n{}", host.name, run.file,
                           lines_of(with_local_name(answer.text("check " + run.name), run), "  "));
      if (answer.has("other " + run.name))
        all +=
            fmt::format("{}: {} runs already, with another configuration than {}; stop it first: imud rack stop {}\n",
                        host.name, run.text(), run.file, path_word(rack.file));
    }
  }
  if (versions.size() > 1) {
    std::vector<std::string> texts;
    for (const auto& [version, hosts] : versions)
      texts.push_back(fmt::format("{} ({})", version, fmt::join(hosts, ", ")));
    all += fmt::format("versions differ: {}; install one on all hosts\n", fmt::join(texts, ", "));
  }
  return all;
}

// Returns a line for each host with the runs for which its answer has the section "WORD NAME". Sets `is_whole` to
// false if a run lacks this section.
std::string report(const Rack& rack, const std::vector<HostAnswer>& answers, std::string_view word, bool& is_whole) {
  std::string text;
  for (std::size_t i = 0; i < rack.hosts.size(); ++i) {
    const RackHost& host = rack.hosts[i];
    const HostAnswer& answer = answers[i];
    std::vector<std::string> done, others;
    for (const RackRun& run : host.runs)
      (answer.has(fmt::format("{} {}", word, run.name)) ? done : others).push_back(run.text());
    if (!done.empty()) text += fmt::format("{}: {} {}\n", host.name, word, fmt::join(done, ", "));
    if (others.empty()) continue;
    is_whole = false;
    text += fmt::format("{}: NOT {} {}{}{}\n", host.name, word, fmt::join(others, ", "),
                        answer.fault.empty() ? "" : ": ", answer.fault);
    text += lines_of(answer.text("systemctl"), "  ");
    for (const RackRun& run : host.runs) text += lines_of(answer.text("failed " + run.name), "  ");
  }
  return printable(std::move(text));
}

}  // namespace

int rack_start(const std::string& path) {
  const Rack rack = read_rack(path);
  std::vector<std::string> warnings;
  load_rack(rack, warnings);
  for (const std::string& warning : warnings) fmt::print(stderr, "warning: {}\n", warning);
  std::vector<std::string> prepare, start;
  for (const RackHost& host : rack.hosts) {
    std::vector<std::string> contents;
    for (const RackRun& run : host.runs) contents.push_back(read_whole(run.file));
    prepare.push_back(preparation(host, contents));
    start.push_back(start_script(host, contents));
  }
  catch_workers_stop();
  const std::string wrong = objections(rack, ask(rack, prepare, rack.time_limit));
  if (!wrong.empty()) {
    fmt::print(stderr, "{}nothing was started\n", printable(wrong));
    return 1;
  }
  bool is_whole = true;
  TextFile("-").write(report(rack, ask(rack, start, rack.time_limit + longest_job), "started", is_whole));
  if (is_whole) return 0;
  fmt::print(stderr,
             "those that have started go on; repeat imud rack start {0} for the others, or imud rack stop {0}\n",
             path_word(path));
  return 1;
}

int rack_stop(const std::string& path) {
  const Rack rack = read_rack(path);
  std::vector<std::string> scripts;
  for (const RackHost& host : rack.hosts) scripts.push_back(stop_script(host));
  catch_workers_stop();
  bool is_whole = true;
  TextFile("-").write(report(rack, ask(rack, scripts, rack.time_limit + longest_job), "stopped", is_whole));
  return is_whole ? 0 : 1;
}

}  // namespace imud
