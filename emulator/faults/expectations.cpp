#include "emulator/faults/expectations.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <sstream>

namespace imud {

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
    if (!config.fault_name.empty()) {
      const bool is_active = schedule.is_active(config.fault_name);
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
  suite.put("<xmlattr>.failures", std::ranges::count_if(results, [](const Expected& one) { return !one.holds; }));
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
