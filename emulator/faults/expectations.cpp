#include "emulator/faults/expectations.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <sstream>

namespace imud {

std::string ExpectConfig::text() const {
  const std::string bytes = text_of(pattern);
  std::string text;
  switch (what) {
    case What::host_sends:
      text = fmt::format("the host of {} sends {} within {:g} s", imu, bytes, within_s);
      break;
    case What::host_is_silent:
      text = fmt::format("the host of {} does not send {} for {:g} s", imu, bytes, within_s);
      break;
    case What::host_reopens:
      text = fmt::format("the host of {} reopens its port within {:g} s", imu, within_s);
      break;
  }
  if (!fault) return text + fmt::format(", from {:g} s", at_s);
  return text + fmt::format(", from the {} of fault {}", after_end ? "end" : "begin", *fault + 1);
}

ExpectConfig read_expect(TableReader& table, std::size_t index, const std::vector<std::string>& imus,
                         std::span<const FaultConfig> faults) {
  ExpectConfig expect;
  expect.name = table.text("name", fmt::format("expect{}", index + 1));
  expect.imu = table.text("imu", imus.size() == 1 ? imus.front() : "");
  if (expect.imu.empty())
    table.fault("imu", fmt::format("missing: whose host; of: {}", fmt::join(imus, ", ")));
  else if (std::find(imus.begin(), imus.end(), expect.imu) == imus.end())
    table.fault("imu", fmt::format("there is no imu \"{}\"; of: {}", expect.imu, fmt::join(imus, ", ")));
  table.require("what", "\"host_sends\", \"host_is_silent\" or \"host_reopens\"");
  constexpr ExpectConfig::What all[] = {ExpectConfig::What::host_sends, ExpectConfig::What::host_is_silent,
                                        ExpectConfig::What::host_reopens};
  expect.what = all[table.choice("what", {"host_sends", "host_is_silent", "host_reopens"}, 0)];
  expect.pattern = read_host_bytes(table);
  if (expect.what == ExpectConfig::What::host_reopens && !expect.pattern.empty())
    table.fault("what", "\"host_reopens\" is not about bytes; omit text and hex");
  const auto number_of = [&](std::string_view key) -> std::optional<std::size_t> {
    if (!table.has(key)) return std::nullopt;
    const std::string name = table.text(key, "");
    for (std::size_t i = 0; i < faults.size(); ++i)
      if (faults[i].name == name && (faults[i].kind == nullptr || faults[i].acts_on(expect.imu))) return i;
    table.fault(key, fmt::format("no fault \"{}\" acts on {}", name, expect.imu));
    return std::nullopt;
  };
  if (int{table.has("after")} + int{table.has("after_end_of")} + int{table.has("at_s")} > 1)
    table.fault("after", "give one of after, after_end_of and at_s");
  expect.after_end = table.has("after_end_of");
  expect.fault = number_of(expect.after_end ? "after_end_of" : "after");
  constexpr double longest_s = 1e9;
  if (!expect.fault || table.has("at_s")) expect.at_s = table.real("at_s", 0, 0, longest_s);
  table.require("within_s", "the length of the time, in seconds");
  expect.within_s = table.real("within_s", 1, 1e-6, longest_s);
  table.finish();
  return expect;
}

Expectations::Expectations(std::span<const ExpectConfig> all, std::string_view imu) {
  for (const ExpectConfig& config : all)
    if (config.imu == imu) watches_.push_back({.config = &config});
}

void Expectations::begin_run() noexcept {
  now_s_ = 0;
  for (Watch& watch : watches_)
    if (!watch.is_over && !watch.met_s) watch = {.config = watch.config};
}

void Expectations::take(const FaultSchedule& schedule, double time_s) noexcept {
  now_s_ = time_s;
  for (Watch& watch : watches_) {
    const ExpectConfig& config = *watch.config;
    if (config.fault) {
      const bool is_active = schedule.is_active(*config.fault);
      const bool was_active = watch.was_active;
      watch.was_active = is_active;
      if (!watch.begin_s && (config.after_end ? was_active && !is_active : is_active)) watch.begin_s = time_s;
    } else if (!watch.begin_s && time_s >= config.at_s) {
      watch.begin_s = time_s;
    }
    if (watch.begin_s && time_s > *watch.begin_s + config.within_s) watch.is_over = true;
  }
}

void Expectations::meet(Watch& watch) noexcept {
  if (watch.begin_s && !watch.is_over && !watch.met_s) watch.met_s = now_s_;
}

void Expectations::host_sent(std::span<const std::byte> bytes) noexcept {
  for (Watch& watch : watches_) {
    const ExpectConfig& config = *watch.config;
    if (config.what == ExpectConfig::What::host_reopens || bytes.empty()) continue;
    if (watch.search.take(config.pattern, bytes)) meet(watch);
  }
}

void Expectations::port_is(PortState state) noexcept {
  const bool has_no_reader = state == PortState::no_reader || state == PortState::lost;
  if (had_no_reader_ && !has_no_reader)
    for (Watch& watch : watches_)
      if (watch.config->what == ExpectConfig::What::host_reopens) meet(watch);
  had_no_reader_ = has_no_reader;
}

std::vector<Expected> Expectations::results() const {
  std::vector<Expected> all;
  for (const Watch& watch : watches_) {
    const ExpectConfig& config = *watch.config;
    Expected result{.name = config.name, .text = config.text()};
    const bool shall_be_silent = config.what == ExpectConfig::What::host_is_silent;
    if (!watch.begin_s) {
      result.seen = "its time has never begun";
    } else if (watch.met_s) {
      result.duration_s = *watch.met_s - *watch.begin_s;
      result.holds = !shall_be_silent;
      result.seen = fmt::format("{} {:.6g} s after the begin of its time, at {:.6g} s",
                                config.what == ExpectConfig::What::host_reopens ? "reopened" : "sent",
                                result.duration_s, *watch.met_s);
    } else if (!watch.is_over && now_s_ < *watch.begin_s + config.within_s) {
      result.seen =
          fmt::format("the run ended {:.6g} s before the end of its time", *watch.begin_s + config.within_s - now_s_);
    } else {
      result.duration_s = config.within_s;
      result.holds = shall_be_silent;
      result.seen = shall_be_silent ? "not sent" : "not seen in its time";
    }
    all.push_back(std::move(result));
  }
  return all;
}

std::string junit_xml(std::span<const Expected> results, const std::string& name) {
  namespace pt = boost::property_tree;
  pt::ptree suite;
  suite.put("<xmlattr>.name", name);
  suite.put("<xmlattr>.tests", results.size());
  suite.put("<xmlattr>.failures",
            std::count_if(results.begin(), results.end(), [](const Expected& one) { return !one.holds; }));
  for (const Expected& one : results) {
    pt::ptree test;
    test.put("<xmlattr>.name", one.name);
    test.put("<xmlattr>.classname", name);
    test.put("<xmlattr>.time", fmt::format("{:.6f}", one.duration_s));
    if (!one.holds) {
      test.put("failure.<xmlattr>.message", one.seen);
      test.put("failure", fmt::format("expected: {}; {}", one.text, one.seen));
    }
    suite.add_child("testcase", test);
  }
  pt::ptree root;
  root.add_child("testsuites.testsuite", suite);
  std::ostringstream text;
  pt::write_xml(text, root, pt::xml_writer_make_settings<std::string>(' ', 1));
  return text.str() + "\n";
}

}  // namespace imud
