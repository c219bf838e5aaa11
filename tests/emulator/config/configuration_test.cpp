// Compares emulator/CONFIGURATION.md with the code: keys, and the range that the code enforces for each.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "emulator/config/entries.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/plan/config.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

struct Row {
  std::string default_value, range;
};

// Returns the rows by their keys, written as for `--set`. Every word in backticks in a first cell is a key of the
// heading's table.
std::map<std::string, Row> documented() {
  std::map<std::string, Row> rows;
  std::ifstream file(IMUD_SOURCE_DIR "/emulator/CONFIGURATION.md");
  std::string table;
  bool is_protocols = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("## ")) {
      std::smatch name;
      const bool found = std::regex_search(line, name, std::regex(R"(\[([a-z.]+)\])"));
      table = found ? name[1].str() + "." : "";
      if (line.find("`, `") != line.npos) table = "imu.";  // Several tables: the keys have their names.
      if (table.starts_with("imu.")) table.replace(0, 4, "imu.0.");
    }
    if (line.starts_with("#")) is_protocols = line.starts_with("### ");  // see HasEverySettingOfEveryProtocol
    if (!line.starts_with("| `") || is_protocols) continue;
    std::vector<std::string> cells;
    for (std::size_t at = 1, end = 0; (end = line.find('|', at)) != line.npos; at = end + 1)
      cells.push_back(line.substr(at, end - at));
    EXPECT_EQ(cells.size(), 4U) << line;
    if (cells.size() != 4) continue;
    const std::regex word("`([^`]+)`");
    for (std::sregex_iterator at(cells[0].begin(), cells[0].end(), word), end; at != end; ++at)
      EXPECT_TRUE(rows.emplace(table + (*at)[1].str(), Row{cells[1], cells[2]}).second) << *at->begin();
  }
  return rows;
}

class ConfigurationReference : public testing::Test {
 protected:
  // Returns the faults of a configuration after an assignment, as one text. A key below imu.0.cause is one of the
  // first table of the list.
  std::string faults(std::string assignment, const std::string& format) {
    const std::string causes = "imu.0.cause.";
    const bool is_of_cause = assignment.starts_with(causes);
    if (is_of_cause) {
      const std::string entry = std::regex_replace(assignment.substr(causes.size()), std::regex(R"(\?)"), "\"?\"");
      assignment = fmt::format("imu.0.cause=[{{{}}}]", entry);
    }
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"" << format
                         << "\"\n[[imu]]\nrate_hz = 200\nprotocol = \"native\"\nport = \"pty:imu1\"\n"
                            "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n";
    try {
      load_config(path_, std::vector{assignment});
    } catch (const ConfigError& error) {
      const std::string text = std::string("\n") + error.what() + "\n";
      return is_of_cause ? std::regex_replace(text, std::regex(R"(imu\.0\.cause\.0\.)"), causes) : text;
    }
    return {};
  }
  // Collects the keys of the table `prefix` ("truth.", "imu.0.gyro."), and of the tables in it, with the fault that a
  // value of a wrong kind gives. The fault of an unknown key lists the known ones.
  void collect(const std::string& prefix, const std::string& format, std::map<std::string, std::string>& all) {
    const std::string text = faults(prefix + "?=1", format);
    const std::string intro = ": " + prefix + "?: unknown key; known here: ";
    const std::size_t at = text.find(intro);
    if (at == text.npos) {  // no table
      const std::string key = prefix.substr(0, prefix.size() - 1), plain = faults(key + "={}", format);
      const std::size_t begin = plain.find(": " + key + ": ");
      ASSERT_NE(begin, plain.npos) << key << " accepts a table:" << plain;
      all[key] = plain.substr(begin, plain.find('\n', begin) - begin);
      return;
    }
    std::string known = text.substr(at + intro.size());
    known = known.substr(0, known.find('\n')) + ", ";
    for (std::size_t begin = 0, end = 0; (end = known.find(", ", begin)) != known.npos; begin = end + 2) {
      const std::string key = known.substr(begin, end - begin);
      if (!key.empty()) collect(prefix + (key == "imu" ? "imu.0" : key) + ".", format, all);
    }
    if (prefix == "imu.0.") {
      const std::string plain = faults("imu.0.cause={}", format);
      all["imu.0.cause"] = plain.substr(plain.find(": imu.0.cause: "));
    }
  }

  // Collects the keys of all formats, which differ in [truth].
  void collect_all(std::map<std::string, std::string>& all) {
    collect("", "native", all);
    for (const TruthFormat* format : truth_formats()) collect("truth.", std::string(format->name), all);
  }
  // Returns the first truth format that has the setting of that key, and the setting; nullptr if there is none.
  static std::pair<const TruthFormat*, const Setting*> setting_of(const std::string& key) {
    for (const TruthFormat* format : truth_formats())
      for (const Setting& setting : format->settings)
        if (key == "truth." + std::string(setting.key)) return {format, &setting};
    return {};
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
};

TEST_F(ConfigurationReference, HasEveryKeyAndNoOther) {
  std::map<std::string, std::string> known;
  collect_all(known);
  const std::map<std::string, Row> rows = documented();
  EXPECT_GT(known.size(), 60U);
  for (const auto& [key, fault] : known) EXPECT_TRUE(rows.contains(key)) << key << " is not documented";
  for (const auto& [key, row] : rows) EXPECT_TRUE(known.contains(key)) << key << " is documented, but unknown";
}

// What the file must have is printed, to be copied.
TEST_F(ConfigurationReference, HasEverySettingOfEveryProtocol) {
  std::ifstream input(IMUD_SOURCE_DIR "/emulator/CONFIGURATION.md");
  const std::string file(std::istreambuf_iterator<char>(input), {});
  std::size_t settings = 0, headings = 0, protocols_with_settings = 0;
  for (const Protocol* protocol : protocols()) {
    if (protocol->settings.empty()) continue;
    ++protocols_with_settings;
    std::string section =
        fmt::format("\n### `{}`\n| key | default | range | meaning |\n|---|---|---|---|\n", protocol->name);
    for (const Setting& setting : protocol->settings) {
      ++settings;
      std::string valid = valid_values(setting);
      if (valid.empty())
        valid = std::array{"`true`, `false`", "a whole number", "a number", "text", "list of texts"}.at(
            setting.initial.index());
      section +=
          fmt::format("| `{}` | `{}` | {} | {} |\n", setting.key, initial_value(setting).dump(), valid, setting.help);
    }
    EXPECT_NE(file.find(section + "\n"), file.npos) << "CONFIGURATION.md lacks:\n" << section;
  }
  for (std::size_t at = 0; (at = file.find("\n### `", at)) != file.npos; ++at) ++headings;
  EXPECT_EQ(headings, protocols_with_settings);
  EXPECT_GT(settings, 20U);
}

TEST_F(ConfigurationReference, RangesAreTheCodes) {
  std::map<std::string, std::string> known;
  collect_all(known);
  std::size_t ranges = 0, choices = 0;
  for (const auto& [key, row] : documented()) {
    const std::string fault = known[key];
    std::smatch match;
    if (key == "realtime.cpu") {  // the machine's
      EXPECT_NE(fault.find("give a whole number from 0 to "), fault.npos) << fault;
    } else if (std::regex_search(fault, match, std::regex(R"((number|time) from (\S+ to [^ ,;]+))"))) {
      ++ranges;
      const bool is_documented = row.range.find(" " + match[2].str() + " ") != row.range.npos ||
                                 row.range.find(" " + match[2].str() + ",") != row.range.npos;
      EXPECT_TRUE(is_documented) << key << ":" << row.range << fault;
    } else if (fault.find("give one of ") != fault.npos) {
      ++choices;
      const std::string words = fault.substr(fault.find("give one of ") + 12);
      std::string documented_words;
      for (const char c : row.range)
        if (c != '`') documented_words += c;
      EXPECT_EQ(documented_words, " " + words + " ") << key;
    } else if (fault.find("true or false") != fault.npos) {
      EXPECT_EQ(row.range, " `true`, `false` ") << key;
    } else if (fault.find("give a list of") != fault.npos) {
      EXPECT_EQ(row.range.substr(0, 8), " list of") << key << fault;
    } else if (fault.find("three") != fault.npos) {
      EXPECT_EQ(row.range.substr(0, 6), " three") << key << fault;
      EXPECT_EQ(fault.find("rows") != fault.npos, row.range.find("rows") != row.range.npos) << key << fault;
    } else if (fault.find("give tables, each as ") != fault.npos) {
      const std::string heading = std::regex_replace(key, std::regex(R"(imu\.0)"), "imu");
      EXPECT_EQ(row.range, fmt::format(" tables, each as [[{}]] ", heading)) << key << fault;
    } else if (fault.find("give text") != fault.npos) {
      EXPECT_EQ(row.range.substr(0, 5), " text") << key << fault;
    } else {
      const Setting* const setting = setting_of(key).second;
      ASSERT_NE(setting, nullptr) << key << fault;
      for (const std::string_view choice : setting->choices)
        EXPECT_NE(row.range.find(fmt::format("`\"{}\"`", choice)), row.range.npos) << key << row.range;
      if (setting->min < setting->max) {
        EXPECT_NE(row.range.find(fmt::format(" {} to {} ", setting->min, setting->max)), row.range.npos) << key;
      }
    }
  }
  EXPECT_GT(ranges, 20U);
  EXPECT_GT(choices, 8U);
}

// A default that is a value in TOML can be given, and is then no fault of its own.
TEST_F(ConfigurationReference, DefaultsCanBeGiven) {
  std::size_t given = 0;
  for (const auto& [key, row] : documented()) {
    const std::size_t end = row.default_value.find('`', 2);
    if (!row.default_value.starts_with(" `")) continue;
    const TruthFormat* const format = setting_of(key).first;
    const std::string fault = faults(key + "=" + row.default_value.substr(2, end - 2),
                                     format == nullptr ? "native" : std::string(format->name));
    ++given;
    const bool needs_another = fault.find(": needs ") != fault.npos || fault.find(" needs a capture") != fault.npos;
    EXPECT_TRUE(fault.empty() || needs_another) << fault;
  }
  EXPECT_GT(given, 40U);
}

TEST_F(ConfigurationReference, NamesWhatAReloadCanChange) {
  std::ifstream input(IMUD_SOURCE_DIR "/emulator/CONFIGURATION.md");
  const std::string file(std::istreambuf_iterator<char>(input), {});
  const std::size_t begin = file.find("In a run that goes on they can"), end = file.find("needs a new", begin);
  ASSERT_NE(end, file.npos);
  const std::string section = file.substr(begin, end - begin);
  std::vector<std::string> named, known;
  const std::regex word("`([^`]+)`");
  for (std::sregex_iterator at(section.begin(), section.end(), word), last; at != last; ++at)
    named.push_back((*at)[1].str());
  for (const std::string_view key : reloadable_keys(false)) known.emplace_back(key);
  for (const std::string_view key : reloadable_keys(true)) known.push_back(fmt::format("imu.{}", key));
  EXPECT_EQ(named, known);
  const std::map<std::string, Row> rows = documented();
  for (std::string key : known) {
    if (key == "imu.device.") continue;  // of the protocols
    if (key.starts_with("imu.")) key.replace(0, 4, "imu.0.");
    const auto row = rows.lower_bound(key);
    EXPECT_TRUE(row != rows.end() && (key.ends_with('.') ? row->first.starts_with(key) : row->first == key)) << key;
  }
}

}  // namespace
}  // namespace imud
