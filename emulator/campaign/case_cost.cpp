#include "emulator/campaign/case_cost.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>

#include "emulator/drive/assembly.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/report/summary.hpp"
#include "emulator/truth/capture_check.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

// Sets `stop` after a time, unless it is destroyed before.
class TimeLimit {
 public:
  TimeLimit(std::atomic<bool>& stop, std::chrono::seconds limit)
      : thread_([this, &stop, limit](const std::stop_token& end) {
          std::unique_lock lock(mutex_);
          if (!ended_.wait_for(lock, end, limit, [&end] { return end.stop_requested(); })) stop = true;
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any ended_;
  std::jthread thread_;
};

std::unique_ptr<Port> truth_alone(const PortUse& use) {
  return use.of == PortUse::Of::truth ? real_ports(use) : no_ports(use);
}

// Returns an estimate of the bytes of a row of the case, by its columns and by the figures of the summary.
double estimated_row(const Campaign& campaign, const CampaignCase& c, const Config& config, Assembly& assembly) {
  constexpr std::size_t fixed = 300, per_imu = 80, per_text = 6, per_figure = 10, per_error = 55;
  std::size_t bytes = fixed + per_error * error_figures(campaign, config);
  for (const auto& [name, text] : columns_of(campaign, c)) bytes += name.size() + text.size() + per_text;
  RunCounters counters{&assembly.engine().intake().counters(), &assembly.engine().quality(), {}};
  for (const auto& channel : assembly.engine().channels())
    counters.imus.emplace_back(channel->name, &channel->counters);
  const Summary summary = summarize(counters, 0, std::vector<double>(counters.imus.size()));
  for (const std::string& name : count_names(summary)) {
    const bool is_of_imu = name.find('.') == name.npos;
    bytes += (name.size() + per_figure) * (is_of_imu ? summary.imus.size() : 1);
  }
  for (const Summary::Imu& imu : summary.imus) bytes += per_imu + imu.name.size();
  return static_cast<double>(bytes + array_bytes(campaign, config));
}

}  // namespace

CampaignCost measure_cases(const Campaign& campaign) {
  constexpr std::chrono::seconds longest(20);
  const std::uint64_t last = campaign.cases() - 1;
  const std::set<std::uint64_t> cases = {0, last / 2, last};
  CampaignCost cost{.cases = {cases.begin(), cases.end()}, .processors = usable_processors()};
  for (const std::uint64_t index : cases) {
    const HostTime begin = host_now();
    const CampaignCase c = case_of(campaign, index);
    const Config config = config_of(campaign, c);
    static_cast<void>(identity_of(campaign, config));
    Assembly assembly(config, truth_alone, {.repeats = CapturePort(c.capture, campaign.base).repeats});
    double paced_s = 0;
    std::atomic<bool> is_cut = false;
    if (config.clock == ClockMode::realtime) {
      const CaptureLength length = capture_length(config);
      paced_s = campaign.test->settle_s + length.length_s;
      is_cut = !length.is_whole;
    } else {
      MonotonicHost host;
      const TimeLimit limit(is_cut, longest);
      assembly.run(host, is_cut);
    }
    cost.case_s += (paced_s + seconds(host_now() - begin)) / static_cast<double>(cases.size());
    cost.is_cut = cost.is_cut || is_cut;
    cost.row_bytes += estimated_row(campaign, c, config, assembly) / static_cast<double>(cases.size());
  }
  return cost;
}

}  // namespace imud
