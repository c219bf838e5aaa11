// Scripts on the hosts of a rack, which is this machine here.
#include "emulator/rack/host_scripts.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <span>
#include <string>
#include <vector>

namespace imud {
namespace {

TEST(HostScripts, HaveSectionsBehindWhatALoginPrints) {
  const std::atomic<bool> stop = false;
  const std::vector<RackHost> hosts(2, RackHost{.name = "here", .ssh = "", .runs = {}});
  const std::vector<std::string> scripts = {
      "echo greeting\n" + section("one") + "printf 'a\\nb'\n" + section("two") + "printf '%s' 'it'\\''s'\n",
      section("one") + "echo no such file >&2\nexit 3\n"};
  const auto answers = run_on_hosts(hosts, scripts, std::chrono::seconds(300), stop);
  EXPECT_EQ(answers[0].fault, "");
  EXPECT_EQ(answers[0].text("one"), "a\nb");
  EXPECT_EQ(answers[0].text("two"), "it's");
  EXPECT_EQ(answers[0].text("three"), "");
  EXPECT_EQ(answers[1].fault, "its shell has ended with exit code 3: no such file");
  const std::vector<std::string> slow = {section("one") + "sleep 1000\n"};
  const std::span<const RackHost> one_host(hosts.data(), 1);
  EXPECT_EQ(run_on_hosts(one_host, slow, std::chrono::seconds(1), stop)[0].fault, "has not answered within 1 s");
}

}  // namespace
}  // namespace imud
