// A scenario with all kinds of faults has the same bytes each time, in lockstep and fast, and beside other imus;
// their hashes, in fault_hashes.txt, are those of every compiler and optimisation.
#include <gtest/gtest.h>

#include "emulator/faults/fault_kinds.hpp"
#include "tests/emulator/every_quantity.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

constexpr double scenario_s = 10;

// The imus of each group that fault_bytes.txt names: lists of names, empty where no imu is such.
struct Groups {
  std::string all, lines, sealed, bus, inclined, tested;
};

// Returns the faults of fault_bytes.txt for these imus.
std::string all_faults(const Groups& groups) {
  std::string text = "fault = [\n";
  for (std::string line : lines_of(read_file(IMUD_TEST_DATA "/emulator/faults/fault_bytes.txt"))) {
    if (line.starts_with('#')) continue;
    bool has_imus = true;
    for (const auto& [word, imus] : {std::pair("ALL", groups.all),
                                     {"LINES", groups.lines},
                                     {"SEALED", groups.sealed},
                                     {"BUS", groups.bus},
                                     {"INCLINED", groups.inclined},
                                     {"TESTED", groups.tested}}) {
      const std::size_t at = line.find(fmt::format("imu = {},", word));
      if (at == line.npos) continue;
      has_imus = !imus.empty();
      line.replace(at + 6, std::string_view(word).size(), imus);
    }
    if (has_imus) text += line + "\n";
  }
  return text + "]\n";
}

// Returns the groups of imus of `native`, which have neither inclinometers nor a self test.
Groups native_groups(const std::string& imus) {
  return {.all = imus, .lines = imus, .sealed = imus, .bus = "", .inclined = "", .tested = ""};
}

class FaultBytesTest : public EveryQuantityTest {};

TEST_F(FaultBytesTest, HaveEveryKindOnEveryTarget) {
  const std::string text = read_file(IMUD_TEST_DATA "/emulator/faults/fault_bytes.txt");
  std::size_t asked = 0;
  for (const FaultKind* const kind : fault_kinds()) {
    if (!kind->in_lockstep) continue;
    for (const std::string_view target : kind->targets) {
      ++asked;
      EXPECT_NE(text.find(fmt::format("target = \"{}\", kind = \"{}\"", target, kind->name)), text.npos)
          << "fault_bytes.txt lacks " << target << ", " << kind->name;
    }
  }
  EXPECT_GE(asked, 110U);
}

TEST_F(FaultBytesTest, AreTheSameEachTimeAndInEveryBuild) {
  const auto product = [](const std::string& name, const std::string& keys, double rate_hz) {
    return Unit{name, fmt::format("protocol = \"{0}\"\nport = \"file:{0}\"\n{1}", name, keys), rate_hz};
  };
  const std::vector<Unit> units = {
      native_unit("native"), every_quantity_unit("dbc"), product("stim300", "", 2000),
      product("vectornav",
              "device.async_type = 0\ndevice.binary_1 = \"1,4,04,0ED0\"\nnavigation.solution = \"truth\"\n", 800),
      product("mip", "navigation.solution = \"truth\"\n", 1000)};
  const std::string faults = all_faults({.all = "\"*\"",
                                         .lines = "[\"native\", \"stim300\", \"vectornav\", \"mip\"]",
                                         .sealed = "[\"native\", \"stim300\", \"vectornav\"]",
                                         .bus = "\"dbc\"",
                                         .inclined = "\"stim300\"",
                                         .tested = "\"stim300\""});
  const Sampled one = run(units, faults, scenario_s);
  EXPECT_GT(one.acted.size(), 300U);
  EXPECT_EQ(run(units, faults, scenario_s).sent, one.sent);
  EXPECT_EQ(run(units, faults, scenario_s, 7, "lockstep").sent, one.sent);
  EXPECT_NE(run(units, faults, scenario_s, 8).sent, one.sent);
  std::string hashes;
  for (std::size_t i = 0; i < units.size(); ++i) {
    std::uint64_t hash = 0xcbf29ce484222325U;
    std::size_t size = 0;
    for (const std::string& sent : one.sent[i]) {
      for (const char c : sent) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
      size += sent.size();
    }
    hashes += fmt::format("{:016x} {} {}\n", hash, size, units[i].name);
  }
  std::string wanted;
  for (const std::string& line : lines_of(read_file(IMUD_TEST_DATA "/emulator/faults/fault_hashes.txt")))
    if (!line.starts_with('#')) wanted += line + "\n";
  EXPECT_EQ(hashes, wanted);
}

TEST_F(FaultBytesTest, AreTheSameBesideFifteenOthers) {
  std::vector<Unit> many;
  for (int i = 1; i <= 16; ++i) many.push_back(native_unit(fmt::format("imu{}", i)));
  const std::string one = all_faults(native_groups("\"imu1\"")), all = all_faults(native_groups("\"*\""));
  const Sampled alone = run({many[0]}, one, scenario_s);
  const Sampled beside = run(many, one, scenario_s);
  const Sampled together = run(many, all, scenario_s);
  EXPECT_EQ(beside.sent[0], alone.sent[0]);
  EXPECT_EQ(together.sent[0], alone.sent[0]);
  EXPECT_NE(together.sent[1], together.sent[0]);
  EXPECT_NE(together.sent[1], beside.sent[1]);
}

}  // namespace
}  // namespace imud
