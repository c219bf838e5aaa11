// tests/benchmark/every_error.toml, by which the cost of all errors is measured, against the keys of the code: it has
// every error that there is.
#include <gtest/gtest.h>
#include <toml++/toml.h>

#include <set>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"

namespace imud {
namespace {

const std::string file = IMUD_TEST_DATA "/benchmark/every_error.toml";

// Returns the faults of the file with an assignment to its imu, as one text.
std::string faults(const std::string& assignment) {
  try {
    load_config(file, std::vector{"imu.0." + assignment});
  } catch (const ConfigError& error) {
    return error.what();
  }
  return {};
}

// Returns the keys of a table of the imu ("gyro."; empty: of the imu itself) that the code knows.
std::vector<std::string> known_keys(const std::string& table) {
  const std::string text = faults(table + "?=1"), intro = "?: unknown key; known here: ";
  const std::size_t begin = text.find(intro);
  EXPECT_NE(begin, text.npos) << text;
  std::vector<std::string> keys;
  std::string list = text.substr(begin + intro.size(), text.find('\n', begin) - begin - intro.size());
  for (list += ", "; !list.empty(); list.erase(0, list.find(", ") + 2))
    keys.push_back(list.substr(0, list.find(", ")));
  return keys;
}

// Another unit of a term that is given, another filter, or the other one of two keys.
bool is_another_of_one_that_is_given(const std::string& key) {
  for (const char* value : {"1", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "2"}) {
    const std::string text = faults(key + "=" + value);
    for (const char* part : {", not both", "there is another filter", "cic_length is that of a CIC"})
      if (text.find(part) != text.npos) return true;
  }
  return false;
}

bool is_off(const toml::node& value) {
  if (const toml::array* list = value.as_array()) return list->empty();
  return value.value<double>() == 0.0 || value.value<bool>() == false;
}

TEST(EveryError, TheFileHasEachKeyOfTheErrors) {
  const toml::table parsed = toml::parse_file(file);
  // The range, how a density is stated, and a model whose errors the keys would change.
  const std::set<std::string> no_errors = {"max", "min", "model", "noise_density_sidedness"};
  std::size_t given = 0, others = 0;
  const auto check = [&](const std::string& table, const std::set<std::string>& left_out) {
    const toml::table* own = parsed.at_path("imu[0]" + (table.empty() ? "" : "." + table)).as_table();
    ASSERT_NE(own, nullptr) << table;
    const std::string prefix = table.empty() ? "" : table + ".";
    for (const std::string& key : known_keys(prefix)) {
      if (left_out.contains(key) || left_out.contains(key.substr(0, key.find('_')))) continue;
      if (const toml::node* value = own->get(key)) {
        EXPECT_FALSE(is_off(*value)) << prefix << key;
        ++given;
      } else {
        EXPECT_TRUE(is_another_of_one_that_is_given(prefix + key)) << prefix << key << " is missing";
        ++others;
      }
    }
  };
  // The sensor's rates, its protocol and its ports.
  check("", {"also", "before", "device", "internal", "name", "pace", "phase_us", "port", "protocol", "rate_hz",
             "second", "sync", "temperature_c", "model", "increments"});
  for (const std::string triad : {"gyro", "accelerometer", "magnetometer"})
    for (const std::string table : {"", ".unit_sigma", ".turn_on_sigma"}) check(triad + table, no_errors);
  for (const std::string table : {"temperature", "vibration", "mounting", "barometer", "clock"})
    check(table, {"model"});
  // The keys of the unit's own filter give no errors.
  check("navigation", {"solution", "alignment", "alignment_s", "gnss", "magnetic", "antennas", "barometer",
                       "barometric", "zero", "quiet", "accept"});
  EXPECT_GT(given, 250U);
  EXPECT_GT(others, 150U);
}

}  // namespace
}  // namespace imud
