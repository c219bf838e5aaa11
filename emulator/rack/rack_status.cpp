#include "emulator/rack/rack_status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/rack/rack_differences.hpp"
#include "emulator/seeds/worker_processes.hpp"
#include "emulator/watch/run_text.hpp"

namespace imud {
namespace {

constexpr std::string_view version_section = "version", units_section = "units", runs_section = "runs";

std::string status_script(const RackHost& host) {
  std::string script =
      section(version_section) + "imud --version\n" + section(units_section) + systemctl(host) + " is-active";
  for (const RackRun& run : host.runs) script += " " + shell_word(run.text());
  return script + "\n" + section(runs_section) + "imud status --json\n";
}

double number_in(const Json& object, const char* key) { return object.value(key, 0.0); }

// Returns the members of an imu that are shown, from the answers of its run.
Json imu_figures(const Json& imu, const Json& counters) {
  static const Json none = Json::object(), empty = Json::array();
  const std::string name = imu.value("name", "?");
  const Json& all = counters.contains("imus") ? counters["imus"] : empty;
  const auto found = std::ranges::find_if(all, [&](const Json& one) { return one.value("name", "") == name; });
  const Json& figures = found == all.end() ? none : *found;
  const Json& late = figures.contains("lateness_us") ? figures["lateness_us"] : none;
  const double duration_s = number_in(counters, "duration_s"), samples = number_in(figures, "samples");
  Json json = {{"name", name},
               {"protocol", imu.value("protocol", "?")},
               {"rate_hz", number_in(imu, "rate_hz")},
               {"measured_hz", duration_s > 0 ? samples / duration_s : 0.0},
               {"samples", figures.value("samples", std::uint64_t{0})},
               {"dropped", figures.value("dropped", std::uint64_t{0})},
               {"missed", figures.value("missed", std::uint64_t{0})},
               {"late_p99_us", number_in(late, "p99")},
               {"late_max_us", number_in(late, "max")}};
  json["first_k"] = figures.contains("first_k") ? Json(figures.value("first_k", std::uint64_t{0})) : Json();
  return json;
}

// Returns the members of a clock that are shown, with checked types; null if there is no clock.
Json clock_figures(const Json& clock) {
  if (!clock.is_object()) return {};
  Json json = {{"epoch", clock.value("epoch", "?")}, {"steps", clock.value("steps", std::uint64_t{0})}};
  if (clock.contains("synchronised")) json["synchronised"] = clock.value("synchronised", false);
  for (const char* key : {"error_us", "tai_offset_s"})
    if (clock.contains(key)) json[key] = clock.value(key, std::int64_t{0});
  return json;
}

// Returns the shown members of a running run. Throws Json::exception if a member of the answer has the wrong type.
Json run_figures(const Json& answer) {
  static const Json none = Json::object(), empty = Json::array();
  const Json& counters = answer.contains("counters") ? answer["counters"] : none;
  const Json& truth = counters.contains("truth") ? counters["truth"] : none;
  Json json = {{"version", answer.value("version", "?")},
               {"started", answer.value("started", "?")},
               {"duration_s", number_in(counters, "duration_s")},
               {"truth_hz", number_in(truth, "rate_hz")},
               {"clock", clock_figures(counters.value("clock", Json()))},
               {"faults", answer.contains("faults") ? answer["faults"].size() : 0},
               {"imus", Json::array()}};
  for (const Json& imu : answer.contains("imus") ? answer["imus"] : empty)
    json["imus"].push_back(imu_figures(imu, counters));
  return json;
}

// Returns a text about a run that does not answer, by the state of its unit.
std::string why_not(std::string_view state, const std::string& unit) {
  if (state == "killed") return "was killed";
  if (state == "silent") return "does not answer: its process is stopped or too busy, or ends";
  if (state == "foreign") return "belongs to another user than that of ssh";
  if (unit == "failed") return "has failed: journalctl -u shows why";
  if (unit == "active" || unit == "activating") return "its unit is " + unit + ", but it cannot be asked";
  return "does not run";
}

Json run_status(const RackRun& run, const std::string& unit, const Json& answers) {
  Json json = {{"name", run.name}, {"state", "stopped"}, {"unit", unit}};
  for (const Json& answer : answers)
    if (answer.is_object() && answer.value("name", Json()) == Json(run.name)) {
      json["state"] = answer.value("state", Json("?"));
      if (json["state"] != "running") continue;
      try {
        json.update(run_figures(answer));
      } catch (const Json::exception&) {
        json["state"] = "unknown";
        json["why"] = "its answer is one that this version does not know";
      }
      return json;
    }
  const Json& state = json["state"];
  json["why"] = why_not(state.is_string() ? state.get_ref<const std::string&>() : std::string(), unit);
  return json;
}

Json host_status(const RackHost& host, const HostAnswer& answer) {
  const std::string version = answer.text(version_section);
  Json json = {{"name", host.name},
               {"ssh", host.ssh},
               {"reached", answer.fault.empty()},
               {"why", answer.fault},
               {"version", version.starts_with("imud ") ? version.substr(5) : version},
               {"runs", Json::array()}};
  if (answer.fault.empty() && version.empty()) json["why"] = "imud is not installed there";
  const Json parsed = Json::parse(answer.text(runs_section), nullptr, false);
  const Json answers =
      parsed.is_object() && parsed.contains("runs") && parsed["runs"].is_array() ? parsed["runs"] : Json::array();
  std::istringstream units(answer.text(units_section));
  for (const RackRun& run : host.runs) {
    std::string unit;
    std::getline(units, unit);
    if (!json["why"].get_ref<const std::string&>().empty())
      json["runs"].push_back({{"name", run.name}, {"state", "unknown"}, {"unit", ""}, {"why", json["why"]}});
    else
      json["runs"].push_back(run_status(run, unit, answers));
  }
  return json;
}

bool runs_well(const Json& run) { return run["state"] == "running"; }

// Returns "tai, 12 us"; "-" without an epoch.
std::string clock_text(const Json& clock) {
  if (!clock.is_object()) return "-";
  std::string text = clock.value("epoch", "?");
  if (clock.value("synchronised", false))
    text += fmt::format(", {} us", clock.value("error_us", std::int64_t{0}));
  else if (clock.contains("synchronised"))
    text += ", not synchronised";
  return text;
}

std::vector<std::vector<std::string>> rows_of(const Json& host, const Json& run) {
  const auto text = [](const Json& object, const char* key) { return object.value(key, std::string("?")); };
  std::vector<std::string> begin = {text(host, "name"), text(run, "name"), text(run, "state")};
  if (!runs_well(run)) {
    begin.resize(12);
    begin[3] = text(host, "version");
    return {begin};
  }
  std::vector<std::vector<std::string>> rows;
  for (const Json& imu : run["imus"]) {
    rows.push_back(begin);
    const Json& first_k = imu["first_k"];
    for (std::string one : {text(run, "version"), run_time_text(number_in(run, "duration_s")), text(imu, "name"),
                            fmt::format("{:.1f}", number_in(imu, "measured_hz")), imu["samples"].dump(),
                            imu["missed"].dump(), fmt::format("{:.1f}", number_in(imu, "late_p99_us")),
                            clock_text(run["clock"]), first_k.is_null() ? std::string("-") : first_k.dump()})
      rows.back().push_back(std::move(one));
    for (std::size_t i = 0; i < 5; ++i) begin[i < 3 ? i : 0] = "";  // once a run
  }
  return rows;
}

}  // namespace

Json rack_status_of(const Rack& rack, const std::vector<HostAnswer>& answers) {
  Json json = {{"rack", rack.file}, {"good", true}, {"hosts", Json::array()}};
  for (std::size_t i = 0; i < rack.hosts.size(); ++i) {
    json["hosts"].push_back(host_status(rack.hosts[i], answers[i]));
    if (!std::ranges::all_of(json["hosts"].back()["runs"], runs_well)) json["good"] = false;
  }
  json["remarks"] = differences(json["hosts"]);
  return json;
}

Json rack_status(const Rack& rack, const std::atomic<bool>& stop) {
  std::vector<std::string> scripts;
  for (const RackHost& host : rack.hosts) scripts.push_back(status_script(host));
  return rack_status_of(rack, run_on_hosts(rack.hosts, scripts, rack.time_limit, stop));
}

std::string rack_status_text(const Json& status) {
  std::vector<std::vector<std::string>> rows = {{"HOST", "RUN", "STATE", "VERSION", "FOR", "IMU", "HZ", "SAMPLES",
                                                 "MISSED", "LATE P99 us", "CLOCK", "FIRST K"}};
  for (const Json& host : status["hosts"])
    for (const Json& run : host["runs"])
      for (std::vector<std::string>& row : rows_of(host, run)) rows.push_back(std::move(row));
  std::string text;
  for (const std::string& line : table_lines(rows, {0, 1, 2, 3, 5, 10})) text += line + "\n";
  for (const Json& host : status["hosts"]) {
    const std::string name = host["name"], why = host["why"];
    if (!why.empty()) {
      text += fmt::format("{}: {}\n", name, why);
      continue;
    }
    for (const Json& run : host["runs"])
      if (!runs_well(run))
        text += fmt::format("{}: imud@{} {}\n", name, run["name"].get<std::string>(), run["why"].get<std::string>());
  }
  for (const Json& remark : status["remarks"]) text += remark.get<std::string>() + "\n";
  return printable(std::move(text));
}

int show_rack_status(const std::string& path, bool as_json) {
  const Rack rack = read_rack(path);
  catch_workers_stop();
  const Json status = rack_status(rack, workers_stop());
  TextFile("-").write(as_json ? status.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"
                              : rack_status_text(status));
  return status["good"] == true ? 0 : 1;
}

}  // namespace imud
