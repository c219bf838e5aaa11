#include "emulator/config/load_config.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "emulator/config/config_parts.hpp"
#include "emulator/config/config_text.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/scenario.hpp"
#include "emulator/frames/frame_file.hpp"
#include "emulator/plan/keys.hpp"
#include "transports/port_spec.hpp"

namespace imud {
namespace {

// Returns {key = "text"} as "key=text", the form in a list. A number is converted to its text.
std::vector<std::string> texts_of(const toml::table& table) {
  const std::invalid_argument fault("give a list of texts, or a table of texts such as {time_s = \"t\"}");
  if (table.empty()) throw fault;
  std::vector<std::string> list;
  for (const auto& [key, value] : table) {
    if (const auto* text = value.as_string())
      list.push_back(fmt::format("{}={}", key.str(), text->get()));
    else if (const auto* number = value.as_integer())
      list.push_back(fmt::format("{}={}", key.str(), number->get()));
    else
      throw fault;
  }
  return list;
}

// The index of a list in Setting::initial and in SettingValue.
constexpr std::size_t list_index = 4;
static_assert(std::is_same_v<std::variant_alternative_t<list_index, SettingValue>, std::vector<std::string>>);

}  // namespace

Settings read_settings(TableReader& table, std::span<const Setting> declared, TableReader* own,
                       const Settings* absent) {
  Settings settings = absent != nullptr ? *absent : Settings(declared);
  for (const Setting& setting : declared) {
    const toml::node* node = table.node(setting.key);
    if (own != nullptr && own->has(setting.key)) {
      if (node != nullptr) own->fault(setting.key, "is given twice, here and in the table around it");
      node = own->node(setting.key);
    }
    if (node == nullptr) continue;
    try {
      if (const auto* flag = node->as_boolean()) {
        settings.set(setting.key, flag->get());
      } else if (const auto* integer = node->as_integer()) {
        settings.set(setting.key, integer->get());
      } else if (const auto* real = node->as_floating_point()) {
        settings.set(setting.key, real->get());
      } else if (const auto* text = node->as_string()) {
        settings.set(setting.key, text->get());
      } else if (const auto* array = node->as_array()) {
        std::vector<std::string> list;
        for (const toml::node& item : *array) {
          if (const auto* number = item.as_integer())
            list.push_back(fmt::to_string(number->get()));
          else if (item.is_string())
            list.push_back(item.as_string()->get());
          else
            throw std::invalid_argument("give a list of texts in quotes, or of whole numbers");
        }
        settings.set(setting.key, std::move(list));
      } else if (const auto* map = node->as_table(); map != nullptr && setting.initial.index() == list_index) {
        settings.set(setting.key, texts_of(*map));
      } else {
        throw std::invalid_argument("give a single value");
      }
    } catch (const std::invalid_argument& error) {
      std::string_view what = error.what();
      if (what.starts_with(fmt::format("{}: ", setting.key))) what.remove_prefix(setting.key.size() + 2);
      (own != nullptr && own->has(setting.key) ? *own : table).fault(setting.key, what);
    }
    if (!names_file(setting)) continue;
    const std::string& name = settings.text(setting.key);
    if (setting.names_frames && !is_path_of_frames(name)) continue;
    if (std::string path = file_named(table, setting.key, name); path != name)
      settings.set(setting.key, std::move(path));
  }
  try {
    attach_frames(settings, declared);
  } catch (const ConfigError& error) {
    for (const std::string& fault : error.faults)
      for (const Setting& setting : declared)
        if (setting.names_frames) (own != nullptr && own->has(setting.key) ? *own : table).fault(setting.key, fault);
  }
  for (const Setting& setting : declared)
    std::visit(
        [&](const auto& value) {
          if constexpr (std::is_same_v<decltype(value), const std::vector<std::string>&>) {
            toml::array list;
            for (const std::string& item : value) list.push_back(item);
            table.resolve(setting.key, std::move(list));
          } else {
            table.resolve(setting.key, value);
          }
        },
        settings.value(setting.key));
  return settings;
}

const Transport* read_port(TableReader& table, std::string_view key, const std::string& text,
                           const PortSettings& settings) {
  if (text.empty() && !is_text(table, key)) return nullptr;
  try {
    const PortSpec spec = PortSpec::parse(text);
    const Transport* transport = entry(table, key, spec.scheme, transports(), find_transport(spec.scheme));
    if (transport != nullptr) check_port(*transport, spec, settings);
    return transport;
  } catch (const PortError& error) {
    table.fault(key, error.what());
    return nullptr;
  }
}

namespace {

std::optional<std::uint16_t> port_number(const std::string& port,
                                         std::optional<std::uint16_t> (*Transport::*number)(const PortSpec&)) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || transport->*number == nullptr) return std::nullopt;
  try {
    return (transport->*number)(PortSpec::parse(port));
  } catch (const PortError&) {
    return std::nullopt;
  }
}

}  // namespace

std::optional<std::uint16_t> udp_port(const std::string& port) { return port_number(port, &Transport::udp_port); }
std::optional<std::uint16_t> tcp_port(const std::string& port) { return port_number(port, &Transport::tcp_port); }

namespace {

// Returns the capture that replaces `port`. If it does not name a port of UDP or TCP, it is limited to the UDP or TCP
// port of `port`.
std::string in_place_of(const std::string& port, const std::string& capture) {
  const Transport* transport = transport_of(capture);
  const auto number = udp_port(port) ? udp_port(port) : tcp_port(port);
  if (transport == nullptr || transport->udp_port == nullptr || udp_port(capture) || !number) return capture;
  return fmt::format("{}{}port={}", capture, capture.find('?') == std::string::npos ? '?' : '&', *number);
}

// Returns the value in SI.
double read_number(TableReader& table, const NumberKey& key) {
  return key.si * table.real(key.key(), key.fallback, key.min, key.max);
}

TruthConfig read_truth(TableReader table, ClockMode clock, const std::string& capture) {
  TruthConfig truth;
  truth.port = table.text("port", "");
  const std::string format = table.text("format", default_truth_format);
  truth.format = entry(table, "format", format, truth_formats(), find_truth_format(format));
  if (capture == "-")
    truth.port =
        in_place_of(truth.port, standard_input_port(truth.format == nullptr || !truth.format->delimits_itself));
  else if (!capture.empty())
    truth.port = in_place_of(truth.port, capture);
  else
    require(table, "port", "where the truth comes from, for example \"udp:127.0.0.1:9810\"");
  table.resolve("port", truth.port);
  if (table.has("from")) {
    try {
      truth.port_settings.from = Endpoint::parse(table.text("from", "0.0.0.0"));
    } catch (const PortError& error) {
      table.fault("from", error.what());
    }
  }
  const Transport* transport = read_port(table, "port", truth.port, truth.port_settings);
  if (truth.port_settings.from && capture.empty() && transport != nullptr && transport->udp_port == nullptr)
    table.fault("from", fmt::format("{}: has no senders; omit it, or give truth.port {}", transport->name,
                                    ports_that([](const Transport& t) { return t.brings_truth && t.udp_port; })));
  if (transport != nullptr && !transport->brings_truth)
    table.fault("port", fmt::format("cannot carry truth; give {}",
                                    ports_that([](const Transport& t) { return t.brings_truth; })));

  if (truth.format != nullptr) {
    // The format's own table, such as [truth.csv]. Its values are resolved in [truth].
    std::optional<TableReader> own;
    if (table.has_table(truth.format->name)) own.emplace(table.child(truth.format->name));
    truth.settings = read_settings(table, truth.format->settings, own ? &*own : nullptr);
    try {
      truth.frame = truth.format->make(truth.settings)->frame();
    } catch (const std::invalid_argument& error) {
      const std::string_view what = error.what();
      const std::size_t colon = std::min(what.find(": "), what.size());
      const std::string_view key = what.substr(0, colon);
      (own && own->has(key) ? *own : table).fault(key, what.substr(std::min(colon + 2, what.size())));
    }
    if (own) own->finish();
    if (transport != nullptr && transport->brings_truth && !transport->keeps_datagrams &&
        !truth.format->delimits_itself)
      table.fault("port", fmt::format("{} truth is binary datagrams, whose borders {}: does not keep; give {}",
                                      truth.format->name, transport->name, ports_that([](const Transport& t) {
                                        return t.brings_truth && t.keeps_datagrams;
                                      })));
  }
  if (table.has("stream"))
    truth.stream = static_cast<std::uint32_t>(table.unsigned_integer("stream", 0, 0xFFFF'FFFFU));
  // If the key is absent, the delay is automatic where live truth is sampled by the host's clock.
  const bool is_default =
      !table.has("delay_ms") && clock == ClockMode::realtime && transport != nullptr && !is_capture(truth.port);
  const bool is_automatic = is_default || is_text(table, "delay_ms");
  if (is_automatic || table.has("auto_delay_percent"))
    truth.clock.automatic_percent = read_number(table, keys::automatic_percent);
  if (!is_automatic) {
    truth.clock.delay = nanoseconds(read_number(table, keys::delay));
    if (table.has("auto_delay_percent")) table.fault("auto_delay_percent", "needs delay_ms = \"auto\"");
  } else if (table.text("delay_ms", "auto") != keys::automatic) {
    table.fault("delay_ms", fmt::format("give milliseconds from {} to {}, or \"{}\"", keys::delay.min,
                                        keys::delay.max, keys::automatic));
  }
  const bool is_delayed = truth.clock.delay > Nanoseconds{0} || (is_automatic && !is_capture(truth.port));
  if (clock == ClockMode::lockstep && is_delayed)
    table.fault("delay_ms", "needs clock = \"realtime\": in lockstep a sample waits for its truth; give 0");
  truth.when_stopped = table.choice<WhenStopped>("when_stopped", when_stopped_words, WhenStopped::hold);
  truth.limits.extrapolate = nanoseconds(read_number(table, keys::extrapolate));
  const auto max_gap_ms = static_cast<double>(truth.limits.max_gap.count()) / 1e6;
  truth.limits.max_gap = nanoseconds(1e-3 * table.real("max_gap_ms", max_gap_ms, 1.0, 3.6e6));
  truth.limits.gap_begins_run = is_capture(truth.port);
  read_fit(table, clock, truth);
  read_bounds(table, truth.bounds);
  table.finish();
  return truth;
}

RealtimeConfig read_realtime(TableReader table) {
  RealtimeConfig realtime;
  realtime.priority =
      static_cast<int>(table.unsigned_integer("priority", static_cast<unsigned>(realtime.priority), 99));
  if (table.has("cpu")) {
    const unsigned cpus = std::max(1U, std::thread::hardware_concurrency());
    realtime.cpu = static_cast<unsigned>(table.unsigned_integer("cpu", 0, cpus - 1));
  }
  realtime.lock_memory = table.flag("lock_memory", realtime.lock_memory);
  realtime.spin = nanoseconds(1e-6 * table.real("spin_us", 0.0, 0.0, 1000.0));
  realtime.skip_after = nanoseconds(1e-3 * table.real("skip_after_ms", 1000.0, 1.0, 3'600'000.0));
  realtime.epoch = table.choice<Epoch>("epoch", epoch_words, realtime.epoch);
  realtime.allow_unsynchronised = table.flag("allow_unsynchronised", realtime.allow_unsynchronised);
  table.finish();
  return realtime;
}

// `is_sparing`: a run without a client has no stage for faults, because the stage takes memory and, in "fast",
// time.
ControlConfig read_control(TableReader table, bool has_page, bool is_sparing) {
  ControlConfig control;
  control.name = table.text("name", control.name);
  constexpr std::size_t longest = 40;
  const bool is_name = std::all_of(control.name.begin(), control.name.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
  });
  if (!is_name || control.name.size() > longest)
    table.fault("name", fmt::format("give at most {} letters, digits, - and _", longest));
  control.socket = table.text("socket", control.socket);
  if (control.socket.empty()) table.fault("socket", "give a path, \"auto\" or \"none\"");
  control.listen = table.text("listen", control.listen);
  control.token_file = file_named(table, "token_file", table.text("token_file", control.token_file));
  if (!control.listen.empty()) {
    if (const auto address = NumericAddress::try_parse(control.listen); !address || !address->is_loopback())
      table.fault("listen", "give a loopback address and a port, such as \"127.0.0.1:7700\" or \"[::1]:7700\"");
    if (control.token_file.empty()) table.fault("token_file", "missing: the file whose first line clients must know");
  } else if (!control.token_file.empty()) {
    table.fault("token_file", "needs listen");
  }
  const bool has_clients = control.socket != "none" || !control.listen.empty();
  control.faults = table.flag("faults", has_page || (has_clients && !is_sparing));
  table.finish();
  return control;
}

// `path`: the path of the file; - if there is no file.
Config read_config(ConfigText text, const std::string& path, const std::string& capture,
                   std::span<const std::string> scenarios, Faults faults) {
  const toml::table& root = text.root;
  toml::table resolved;
  TableReader table(&root, "", 0, faults, resolved);
  Config config;
  config.sha256 = std::move(text.sha256);
  config.seed = table.unsigned_integer("seed", config.seed, ~std::uint64_t{0});
  config.clock = table.choice<ClockMode>("clock", clock_words, ClockMode::realtime);
  config.truth = read_truth(table.child("truth"), config.clock, capture);
  config.realtime = read_realtime(table.child("realtime"));
  config.web = read_web(table.child("web"));
  // A record may have faults that a client has begun.
  const Transport* of_truth = transport_of(config.truth.port);
  const bool is_record = of_truth != nullptr && of_truth->is_record != nullptr;
  const bool is_sparing = config.clock == ClockMode::fast && !is_record;
  config.control = read_control(table.child("control"), !config.web.listen.empty(), is_sparing);
  if (config.clock == ClockMode::fast && !config.truth.port.empty() && !is_capture(config.truth.port))
    table.fault("clock", fmt::format("\"fast\" reads a capture; give truth.port {}, or \"lockstep\"",
                                     ports_that([](const Transport& t) { return t.brings_truth && t.ends; })));

  config.truth.earth = read_earth(table.child("earth"), config.truth);

  const toml::node* imus = table.node("imu");
  const toml::array* array = imus == nullptr ? nullptr : imus->as_array();
  toml::array resolved_imus;
  if (array == nullptr || array->empty() || !array->is_array_of_tables()) {
    table.fault("imu", "missing; give at least one [[imu]]");
  } else {
    for (std::size_t i = 0; i < array->size(); ++i) {
      const toml::table& imu = *(*array)[i].as_table();
      toml::table& resolved_imu = resolved_imus.emplace_back<toml::table>();
      TableReader reader(&imu, fmt::format("imu.{}.", i), imu.source().begin.line, faults, resolved_imu);
      ImuConfig& read = config.imus.emplace_back(read_imu(reader, i, config.truth));
      read.model.earth = config.truth.earth;
      if (config.truth.earth.frame == EarthModel::Frame::automatic && !carries_place(read) && !read.navigator.is_on)
        read.model.earth.frame = EarthModel::Frame::none;  // no output depends on the frame, and it takes time
      read.model.r_SB_B -= config.truth.r_RB_B;            // core's B has its origin at R
      const auto set_delivery = [&](PortSettings& port) {
        if (config.clock != ClockMode::realtime) port.delivery = Delivery::complete;
        port.yields = config.clock == ClockMode::fast;
        port.replaces_file = !capture.empty();
      };
      set_delivery(read.port_settings);
      set_delivery(read.second_port_settings);
      std::ranges::for_each(read.also_settings, set_delivery);
      if (!has_live_truth(config)) {
        read.before_first = BeforeFirst::silence;  // sample 0 is at the first truth
        reader.resolve("before_first", "silence");
      }
      if (read.port_settings.paced && config.clock != ClockMode::realtime)
        faults.add(imu.source().begin.line, fmt::format("imu.{}.pace", i),
                   "\"line\" needs clock = \"realtime\": in the other clocks, and with --fast, no time passes; give "
                   "\"none\"");
      if (config.truth.when_stopped == WhenStopped::flag && read.protocol != nullptr &&
          !carries_status(read, status::not_valid))
        faults.add(
            imu.source().begin.line, fmt::format("imu.{}.protocol", i),
            fmt::format("{} cannot mark a sample as not valid, which truth.when_stopped = \"flag\" requires; give "
                        "\"hold\" or \"silence\"",
                        read.protocol->name));
    }
    if (config.clock == ClockMode::fast) set_collecting(config.imus);
    set_bounds(config.imus, config.truth.bounds);
    check_imus_together(config.imus, config.truth.port, *array, faults);
  }
  std::vector<std::string> of_scenarios;
  read_scenarios(table, scenarios, faults, config, of_scenarios);
  if (!config.imus.empty()) check_files(config, path, *array, faults);
  table.finish();
  std::vector<std::string> all_faults = faults.by_line();
  all_faults.insert(all_faults.end(), of_scenarios.begin(), of_scenarios.end());
  if (!all_faults.empty()) throw ConfigError(all_faults);
  config.truth.is_place_needed = std::ranges::any_of(config.imus, needs_place);
  config.warnings = faults.warnings();
  table.resolve("imu", std::move(resolved_imus));
  config.resolved = [table = std::make_shared<const toml::table>(std::move(resolved))] { return toml_text(*table); };
  return config;
}

}  // namespace

Config load_config(const std::string& path, std::span<const std::string> overrides, const std::string& capture,
                   std::span<const std::string> scenarios) {
  Faults faults(path);
  ConfigText text = read_config_text(path, overrides, faults);
  return read_config(std::move(text), path, capture, scenarios, std::move(faults));
}

Config config_of_text(const std::string& text) {
  Faults faults("");
  toml::table root;
  try {
    root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    faults.add(error.source().begin.line, "TOML", error.description());
    throw ConfigError(faults.all());
  }
  return read_config({std::move(root), sha256(text)}, "-", {}, {}, std::move(faults));
}

ImuModel model_named(const std::string& model, double rate_hz) {
  const toml::table keys{
      {"protocol", "native"}, {"port", standard_input_port(false)}, {"rate_hz", rate_hz}, {"model", model}};
  Faults faults("");
  toml::table resolved;
  TableReader table(&keys, "imu.0.", 0, faults, resolved);
  ImuModel errors = read_imu(table, 0, TruthConfig()).model;
  if (!faults.all().empty()) throw ConfigError(faults.all());
  return errors;
}

}  // namespace imud
