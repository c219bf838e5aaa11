#include "emulator/campaign/tested_case.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <optional>
#include <thread>

#include "emulator/campaign/cases/test_metrics.hpp"
#include "transports/port.hpp"

namespace imud {

namespace {

// Returns the transport that makes a pseudo-terminal at a path.
const Transport& terminal() {
  for (const Transport* transport : transports())
    if (transport->makes_link) return *transport;
  throw PortError("no transport makes a pseudo-terminal");
}

}  // namespace

TestedCase::TestedCase(const Campaign& campaign, const CampaignCase& one, Config& config, bool is_shown)
    : limit_s_(campaign.test->time_limit_s),
      settles_(campaign.test->settle_s),
      command_(
          {.folder = std::filesystem::path(campaign.file).parent_path(), .limit_s = limit_s_, .is_shown = is_shown}) {
  const auto imu =
      std::ranges::find_if(config.imus, [](const ImuConfig& any) { return any.protocol->link == Link::bytes; });
  imu_ = static_cast<std::size_t>(imu - config.imus.begin());
  const std::string port = command_.scratch() / "port";
  imu->port = fmt::format("{}:{}", terminal().name, port);
  imu->also = {imu->port};
  imu->also_settings = {imu->port_settings};
  text_ = with_values(campaign.test->command, {{"port", port},
                                               {"case", fmt::to_string(one.index)},
                                               {"seed", fmt::to_string(one.seed)},
                                               {"metrics", command_.scratch() / "metrics.json"}});
}

void TestedCase::begin(Engine& engine, const std::atomic<bool>& stop) {
  command_.start(text_);
  Port& port = *engine.channels()[imu_]->lines.all().front().port;
  std::optional<std::chrono::steady_clock::time_point> opened;
  while (!stop && !command_.has_ended()) {  // the supervisor kills the command at its time limit
    port.flush();
    if (port.state() != PortState::no_reader && !opened) opened = std::chrono::steady_clock::now();
    has_opened_ = opened.has_value();
    if (opened && std::chrono::steady_clock::now() - *opened >= settles_) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

nlohmann::ordered_json TestedCase::end(const std::atomic<bool>& stop, std::vector<std::string>& shortfalls) {
  const TestCommand::End end = command_.wait(stop);
  if (!has_opened_) shortfalls.emplace_back("the test has not opened {port}");
  if (end.is_timed_out)
    shortfalls.push_back(fmt::format("the test was killed after {:g} s", limit_s_));
  else if (end.exit_code != 0)
    shortfalls.push_back(fmt::format("the test has ended with {}", end.exit_code));
  nlohmann::ordered_json test = {
      {"exit_code", end.exit_code}, {"timed_out", end.is_timed_out}, {"metrics", nlohmann::ordered_json::object()}};
  if (std::ifstream file(command_.scratch() / "metrics.json", std::ios::binary); file) {
    std::string fault;
    nlohmann::ordered_json metrics = read_metrics({std::istreambuf_iterator<char>(file), {}}, fault);
    if (fault.empty())
      test["metrics"] = std::move(metrics);
    else
      shortfalls.push_back(fmt::format("the metrics of the test: {}", fault));
  }
  return test;
}

}  // namespace imud
