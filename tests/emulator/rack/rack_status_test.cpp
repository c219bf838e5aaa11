// The status of a rack from the answers of its hosts, and what differs between them.
#include "emulator/rack/rack_status.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "emulator/rack/host_scripts.hpp"

namespace imud {
namespace {

Rack asked_rack() {
  Rack rack;
  rack.file = "rack.toml";
  rack.hosts = {{.name = "bench1", .ssh = "root@bench1", .runs = {{"nose", "nose.toml"}}},
                {.name = "bench2", .ssh = "bench2", .runs = {{"tail", "tail.toml"}}}};
  return rack;
}

// The answer of a run to `status`, as far as it is looked at.
Json answering_run(const std::string& name, std::uint64_t first_k) {
  return {{"name", name},
          {"state", "running"},
          {"version", "1.2"},
          {"imus", {{{"name", name}, {"protocol", "stim300"}, {"rate_hz", 2000}}}},
          {"counters",
           {{"duration_s", 10.0},
            {"imus", {{{"name", name}, {"samples", 20000}, {"missed", 3}, {"first_k", first_k}}}},
            {"clock",
             {{"epoch", "tai"}, {"steps", 0}, {"synchronised", true}, {"error_us", 12}, {"tai_offset_s", 37}}}}}};
}

HostAnswer host_answer_with(const Json& run, const std::string& version = "imud 1.2\n") {
  return {.fault = {},
          .sections = {{"version", version}, {"units", "active\n"}, {"runs", Json({{"runs", {run}}}).dump()}}};
}

constexpr std::uint64_t begin_k = 2000ULL * 1'800'000'000;

TEST(RackStatus, IsGoodIfAllRun) {
  const Json status = rack_status_of(asked_rack(), {host_answer_with(answering_run("nose", begin_k)),
                                                    host_answer_with(answering_run("tail", begin_k))});
  EXPECT_TRUE(status["good"]);
  EXPECT_EQ(status["remarks"], Json::array());
  EXPECT_EQ(rack_status_text(status),
            "HOST    RUN   STATE    VERSION      FOR  IMU       HZ  SAMPLES  MISSED  LATE P99 us  CLOCK             "
            "FIRST K\n"
            "bench1  nose  running  1.2      0:00:10  nose  2000.0    20000       3          0.0  tai, 12 us  "
            "3600000000000\n"
            "bench2  tail  running  1.2      0:00:10  tail  2000.0    20000       3          0.0  tai, 12 us  "
            "3600000000000\n");
}

TEST(RackStatus, NamesWhyARunDoesNotRun) {
  const auto text_with = [](const HostAnswer& second) {
    const Json status = rack_status_of(asked_rack(), {host_answer_with(answering_run("nose", begin_k)), second});
    EXPECT_FALSE(status["good"]);
    const std::string text = rack_status_text(status);
    return text.substr(text.find("\nbench2: ") + 1);
  };
  HostAnswer answer = host_answer_with(answering_run("another", begin_k));
  answer.sections["units"] = "failed\n";
  EXPECT_EQ(text_with(answer), "bench2: imud@tail has failed: journalctl -u shows why\n");
  answer.sections["units"] = "inactive\n";
  EXPECT_EQ(text_with(answer), "bench2: imud@tail does not run\n");
  EXPECT_EQ(text_with(host_answer_with({{"name", "tail"}, {"state", "foreign"}})),
            "bench2: imud@tail belongs to another user than that of ssh\n");
  Json strange = answering_run("tail", begin_k);
  strange["imus"] = {5};
  EXPECT_EQ(text_with(host_answer_with(strange)),
            "bench2: imud@tail its answer is one that this version does not know\n");
  EXPECT_EQ(text_with({.fault = "has not answered within 10 s", .sections = {}}),
            "bench2: has not answered within 10 s\n");
  EXPECT_EQ(text_with({.fault = {}, .sections = {{"version", ""}, {"units", ""}, {"runs", ""}}}),
            "bench2: imud is not installed there\n");
  // What a host answers is shown, not executed by the terminal.
  EXPECT_EQ(text_with({.fault = "\x1b]0;owned\x07", .sections = {}}), "bench2: ?]0;owned?\n");
}

}  // namespace
}  // namespace imud
