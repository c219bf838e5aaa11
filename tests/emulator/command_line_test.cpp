// The command line of imud: commands that are misspelt, its help, and too many open files.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "emulator/config/presets.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

TEST(CommandLine, AnUnknownCommandIsNamedWithTheNearest) {
  const std::pair<std::string, std::string> words[] = {{"rnu", "run"},    {"Run", "run"},     {"lsit", "list"},
                                                       {"rep", "replay"}, {"chekc", "check"}, {"hlep", "help"}};
  for (const auto& [given, meant] : words) {
    const auto result = run_program("imud", {given, "x.toml"});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(result.errors, fmt::format("imud: unknown command \"{}\"; did you mean \"{}\"?\n", given, meant));
  }
  const auto none = run_program("imud", {"imu.toml"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_TRUE(contains(none.errors, "unknown command \"imu.toml\"; there are run, replay, check")) << none.errors;
}

TEST(CommandLine, ANumberOfAnOptionIsRefusedWithItsLimits) {
  const std::tuple<std::vector<std::string>, std::string> options[] = {
      {{"run", "--for"}, "from 0.001 to 1000000000"},
      {{"run", "--log-every"}, "from 0 to 1000000000"},
      {{"selftest", "--for"}, "from 0.1 to 3600"},
      {{"demo", "--for"}, "from 0.1 to 1000000000"},
      {{"campaign", "bisect", "plan.toml", "--axis", "a", "--tolerance"}, "from 1e-300 to 1e+300"}};
  for (const auto& [option, limits] : options)
    for (const std::string number : {"nan", "-1", "inf"}) {
      std::vector<std::string> words = option;
      words.push_back(number);
      const auto result = run_program("imud", words);
      EXPECT_EQ(result.exit_code, 2) << option.back() << number;
      EXPECT_TRUE(contains(result.errors, fmt::format("{}: right would be a number {}\n", number, limits)))
          << result.errors;
    }
}

TEST(CommandLine, AnUnknownOptionIsNamedWithTheNearest) {
  const std::tuple<std::vector<std::string>, std::string> words[] = {
      {{"--bogus"}, "imud: unknown option --bogus; imud --help shows all\n"},
      {{"--versoin"}, "imud: unknown option --versoin; did you mean \"--version\"?\n"},
      {{"run", "--fro"}, "imud: unknown option --fro; did you mean \"--for\"?\n"},
      {{"check", "--jsn=1", "x.toml"}, "imud: unknown option --jsn; did you mean \"--json\"?\n"},
      {{"list", "--qqqqqq"}, "imud: unknown option --qqqqqq; imud list --help shows all\n"}};
  for (const auto& [given, fault] : words) {
    const auto result = run_program("imud", given);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(result.errors, fault);
  }
  // What is no option is refused as before.
  EXPECT_TRUE(contains(run_program("imud", {"list", "a", "b"}).errors, "not expected: b"));
  EXPECT_TRUE(contains(run_program("imud", {"replay", "a"}).errors, "CAPTURE is required"));
}

TEST(CommandLine, HelpIsThatOfTheOption) {
  const auto help = run_program("imud", {"help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_TRUE(contains(help.output, "replay")) << help.output;
  EXPECT_EQ(help.output, run_program("imud", {"--help"}).output);
  const auto run = run_program("imud", {"help", "run"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_TRUE(contains(run.output, "--summary")) << run.output;
  EXPECT_EQ(run.output, run_program("imud", {"run", "--help"}).output);
}

TEST(CommandLine, EveryCommandHasAVersion) {
  const std::string version = run_program("imud", {"--version"}).output;
  EXPECT_TRUE(version.starts_with("imud ") && version.ends_with("\n")) << version;
  const std::vector<std::string> commands[] = {
      {"run"},  {"check"},           {"list"},    {"ctl"},      {"rack"}, {"init"},  {"status"}, {"top"}, {"pty"},
      {"demo"}, {"campaign", "run"}, {"example"}, {"selftest"}, {"help"}, {"replay"}};
  for (std::vector<std::string> command : commands) {
    command.emplace_back("--version");
    const auto result = run_program("imud", command);
    EXPECT_EQ(result.exit_code, 0) << command.front();
    EXPECT_EQ(result.output, version) << command.front();
  }
}

std::vector<std::string> all_names() {
  std::set<std::string_view> names;
  for (const Protocol* protocol : protocols()) names.insert(protocol->name);
  for (const Protocol* protocol : described_protocols()) names.insert(protocol->name);
  for (const TruthFormat* format : truth_formats()) names.insert(format->name);
  for (const Transport* transport : transports()) names.insert(transport->name);
  for (const Preset& preset : presets()) names.insert(preset.name);
  return {names.begin(), names.end()};
}

// All that an entry declares is listed, and as JSON.
TEST(List, ShowsWhatAnEntryHas) {
  EXPECT_GE(all_names().size(), 12U);
  std::size_t counters = 0;
  const std::string all = run_program("imud", {"list"}).output;
  for (const std::string& name : all_names()) {
    const std::string text = run_program("imud", {"list", name}).output;
    const auto json = nlohmann::json::parse(run_program("imud", {"list", name, "--json"}).output);
    std::vector<std::string_view> words;
    std::vector<Preset::Figure> figures;
    std::size_t entries = 0;
    if (const Protocol* protocol = resolve_protocol(name)) {
      ++entries;
      words.insert(words.end(), {protocol->summary, protocol->document});
      for (const Setting& setting : protocol->settings) words.insert(words.end(), {setting.key, setting.help});
      for (const DeviceCounter& counter : protocol->counters) {
        words.insert(words.end(), {counter.key, counter.words});
        ++counters;
      }
      if (is_described(*protocol)) {
        const Settings settings(protocol->settings);
        for (const std::string& line : protocol->layout(settings)) EXPECT_TRUE(contains(text, line)) << name;
        EXPECT_TRUE(contains(text, fmt::format("model in [[imu]]: {}\n", default_model(*protocol, settings))));
        EXPECT_TRUE(contains(all, fmt::format("  {:<16} {} [{}]\n", name, protocol->summary, protocol->document)));
      }
      ASSERT_TRUE(json[0].contains("counters"));
      EXPECT_EQ(json[0]["counters"].size(), protocol->counters.size()) << name;
    }
    if (const TruthFormat* format = find_truth_format(name)) {
      ++entries;
      words.insert(words.end(), {format->summary, format->document});
      for (const Setting& setting : format->settings) words.insert(words.end(), {setting.key, setting.help});
      for (const ColumnGroup& group : format->columns) {
        words.insert(words.end(), group.names.begin(), group.names.end());
        words.push_back(group.help);
      }
    }
    if (const Transport* transport = find_transport(name)) {
      ++entries;
      words.insert(words.end(), {transport->summary, transport->syntax, transport->example, transport->document});
      for (const PortOption& option : transport->options) words.insert(words.end(), {option.key, option.help});
    }
    if (const Preset* preset = find_preset(name)) {
      ++entries;
      words.insert(words.end(), {preset->summary(), preset->source()});
      figures = preset->figures();
      for (const Preset::Figure& figure : figures)
        words.insert(words.end(), {figure.key, figure.value, figure.confidence, figure.note});
    }
    EXPECT_EQ(json.size(), entries) << name;
    EXPECT_GE(words.size(), 2U);
    for (const std::string_view word : words) EXPECT_TRUE(contains(text, word)) << name << ": " << word;
  }
  EXPECT_GE(counters, 1U);
  EXPECT_TRUE(contains(run_program("imud", {"list", "can"}).output, "bit/s; for its load (5000 to 1000000)"));
  const auto unknown = run_program("imud", {"list", "stim30"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_TRUE(contains(unknown.errors, "did you mean \"stim300\"?")) << unknown.errors;
  EXPECT_TRUE(contains(run_program("imud", {"list", "hipnuk"}).errors, "did you mean \"hipnuc\"?"));
}

// With the comments before keys, and without them.
TEST(List, HasTheChecksOfFrames) {
  const std::string text = run_program("imud", {"list", "checks"}).output;
  EXPECT_TRUE(contains(text, "\ncrc16/xmodem                16  1021 0000 false false 0000, 31C3\n")) << text;
  EXPECT_TRUE(contains(text, "\nfletcher8                   16\n")) << text;
  const auto json = nlohmann::json::parse(run_program("imud", {"list", "checks", "--json"}).output);
  EXPECT_GE(json.size(), 80U);
  EXPECT_EQ(std::ranges::count_if(json,
                                  [](const auto& one) {
                                    return one["name"] == "crc32/iso-hdlc" && one["poly"] == "04C11DB7" &&
                                           one["check"] == "CBF43926";
                                  }),
            1);
}

TEST(Example, IsAcceptedForEveryName) {
  std::vector<std::string> names = all_names();
  for (const Preset& preset : field_presets()) names.emplace_back(preset.name);
  for (const std::string& name : names) {
    const auto example = run_program("imud", {"example", name});
    EXPECT_EQ(example.exit_code, 0) << name;
    const auto good = run_program("imud", {"check", "-"}, example.output);
    EXPECT_EQ(good.exit_code, 0) << name << example.output << good.errors;
    std::string all;
    std::size_t keys = 0;
    for (const std::string& line : lines_of(example.output)) {
      const bool is_key = line.size() > 1 && line[0] == '#' && line[1] != ' ';
      if (is_key) ++keys;
      all += line.substr(is_key ? 1 : 0) + "\n";
    }
    const auto complete = run_program("imud", {"check", "-"}, all);
    EXPECT_EQ(complete.exit_code, 0) << name << all << complete.errors;
    const Protocol* protocol = resolve_protocol(name);
    const TruthFormat* format = find_truth_format(name);
    EXPECT_GE(keys, (protocol == nullptr ? 0 : protocol->settings.size()) +
                        (format == nullptr ? 0 : format->settings.size()) + 2)
        << example.output;
    for (const auto entry : {protocol == nullptr ? "" : protocol->summary, format == nullptr ? "" : format->summary})
      EXPECT_TRUE(contains(example.output, entry)) << example.output;
    EXPECT_TRUE(protocol == nullptr || contains(good.output, name + " at ")) << good.output;
    const bool has_gyros = std::ranges::any_of(presets(), [&](const Preset& one) { return one.name == name; });
    EXPECT_EQ(contains(good.output, "errors of the model " + name + ":"), has_gyros) << good.output;
    const bool is_field_preset = find_preset(name) != nullptr && !has_gyros;
    EXPECT_TRUE(!is_field_preset || contains(example.output, "\nmodel = \"" + name + "\"\n")) << example.output;
    EXPECT_TRUE(format == nullptr || contains(good.output, "truth    " + name + " from ")) << good.output;
    EXPECT_TRUE(format != nullptr || contains(example.output, "format = \"native\"")) << example.output;
    EXPECT_TRUE(name != "record" || contains(example.output, "?interface=truth\"")) << "others are no truth";
    if (format == nullptr) continue;
    // 42 uses TCP, and poses are in files.
    const std::string way = name == "42" ? "tcp" : name == "tum" || name == "euroc" ? "file" : "udp";
    EXPECT_TRUE(contains(example.output, "\nport = \"" + way + ":")) << example.output;
    // A format that sends before it receives needs its simulator's address.
    const auto decoder = format->make(Settings(format->settings));
    decoder->start({});
    EXPECT_TRUE(!decoder->deadline() || contains(example.output, "?peer=127.0.0.1:")) << example.output;
  }
  EXPECT_EQ(run_program("imud", {"example", "nonsense"}).exit_code, 2);
}

// Whatever the limit is, imud runs, or names the remedy.
TEST(CommandLine, TooManyOpenFilesNamesTheRemedy) {
  const ScratchFolder folder;
  const std::string path = folder / "imud.toml";
  std::ofstream file(path);
  file << "clock = \"lockstep\"\ntruth.port = \"udp:127.0.0.1:" << free_udp_port() << "\"\n";
  for (int i = 0; i < 8; ++i)
    file << "[[imu]]\nprotocol = \"stim300\"\nport = \"pty:" << folder / fmt::format("imu{}", i) << "\"\n";
  file.close();
  int refused = 0, hidden = 0, ran = 0;
  for (int limit = 9; limit < 64 && ran == 0; limit += 2) {
    const auto result = run_program(
        "/bin/sh", {"-c", fmt::format("ulimit -n {}; exec {}/imud run {} --for 0.1", limit, IMUD_BIN_DIR, path)});
    if (result.exit_code == 0) {
      ++ran;
    } else if (contains(result.errors, "object has invalid vptr")) {
      ++hidden;  // UBSan had no file left for its own check
    } else {
      ++refused;
      EXPECT_TRUE(contains(result.errors, fmt::format("imud may have {0} files open (ulimit -n); permit more by "
                                                      "`ulimit -n {1}` or, in a systemd unit, LimitNOFILE={1}\n",
                                                      limit, 4 * limit)))
          << limit << result.errors;
    }
  }
  EXPECT_GE(refused + hidden, 2);
  EXPECT_EQ(ran, 1);
}

}  // namespace
}  // namespace imud
