// A unit with its own filter, in a channel, and a host that sends commands to the unit.
#pragma once

#include <cmath>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/imu/channel.hpp"
#include "tests/core/navigation/navigating.hpp"
#include "tests/emulator/serve.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {

// A port whose other end is the test. It keeps the bytes that the unit sends.
class OrderPort final : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames)
      sent.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    counters_.sent += frames.size();
  }
  std::optional<Received> receive() noexcept override {
    if (commands.empty()) return std::nullopt;
    bytes_ = std::exchange(commands, {});
    return Received{.frame = {std::as_bytes(std::span(bytes_))}, .time = {}};
  }
  std::string commands, sent;

 private:
  std::string bytes_;
};

inline Truth resting_truth(TruthTime time) {
  Truth truth;
  truth.time = time;
  truth.q_NB = exp(Vector3(0, 0, 0.6));
  truth.has_position = truth.has_velocity = truth.has_specific_force = true;
  truth.specific_force_B = {0, 0, -units::standard_gravity};
  return truth;
}

// The unit flies the turn of navigating.hpp, or rests.
class OrderedUnit {
 public:
  explicit OrderedUnit(const std::string& protocol, const std::string& model, Truth (*motion)(TruthTime) = turn_at,
                       const std::string& keys = "")
      : motion_(motion), text_(config_text(protocol, model, keys)), config_(load(text_)) {
    channel_.emplace(config_.imus[0], 0, 1, [this](const PortUse&) {
      auto port = std::make_unique<OrderPort>();
      port_ = port.get();
      return port;
    });
    channel_->power_on({});
    channel_->sensor.clock().start_samples();
    begin_run();
  }

  // Sends the host's bytes, and returns the replies.
  std::string command(const std::string& bytes) {
    port_->sent.clear();
    port_->commands = bytes;
    serve(*channel_, {});
    return std::exchange(port_->sent, {});
  }
  std::string vectornav(const std::string& body) { return command("$" + body + "*XX\r\n"); }
  // A MIP packet with one command; the answer is its error code.
  int mip(std::uint8_t set, const std::string& field) {
    std::string packet = "\x75\x65";
    packet += static_cast<char>(set);
    packet += static_cast<char>(field.size() + 1);
    packet += static_cast<char>(field.size() + 1);
    packet += field;
    unsigned a = 0, b = 0;
    for (const char byte : packet) b += a += static_cast<unsigned char>(byte);
    packet += static_cast<char>(a);
    packet += static_cast<char>(b);
    const std::string answer = command(packet);
    return answer.size() < 8 ? -1 : answer[7];
  }

  const Sample& run(double seconds) {
    const auto samples = static_cast<std::uint64_t>(seconds * rate_hz());
    for (std::uint64_t end = k_ + samples; k_ < end; ++k_) {
      const TruthTime time = TruthTime{} + nanoseconds(static_cast<double>(k_) / rate_hz());
      timeline_.push(motion_(time));
      truth_ = motion_(time);
      channel_->sensor.sense(timeline_, time, k_);
      channel_->prepare(std::nullopt, false);
      channel_->encode(channel_->prepared);
      channel_->transmit();
    }
    return sample();
  }
  void begin_run() { channel_->begin_run(TruthTime{} + nanoseconds(static_cast<double>(k_) / rate_hz())); }
  void cycle_power() { channel_->cycle_power({}); }
  // Loads the configuration again, with these keys of the imu.
  void reload(const std::string& keys) {
    const Config after = load(text_ + keys);
    Reload next(config_, after, config_.imus, 1);
    channel_->exchange(next.sensors.at(0), {});
  }

  const Sample& sample() { return channel_->sensor.sample(); }
  Solution::State state() { return sample().solution->state; }
  const OwnSolution& solution() const { return *channel_->sensor.own_solution(); }
  std::uint64_t headings() const { return solution().headings().used + solution().headings().rejected; }
  // Returns how many headings, or fixes, the filter has had in so many seconds.
  std::uint64_t headings_in(double seconds) {
    const std::uint64_t before = headings();
    run(seconds);
    return headings() - before;
  }
  std::uint64_t fixes_in(double seconds) {
    const auto count = [this] {
      return solution().navigator()->fixes().used + solution().navigator()->fixes().rejected;
    };
    const std::uint64_t before = count();
    run(seconds);
    return count() - before;
  }
  // The yaw of the solution, and its error, in degrees.
  double yaw() { return yaw_of(sample().q_LP); }
  double yaw_error() { return std::remainder(yaw() - yaw_of(truth_.q_NB), 360.0); }
  double heading_sigma() { return static_cast<double>(sample().solution->attitude.z()) / units::degree; }

 private:
  static double yaw_of(const Quaternion& q) {
    const Vector3 ahead = q * Vector3::UnitX();
    return std::atan2(ahead.y(), ahead.x()) / units::degree;
  }
  static std::string config_text(const std::string& protocol, const std::string& model, const std::string& keys) {
    const bool is_ahrs = model == "vn-100" || model == "3dm-gx5-25" || model == "3dm-cv7-ahrs";
    return "clock = \"lockstep\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n[earth]\nframe = \"local\"\n"
           "latitude_deg = 45\nlongitude_deg = 10\n[[imu]]\nname = \"imu1\"\nprotocol = \"" +
           protocol + "\"\nport = \"pty:imu1\"\nmodel = \"white\"\ndevice.model = \"" + model +
           "\"\nnavigation.solution = \"" + (is_ahrs ? "attitude" : "filter") + "\"\n" + keys;
  }
  Config load(const std::string& text) const {
    const std::string path = folder_ / "config.toml";
    std::ofstream(path) << text;
    return load_config(path);
  }
  double rate_hz() const { return config_.imus[0].rate_hz; }

  ScratchFolder folder_;
  Truth (*motion_)(TruthTime);
  std::string text_;
  Config config_;
  std::optional<Channel> channel_;
  OrderPort* port_ = nullptr;
  Timeline timeline_;
  Truth truth_;
  std::uint64_t k_ = 0;
};

}  // namespace imud
