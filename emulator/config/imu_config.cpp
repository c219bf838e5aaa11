#include <algorithm>
#include <cmath>
#include <optional>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/presets.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/plan/inclinometers.hpp"

namespace imud {
namespace {

void read_mounting(TableReader table, ImuModel& model) {
  model.r_SB_B = table.vector3("position_m", model.r_SB_B);
  model.accelerometer_positions = table.matrix3("accelerometer_positions_m", model.accelerometer_positions, false);
  if (table.has("dcm_PB") && table.has("yaw_pitch_roll_deg"))
    table.fault("dcm_PB", "give either this or yaw_pitch_roll_deg, not both");
  if (table.has("dcm_PB")) {
    model.dcm_PB = table.matrix3("dcm_PB", model.dcm_PB, false);
    constexpr double tolerance = 1e-6;
    if (const double defect = rotation_defect(model.dcm_PB); defect > tolerance)
      table.fault("dcm_PB",
                  fmt::format("not a rotation: its rows are not orthonormal and right-handed within {} (off by "
                              "{:.2g}); write the numbers with more digits, or give yaw_pitch_roll_deg",
                              tolerance, defect));
  } else {
    const Vector3 ypr = units::degree * table.vector3("yaw_pitch_roll_deg", Vector3::Zero());
    if (ypr.cwiseAbs().maxCoeff() > 1e4)
      table.fault("yaw_pitch_roll_deg", "give angles from -572957 to 572957");
    else if (!ypr.isZero(0.0))
      model.dcm_PB = dcm_from_yaw_pitch_roll(ypr[0], ypr[1], ypr[2]);
  }
  constexpr double mrad = 1e-3;
  if (table.has("alignment_sigma_mrad"))
    model.alignment_sigma = mrad * table.per_axis("alignment_sigma_mrad", Vector3::Zero(), 0, 100);
  table.finish();
}

// Returns true if the port's text can be parsed and has the option.
bool has_option(const std::string& port, std::string_view key) {
  try {
    return PortSpec::parse(port).text(key).has_value();
  } catch (const PortError&) {
    return false;
  }
}

// Applies pace = "line" to a valid port. Requires that settings.uart is set.
void pace_line(TableReader& table, const Transport& transport, const std::string& port, PortSettings& settings) {
  if (transport.uart == Uart::real) return;
  if (transport.uart == Uart::none) {
    std::vector<std::string_view> emulated;
    for (const Transport* other : transports())
      if (other->uart == Uart::emulated) emulated.push_back(other->name);
    table.fault("pace", fmt::format("\"line\" is for a {}; {}: has no characters to pace, give \"none\"",
                                    fmt::join(emulated, " or "), transport.name));
  } else if (settings.uart.baud == 0 && !has_option(port, "baud")) {
    table.fault("pace", fmt::format("\"line\" needs the line's speed; give it in port, for example "
                                    "\"{}{}baud=115200\"",
                                    port, port.find('?') == std::string::npos ? '?' : '&'));
  } else {
    settings.paced = true;
  }
}

// Checks the port of the device that `key` names, and applies `pace`. Requires that settings.uart is set. Returns
// nullptr and adds a fault if the port is not valid.
const Transport* check_device_port(TableReader& table, std::string_view key, const std::string& port,
                                   PortSettings& settings) {
  const bool paced = table.choice<bool>("pace", {{false, "none"}, {true, "line"}}, false);
  if (has_option(port, "pace")) {
    table.fault(key, "pace is a key of [[imu]]; give it there");
    return nullptr;
  }
  const Transport* transport = read_port(table, key, port, settings);
  if (transport == nullptr) return nullptr;
  if (transport->uart != Uart::none && settings.uart.baud != 0)
    for (const char* option : {"baud", "parity", "stop", "bits"})
      if (has_option(port, option))
        table.fault(key,
                    fmt::format("{} is set by the device; omit it here, and set the line in [imu.device]", option));
  if (paced) pace_line(table, *transport, port, settings);
  return transport;
}

// Reads `second_port`. Requires that imu.second_port_settings.uart is set. Returns nullptr if there is no second
// port, or if the port is not valid.
const Transport* read_second_port(TableReader& table, ImuConfig& imu) {
  if (!table.has("second_port")) return nullptr;
  imu.second_port = table.text("second_port", "");
  if (imu.protocol != nullptr && !imu.protocol->has_second_uart) {
    table.fault("second_port", fmt::format("{} has no second UART; omit the key", imu.protocol->name));
    imu.second_port.clear();
    return nullptr;
  }
  const Transport* transport = check_device_port(table, "second_port", imu.second_port, imu.second_port_settings);
  if (transport != nullptr && (transport->carries_can || !transport->serves_device)) {
    table.fault("second_port",
                fmt::format("a UART needs a port for bytes; give {}",
                            ports_that([](const Transport& t) { return t.serves_device && !t.carries_can; })));
    transport = nullptr;
  }
  if (transport == nullptr) imu.second_port.clear();
  return transport;
}

// Reads `also`, the ports that also carry the bytes of `port`. Requires that the settings of `port` have been
// read.
void read_also(TableReader& table, ImuConfig& imu) {
  const toml::node* node = table.node("also");
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr || !(list->empty() || list->is_homogeneous(toml::node_type::string)))
    return table.fault("also", "give a list of ports, for example [\"file:imu1.bin\"]");
  table.resolve("also", *list);
  for (const toml::node& entry : *list) {
    const std::string port = entry.value_or(std::string());
    PortSettings settings = imu.port_settings;
    settings.paced = false;
    const Transport* transport = read_port(table, "also", port, settings);
    if (transport == nullptr) continue;
    const bool can = imu.protocol != nullptr && imu.protocol->link == Link::can;
    if (imu.protocol != nullptr && transport->carries_can != can) {
      table.fault(
          "also",
          fmt::format("{}: {} is for {}; give {}", port, imu.protocol->name, can ? "a CAN bus" : "byte links",
                      ports_that([&](const Transport& t) { return t.serves_device && t.carries_can == can; })));
      continue;
    }
    imu.also.push_back(port);
    imu.also_settings.push_back(settings);
  }
}

SyncConfig read_sync(TableReader table, const Protocol* protocol) {
  SyncConfig sync;
  const auto read = [&](std::string_view key, std::string& port, Role role) {
    if (!table.has(key)) return;
    port = table.text(key, "");
    if (protocol != nullptr && !protocol->has_sync_pins)
      table.fault(key, fmt::format("{} has no such pin; omit the key", protocol->name));
    const auto carries_edges = [](const Transport& t) {
      return t.keeps_datagrams && t.serves_device && !t.carries_can;
    };
    const Transport* transport = read_port(table, key, port, role);
    if (transport != nullptr && !carries_edges(*transport))
      table.fault(key, fmt::format("edges are received and sent by {}", ports_that(carries_edges)));
  };
  read("trigger_port", sync.trigger_port, Role::listener);
  read("pps_port", sync.pps_port, Role::listener);
  read("tov_port", sync.tov_port, Role::device);
  table.finish();
  return sync;
}

// Adapts a preset's errors to a product. The product's own preset gets the range and the resolution of the wire.
// Another sensor's range is limited to the product's range.
void fit(TriadErrors& errors, const TriadErrors& product, bool is_own) {
  errors.max = is_own ? product.max : std::min(errors.max, product.max);
  if (!is_own) return;
  errors.lsb = product.lsb;
  errors.rounding = product.rounding;
  errors.increment_lsb = product.increment_lsb;
}

// Reads `device_filters`. Returns the filters that the product's settings select, if the key enables them.
std::optional<SensorFilters> read_device_filters(TableReader& table, const Preset* preset, ImuConfig& imu) {
  std::optional<SensorFilters> filters;
  if (imu.protocol != nullptr) filters = imu.protocol->make(imu.settings)->filters();
  imu.device_filters = table.flag("device_filters", filters && preset != nullptr);
  if (imu.device_filters && !filters) {
    table.fault("device_filters", "the protocol has no filters of its own; omit the key");
    imu.device_filters = false;
  }
  return imu.device_filters ? filters : std::nullopt;
}

// Reads `internal_rate_hz`. Returns the internal rate, which is a multiple of the sample rate.
double read_internal_rate(TableReader& table, double fallback, ImuConfig& imu) {
  const double least = std::max(fallback, imu.rate_hz);
  const double rate_hz = table.real("internal_rate_hz", least, Grid::min_rate_hz, ImuConfig::max_internal_rate_hz);
  if (rate_hz < imu.rate_hz)
    table.fault("internal_rate_hz", fmt::format("give at least the sample rate, {}", imu.rate_hz));
  else if (imu.device_filters && rate_hz != imu.rate_hz)
    table.fault(
        "internal_rate_hz",
        fmt::format("the product's own filters act, at its {} Hz; omit the key, or give device_filters = false",
                    imu.rate_hz));
  constexpr double rounding = 1e-9;
  imu.model.internal_samples = std::max(1, static_cast<int>(std::ceil(rate_hz / imu.rate_hz * (1 - rounding))));
  return imu.model.internal_samples * imu.rate_hz;
}

// Puts the product's own filter into the triad that `table` describes.
void set_device_filter(TableReader table, const SensorFilter& filter, TriadErrors& errors) {
  for (const std::string_view key : {"low_pass_hz", "boxcar_samples", "cic_order"})
    if (errors.filter.is_on() && table.has(key))
      table.fault(key, "the product's own filter acts; set that, or give device_filters = false in [[imu]]");
  errors.filter = filter;
  if (!table.has("fir_taps")) errors.fir_taps.reset();
}

// Reads the errors of the inclinometers. A product without inclinometers has none, and the table is a fault. A
// protocol that takes inclinometers (Protocol::takes_inclinometers) has them by the table. The record of a run from
// before inclinometers had errors of their own is repeated as it was, without them.
void read_inclinometers(TableReader& table, const TriadErrors* product, double internal_hz, Sidedness density,
                        const TruthConfig& truth, ImuConfig& imu) {
  const bool is_given = table.has("inclinometer");
  if (!is_given && (product == nullptr || was_recorded_without(truth.port, "[imu.inclinometer]"))) return;
  const TriadErrors none;
  const TriadErrors errors =
      read_inclinometer(table.child("inclinometer"), product != nullptr ? product : &none, internal_hz, density);
  if (product != nullptr)
    imu.model.inclinometer = errors;
  else if (imu.protocol != nullptr)
    table.fault("inclinometer", inclinometer_objection(*imu.protocol, imu.settings));
}

// Reads the errors of all sensors. Keys that are absent have the values of the model.
void read_errors(TableReader& table, const std::optional<Product>& product, const TruthConfig& truth,
                 ImuConfig& imu) {
  imu.model.rate_hz = imu.rate_hz;
  std::optional<TriadErrors> gyro, accelerometer;
  TriadErrors magnetometer;
  std::optional<TriadErrors> inclinometer;
  Sidedness gyro_density = Sidedness::none, accelerometer_density = Sidedness::none,
            inclinometer_density = Sidedness::none;
  if (product) {
    gyro = product->gyro;
    accelerometer = product->accelerometer;
    magnetometer = product->magnetometer;
    inclinometer = product->inclinometer;
    imu.model.barometer = product->barometer;
  }
  if (imu.protocol != nullptr && imu.protocol->takes_inclinometers && table.has("inclinometer"))
    inclinometer.emplace();
  const std::string_view own = own_model(table, imu);
  const Preset* preset = read_model(table, own, imu.errors_model);
  const std::optional<SensorFilters> filters = read_device_filters(table, preset, imu);
  double internal_hz = 0;
  if (preset != nullptr) {
    try {
      PresetErrors errors = preset_errors(*preset, imu.rate_hz);
      if (!errors.is_imu)
        table.fault("model", fmt::format("{} has no gyros; name it by model in [imu.magnetometer] or [imu.barometer]",
                                         preset->name));
      const bool is_decimated = filters || (!errors.is_within(imu.rate_hz) && !table.has("internal_rate_hz"));
      if (is_decimated) errors.decimate(imu.rate_hz);
      if (product) {
        fit(errors.gyro, product->gyro, preset->name == own);
        fit(errors.accelerometer, product->accelerometer, preset->name == own);
      }
      gyro = errors.gyro;
      accelerometer = errors.accelerometer;
      gyro_density = errors.gyro_density;
      accelerometer_density = errors.accelerometer_density;
      if (inclinometer && errors.inclinometer) {
        inclinometer = errors.inclinometer;
        inclinometer_density = errors.inclinometer_density;
        if (product) fit(*inclinometer, *product->inclinometer, preset->name == own);
      }
      if (errors.magnetometer) magnetometer = *errors.magnetometer;
      if (errors.barometer) imu.model.barometer = *errors.barometer;
      if (!is_decimated) internal_hz = errors.internal_rate_hz;
    } catch (const ConfigError& error) {
      table.fault("model", error.what());
    }
  } else if (imu.errors_model == model_without_errors && product) {
    gyro = ideal(*gyro);
    accelerometer = ideal(*accelerometer);
    magnetometer = ideal(magnetometer);
    if (inclinometer) inclinometer = ideal(*inclinometer);
    imu.model.barometer = {};
  }
  internal_hz = read_internal_rate(table, internal_hz, imu);
  // A product's white noise applies to one sample at its rate.
  if (imu.errors_model == "white" && product)
    for (TriadErrors* errors : {&*gyro, &*accelerometer, inclinometer ? &*inclinometer : nullptr})
      if (errors != nullptr && errors->walk_transition.isZero(0.0))
        errors->walk_sqrt_cov *= std::sqrt(imu.model.internal_samples);
  // The right protocol may have ranges of its own: without it, they are not reported as missing.
  const TriadErrors unknown;
  const TriadErrors* const absent = imu.protocol == nullptr ? &unknown : nullptr;
  imu.model.gyro = read_gyro(table.child("gyro"), gyro ? &*gyro : absent, internal_hz, gyro_density);
  imu.model.accelerometer = read_accelerometer(table.child("accelerometer"), accelerometer ? &*accelerometer : absent,
                                               internal_hz, accelerometer_density);
  CurrentField current;
  imu.model.magnetometer = read_magnetometer(table.child("magnetometer"), &magnetometer, imu.rate_hz, current);
  imu.model.current_field = current.field;
  imu.model.current_field_sigma = current.sigma;
  read_inclinometers(table, inclinometer ? &*inclinometer : nullptr, internal_hz, inclinometer_density, truth, imu);
  if (!filters) return;
  set_device_filter(table.child("gyro"), filters->gyro, imu.model.gyro);
  set_device_filter(table.child("accelerometer"), filters->accelerometer, imu.model.accelerometer);
  set_device_filter(table.child("magnetometer"), filters->magnetometer, imu.model.magnetometer);
  if (imu.model.inclinometer)
    set_device_filter(table.child("inclinometer"), filters->inclinometer, *imu.model.inclinometer);
}

// Adds the fault that a protocol has found in its settings. The text of the fault begins with the key of the
// setting.
void fault_of_settings(TableReader& table, TableReader& device, std::span<const Setting> settings,
                       std::string_view text) {
  for (const Setting& setting : settings)
    if (text.starts_with(fmt::format("{}: ", setting.key)))
      return device.fault(setting.key, text.substr(setting.key.size() + 2));
  // The description of a described protocol.
  if (constexpr std::string_view of_description = "frame_file: "; text.starts_with(of_description))
    return table.fault("protocol", text.substr(of_description.size()));
  table.fault("device", text);
}

}  // namespace

ImuConfig read_imu(TableReader& table, std::size_t index, const TruthConfig& truth) {
  ImuConfig imu;
  imu.name = name_in(table, fmt::format("imu{}", index + 1));
  if (imu.name.find_first_of(",<>=/") != imu.name.npos)
    table.fault("name", "has one of , < > = /, which --require and file names cannot have; give another name");
  if (imu.name == "*" || (!imu.name.empty() && imu.name.find_first_not_of("0123456789") == imu.name.npos))
    table.fault("name", "a number or * selects imus of a list, as in --set imu.0.rate_hz=100; give another name");
  for (const std::string_view other : {"truth.", "record.", "control.", "clock."})
    if ((imu.name + ".").starts_with(other))
      table.fault("name", fmt::format("--require has other figures that begin with {}; give another name", other));

  require(table, "protocol", "one that `imud list` shows");
  const std::string protocol = table.text("protocol", "");
  imu.protocol = resolve_protocol(protocol);
  if (imu.protocol == nullptr && !(protocol.empty() && !is_text(table, "protocol")))
    table.fault("protocol", fmt::format("there is no \"{}\"; {}", protocol, suggestion(protocol, protocol_names())));
  std::optional<Product> product;
  std::optional<TableReader> device;
  if (imu.protocol != nullptr) {
    device.emplace(table.child("device"));
    imu.settings = read_settings(*device, imu.protocol->settings);
    if (is_described(*imu.protocol) && device->node("frame_file") != nullptr)
      device->fault("frame_file", frame_file_refusal(*imu.protocol));
    device->finish();
    try {
      static_cast<void>(imu.protocol->make(imu.settings));
    } catch (const std::invalid_argument& error) {
      fault_of_settings(table, *device, imu.protocol->settings, error.what());
      imu.settings = Settings(imu.protocol->settings);
    }
    if (imu.protocol->product != nullptr) product = imu.protocol->product(imu.settings);
    const std::unique_ptr<Device> made = imu.protocol->make(imu.settings);
    imu.port_settings.uart = made->uart();
    imu.second_port_settings.uart = made->second_uart();
  } else {
    table.node("device");
  }

  if (product) {
    imu.rate_hz = table.real("rate_hz", product->rate_hz, Grid::min_rate_hz, Grid::max_rate_hz);
    if (imu.rate_hz != product->rate_hz)
      table.fault("rate_hz",
                  fmt::format("{} always samples at {} Hz; the rate of its output is set in [imu.device]; omit "
                              "this key",
                              imu.protocol->name, product->rate_hz));
  } else {
    const double own = imu.protocol == nullptr ? 0 : default_rate_hz(*imu.protocol, imu.settings);
    // A description that could not be read may state the rate. That rate_hz is missing is then not reported.
    const bool is_unread = device && imu.settings.frames() == nullptr &&
                           std::ranges::any_of(imu.protocol->settings, &Setting::names_frames);
    if (own == 0 && !is_unread && imu.protocol != nullptr) require(table, "rate_hz", "the sensor's output rate");
    imu.rate_hz = table.real("rate_hz", own == 0 ? 100.0 : own, Grid::min_rate_hz, Grid::max_rate_hz);
  }
  if (device && imu.protocol->check != nullptr) {
    try {
      imu.protocol->check(imu.settings, imu.rate_hz);
    } catch (const std::invalid_argument& error) {
      fault_of_settings(table, *device, imu.protocol->settings, error.what());
    }
  }
  const double error_ppm = table.real("clock_error_ppm", 0.0, -Grid::max_clock_error_ppm, Grid::max_clock_error_ppm);
  const double phase_us = table.real("phase_us", 0.0, 0.0, 1e9);
  imu.grid = Grid(imu.rate_hz, error_ppm, nanoseconds(1e-6 * phase_us));
  read_instants(table, imu);

  imu.before_first =
      table.choice<BeforeFirst>("before_first", {{BeforeFirst::silence, "silence"}, {BeforeFirst::rest, "rest"}},
                                product ? BeforeFirst::rest : BeforeFirst::silence);

  require(table, "port", "where the sensor is connected, for example \"pty:imu1\"");
  imu.port = table.text("port", "");
  if (imu.protocol != nullptr && imu.protocol->link == Link::can)
    imu.port_settings.sends_fd = std::ranges::any_of(imu.protocol->can_messages(imu.settings, imu.rate_hz),
                                                     [](const CanMessage& message) { return message.can.fd; });
  const Transport* transport = check_device_port(table, "port", imu.port, imu.port_settings);
  if (transport != nullptr && imu.protocol != nullptr) {
    const bool can = imu.protocol->link == Link::can;
    if (transport->carries_can == can)
      imu.load = line_load(imu);
    else
      table.fault(
          "port",
          fmt::format("{} is for {}; give {}", imu.protocol->name, can ? "a CAN bus" : "byte links",
                      ports_that([&](const Transport& t) { return t.serves_device && t.carries_can == can; })));
    if (imu.load.percent > 100.0)
      table.fault(product ? "device" : "rate_hz",
                  fmt::format("{}; {}", imu.load.text(),
                              product ? "reduce what it sends or how often, or give a faster line"
                                      : "give a lower rate or a faster line"));
    else if (imu.load.percent >= BusLoad::high_percent && can)
      table.warn("port", fmt::format("{}; above {:.0f} % a CAN bus delays frames of low priority", imu.load.text(),
                                     BusLoad::high_percent));
    if (imu.protocol->waits_for_host != nullptr && transport->ends)
      if (const std::string_view setting = imu.protocol->waits_for_host(imu.settings); !setting.empty())
        table.warn("port", fmt::format("the unit sends no measurements before a message of a host, which only the "
                                       "replay of a record brings to a file; with device.{} it sends them",
                                       setting));
  }
  if (read_second_port(table, imu) != nullptr && imu.protocol != nullptr) {
    imu.second_load = line_load(imu, 1);
    if (imu.second_load.percent > 100.0)
      table.fault("device",
                  fmt::format("at the second port {}; reduce what it sends or how often, or give a faster line",
                              imu.second_load.text()));
  }

  read_also(table, imu);
  imu.sync = read_sync(table.child("sync"), imu.protocol);

  imu.model.temperature_c = table.real("temperature_c", imu.model.temperature_c, -273.15, 1e4);
  read_mounting(table.child("mounting"), imu.model);
  imu.model.temperature = read_temperature(table.child("temperature"));
  imu.model.oscillator = read_oscillator(table.child("clock"));
  imu.model.vibration = read_vibration(table.child("vibration"));
  read_errors(table, product, truth, imu);
  read_causes(table, imu.model);
  read_barometer(table.child("barometer"), imu.model.barometer);
  read_navigation(table.child("navigation"), truth, imu);
  TableReader increments = table.child("increments");
  imu.model.delta_angle = increments.choice<DeltaAngle>(
      "delta_angle", {{DeltaAngle::rotation_vector, "rotation_vector"}, {DeltaAngle::integral, "integral"}},
      DeltaAngle::rotation_vector);
  imu.model.delta_velocity = increments.choice<DeltaVelocity>(
      "delta_velocity",
      {{DeltaVelocity::integral, "integral"}, {DeltaVelocity::memo, "memo"}, {DeltaVelocity::end_frame, "end_frame"}},
      DeltaVelocity::integral);
  increments.finish();
  table.finish();
  return imu;
}

}  // namespace imud
