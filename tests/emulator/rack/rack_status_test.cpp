// The status of a rack from the answers of its hosts, and what differs between them.
#include "emulator/rack/rack_status.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "emulator/rack/host_scripts.hpp"
#include "emulator/rack/rack_record.hpp"

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

std::vector<std::string> remarks_of(const HostAnswer& first, const HostAnswer& second) {
  return rack_status_of(asked_rack(), {first, second})["remarks"];
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
  // The terminal shows the answer of a host, and does not execute it.
  EXPECT_EQ(text_with({.fault = "\x1b]0;owned\x07", .sections = {}}), "bench2: ?]0;owned?\n");
}

TEST(RackStatus, SaysWhatDiffers) {
  const HostAnswer nose = host_answer_with(answering_run("nose", begin_k));
  using Texts = std::vector<std::string>;
  EXPECT_EQ(remarks_of(nose, host_answer_with(answering_run("tail", begin_k + 8000))),
            Texts{"tail of imud@tail on bench2 has begun 4 s after nose of imud@nose on bench1: its counter is that "
                  "much behind"});
  EXPECT_EQ(remarks_of(nose, host_answer_with(answering_run("tail", begin_k + 900))), Texts{})
      << "another phase or rate";
  Json run = answering_run("tail", begin_k);
  run["version"] = "1.3";
  EXPECT_EQ(remarks_of(nose, host_answer_with(run, "imud 1.3\n")),
            Texts{"versions differ: 1.2 (bench1), 1.3 (bench2); install one on all hosts"});
  run["version"] = "1.1";
  EXPECT_EQ(remarks_of(nose, host_answer_with(run)),
            Texts{"bench2: tail runs version 1.1, and 1.2 is installed; start it again"});
  run = answering_run("tail", begin_k);
  run["counters"]["clock"]["tai_offset_s"] = 0;
  EXPECT_EQ(remarks_of(nose, host_answer_with(run)),
            Texts{"offsets of TAI differ: 0 s (bench2), 37 s (bench1); the samples "
                  "of these hosts are whole seconds apart"});
  run = answering_run("tail", begin_k);
  run["counters"]["clock"]["synchronised"] = false;
  run["counters"]["clock"]["steps"] = 2;
  EXPECT_EQ(remarks_of(nose, host_answer_with(run)),
            (Texts{"bench2: its clock is not known to be synchronised, and may differ from the others",
                   "bench2: its clock has been set 2 times since tail began"}));
  run = answering_run("tail", begin_k);
  run["counters"].erase("clock");
  run["counters"]["imus"][0].erase("first_k");
  EXPECT_EQ(remarks_of(nose, host_answer_with(run)),
            Texts{"epochs differ: none (imud@tail on bench2), tai (imud@nose on bench1); the runs are not in phase"});
}

// As systemctl 252 shows the property.
TEST(RackRecord, IsWhereTheUnitRecords) {
  const auto record = [](const std::string& words) {
    return unit_record(
        "{ path=/usr/bin/imud ; argv[]=imud run /etc/imud/nose.toml --set control.name=nose " + words +
        " ; ignore_errors=no ; start_time=[n/a] ; stop_time=[n/a] ; pid=0 ; code=(null) ; status=0/0 }");
  };
  EXPECT_EQ(record("").file, "");
  EXPECT_EQ(record("--quality /var/lib/imud/nose.jsonl").file, "");
  EXPECT_EQ(record("--record /var/lib/imud/nose.pcapng").file, "/var/lib/imud/nose.pcapng");
  EXPECT_FALSE(record("--record /var/lib/imud/nose.pcapng").is_split);
  EXPECT_EQ(record("--record=a=b.pcapng -q").file, "a=b.pcapng");
  EXPECT_EQ(record("--record -").file, "") << "the journal has it";
  EXPECT_TRUE(record("--record a.pcapng --record-max-mb 100 --record-files 5").is_split);
  EXPECT_TRUE(record("--record-max-mb=100 --record a.pcapng").is_split);
  EXPECT_EQ(unit_record("").file, "") << "there is no such unit";
}

}  // namespace
}  // namespace imud
