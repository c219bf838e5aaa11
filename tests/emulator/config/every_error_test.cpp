// tests/benchmark/every_error.toml, by which the cost of all errors is measured, against the keys of the code: it has
// every error that there is.
#include <gtest/gtest.h>
#include <toml++/toml.h>

#include <array>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
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
  // The sensor's rates, its protocol and its ports; and a table that this protocol cannot have.
  check("", {"inclinometer", "also", "before", "device", "internal", "name", "pace", "phase_us", "port", "protocol",
             "rate_hz", "second", "sync", "temperature_c", "model", "increments"});
  for (const std::string triad : {"gyro", "accelerometer", "magnetometer"})
    for (const std::string table : {"", ".unit_sigma", ".turn_on_sigma"}) check(triad + table, no_errors);
  for (const std::string table : {"temperature", "vibration", "mounting", "barometer", "clock"})
    check(table, {"model"});
  // The keys of the unit's own filter give no errors.
  check("navigation", {"solution", "alignment", "alignment_s", "gnss", "magnetic", "antennas", "barometer",
                       "barometric", "zero", "quiet", "accept", "estimate"});
  EXPECT_GT(given, 250U);
  EXPECT_GT(others, 150U);
}

// Returns the members. If a member is added, this does not compile until the member is named here.
auto terms_of(const TriadErrors& errors) {
  const auto& [misalignment, dead_zone, scale_factor, scale_factor_asymmetry, quadratic, cubic,
               reference_temperature_c, temperature_scale, temperature_bias, temperature_rate_bias,
               temperature_hysteresis, temperature_hysteresis_c, bias, walk_transition, walk_sqrt_cov, walk_bound,
               turn_on_bias, ramp, g_sensitivity, g_squared_sensitivity, cross_sensitivity, vibration_rectification,
               vibration_average, vibration_mean_square, white_density, bias_instability, flicker_from_s,
               flicker_to_s, correlated_sigma, correlation_time, popcorn_noise, popcorn_time, random_walk_density,
               quantization_noise, fir_taps, filter, lsb, rounding, carry, max, limits, increment_lsb, unit_sigma,
               turn_on_sigma] = errors;
  // Not vibration_mean_square, which Imu sets.
  return std::tie(misalignment, dead_zone, scale_factor, scale_factor_asymmetry, quadratic, cubic,
                  reference_temperature_c, temperature_scale, temperature_bias, temperature_rate_bias,
                  temperature_hysteresis, temperature_hysteresis_c, bias, walk_transition, walk_sqrt_cov, walk_bound,
                  turn_on_bias, ramp, g_sensitivity, g_squared_sensitivity, cross_sensitivity,
                  vibration_rectification, vibration_average, white_density, bias_instability, flicker_from_s,
                  flicker_to_s, correlated_sigma, correlation_time, popcorn_noise, popcorn_time, random_walk_density,
                  quantization_noise, fir_taps, filter, lsb, rounding, carry, max, limits, increment_lsb, unit_sigma,
                  turn_on_sigma);
}

template <class Term>
bool is_changed(const Term& term, const Term& initial) {
  return term != initial;
}
bool is_changed(const std::optional<AxisLimits>& term, const std::optional<AxisLimits>&) { return term.has_value(); }
bool is_changed(const ConstantErrors& term, const ConstantErrors&) { return term.is_on(); }

// A term that no key sets stays as it is in sensors without errors.
TEST(EveryError, TheFileChangesEachTermOfASensor) {
  const ImuModel model =
      load_config(file, std::vector<std::string>{"clock=lockstep", "imu.0.gyro.min_deg_per_s=-300"}).imus.at(0).model;
  const TriadErrors initial;
  constexpr std::size_t count = std::tuple_size_v<decltype(terms_of(initial))>;
  std::array<bool, count> changed{};
  for (const TriadErrors* errors : {&model.gyro, &model.accelerometer, &model.magnetometer})
    [&]<std::size_t... i>(std::index_sequence<i...>) {
      ((changed[i] = changed[i] || is_changed(std::get<i>(terms_of(*errors)), std::get<i>(terms_of(initial)))), ...);
    }
  (std::make_index_sequence<count>());
  for (std::size_t i = 0; i < count; ++i)
    EXPECT_TRUE(changed[i]) << "term " << i << " of terms_of(): give it a key in emulator/config/triad_config.cpp";
}

}  // namespace
}  // namespace imud
