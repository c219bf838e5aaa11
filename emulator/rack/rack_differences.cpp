#include "emulator/rack/rack_differences.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "emulator/ground/plural.hpp"

namespace imud {
namespace {

// Lists the owners of each value: "1.2 (bench1, bench2), 1.3 (bench3)".
class Values {
 public:
  void add(const std::string& value, const std::string& owner) {
    std::vector<std::string>& owners = owners_[value];
    if (std::ranges::find(owners, owner) == owners.end()) owners.push_back(owner);
  }
  bool differ() const { return owners_.size() > 1; }
  std::string text() const {
    std::vector<std::string> all;
    for (const auto& [value, owners] : owners_) all.push_back(fmt::format("{} ({})", value, fmt::join(owners, ", ")));
    return fmt::format("{}", fmt::join(all, ", "));
  }

 private:
  std::map<std::string, std::vector<std::string>> owners_;
};

// The begin of an imu's samples, by the common clock.
struct Begin {
  double time_s, period_s;
  std::string owner;
};

void add_begins(const Json& run, const std::string& owner, std::vector<Begin>& begins) {
  for (const Json& imu : run.value("imus", Json::array())) {
    const double rate_hz = imu.value("rate_hz", 0.0);
    if (rate_hz > 0 && imu["first_k"].is_number())
      begins.push_back({imu["first_k"].get<double>() / rate_hz, 1 / rate_hz,
                        fmt::format("{} of {}", imu.value("name", "?"), owner)});
  }
}

}  // namespace

Json differences(const Json& hosts) {
  Json remarks = Json::array();
  Values versions, epochs, tai_offsets;
  std::vector<Begin> begins;
  for (const Json& host : hosts) {
    const std::string name = host["name"];
    const std::string version = host["version"];
    if (!version.empty()) versions.add(version, name);
    for (const Json& run : host["runs"]) {
      if (run["state"] != "running") continue;
      const std::string owner = fmt::format("imud@{} on {}", run["name"].get<std::string>(), name);
      if (const std::string of_run = run["version"]; !version.empty() && of_run != version)
        remarks.push_back(fmt::format("{}: {} runs version {}, and {} is installed; start it again", name,
                                      run["name"].get<std::string>(), of_run, version));
      const Json& clock = run["clock"];
      epochs.add(clock.is_object() ? clock.value("epoch", "?") : "none", owner);
      if (!clock.is_object()) continue;
      if (clock.contains("tai_offset_s") && clock.value("epoch", "") == "tai")
        tai_offsets.add(fmt::format("{} s", clock["tai_offset_s"].dump()), name);
      if (clock.contains("synchronised") && !clock.value("synchronised", false))
        remarks.push_back(
            fmt::format("{}: its clock is not known to be synchronised, and may differ from the others", name));
      if (const auto steps = clock.value("steps", std::uint64_t{0}); steps > 0)
        remarks.push_back(fmt::format("{}: its clock has been set {} since {} began", name, plural(steps, "time"),
                                      run["name"].get<std::string>()));
      add_begins(run, owner, begins);
    }
  }
  if (versions.differ())
    remarks.push_back(fmt::format("versions differ: {}; install one on all hosts", versions.text()));
  if (epochs.differ()) remarks.push_back(fmt::format("epochs differ: {}; the runs are not in phase", epochs.text()));
  if (tai_offsets.differ())
    remarks.push_back(fmt::format("offsets of TAI differ: {}; the samples of these hosts are whole seconds apart",
                                  tai_offsets.text()));
  if (!begins.empty()) {
    const Begin first = *std::ranges::min_element(begins, {}, &Begin::time_s);
    for (const Begin& one : begins)
      if (one.time_s - first.time_s > 0.5 + one.period_s)  // they begin at whole seconds
        remarks.push_back(fmt::format("{} has begun {:.0f} s after {}: its counter is that much behind", one.owner,
                                      one.time_s - first.time_s, first.owner));
  }
  Json unique = Json::array();
  for (Json& remark : remarks)
    if (std::ranges::find(unique, remark) == unique.end()) unique.push_back(std::move(remark));
  return unique;
}

}  // namespace imud
