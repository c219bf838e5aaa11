#include "emulator/config/scenario.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <sstream>
#include <utility>

#include "emulator/config/config_text.hpp"
#include "emulator/config/fault_reader.hpp"
#include "emulator/faults/fault_kinds.hpp"
#include "emulator/faults/other_units.hpp"

namespace imud {
namespace {

// Reads the tables of an array, such as [[fault]], by read(TableReader&).
template <class Read>
void read_each(TableReader& table, std::string_view key, Faults& faults, toml::array& resolved, const Read& read) {
  const toml::node* node = table.node(key);
  if (node == nullptr) return;
  const toml::array* array = node->as_array();
  if (array == nullptr || (!array->empty() && !array->is_array_of_tables())) {
    table.fault(key, fmt::format("give tables, each as [[{}]]", key));
    return;
  }
  for (std::size_t i = 0; i < array->size(); ++i) {
    const toml::table& one = *(*array)[i].as_table();
    TableReader reader(&one, fmt::format("{}.{}.", key, i), one.source().begin.line, faults,
                       resolved.emplace_back<toml::table>());
    read(reader);
  }
}

bool is_record(const std::string& port) {
  const Transport* transport = transport_of(port);
  return transport != nullptr && transport->is_record != nullptr;
}

std::string objection_of(const FaultConfig& fault, const ImuConfig& imu) {
  const std::string_view target = fault.kind->targets[fault.target];
  if (target == "inclinometer" && imu.model.inclinometer) return {};
  return fault_objection(*fault.kind, target, *imu.protocol, imu.settings);
}

// Returns why an expectation cannot hold on the port of its imu; empty if it can.
std::string expect_objection(const ExpectConfig& expect, std::span<const ImuConfig> imus) {
  const auto imu = std::ranges::find(imus, expect.imu, &ImuConfig::name);
  const Transport* transport = imu == imus.end() ? nullptr : transport_of(imu->port);
  if (expect.what != ExpectConfig::What::host_reopens || transport == nullptr || transport->has_readers) return {};
  return fmt::format("\"host_reopens\" needs a port that its host opens; {} has no readers. Such ports are {}",
                     imu->port, fmt::join(port_examples([](const Transport& one) { return one.has_readers; }), ", "));
}

// JSON has no dates: replaces the text `at_time` of a begun fault by the date and time in it, if it is one.
void read_date(toml::table& table) {
  const auto text = table["at_time"].value<std::string>();
  if (!text) return;
  try {
    const toml::table date = toml::parse("at_time = " + *text);
    if (const auto* time = date["at_time"].as_date_time(); time != nullptr && date.size() == 1)
      table.insert_or_assign("at_time", time->get());
  } catch (const toml::parse_error&) {
    return;  // read_fault() refuses it
  }
}

constexpr std::string_view needs_host =
    "needs clock = \"realtime\", or the replay of a record of --record, which has what the host has sent";

}  // namespace

std::string begin_objection(const FaultConfig& fault, const Config& config) {
  const bool is_paced = config.clock == ClockMode::realtime;
  if (fault.kind != nullptr && !fault.kind->in_lockstep && config.clock == ClockMode::lockstep)
    return fmt::format("{} needs another clock than \"lockstep\": the simulator would wait for ever",
                       fault.kind->name);
  if (fault.waits() && fault.acts_on(fault_of_truth)) return "truth has no host; give at_s";
  if (fault.after_host && !is_paced && !is_record(config.truth.port)) return std::string(needs_host);
  if (fault.after_utc_ns && (!is_paced || is_record(config.truth.port)))
    return "needs clock = \"realtime\", and a truth that is no record; give at_s";
  return {};
}

void check_begins_by_host(const Config& config, bool repeats) {
  if (config.clock == ClockMode::realtime || repeats) return;
  std::vector<std::string> wrong;
  for (const FaultConfig& fault : config.faults)
    if (fault.after_host) wrong.push_back(fmt::format("fault {}: after_host: {}", fault.name, needs_host));
  if (!wrong.empty()) throw ConfigError(wrong);
}

FaultConfig read_begun_fault(std::string_view text, std::size_t number, std::span<const ImuConfig> imus,
                             std::vector<std::string>& wrong) {
  toml::table table, resolved;
  try {
    table = toml::parse(text);
  } catch (const toml::parse_error& error) {
    wrong.emplace_back(error.description());
    return {};
  }
  read_date(table);
  Faults faults("");
  TableReader reader(&table, "", 0, faults, resolved);
  FaultConfig fault = read_fault(reader, number, names_of(imus));
  wrong = faults.all();
  if (!wrong.empty()) return fault;
  if (fault.kind->has_settings)
    wrong.push_back(fmt::format("{} needs a second unit, which is made at the start of imud; give a [[fault]]",
                                fault.kind->name));
  for (const ImuConfig& imu : imus)
    if (fault.acts_on(imu.name))
      if (const std::string objection = objection_of(fault, imu); !objection.empty())
        wrong.push_back(fmt::format("{}: {}", imu.name, objection));
  return fault;
}

std::string text_to_begin(const Config& config, std::size_t number) {
  toml::table all = toml::parse(config.resolved());
  toml::table& fault = *all["fault"][number].as_table();
  // The fault lasts as long as before.
  if (const auto until_s = fault["until_s"].value<double>()) {
    fault.insert_or_assign("for_s", *until_s - fault["at_s"].value_or(0.0));
    fault.erase("until_s");
  }
  for (const std::string_view key :
       {"at_s", "at_sample", "at_time", "after_host", "when", "every_s", "times", "probability", "optional"})
    fault.erase(key);
  std::ostringstream text;
  text << fault << "\n";
  return text.str();
}

void read_scenarios(TableReader& table, std::span<const std::string> scenarios, Faults& faults, Config& config,
                    std::vector<std::string>& wrong) {
  const std::vector<std::string> imus = names_of(config.imus);
  toml::array resolved_faults, resolved_expectations;
  const auto read = [&](TableReader& from, Faults& of_file) {
    read_each(from, "fault", of_file, resolved_faults, [&](TableReader& reader) {
      config.faults.push_back(read_fault(reader, config.faults.size(), imus));
      const auto has_its_name = [&](const FaultConfig& f) { return f.name == config.faults.back().name; };
      if (std::count_if(config.faults.begin(), config.faults.end(), has_its_name) > 1)
        reader.fault("name", fmt::format("there is a fault \"{}\" already; names tell faults apart in log and labels",
                                         config.faults.back().name));
      const FaultKind* kind = config.faults.back().kind;
      if (kind != nullptr && kind->has_settings) read_other_settings(reader, config.imus, config.faults.back());
      if (const std::string objection = begin_objection(config.faults.back(), config); !objection.empty())
        reader.fault(config.faults.back().after_host     ? "after_host"
                     : config.faults.back().after_utc_ns ? "at_time"
                                                         : "kind",
                     objection);
      if (kind == nullptr) return;
      for (const ImuConfig& imu : config.imus)
        if (imu.protocol != nullptr && config.faults.back().acts_on(imu.name))
          if (const std::string objection = objection_of(config.faults.back(), imu); !objection.empty())
            reader.fault("kind", fmt::format("{}: {}", imu.name, objection));
    });
    read_each(from, "expect", of_file, resolved_expectations, [&](TableReader& reader) {
      config.expectations.push_back(read_expect(reader, config.expectations.size(), imus, config.faults));
      if (const std::string wrong_port = expect_objection(config.expectations.back(), config.imus);
          !wrong_port.empty())
        reader.fault("what", wrong_port);
    });
  };
  read(table, faults);
  for (const std::string& path : scenarios) {
    Faults of_scenario(path);
    const ConfigText text = read_config_text(path, {}, of_scenario);
    toml::table unused;
    TableReader scenario(&text.root, "", 0, of_scenario, unused);
    read(scenario, of_scenario);
    scenario.finish();
    config.sha256 = sha256(config.sha256 + text.sha256);
    config.files.add(regular_file(path), "the file of a scenario");
    for (const Faults::NamedFile& file : of_scenario.named_files())
      config.files.add(regular_file(file.path), fmt::format("the file of {}", file.key));
    wrong.insert(wrong.end(), of_scenario.all().begin(), of_scenario.all().end());
  }
  if (!resolved_faults.empty()) table.resolve("fault", std::move(resolved_faults));
  if (!resolved_expectations.empty()) table.resolve("expect", std::move(resolved_expectations));
}

}  // namespace imud
