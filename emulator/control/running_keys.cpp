#include "emulator/control/running_keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "core/numbers/nearest.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/keys.hpp"
#include "protocols/quantities/key_units.hpp"

namespace imud {
namespace {

constexpr auto reactions = words_by_number(when_stopped_words);
constexpr std::array<std::string_view, 3> levels = {"quiet", "normal", "verbose"};  // LogLevel
constexpr std::array<std::string_view, 5> types = {"number", "integer", "vector", "word", "list"};

const char* needs_live_truth(const Config& config, double) {
  return has_live_truth(config) ? nullptr : "needs clock = \"realtime\" and live truth";
}

const char* needs_mark(const Config& config, double reaction) {
  const bool can =
      std::ranges::all_of(config.imus, [](const ImuConfig& imu) { return carries_status(imu, status::not_valid); });
  return static_cast<WhenStopped>(reaction) != WhenStopped::flag || can
             ? nullptr
             : "a protocol of this run cannot mark a sample as not valid";
}

const char* needs_servos(const Config& config, double) {
  return config.truth.format->servos > 0 ? nullptr : "the truth format of this run sends no pulse widths";
}

using Kind = Command::Kind;
using Type = RunningKey::Type;

constexpr RunningKey number(const NumberKey& key, std::string_view meaning, Kind kind) {
  return {.key = key.path, .meaning = meaning, .kind = kind, .min = key.min, .max = key.max, .si = key.si};
}

// A key of three sensors, "gyro.bias" and its unit.
template <class Units>
constexpr RunningKey bias(std::string_view key, std::string_view meaning, Kind kind, const Units& units) {
  const double si = find_unit(units, key.substr(key.find("bias") + 4))->factor;
  return {.key = key,
          .meaning = meaning,
          .type = Type::vector,
          .kind = kind,
          .of_imu = true,
          .min = -keys::largest,
          .max = keys::largest,
          .si = si};
}
constexpr RunningKey gyro_bias(std::string_view key) {
  return bias(key, "replaces the bias of the gyros, in platform axes", Kind::gyro_bias, key_units::rate);
}
constexpr RunningKey accelerometer_bias(std::string_view key) {
  return bias(key, "replaces the bias of the accelerometers, in platform axes", Kind::accelerometer_bias,
              key_units::acceleration);
}

constexpr RunningKey delay = [] {
  RunningKey key =
      number(keys::delay,
             "the delay of live truth, or \"auto\"; it changes gradually, by at most 5 % of the time that passes",
             Kind::delay);
  key.automatic = keys::automatic;
  key.refusal = needs_live_truth;
  return key;
}();

constexpr auto entries = std::to_array<RunningKey>({
    {.key = "seed",
     .meaning = "random numbers from the next sample on are those of this seed",
     .type = Type::integer,
     .kind = Kind::seed},
    delay,
    number(keys::extrapolate, "motion is extrapolated for this long after the newest truth", Kind::extrapolate),
    {.key = "truth.when_stopped",
     .meaning = "the output while truth has stopped",
     .type = Type::word,
     .kind = Kind::when_stopped,
     .words = reactions,
     .refusal = needs_mark},
    {.key = "truth.pwm",
     .meaning = "pulse widths of the first servo channels, us; the others stay, and more than 16 are sent as 32",
     .type = Type::list,
     .kind = Kind::servo,
     .max = 65535,
     .refusal = needs_servos,
     .most = 32},
    {.key = "log.level", .meaning = "what the log has", .type = Type::word, .kind = Kind::log_level, .words = levels},
    gyro_bias("gyro.bias_rad_per_s"),
    gyro_bias("gyro.bias_deg_per_s"),
    gyro_bias("gyro.bias_deg_per_hr"),
    accelerometer_bias("accelerometer.bias_m_per_s2"),
    accelerometer_bias("accelerometer.bias_mg"),
});

[[noreturn]] void refuse(std::string_view key, std::string_view what) {
  throw wrong_params(fmt::format("{}: {}", key, what));
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

double automatic_percent(const Config& config) {
  return config.truth.clock.automatic_percent > 0 ? config.truth.clock.automatic_percent
                                                  : keys::automatic_percent.fallback;
}

// Splits "imu.NAME.KEY", whose name may have dots: of several names that fit, the longest is meant. Returns the
// number of the imu, and reduces the text to KEY.
std::uint16_t imu_of(std::string_view& rest, const Config& config) {
  if (rest.starts_with("*.")) {
    rest.remove_prefix(2);
    return Command::all_imus;
  }
  std::size_t longest = 0, imu = 0;
  for (std::size_t i = 0; i < config.imus.size(); ++i)
    for (const std::string& name : {config.imus[i].name, fmt::to_string(i)})
      if (name.size() > longest && rest.starts_with(name + ".")) {
        longest = name.size();
        imu = i;
      }
  if (longest == 0)
    throw wrong_params(fmt::format("there is no such imu; there are {}", fmt::join(names_of(config.imus), ", ")));
  rest.remove_prefix(longest + 1);
  return static_cast<std::uint16_t>(imu);
}

void add_key_paths(const toml::table& table, const std::string& before, std::vector<std::string>& key_paths) {
  for (const auto& [key, value] : table) {
    const std::string path = before + std::string(key.str());
    key_paths.push_back(path);
    if (const toml::table* below = value.as_table()) add_key_paths(*below, path + ".", key_paths);
  }
}

// Returns the keys of the configuration, or of its imus if `of_imu`, and all keys that can change.
std::vector<std::string> keys_of(bool of_imu, const Config& config) {
  std::vector<std::string> key_paths;
  for (const RunningKey& key : entries)
    if (key.of_imu == of_imu) key_paths.emplace_back(key.key);
  const toml::table root = toml::parse(config.resolved());
  if (!of_imu) add_key_paths(root, "", key_paths);
  if (const toml::array* imus = root["imu"].as_array(); of_imu && imus != nullptr)
    for (const toml::node& imu : *imus) add_key_paths(*imu.as_table(), "", key_paths);
  return key_paths;
}

bool is_configured(bool of_imu, std::string_view key, const Config& config) {
  const std::vector<std::string> all = keys_of(of_imu, config);
  return std::ranges::find(all, key) != all.end();
}

}  // namespace

std::span<const RunningKey> running_keys() noexcept { return entries; }

void add_commands(std::vector<Command>& commands, const std::string& key, const Json& value, const Config& config) {
  std::string_view rest = key;
  Command command;
  const bool of_imu = rest.starts_with("imu.");
  if (of_imu) {
    rest.remove_prefix(std::string_view("imu.").size());
    command.imu = imu_of(rest, config);
  }
  const auto entry = std::ranges::find_if(
      entries, [&](const RunningKey& k) { return k.of_imu == of_imu && is_same_key(k.key, rest); });
  if (entry == entries.end()) {
    const std::string before = key.substr(0, key.size() - rest.size());
    if (!is_configured(of_imu, rest, config)) {
      const std::string meant = nearest(rest, keys_of(of_imu, config));
      refuse(key, meant.empty() ? "there is no such key; imud check CONFIG lists all"
                                : fmt::format("there is no such key; did you mean \"{}{}\"?", before, meant));
    }
    std::vector<std::string> known;
    for (const RunningKey& k : entries) known.push_back(fmt::format("{}{}", k.of_imu ? "imu.NAME." : "", k.key));
    refuse(key, fmt::format("cannot change while the run goes on; those that can: {}", fmt::join(known, ", ")));
  }
  command.kind = entry->kind;
  switch (entry->type) {
    case Type::integer:
      if (!value.is_number_unsigned()) refuse(key, "give a whole number that is not negative");
      command.number = value.get<std::uint64_t>();
      break;
    case Type::word: {
      const auto word =
          value.is_string() ? std::ranges::find(entry->words, value.get<std::string>()) : entry->words.end();
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
          !std::ranges::all_of(value, [&](const Json& one) {
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
  for (const RunningKey& key : entries) {
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
