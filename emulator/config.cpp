#include "emulator/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <map>
#include <optional>
#include <set>
#include <thread>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "emulator/line_load.hpp"
#include "emulator/table_reader.hpp"
#include "transports/port.hpp"

namespace imud {

ConfigError::ConfigError(std::vector<std::string> all)
    : std::runtime_error(fmt::format("{}", fmt::join(all, "\n"))), faults(std::move(all)) {}

bool is_capture(const std::string& truth_port) {
  return truth_port.starts_with("pcap:") || truth_port.starts_with("file:");
}

namespace {

template <class Entry>
std::vector<std::string> names(std::span<const Entry* const> table) {
  std::vector<std::string> all;
  for (const Entry* entry : table) all.emplace_back(entry->name);
  return all;
}

// The table entry that `key` names, or nullptr with a fault.
template <class Entry>
const Entry* entry(TableReader& table, std::string_view key, const std::string& word,
                   std::span<const Entry* const> entries, const Entry* found) {
  if (found != nullptr || word.empty()) return found;
  const std::string meant = nearest(word, names(entries));
  table.fault(key, fmt::format("there is no \"{}\"; {}", word,
                               meant.empty() ? fmt::format("known: {}", fmt::join(names(entries), ", "))
                                             : fmt::format("did you mean \"{}\"?", meant)));
  return nullptr;
}

// Takes every declared setting that is there.
Settings read_settings(TableReader& table, std::span<const Setting> declared) {
  Settings settings(declared);
  for (const Setting& setting : declared) {
    const toml::node* node = table.node(setting.key);
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
          if (!item.is_string()) throw std::invalid_argument("give a list of texts in quotes");
          list.push_back(item.as_string()->get());
        }
        settings.set(setting.key, std::move(list));
      } else {
        throw std::invalid_argument("give a single value");
      }
    } catch (const std::invalid_argument& error) {
      table.fault(setting.key, error.what());
    }
  }
  return settings;
}

// Takes a port's text apart and finds its transport; nullptr with a fault if that fails.
const Transport* read_port(TableReader& table, std::string_view key, const std::string& text, Role role) {
  if (text.empty()) return nullptr;
  try {
    const PortSpec spec = PortSpec::parse(text);
    const Transport* transport = entry(table, key, spec.scheme, transports(), find_transport(spec.scheme));
    if (transport != nullptr) transport->check(spec, role);
    return transport;
  } catch (const PortError& error) {
    table.fault(key, error.what());
    return nullptr;
  }
}

// `product`: what holds where nothing is said; nullptr: the range must be.
TriadErrors read_triad(TableReader table, std::string_view unit, const TriadErrors* product) {
  constexpr double huge = 1e9;
  const auto key = [&](std::string_view stem) { return fmt::format("{}_{}", stem, unit); };
  TriadErrors e;
  if (product != nullptr)
    e = *product;
  else
    table.require(key("max"), "the largest value that the sensor can measure");
  e.max = table.real(key("max"), e.max, 1e-12, huge);
  e.bias = table.vector3(key("bias"), e.bias);
  e.scale_factor = table.vector3("scale_factor", e.scale_factor);
  e.lsb = table.real(key("lsb"), e.lsb, 0.0, huge);
  constexpr Rounding roundings[] = {Rounding::toward_zero, Rounding::nearest, Rounding::away_from_zero};
  e.rounding = roundings[table.choice("rounding", {"toward_zero", "nearest", "away_from_zero"}, 0)];
  e.carry = table.flag("carry", e.carry);
  e.walk_transition = table.matrix3("walk_transition", e.walk_transition, true);
  e.walk_sqrt_cov = table.matrix3("walk_sqrt_cov", e.walk_sqrt_cov, true);
  e.walk_bound = table.vector3("walk_bound", e.walk_bound);
  if ((e.walk_bound.array() < 0.0).any()) table.fault("walk_bound", "give numbers of at least 0 (0: no bound)");
  table.finish();
  return e;
}

void read_mounting(TableReader table, ImuModel& model) {
  model.r_SB_B = table.vector3("position_m", model.r_SB_B);
  if (table.has("dcm_PB") && table.has("yaw_pitch_roll_deg"))
    table.fault("dcm_PB", "give either this or yaw_pitch_roll_deg, not both");
  const Vector3 ypr = units::degree * table.vector3("yaw_pitch_roll_deg", Vector3::Zero());
  if (ypr.cwiseAbs().maxCoeff() > 1e4)
    table.fault("yaw_pitch_roll_deg", "give angles within some turns");
  else if (!ypr.isZero(0.0))
    model.dcm_PB = dcm_from_yaw_pitch_roll(ypr[0], ypr[1], ypr[2]);
  const Matrix3 dcm = table.matrix3("dcm_PB", model.dcm_PB, false);
  constexpr double tolerance = 1e-6;
  if (const double defect = rotation_defect(dcm); defect > tolerance)
    table.fault("dcm_PB", fmt::format("no rotation: its rows are not orthonormal and right-handed within {} (off by "
                                      "{:.2g}); write the numbers with more digits, or give yaw_pitch_roll_deg",
                                      tolerance, defect));
  model.dcm_PB = dcm;
  table.finish();
}

// The port of a device whose UART is set so: that is what a serial port is opened with, and a pty begins with.
std::string with_line(TableReader& table, const std::string& port, const LineSettings& line) {
  const PortSpec spec = PortSpec::parse(port);
  if (spec.scheme != "serial" && spec.scheme != "pty") return port;
  for (const char* key : {"baud", "parity", "stop", "bits"})
    if (spec.text(key))
      table.fault("port", fmt::format("{} is the device's, leave it away here; what [imu.device] says of its line holds", key));
  std::string options = fmt::format("baud={}", line.baud);
  if (spec.scheme == "serial" || line.parity != Parity::none || line.stop_bits != 1) {
    constexpr std::array<std::string_view, 3> parities = {"none", "even", "odd"};
    options += fmt::format("&parity={}&stop={}", parities[static_cast<std::size_t>(line.parity)], line.stop_bits);
  }
  return port + (port.find('?') == std::string::npos ? "?" : "&") + options;
}

// The port of a line whose characters take their time, if they shall; a serial line's do anyway.
std::string with_pace(TableReader& table, const std::string& port, bool paced, bool has_speed) {
  const PortSpec spec = PortSpec::parse(port);
  if (spec.text("pace")) table.fault("port", "pace is a key of [[imu]]; give it there");
  if (!paced || spec.text("pace") || spec.scheme == "serial") return port;
  if (spec.scheme != "pty")
    table.fault("pace", fmt::format("\"line\" is for a pty; {}: has no characters that take their time, give \"none\"",
                                    spec.scheme));
  else if (!has_speed && !spec.text("baud"))
    table.fault("pace", "\"line\" needs the line's speed; give it in port, for example \"pty:imu1?baud=115200\"");
  return port + (port.find('?') == std::string::npos ? "?" : "&") + "pace=line";
}

SyncConfig read_sync(TableReader table, const Protocol* protocol) {
  SyncConfig sync;
  const auto read = [&](std::string_view key, std::string& port, Role role) {
    port = table.text(key, "");
    if (port.empty()) return;
    if (protocol != nullptr && !protocol->has_sync_pins)
      table.fault(key, fmt::format("{} has no such pin; leave it away", protocol->name));
    if (read_port(table, key, port, role) != nullptr && !port.starts_with("udp:"))
      table.fault(key, "edges come and go by \"udp:ADDR:PORT\"");
  };
  read("trigger_port", sync.trigger_port, Role::listener);
  read("pps_port", sync.pps_port, Role::listener);
  read("tov_port", sync.tov_port, Role::device);
  table.finish();
  return sync;
}

ImuConfig read_imu(TableReader& table, std::size_t index) {
  ImuConfig imu;
  imu.name = table.text("name", fmt::format("imu{}", index + 1));
  if (imu.name.empty()) table.fault("name", "give a name that is not empty");

  table.require("protocol", "one that `imud list` shows");
  const std::string protocol = table.text("protocol", "");
  imu.protocol = entry(table, "protocol", protocol, protocols(), find_protocol(protocol));
  std::optional<Product> product;
  LineSettings line;
  if (imu.protocol != nullptr) {
    TableReader device = table.child("device");
    imu.settings = read_settings(device, imu.protocol->settings);
    device.finish();
    try {
      if (imu.protocol->product != nullptr) product = imu.protocol->product(imu.settings);
      line = imu.protocol->make(imu.settings)->line();
    } catch (const std::invalid_argument& error) {
      table.fault("device", error.what());
      imu.settings = Settings(imu.protocol->settings);
      if (imu.protocol->product != nullptr) product = imu.protocol->product(imu.settings);
    }
  } else {
    table.node("device");
  }

  if (product) {
    imu.rate_hz = table.real("rate_hz", product->rate_hz, Grid::min_rate_hz, Grid::max_rate_hz);
    if (imu.rate_hz != product->rate_hz)
      table.fault("rate_hz", fmt::format("{} samples at {} Hz inside; how often it sends is set in [imu.device], leave "
                                         "this away",
                                         imu.protocol->name, product->rate_hz));
  } else {
    table.require("rate_hz", "the sensor's output rate");
    imu.rate_hz = table.real("rate_hz", 100.0, Grid::min_rate_hz, Grid::max_rate_hz);
  }
  const double error_ppm = table.real("clock_error_ppm", 0.0, -Grid::max_clock_error_ppm, Grid::max_clock_error_ppm);
  const double phase_us = table.real("phase_us", 0.0, 0.0, 1e9);
  imu.grid = Grid(imu.rate_hz, error_ppm, nanoseconds(1e-6 * phase_us));

  table.require("port", "where the sensor is connected, for example \"pty:imu1\"");
  imu.port = table.text("port", "");
  const Transport* transport = read_port(table, "port", imu.port, Role::device);
  imu.paced = table.choice("pace", {"none", "line"}, 0) == 1;
  if (transport != nullptr) imu.port = with_pace(table, imu.port, imu.paced, line.baud != 0);
  if (transport != nullptr && line.baud != 0) imu.port = with_line(table, imu.port, line);
  if (transport != nullptr && imu.protocol != nullptr) {
    if (transport->carries_can != (imu.protocol->link == Link::can))
      table.fault("port", fmt::format("{} speaks on {}; give {}", imu.protocol->name,
                                      imu.protocol->link == Link::can ? "a CAN bus" : "byte links",
                                      imu.protocol->link == Link::can ? "\"can:...\"" : "\"pty:...\", \"serial:...\", "
                                                                                        "\"udp:...\" or \"file:...\""));
    else if (const LineLoad load = line_load(imu); load.percent > 100.0)
      table.fault("rate_hz", fmt::format("{}; give a lower rate or a faster line", load.text()));
  }

  imu.sync = read_sync(table.child("sync"), imu.protocol);

  imu.model.temperature_c = table.real("temperature_c", imu.model.temperature_c, -273.15, 1e4);
  read_mounting(table.child("mounting"), imu.model);
  imu.model.gyro = read_triad(table.child("gyro"), "rad_per_s", product ? &product->gyro : nullptr);
  imu.model.accelerometer =
      read_triad(table.child("accelerometer"), "m_per_s2", product ? &product->accelerometer : nullptr);
  imu.model.magnetometer = read_triad(table.child("magnetometer"), "t", product ? &product->magnetometer : &imu.model.magnetometer);
  if (product) imu.model.barometer = product->barometer;
  TableReader barometer = table.child("barometer");
  imu.model.barometer.bias = barometer.real("bias_pa", imu.model.barometer.bias, -1e6, 1e6);
  imu.model.barometer.noise = barometer.real("noise_pa", imu.model.barometer.noise, 0.0, 1e6);
  barometer.finish();
  TableReader increments = table.child("increments");
  constexpr DeltaAngle angles[] = {DeltaAngle::rotation_vector, DeltaAngle::integral};
  constexpr DeltaVelocity velocities[] = {DeltaVelocity::integral, DeltaVelocity::memo, DeltaVelocity::end_frame};
  imu.model.delta_angle = angles[increments.choice("delta_angle", {"rotation_vector", "integral"}, 0)];
  imu.model.delta_velocity = velocities[increments.choice("delta_velocity", {"integral", "memo", "end_frame"}, 0)];
  increments.finish();
  table.finish();
  return imu;
}

EarthModel read_earth(TableReader table) {
  EarthModel earth;
  constexpr EarthModel::Frame frames[] = {EarthModel::Frame::none, EarthModel::Frame::local, EarthModel::Frame::inertial};
  earth.frame = frames[table.choice("frame", {"none", "local", "inertial"}, 0)];
  constexpr std::int64_t in_2025 = 1'735'689'600;
  const std::int64_t start = table.utc_s("start", in_2025, 2017, 2100);
  earth.start_gps_ns = gps_ns_from_unix(start);
  if (earth.frame == EarthModel::Frame::local) {
    table.require("latitude_deg", "where N's origin is");
    table.require("longitude_deg", "where N's origin is");
  }
  earth.latitude = units::degree * table.real("latitude_deg", 0.0, -90.0, 90.0);
  earth.longitude = units::degree * table.real("longitude_deg", 0.0, -180.0, 360.0);
  earth.height = table.real("height_m", 0.0, -1e4, 1e8);
  earth.angle = units::degree * table.real("angle_deg", earth_rotation_angle(start) / units::degree, -360.0, 360.0);
  const auto only_for = [&](std::string_view key, EarthModel::Frame frame, std::string_view name) {
    if (table.has(key) && earth.frame != frame) table.fault(key, fmt::format("needs frame = \"{}\"", name));
  };
  for (const char* key : {"latitude_deg", "longitude_deg", "height_m"}) only_for(key, EarthModel::Frame::local, "local");
  only_for("angle_deg", EarthModel::Frame::inertial, "inertial");
  table.finish();
  return earth;
}

// The capture, with the UDP port of the port that it takes the place of if it names none of its own.
std::string in_place_of(const std::string& port, const std::string& capture) {
  const std::size_t asks = capture.find('?');
  if (!capture.starts_with("pcap:") || (asks != std::string::npos && capture.find("port=", asks) != std::string::npos))
    return capture;
  std::string number;
  if (port.starts_with("udp:")) number = port.substr(port.rfind(':') + 1);
  const std::size_t options = port.find('?');
  if (const std::size_t at = port.find("port=", options); options != std::string::npos && at != std::string::npos)
    number = port.substr(at + 5);
  number = number.substr(0, number.find_first_not_of("0123456789"));
  if (number.empty()) return capture;
  return capture + (asks == std::string::npos ? "?port=" : "&port=") + number;
}

TruthConfig read_truth(TableReader table, const std::string& capture) {
  TruthConfig truth;
  truth.port = table.text("port", "");
  if (!capture.empty())
    truth.port = in_place_of(truth.port, capture);
  else
    table.require("port", "where the truth comes from, for example \"udp:127.0.0.1:9810\"");
  const Transport* transport = read_port(table, "port", truth.port, Role::listener);
  if (transport != nullptr && !is_capture(truth.port) && !truth.port.starts_with("udp:"))
    table.fault("port", "truth comes by \"udp:ADDR:PORT\", \"pcap:PATH?port=N\" or \"file:PATH.csv\"");

  const std::string format = table.text("format", "native");
  truth.format = entry(table, "format", format, truth_formats(), find_truth_format(format));
  if (truth.format != nullptr) {
    truth.settings = read_settings(table, truth.format->settings);
    if (truth.port.starts_with("file:") && !truth.format->text)
      table.fault("port", fmt::format("{} truth is binary datagrams, which a plain file does not delimit; give a "
                                      "pcap",
                                      truth.format->name));
  }
  if (table.has("stream"))
    truth.stream = static_cast<std::uint32_t>(table.unsigned_integer("stream", 0, 0xFFFF'FFFFU));
  const auto milliseconds = [&](std::string_view key, Nanoseconds fallback, double min, double max) {
    return nanoseconds(1e-3 * table.real(key, 1e3 * seconds(fallback), min, max));
  };
  const double percent = table.real("auto_delay_percent", 99.0, 50.0, 100.0);
  if (table.is_text("delay_ms")) {
    if (table.text("delay_ms", "") != "auto") table.fault("delay_ms", "give milliseconds from 0 to 1000, or \"auto\"");
    truth.clock.automatic_percent = percent;
  } else {
    truth.clock.delay = milliseconds("delay_ms", truth.clock.delay, 0.0, 1000.0);
    if (table.has("auto_delay_percent")) table.fault("auto_delay_percent", "needs delay_ms = \"auto\"");
  }
  constexpr WhenStopped reactions[] = {WhenStopped::hold, WhenStopped::flag, WhenStopped::silence};
  truth.when_stopped = reactions[table.choice("when_stopped", {"hold", "flag", "silence"}, 0)];
  truth.limits.extrapolate = milliseconds("extrapolate_ms", truth.limits.extrapolate, 0.0, 10'000.0);
  truth.limits.max_gap = milliseconds("max_gap_ms", truth.limits.max_gap, 1.0, 3.6e6);
  table.finish();
  return truth;
}

RealtimeConfig read_realtime(TableReader table) {
  RealtimeConfig realtime;
  realtime.priority = static_cast<int>(table.unsigned_integer("priority", static_cast<unsigned>(realtime.priority), 99));
  if (table.has("cpu")) {
    const unsigned cpus = std::max(1U, std::thread::hardware_concurrency());
    realtime.cpu = static_cast<unsigned>(table.unsigned_integer("cpu", 0, cpus - 1));
  }
  realtime.lock_memory = table.flag("lock_memory", realtime.lock_memory);
  realtime.spin = nanoseconds(1e-6 * table.real("spin_us", 0.0, 0.0, 1000.0));
  table.finish();
  return realtime;
}

// Two imus that would disturb one another.
void check_imus_together(const std::vector<ImuConfig>& imus, const toml::array* tables, Faults& faults) {
  std::map<std::string, std::size_t> by_name;
  std::map<std::uint32_t, std::size_t> by_stream;
  std::map<std::string, std::size_t> by_port;
  std::map<std::pair<std::string, std::uint32_t>, std::size_t> by_can_id;
  for (std::size_t i = 0; i < imus.size(); ++i) {
    const auto line = (*tables)[i].source().begin.line;
    const auto clash = [&](std::string_view key, std::size_t other, std::string_view what) {
      faults.add(line, fmt::format("imu.{}.{}", i, key), fmt::format("{} as imu.{}; give another", what, other));
    };
    if (const auto [at, fresh] = by_name.emplace(imus[i].name, i); !fresh)
      clash("name", at->second, "the same");
    else if (const auto [same, alone] = by_stream.emplace(stream_id(imus[i].name), i); !alone)
      clash("name", same->second, "the same random numbers");
    const std::string port = imus[i].port.substr(0, imus[i].port.find('?'));
    if (!port.starts_with("can:") && !port.starts_with("udp:") && !port.empty()) {
      if (const auto [at, fresh] = by_port.emplace(port, i); !fresh) clash("port", at->second, "the same");
      continue;
    }
    if (imus[i].protocol == nullptr || imus[i].protocol->link != Link::can) continue;
    std::set<std::uint32_t> ids;
    for (const CanHeader& header : can_headers(imus[i])) ids.insert(header.id | (header.extended ? 1U << 31U : 0U));
    for (const std::uint32_t id : ids)
      if (const auto [at, fresh] = by_can_id.emplace(std::pair{port, id}, i); !fresh) {
        clash("device", at->second, fmt::format("the same CAN identifier {:#x} on the same bus", id & 0x1FFF'FFFFU));
        break;
      }
  }
}

// Whether these bits of Sample::status come through the imu's protocol.
bool carries_status(const ImuConfig& imu, std::uint32_t bits) {
  struct Sink final : MeasurementSink {
    void on_measurement(const Measurement& measurement) override {
      if ((measurement.fields & Measurement::status) != 0) seen |= measurement.sample.status;
    }
    std::uint32_t seen = 0;
  } sink;
  if (imu.protocol->product != nullptr) return (imu.protocol->status_bits & bits) == bits;
  Sample sample = ordinary_sample();
  sample.status = bits;
  const auto frames = std::make_unique<FrameBuffer>();
  imu.protocol->make(imu.settings)->sample(sample, *frames);
  const std::unique_ptr<Decoder> decoder = imu.protocol->make_decoder(imu.settings);
  for (const Frame& frame : frames->frames()) decoder->feed(frame, sink);
  decoder->finish(sink);
  return (sink.seen & bits) == bits;
}

// Sets "imu.0.rate_hz=400".
void override_key(toml::table& root, const std::string& assignment, Faults& faults) {
  const auto fault = [&](std::string_view what) { faults.add(0, fmt::format("--set {}", assignment), what); };
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) return fault("give KEY=VALUE, for example imu.0.rate_hz=400");
  const std::string value = assignment.substr(equals + 1);
  toml::table parsed;
  try {
    parsed = toml::parse("v = " + value);
  } catch (const toml::parse_error&) {
    parsed.insert_or_assign("v", value);  // a bare word
  }
  toml::node* at = &root;
  std::string path = assignment.substr(0, equals);
  while (true) {
    const std::size_t dot = path.find('.');
    const std::string step = path.substr(0, dot);
    if (auto* array = at->as_array()) {
      const bool digits = !step.empty() && step.size() < 6 && step.find_first_not_of("0123456789") == std::string::npos;
      if (!digits || std::stoul(step) >= array->size() || dot == std::string::npos)
        return fault(fmt::format("\"{}\" is no index below {}", step, array->size()));
      at = &(*array)[std::stoul(step)];
    } else if (auto* table = at->as_table()) {
      if (dot == std::string::npos) {
        table->insert_or_assign(step, *parsed.get("v"));
        return;
      }
      if (!table->contains(step)) table->insert(step, toml::table{});
      at = table->get(step);
    } else {
      return fault(fmt::format("\"{}\" stands below a plain value", step));
    }
    path = path.substr(dot + 1);
  }
}

}  // namespace

Config load_config(const std::string& path, std::span<const std::string> overrides, const std::string& capture) {
  Faults faults(path);
  toml::table root;
  try {
    root = toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    faults.add(error.source().begin.line, "TOML", error.description());
    throw ConfigError(faults.all());
  }
  for (const std::string& assignment : overrides) override_key(root, assignment, faults);

  TableReader table(&root, "", 0, faults);
  Config config;
  config.seed = table.unsigned_integer("seed", config.seed, ~std::uint64_t{0});
  constexpr ClockMode clocks[] = {ClockMode::realtime, ClockMode::lockstep, ClockMode::fast};
  config.clock = clocks[table.choice("clock", {"realtime", "lockstep", "fast"}, 0)];
  config.truth = read_truth(table.child("truth"), capture);
  config.realtime = read_realtime(table.child("realtime"));
  if (config.clock == ClockMode::fast && !config.truth.port.empty() && !is_capture(config.truth.port))
    table.fault("clock", "\"fast\" reads a capture; give truth.port \"pcap:...\" or \"file:...\", or \"lockstep\"");

  const EarthModel earth = read_earth(table.child("earth"));

  const toml::node* imus = table.node("imu");
  const toml::array* array = imus == nullptr ? nullptr : imus->as_array();
  if (array == nullptr || array->empty() || !array->is_array_of_tables()) {
    table.fault("imu", "missing; give at least one [[imu]]");
  } else {
    for (std::size_t i = 0; i < array->size(); ++i) {
      const toml::table& imu = *(*array)[i].as_table();
      TableReader reader(&imu, fmt::format("imu.{}.", i), imu.source().begin.line, faults);
      config.imus.push_back(read_imu(reader, i));
      config.imus.back().model.earth = earth;
      const ImuConfig& read = config.imus.back();
      if (read.paced && config.clock != ClockMode::realtime)
        faults.add(imu.source().begin.line, fmt::format("imu.{}.pace", i),
                   "\"line\" needs clock = \"realtime\": in the other clocks no time passes; give \"none\"");
      if (config.truth.when_stopped == WhenStopped::flag && read.protocol != nullptr &&
          !carries_status(read, status::not_valid))
        faults.add(imu.source().begin.line, fmt::format("imu.{}.protocol", i),
                   fmt::format("{} cannot say that a sample is not valid, as truth.when_stopped = \"flag\" wants; give "
                               "\"hold\" or \"silence\"",
                               read.protocol->name));
    }
    check_imus_together(config.imus, array, faults);
  }
  table.finish();
  if (!faults.all().empty()) throw ConfigError(faults.all());
  return config;
}

}  // namespace imud
