#include "emulator/imu/reload.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "emulator/faults/other_units.hpp"
#include "emulator/ground/table_comparison.hpp"
#include "emulator/imu/channel.hpp"

namespace imud {

namespace {

constexpr std::string_view truth_keys[] = {"truth.auto_delay_percent", "truth.delay_ms", "truth.extrapolate_ms",
                                           "truth.when_stopped"};
// The keys of an imu that a reload can change. A dot at the end stands for all keys of a table.
constexpr std::string_view imu_keys[] = {"port",
                                         "second_port",
                                         "pace",
                                         "model",
                                         "device.",
                                         "rate_hz",
                                         "clock_error_ppm",
                                         "internal_rate_hz",
                                         "sampling_jitter_us",
                                         "stamp_offset_us",
                                         "stamp_jitter_us",
                                         "clock.",
                                         "temperature_c",
                                         "mounting.",
                                         "gyro.",
                                         "accelerometer.",
                                         "magnetometer.",
                                         "inclinometer.",
                                         "barometer.",
                                         "navigation.",
                                         "temperature.",
                                         "vibration.",
                                         "cause"};

constexpr std::string_view port_keys[] = {"port", "second_port", "pace"};

bool is_in(std::span<const std::string_view> keys, std::string_view key) noexcept {
  return std::ranges::any_of(
      keys, [&](std::string_view one) { return one.ends_with('.') ? key.starts_with(one) : key == one; });
}

std::string in_one_line(std::string value) {
  std::ranges::replace(value, '\n', ' ');
  return value;
}

const ImuConfig* find_imu(const Config& config, const std::string& name) {
  const auto found = std::ranges::find(config.imus, name, &ImuConfig::name);
  return found == config.imus.end() ? nullptr : &*found;
}

// Returns the identifiers that the imu uses on a CAN bus, as text.
std::string identifiers_of(const ImuConfig& imu) {
  std::string text;
  for (const CanFilter& f : imu.protocol->can_filters(imu.settings))
    text += fmt::format("{:x}/{:x}/{}{}{}{} ", f.id, f.mask, f.extended, f.data, f.remote, f.inverted);
  for (const CanMessage& message : imu.protocol->can_messages(imu.settings, imu.rate_hz))
    text += fmt::format("{:x}/{} ", message.can.id, message.can.extended);
  return text;
}

// Returns why the device's settings cannot change to the settings of `after`; nullptr if they can.
const char* refusal_of_settings(const Config& config, const ImuConfig& before, const ImuConfig& after) {
  if (before.protocol != after.protocol) return "cannot change while the run goes on";
  if (before.protocol->link == Link::can && identifiers_of(before) != identifiers_of(after))
    return "the identifiers on a CAN bus cannot change while the run goes on";
  const bool has_others = std::ranges::any_of(
      config.faults, [&](const FaultConfig& fault) { return fault.settings_of(before.name) != nullptr; });
  return has_others ? "cannot change in a run in which a fault gives this imu other settings" : nullptr;
}

// Returns why the key of a port cannot change; nullptr if it can.
const char* refusal_of_port(std::string_view key, const ImuConfig& before, const ImuConfig& after) {
  if (key == "second_port" && (before.second_port.empty() || after.second_port.empty()))
    return "a second UART can be neither connected nor disconnected while the run goes on";
  const bool stays =
      before.port == after.port || (!before.second_port.empty() && before.second_port == after.second_port);
  return key == "pace" && stays ? "can change only together with the port" : nullptr;
}

// Returns why a key of the imu cannot change; nullptr if it can.
const char* refusal_of(std::string_view key, const Config& config, const ImuConfig& before, const ImuConfig& after) {
  if (!is_in(imu_keys, key)) return "cannot change while the run goes on";
  if (is_in(port_keys, key)) return refusal_of_port(key, before, after);
  if (key.starts_with("inclinometer.") && before.protocol->takes_inclinometers &&
      before.model.inclinometer.has_value() != after.model.inclinometer.has_value())
    return "the columns cannot change while the run goes on: a reload neither adds nor removes [imu.inclinometer]";
  return key.starts_with("device.") ? refusal_of_settings(config, before, after) : nullptr;
}

bool is_of(const KeyChange& change, const std::string& imu, std::string_view key) {
  return change.key.starts_with("imu." + imu + "." + std::string(key));
}

// Returns the change of a port, or of the second UART's port. Its texts are equal if nothing changes.
Reload::Line line_of(const ImuConfig& before, const ImuConfig& after, bool second) {
  Reload::Line line;
  line.uart = second ? 1 : 0;
  line.key = fmt::format("imu.{}.{}", after.name, second ? "second_port" : "port");
  line.before = second ? before.second_port : before.port;
  line.after = second ? after.second_port : after.port;
  line.settings = second ? after.second_port_settings : after.port_settings;
  const Transport* transport = transport_of(line.after);
  if (transport != nullptr && transport->wire_time != nullptr)
    line.bit_rate = transport->wire_time(PortSpec::parse(line.after), line.settings, {}).bit_rate;
  return line;
}

}  // namespace

std::span<const std::string_view> reloadable_keys(bool of_imu) noexcept {
  return of_imu ? std::span<const std::string_view>(imu_keys) : truth_keys;
}

std::vector<KeyChange> key_changes(const Config& before, const Config& after) {
  constexpr const char* fixed = "cannot change while the run goes on";
  const toml::table ours = toml::parse(before.resolved()), theirs = toml::parse(after.resolved());
  std::vector<KeyChange> all;
  compare(&ours, &theirs, "", true, [&](const std::string& key, const std::string& one, const std::string& other) {
    if (key == "imu") return;
    const bool is_delay = key == "truth.delay_ms" || key == "truth.auto_delay_percent";
    const char* refusal = !is_in(truth_keys, key)               ? fixed
                          : is_delay && !has_live_truth(before) ? "needs clock = \"realtime\" and live truth"
                                                                : nullptr;
    all.push_back({key, in_one_line(one), in_one_line(other), refusal});
  });
  const std::string names = fmt::format("{}", fmt::join(names_of(before.imus), ", "));
  if (const std::string others = fmt::format("{}", fmt::join(names_of(after.imus), ", ")); names != others)
    all.push_back({"imu", names, others, "the imus and their order cannot change while the run goes on"});
  for (const ImuConfig& imu : before.imus) {
    const toml::table *one = imu_table(ours, imu.name), *other = imu_table(theirs, imu.name);
    if (one == nullptr || other == nullptr) continue;
    const std::string prefix = "imu." + imu.name + ".";
    compare(one, other, prefix, true, [&](const std::string& key, const std::string& was, const std::string& is) {
      const std::string_view own = std::string_view(key).substr(prefix.size());
      all.push_back(
          {key, in_one_line(was), in_one_line(is), refusal_of(own, before, imu, *find_imu(after, imu.name))});
    });
  }
  return all;
}

Reload::Reload(const Config& before, const Config& after, std::span<const ImuConfig> imus, std::uint64_t seed)
    : text(after.resolved()) {
  const std::vector<KeyChange> changes = key_changes(before, after);
  const auto has = [&](std::string_view key) { return std::ranges::count(changes, key, &KeyChange::key) > 0; };
  const auto changes_sensor = [&](const std::string& imu) {
    const std::string prefix = "imu." + imu + ".";
    return std::ranges::any_of(changes, [&](const KeyChange& c) {
      return c.refusal == nullptr && c.key.starts_with(prefix) &&
             !is_in(port_keys, std::string_view(c.key).substr(prefix.size()));
    });
  };
  const TruthConfig& truth = after.truth;
  if (has("truth.delay_ms") || has("truth.auto_delay_percent")) {
    const bool is_automatic = truth.clock.automatic_percent > 0;
    commands.push_back({.kind = is_automatic ? Command::Kind::automatic_delay : Command::Kind::delay,
                        .value = is_automatic ? truth.clock.automatic_percent : seconds(truth.clock.delay)});
  }
  if (has("truth.extrapolate_ms"))
    commands.push_back({.kind = Command::Kind::extrapolate, .value = seconds(truth.limits.extrapolate)});
  if (has("truth.when_stopped"))
    commands.push_back(
        {.kind = Command::Kind::when_stopped, .number = static_cast<std::uint64_t>(truth.when_stopped)});

  for (std::size_t i = 0; i < imus.size(); ++i) {
    const ImuConfig* imu = find_imu(after, imus[i].name);
    if (imu == nullptr) continue;
    const auto changes_key = [&](std::string_view key) {
      return std::ranges::any_of(
          changes, [&](const KeyChange& c) { return c.refusal == nullptr && is_of(c, imu->name, key); });
    };
    const ImuConfig* old = find_imu(before, imu->name);
    for (const bool second : {false, true}) {
      if (old == nullptr) break;
      Line line = line_of(*old, *imu, second);
      if (line.before == line.after || line.before.empty() || line.after.empty()) continue;
      line.channel = i;
      lines.push_back(std::move(line));
    }
    if (!changes_sensor(imu->name)) continue;
    const bool is_ideal = imus[i].errors_model == model_of_truth;
    const ImuModel model = is_ideal ? without_errors(*imu).model : imu->model;
    const bool filters = !is_ideal && imus[i].device_filters, filters_itself = !is_ideal && imu->navigator.is_on;
    sensors.push_back(
        {.channel = i,
         .model = model,
         .imu = Imu(model, imus[i].seed.value_or(seed), stream_id(imus[i].name)),
         .oscillator = Oscillator(model.oscillator, model.temperature, model.temperature_c, imu->grid),
         .solution = filters_itself ? std::optional<OwnSolution>(std::in_place, imu->navigator, model) : std::nullopt,
         .judge = filters_itself ? std::optional<SolutionJudge>(model) : std::nullopt,
         .grid = changes_key("rate_hz") || changes_key("clock_error_ppm") ? std::optional(imu->grid) : std::nullopt,
         .device = nullptr,
         .delivered_device = nullptr,
         .seals = {},
         .keeps_gyro_bias = !changes_key("gyro.bias"),
         .keeps_accelerometer_bias = !changes_key("accelerometer.bias")});
    if (changes_key("device.") && !is_ideal && imus[i].protocol == imu->protocol) {
      const auto make = [&](const Settings& settings) {
        std::unique_ptr<Device> device = imu->protocol->make(settings);
        if (!imus[i].second_port.empty()) device->connect_second_uart();
        return device;
      };
      sensors.back().device = make(imu->settings);
      sensors.back().delivered_device = make(settings_as_delivered(*imu));
      for (auto& seal : sensors.back().seals) seal = make_seal(*imu->protocol, imu->settings);
    }
    if (filters) sensors.back().imu.reserve_filters(Device::longest_boxcar);
  }
}

std::vector<std::string> Reload::open_ports(
    std::span<const std::unique_ptr<Channel>> channels,
    const std::function<std::unique_ptr<Port>(std::string_view, const PortSettings&)>& open) {
  std::vector<std::string> refusals;
  const auto is_file = [](const Line& line) { return transport_of(line.after)->is_standard_output != nullptr; };
  // Files are last, because a file is emptied when it is opened.
  for (const bool files : {false, true})
    for (Line& line : lines) {
      if (is_file(line) != files || (files && !refusals.empty())) continue;
      const Channel& channel = *channels[line.channel];
      try {
        line.port = open(line.after, line.settings);
        if (channel.is_can) line.port->set_filters(channel.lines.can_filters());
      } catch (const PortError& error) {
        refusals.push_back(fmt::format("{}: {}", line.key, error.what()));
      }
    }
  if (!refusals.empty())
    for (Line& line : lines) line.port.reset();
  return refusals;
}

}  // namespace imud
