// Hashes of what every product sends during the captured flight, compared with those in a file. It needs only core,
// protocols and the standard library, so that it runs wherever these can be cross-compiled to.
//
//   run_hashes CAPTURE.pcap HASHES
//
// A line of HASHES is a 64-bit FNV-1a hash, the number of frames, a protocol and its settings (key=value ...). The
// exit code is 1 if a line is wrong; the correct lines go to standard output. With the setting solution=filter the
// unit computes its own solution, and with solution=attitude its attitude alone. With aids=all the filter has every
// aid, each of which must have been used, and with motion=rest the vehicle rests instead of the flight. With
// scale=estimated the sensors have scale factors, which the filter estimates. With sky=almanac the receiver sees the
// satellites of an almanac.
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "core/attitude.hpp"
#include "core/gps_time.hpp"
#include "core/imu.hpp"
#include "core/navigation/own_solution.hpp"
#include "core/timeline.hpp"
#include "core/units.hpp"
#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"
#include "tests/core/gnss/constellation.hpp"

namespace imud {
namespace {

class Hash {
 public:
  void add(std::span<const std::byte> bytes) {
    for (const std::byte byte : bytes) value_ = (value_ ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3U;
  }
  void add(std::uint32_t number) {
    for (int shift = 0; shift < 32; shift += 8) {
      const std::byte byte{static_cast<std::uint8_t>(number >> shift)};
      add({&byte, 1});
    }
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  return {std::istreambuf_iterator<char>(file), {}};
}

// The truths of a capture in JSBSim's format: a pcap file of Ethernet frames, little-endian, IPv4 without options.
std::vector<Truth> read_flight(const std::string& path) {
  constexpr std::size_t file_header = 24, record_header = 16, packet_headers = 14 + 20 + 8;
  const std::string pcap = read_file(path);
  const TruthFormat& format = *find_truth_format("jsbsim");
  const std::unique_ptr<TruthDecoder> decoder = format.make(Settings(format.settings));
  std::vector<Truth> truths;
  std::uint32_t size = 0;
  for (std::size_t at = file_header; at + record_header <= pcap.size(); at += record_header + size) {
    std::memcpy(&size, pcap.data() + at + 8, sizeof size);
    const std::span packet(pcap.data() + at + record_header, size);
    decoder->feed(std::as_bytes(packet.subspan(packet_headers)), TruthInput::datagram, {});
    Truth truth;
    while (const auto result = decoder->next(truth)) {
      if (*result != TruthResult::ok) continue;
      truth.has_earth_angle = false;  // the Earth's angle is that of the model
      truths.push_back(truth);
    }
  }
  return truths;
}

// The imu "every-effect" of the regression run, and place and sensors that its protocol does not carry: so the hash
// of `native` is also that of the regression's file.
ImuModel every_effect() {
  ImuModel model;
  model.r_SB_B = Vector3(0.5, -0.25, 1.0);
  model.dcm_PB = dcm_from_yaw_pitch_roll(90 * units::degree, 10 * units::degree, -5 * units::degree);
  model.gyro.scale_factor = Vector3(1.001, 0.999, 1.0005);
  model.gyro.bias = Vector3(0.001, -0.002, 0.0005);
  model.gyro.walk_transition = Vector3(0.9, 0.99, 1.0).asDiagonal();
  model.gyro.walk_sqrt_cov << 1e-4, 0, 0, 2e-5, 1e-4, 0, 0, 0, 1e-5;
  model.gyro.walk_bound = Vector3(0, 1e-3, 1e-4);
  model.gyro.lsb = 1e-5;
  model.gyro.rounding = Rounding::nearest;
  model.gyro.carry = true;
  model.gyro.max = 0.015;
  model.accelerometer.scale_factor = Vector3(0.998, 1.001, 1.002);
  model.accelerometer.bias = Vector3(0.01, -0.02, 0.03);
  model.accelerometer.walk_transition = Matrix3::Zero();
  model.accelerometer.walk_sqrt_cov = Vector3::Constant(0.02).asDiagonal();
  model.accelerometer.lsb = 1e-3;
  model.accelerometer.max = 10;
  model.delta_angle = DeltaAngle::integral;
  model.delta_velocity = DeltaVelocity::integral;
  model.temperature_c = 31.5;
  model.magnetometer = TriadErrors::white(1e-9, 200, 1e-3);
  model.barometer.noise = 3;
  model.earth.frame = EarthModel::Frame::inertial;
  model.earth.start_gps_ns = gps_ns_from_unix(1'782'993'600);  // 2026-07-02T12:00:00Z
  return model;
}

// A unit with the noise of a MEMS sensor, whose receiver has errors, too.
ImuModel navigating(double rate_hz) {
  ImuModel model;
  model.rate_hz = rate_hz;
  model.gyro.white_density = Vector3::Constant(1e-4);
  model.gyro.turn_on_bias = Vector3::Constant(1e-3);
  model.accelerometer.white_density = Vector3::Constant(1e-3);
  model.magnetometer = TriadErrors::white(1e-8, rate_hz, 1e-3);
  model.navigation.latency = std::chrono::milliseconds(40);
  model.navigation.position_noise = Vector3(1, 1, 2);
  model.navigation.velocity_noise = Vector3::Constant(0.05);
  model.earth = every_effect().earth;
  return model;
}

// The settings of a line that are not the protocol's.
struct Unit {
  std::optional<NavigatorModel::Kind> solution;
  bool has_all_aids = false, rests = false, has_almanac = false, estimates_scale = false;

  // Returns whether `setting` is one of these.
  bool read(std::string_view setting) {
    if (setting == "solution=filter") {
      solution = NavigatorModel::Kind::inertial;
    } else if (setting == "solution=attitude") {
      solution = NavigatorModel::Kind::attitude;
    } else if (setting == "aids=all") {
      has_all_aids = true;
    } else if (setting == "scale=estimated") {
      estimates_scale = true;
    } else if (setting == "motion=rest") {
      rests = true;
    } else if (setting == "sky=almanac") {
      has_almanac = true;
    } else {
      return false;
    }
    return true;
  }
};

// Ten seconds at rest in a local level, with a bank.
std::vector<Truth> rest() {
  std::vector<Truth> truths(1001);
  for (std::size_t i = 0; i < truths.size(); ++i) {
    Truth& truth = truths[i];
    truth.time = TruthTime{} + std::chrono::milliseconds(10 * i);
    truth.q_NB = exp(Vector3(0, 0, 0.5)) * exp(Vector3(0.1, 0.05, 0));
    truth.has_position = truth.has_velocity = truth.has_specific_force = true;
    truth.r_BN_N = {10, -20, -100};
    truth.specific_force_B = truth.q_NB.conjugate() * Vector3(0, 0, -units::standard_gravity);
  }
  return truths;
}

ImuModel model_of(const Unit& unit, double rate_hz) {
  if (!unit.solution) return every_effect();
  ImuModel model = navigating(rate_hz);
  if (unit.rests) {
    model.earth.frame = EarthModel::Frame::local;
    model.earth.latitude = 0.8;
    model.earth.longitude = -1.2;
  }
  if (unit.has_almanac) {
    model.navigation.gnss.almanac = constellation();
    model.navigation.gnss.multipath = 3;
  }
  if (unit.estimates_scale) {
    model.gyro.scale_factor = Vector3(1.003, 0.998, 1.002);
    model.accelerometer.scale_factor = Vector3(0.997, 1.001, 1.002);
  }
  if (!unit.has_all_aids) return model;
  model.barometer.noise = 5;
  model.navigation.position = Vector3(1.5, 1.5, 3);
  model.navigation.velocity = Vector3::Constant(0.1);
  return model;
}

NavigatorModel navigator_of(const Unit& unit, const ImuModel& model) {
  NavigatorModel navigator;
  navigator.kind = *unit.solution;
  tune(navigator, model);
  navigator.estimates_scale_factors = unit.estimates_scale;
  if (!unit.has_all_aids) return navigator;
  navigator.slow_position = model.navigation.position;
  navigator.slow_velocity = model.navigation.velocity;
  navigator.barometer_rate_hz = 10;
  navigator.zero_velocity = true;
  return navigator;
}

// The frames that `device` sends during a motion.
class Run {
 public:
  Run(Device& device, double rate_hz, Link link, const Unit& unit)
      : device_(device), grid_(rate_hz), is_can_(link == Link::can), unit_(unit), model_(model_of(unit, rate_hz)) {
    if (unit.solution) solution_.emplace(navigator_of(unit, model_), model_);
  }

  void over(const std::vector<Truth>& flight) {
    Timeline timeline;
    Imu imu(model_, 20261120, stream_id("every-effect"));
    for (const Truth& truth : flight) {
      const Admission admission = timeline.push(truth);
      if (admission != Admission::accepted && admission != Admission::new_run)
        throw std::runtime_error("a truth was refused");
      for (; timeline.run_start() + grid_.offset(imu.next()) <= timeline.newest();) {
        const TruthTime instant = timeline.run_start() + grid_.offset(imu.next());
        const DeviceTime now{instant.ns};
        if (imu.next() == 0) device_.step_clock(now - DeviceTime{});  // power comes on at sample 0
        for (auto due = device_.deadline(); due && *due <= now; due = device_.deadline())
          add([&] { device_.poll(*due, *frames_); });
        Sample sample = imu.sample(timeline, instant, now);
        if (solution_) {
          if (unit_.has_all_aids && sample.navigation.is_known)
            sample.navigation.antennas = measured_line(sample.q_LP, 0.005, Normals(20261127, 1), sample.counter);
          solution_->take(sample, instant, std::nullopt);
          aids_used_ |= sample.solution->used;
        }
        add([&] { device_.sample(sample, *frames_); });
      }
    }
  }

  std::uint64_t hash() const { return hash_.value(); }
  std::size_t frames() const { return count_; }
  // Returns whether each aid that the unit has was used. A flight has no rest.
  bool has_used_aids() const {
    if (!unit_.solution) return true;
    unsigned aids = aid::magnetic_heading;
    aids |= *unit_.solution == NavigatorModel::Kind::attitude ? aid::gravity : aid::position | aid::velocity;
    if (unit_.has_all_aids) aids |= aid::antennas_heading | aid::pressure;
    if (unit_.has_all_aids && unit_.rests) aids |= aid::zero_velocity;
    return (aids_used_ & aids) == aids;
  }

 private:
  template <class Call>
  void add(Call&& call) {
    frames_->clear();
    call();
    for (const Frame& frame : frames_->frames()) {
      if (is_can_) hash_.add(frame.can.id);
      hash_.add(frame.bytes);
    }
    count_ += frames_->frames().size();
  }

  Device& device_;
  Grid grid_;
  bool is_can_;
  Unit unit_;
  ImuModel model_;
  std::optional<OwnSolution> solution_;
  unsigned aids_used_ = 0;
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
  Hash hash_;
  std::size_t count_ = 0;
};

const Protocol* protocol_of(const std::string& line) {
  std::istringstream words(line);
  std::string hash, frames, name;
  words >> hash >> frames >> name;
  const Protocol* protocol = find_protocol(name);
  if (protocol == nullptr) throw std::runtime_error("no protocol in: " + line);
  return protocol;
}

// Returns the correct line for the protocol and settings of `line`.
std::string right_line(const std::string& line, const std::vector<Truth>& flight) {
  const Protocol* protocol = protocol_of(line);
  std::istringstream words(line);
  std::string hash, frames, name;
  words >> hash >> frames >> name;
  Settings settings(protocol->settings);
  std::ostringstream right;
  Unit unit;
  for (std::string setting; words >> setting; right << ' ' << setting) {
    if (unit.read(setting)) continue;
    const std::size_t equals = setting.find('=');
    settings.set_text(setting.substr(0, equals), setting.substr(equals + 1));
  }
  const std::unique_ptr<Device> device = protocol->make(settings);
  Run run(*device, protocol->product != nullptr ? protocol->product(settings).rate_hz : 200, protocol->link, unit);
  run.over(unit.rests ? rest() : flight);
  if (!run.has_used_aids()) throw std::runtime_error("an aid was never used in: " + line);
  std::ostringstream begin;
  begin << std::hex << std::setfill('0') << std::setw(16) << run.hash() << std::dec << ' ' << run.frames() << ' '
        << name;
  return begin.str() + right.str();
}

int check(const std::string& capture, const std::string& hashes) {
  const std::vector<Truth> flight = read_flight(capture);
  if (flight.size() != 2001) throw std::runtime_error(std::to_string(flight.size()) + " truths in " + capture);
  std::istringstream lines(read_file(hashes));
  int right = 0, wrong = 0;
  std::set<std::string_view> absent;
  for (const Protocol* protocol : protocols()) absent.insert(protocol->name);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.front() == '#') continue;
    const std::string wanted = right_line(line, flight);
    absent.erase(protocol_of(line)->name);
    ++(wanted == line ? right : wrong);
    std::cout << wanted << (wanted == line ? "" : "    # not as before") << '\n';
  }
  if (right + wrong < 10) throw std::runtime_error("fewer than 10 lines in " + hashes);
  for (const std::string_view name : absent)
    std::cout << right_line("0 0 " + std::string(name), flight) << "    # is absent\n";
  return wrong == 0 && absent.empty() ? 0 : 1;
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("usage: run_hashes CAPTURE.pcap HASHES");
  return imud::check(argv[1], argv[2]);
} catch (const std::exception& error) {
  std::cerr << "run_hashes: " << error.what() << '\n';
  return 1;
}
