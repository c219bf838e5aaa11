#include "emulator/control/running_keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/ground/table_reader.hpp"
#include "protocols/quantities/key_units.hpp"

namespace imud {

namespace {

constexpr std::array<std::string_view, 3> reactions = {"hold", "flag", "silence"};  // WhenStopped
constexpr std::array<std::string_view, 3> levels = {"quiet", "normal", "verbose"};  // LogLevel
constexpr std::array<std::string_view, 5> types = {"number", "integer", "vector", "word", "list"};
constexpr double millisecond = 1e-3, per_hour = 1.0 / 3600.0, huge = 1e9;

const char* needs_live_truth(const Config& config, double) {
  return config.clock == ClockMode::realtime && !is_capture(config.truth.port)
             ? nullptr
             : "needs clock = \"realtime\" and live truth";
}

// The second reaction is WhenStopped::flag.
const char* needs_mark(const Config& config, double reaction) {
  const bool can = std::all_of(config.imus.begin(), config.imus.end(),
                               [](const ImuConfig& imu) { return carries_status(imu, status::not_valid); });
  return reaction != 1 || can ? nullptr : "a protocol of this run cannot mark a sample as not valid";
}

const char* needs_servos(const Config& config, double) {
  return config.truth.format->servos > 0 ? nullptr : "the truth format of this run sends no pulse widths";
}

using Kind = Command::Kind;
using Type = RunningKey::Type;
constexpr std::string_view gyro = "replaces the bias of the gyros, in platform axes",
                           accelerometer = "replaces the bias of the accelerometers, in platform axes";
constexpr RunningKey bias_of(std::string_view key, std::string_view meaning, Kind kind, double si) {
  return {key, meaning, Type::vector, kind, true, -huge, huge, si};
}

constexpr auto keys = std::to_array<RunningKey>({
    {"seed", "random numbers from the next sample on are those of this seed", Type::integer, Kind::seed},
    {"truth.delay_ms",
     "the delay of live truth, or \"auto\"; slewed",
     Type::number,
     Kind::delay,
     false,
     0,
     1000,
     millisecond,
     {},
     "auto",
     needs_live_truth},
    {"truth.extrapolate_ms", "motion is extrapolated for this long after the newest truth", Type::number,
     Kind::extrapolate, false, 0, 10'000, millisecond},
    {"truth.when_stopped",
     "the output while truth has stopped",
     Type::word,
     Kind::when_stopped,
     false,
     0,
     0,
     1,
     reactions,
     {},
     needs_mark},
    {"truth.pwm",
     "pulse widths of the first servo channels, us; the others stay, and more than 16 are sent as 32",
     Type::list,
     Kind::servo,
     false,
     0,
     65535,
     1,
     {},
     {},
     needs_servos,
     32},
    {"log.level", "what the log has", Type::word, Kind::log_level, false, 0, 0, 1, levels},
    bias_of("gyro.bias_rad_per_s", gyro, Kind::gyro_bias, 1),
    bias_of("gyro.bias_deg_per_s", gyro, Kind::gyro_bias, units::degree),
    bias_of("gyro.bias_deg_per_hr", gyro, Kind::gyro_bias, units::degree* per_hour),
    bias_of("accelerometer.bias_m_per_s2", accelerometer, Kind::accelerometer_bias, 1),
    bias_of("accelerometer.bias_mg", accelerometer, Kind::accelerometer_bias, 1e-3 * units::standard_gravity),
});

[[noreturn]] void refuse(std::string_view key, std::string_view what) {
  throw RpcError(RpcError::invalid_params, fmt::format("Invalid params: {}: {}", key, what));
}

double number_of(const RunningKey& entry, std::string_view key, const Json& value) {
  if (!value.is_number() || !(value.get<double>() >= entry.min && value.get<double>() <= entry.max))
    refuse(key, fmt::format("give {}from {} to {}{}",
                            entry.type == Type::vector ? "three numbers, or one, " : "a number ", entry.min,
                            entry.max, entry.automatic.empty() ? "" : fmt::format(", or \"{}\"", entry.automatic)));
  return value.get<double>();
}

void check(const RunningKey& entry, std::string_view key, const Config& config, double value) {
  if (entry.refusal == nullptr) return;
  if (const char* why = entry.refusal(config, value))
    throw RpcError(RpcError::refused, fmt::format("{}: {}", key, why));
}

// The percentile that load_config() assumes.
double automatic_percent(const Config& config) {
  constexpr double usual = 99;
  return config.truth.clock.automatic_percent > 0 ? config.truth.clock.automatic_percent : usual;
}

// Splits "imu.NAME.KEY", whose name may have dots. Returns the imu's number and leaves KEY.
std::uint16_t imu_of(std::string_view& rest, const Config& config) {
  if (rest.starts_with("*.")) {
    rest.remove_prefix(2);
    return Command::all_imus;
  }
  for (std::size_t i = 0; i < config.imus.size(); ++i)
    for (const std::string& name : {config.imus[i].name, fmt::to_string(i)})
      if (rest.starts_with(name + ".")) {
        rest.remove_prefix(name.size() + 1);
        return static_cast<std::uint16_t>(i);
      }
  std::vector<std::string> names;
  for (const ImuConfig& imu : config.imus) names.push_back(imu.name);
  throw RpcError(RpcError::invalid_params,
                 fmt::format("Invalid params: there is no such imu; there are {}", fmt::join(names, ", ")));
}

void add_paths(const toml::table& table, const std::string& before, std::vector<std::string>& paths) {
  for (const auto& [key, value] : table) {
    const std::string path = before + std::string(key.str());
    paths.push_back(path);
    if (const toml::table* below = value.as_table()) add_paths(*below, path + ".", paths);
  }
}

// Returns the keys of the configuration, or of its imus if `of_imu`, and all keys that can change.
std::vector<std::string> keys_of(bool of_imu, const Config& config) {
  std::vector<std::string> paths;
  for (const RunningKey& key : keys)
    if (key.of_imu == of_imu) paths.emplace_back(key.key);
  const toml::table root = toml::parse(config.resolved);
  if (!of_imu) add_paths(root, "", paths);
  if (const toml::array* imus = root["imu"].as_array(); of_imu && imus != nullptr)
    for (const toml::node& imu : *imus) add_paths(*imu.as_table(), "", paths);
  return paths;
}

bool is_configured(bool of_imu, std::string_view key, const Config& config) {
  const std::vector<std::string> all = keys_of(of_imu, config);
  return std::find(all.begin(), all.end(), key) != all.end();
}

}  // namespace

std::span<const RunningKey> running_keys() noexcept { return keys; }

void add_commands(std::vector<Command>& commands, const std::string& key, const Json& value, const Config& config) {
  std::string_view rest = key;
  Command command;
  const bool of_imu = rest.starts_with("imu.");
  if (of_imu) {
    rest.remove_prefix(std::string_view("imu.").size());
    command.imu = imu_of(rest, config);
  }
  const auto entry = std::find_if(
      keys.begin(), keys.end(), [&](const RunningKey& k) { return k.of_imu == of_imu && is_same_key(k.key, rest); });
  if (entry == keys.end()) {
    const std::string before = key.substr(0, key.size() - rest.size());
    if (!is_configured(of_imu, rest, config)) {
      const std::string meant = nearest(rest, keys_of(of_imu, config));
      refuse(key, meant.empty() ? "there is no such key; imud check CONFIG lists all"
                                : fmt::format("there is no such key; did you mean \"{}{}\"?", before, meant));
    }
    std::vector<std::string> known;
    for (const RunningKey& k : keys) known.push_back(fmt::format("{}{}", k.of_imu ? "imu.NAME." : "", k.key));
    refuse(key, fmt::format("cannot change while the run goes on; those that can: {}", fmt::join(known, ", ")));
  }
  command.kind = entry->kind;
  switch (entry->type) {
    case Type::integer:
      if (!value.is_number_unsigned()) refuse(key, "give a whole number that is not negative");
      command.number = value.get<std::uint64_t>();
      break;
    case Type::word: {
      const auto word = value.is_string()
                            ? std::find(entry->words.begin(), entry->words.end(), value.get<std::string>())
                            : entry->words.end();
      if (word == entry->words.end()) refuse(key, fmt::format("give one of {}", fmt::join(entry->words, ", ")));
      command.number = static_cast<std::uint64_t>(word - entry->words.begin());
      break;
    }
    case Type::number:
      if (!entry->automatic.empty() && value.is_string() && value.get<std::string>() == entry->automatic) {
        command.kind = Kind::automatic_delay;
        command.value = automatic_percent(config);
      } else {
        command.value = entry->si * number_of(*entry, key, value);
      }
      break;
    case Type::vector:
      if (value.is_array() && value.size() != 3) refuse(key, "give three numbers, or one for all axes");
      for (std::size_t i = 0; i < 3; ++i) {
        command.value = entry->si * number_of(*entry, key, value.is_array() ? value[i] : value);
        command.number = i;
        check(*entry, key, config, command.value);
        commands.push_back(command);
      }
      return;
    case Type::list:
      check(*entry, key, config, 0);
      if (!value.is_array() || value.empty() || value.size() > entry->most ||
          !std::all_of(value.begin(), value.end(), [&](const Json& one) {
            return one.is_number_integer() && one.get<double>() >= entry->min && one.get<double>() <= entry->max;
          }))
        refuse(key, fmt::format("give a list of 1 to {} whole numbers from {} to {}", entry->most, entry->min,
                                entry->max));
      for (std::size_t i = 0; i < value.size(); ++i) {
        command.value = value[i].get<double>();
        command.number = i;
        commands.push_back(command);
      }
      return;
  }
  check(*entry, key, config, entry->type == Type::word ? static_cast<double>(command.number) : command.value);
  commands.push_back(command);
}

Json running_keys_json() {
  Json all = Json::array();
  for (const RunningKey& key : keys) {
    Json one = {{"key", fmt::format("{}{}", key.of_imu ? "imu.NAME." : "", key.key)},
                {"meaning", key.meaning},
                {"type", types[static_cast<std::size_t>(key.type)]}};
    if (key.type == Type::number || key.type == Type::vector || key.type == Type::list) {
      one["min"] = key.min;
      one["max"] = key.max;
    }
    if (key.most > 0) one["most"] = key.most;
    if (!key.words.empty()) one["words"] = key.words;
    if (!key.automatic.empty()) one["words"] = {key.automatic};
    all.push_back(std::move(one));
  }
  return all;
}

}  // namespace imud
