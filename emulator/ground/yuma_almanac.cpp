#include "emulator/ground/yuma_almanac.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bitset>
#include <cctype>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "core/gps_time.hpp"
#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

struct Key {
  std::string_view begin;
  double min, max;
};
enum Number : std::size_t {
  id,
  health,
  eccentricity,
  time,
  inclination,
  rate,
  root,
  node,
  perigee,
  anomaly,
  af0,
  af1,
  week
};
constexpr double most = 1e3;
constexpr Key keys[] = {
    {"id", 1, 63},   {"health", 0, 511},  {"eccentricity", 0, 0.1}, {"time", 0, 604'799},      {"orbital", 0, 3.2},
    {"rate", -1, 1}, {"sqrt", 2000, 1e4}, {"right", -most, most},   {"argument", -most, most}, {"mean", -most, most},
    {"af0", -1, 1},  {"af1", -1, 1},      {"week", 0, 1e4}};
constexpr std::size_t key_count = std::size(keys);
constexpr std::int64_t rollover = 1024;  // weeks

std::string_view trimmed(std::string_view text) {
  const auto is_space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

bool begins(std::string_view text, std::string_view lower_case) {
  return text.size() >= lower_case.size() && std::ranges::equal(text.substr(0, lower_case.size()), lower_case, {},
                                                                [](unsigned char c) { return std::tolower(c); });
}

double almanac_value(const Key& key, std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto value = number_in<double>(text);
  if (!value || !(*value >= key.min && *value <= key.max))
    throw std::runtime_error(fmt::format("give a number from {} to {}", key.min, key.max));
  return *value;
}

AlmanacOrbit orbit_of(const std::array<double, key_count>& values, std::int64_t near_gps_ns) {
  auto weeks = static_cast<std::int64_t>(values[week]);
  if (weeks < rollover)
    weeks += rollover * std::max<std::int64_t>(0, (near_gps_ns / gps_week_ns - weeks + rollover / 2) / rollover);
  return {.prn = static_cast<int>(values[id]),
          .reference_ns = weeks * gps_week_ns + std::llround(1e9 * values[time]),
          .eccentricity = values[eccentricity],
          .inclination = values[inclination],
          .node_rate = values[rate],
          .root_axis = values[root],
          .node = values[node],
          .perigee = values[perigee],
          .mean_anomaly = values[anomaly]};
}

}  // namespace

std::vector<AlmanacOrbit> yuma_almanac(const std::string& text, std::int64_t near_gps_ns) {
  std::vector<AlmanacOrbit> orbits;
  std::array<double, key_count> values = {};
  std::bitset<key_count> read;
  std::bitset<64> satellites;
  std::istringstream lines(text);
  int number = 0;
  const auto fault = [&](std::string_view what) {
    return std::runtime_error(fmt::format("line {}: {}", number, what));
  };
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const std::size_t colon = line.find(':');
    if (colon == line.npos) continue;
    const std::string_view name = trimmed(std::string_view(line).substr(0, colon));
    const auto key = std::ranges::find_if(keys, [&](const Key& one) { return begins(name, one.begin); });
    if (key == std::end(keys)) continue;
    const auto index = static_cast<std::size_t>(key - std::begin(keys));
    if (index == id ? read.any() : read[index] || !read[id])
      throw fault(fmt::format("\"{}\" is not where the 13 lines of a satellite have it", name));
    try {
      values[index] = almanac_value(*key, trimmed(std::string_view(line).substr(colon + 1)));
    } catch (const std::runtime_error& error) {
      throw fault(fmt::format("\"{}\": {}", name, error.what()));
    }
    read.set(index);
    if (!read.all()) continue;
    const AlmanacOrbit orbit = orbit_of(values, near_gps_ns);
    const auto prn = static_cast<std::size_t>(orbit.prn);
    if (satellites[prn]) throw fault(fmt::format("the satellite {} is there twice", prn));
    satellites.set(prn);
    if (values[health] == 0) orbits.push_back(orbit);
    read.reset();
  }
  if (read.any()) throw fault("the last satellite lacks lines");
  if (satellites.none())
    throw fault("there is no satellite; give an almanac in the YUMA format, or a navigation file in RINEX 2 or 3");
  if (orbits.empty()) throw fault("no satellite is healthy; give another almanac");
  return orbits;
}

}  // namespace imud
