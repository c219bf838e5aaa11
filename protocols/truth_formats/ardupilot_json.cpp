// The JSON interface of ArduPilot's simulator in the loop (SITL), on the flight stack's side. imud sends servo
// packets to the simulator, UDP port 9002 by default, and the simulator answers each packet with a JSON object. Both
// run in lockstep: the next packet is sent when the samples up to the last truth have been sent. A packet without an
// answer is sent again. Give the simulator's address: truth.port = "udp:0.0.0.0:0?peer=127.0.0.1:9002".
//
// The servo packet, little-endian: u16 magic, 18458 with 16 channels or 29569 with 32; u16 frame rate (Hz), the step
// that the simulator should take; u32 frame count, 0 at the start, which resets the simulator; u16 pulse width of
// each channel (us). The answer: `timestamp` (s), `imu.gyro` (rad/s) and `imu.accel_body` (specific force, m/s^2) in
// front-right-down; `position` (m) and `velocity` (m/s), north-east-down from the origin; `attitude` (roll, pitch,
// yaw, rad), or `quaternion` (w first, body to north-east-down), which is preferred. Other names are not used.
#include <boost/endian/conversion.hpp>
#include <stdexcept>

#include "protocols/quantities/columns.hpp"
#include "protocols/quantities/json_truth_decoder.hpp"

namespace imud {
namespace {

constexpr std::size_t few_channels = 16, most_channels = 32, header_size = 8;
constexpr std::uint16_t magic_of_16 = 18458, magic_of_32 = 29569;
constexpr std::uint16_t idle_us = 1000;
constexpr Nanoseconds resend_after{1'000'000'000};  // as ArduPilot does

// The paths of quantities in the object. The path of several quantities is an array.
constexpr std::pair<std::string_view, std::string_view> paths[] = {
    {"time_s", "timestamp"},
    {"{p,q,r}_rad_per_s", "imu.gyro"},
    {"specific_force_{x,y,z}_m_per_s2", "imu.accel_body"},
    {"{roll,pitch,yaw}_rad", "attitude"},
    {"q_LB_{w,x,y,z}", "quaternion"},
    {"{north,east,down}_m", "position"},
    {"v_{north,east,down}_m_per_s", "velocity"},
};
constexpr std::size_t required_quantities = 7;  // time, rate, specific force

TruthMap map_of_paths() {
  std::vector<std::string> texts;
  for (const auto& [ours, theirs] : paths) {
    const std::vector<std::string> names = names_in(ours);
    for (std::size_t i = 0; i < names.size(); ++i)
      texts.push_back(names[i] + "=" + std::string(theirs) + (names.size() > 1 ? "." + std::to_string(i) : ""));
  }
  return parse_truth_map(texts);
}

QuantitySet required() {
  TruthMap map = map_of_paths();
  map.resize(required_quantities);
  return quantities_of(map);
}

QuantitySet set_of(TruthGroup group) {
  QuantitySet set;
  for (std::size_t i = 0; i < quantity_group(group).names.size(); ++i) set.set(quantity_group(group).first + i);
  return set;
}

class ArdupilotJsonDecoder final : public JsonTruthDecoder {
 public:
  explicit ArdupilotJsonDecoder(const Settings& settings)
      : JsonTruthDecoder(map_of_paths(), required(), {}, {.kind = TruthFrame::Kind::local}),
        rate_hz_(static_cast<std::uint16_t>(settings.integer("frame_rate_hz"))),
        speedup_(settings.real("speedup")) {
    const std::vector<std::string>& pulses = settings.list("pwm");
    const auto fault = [](const std::string& text) {
      throw std::invalid_argument("pwm: " + text + "; give at most 32 whole numbers from 0 to 65535, us");
    };
    if (pulses.size() > most_channels) fault(std::to_string(pulses.size()) + " channels");
    pulses_.fill(idle_us);
    for (std::size_t i = 0; i < pulses.size(); ++i) {
      const auto pulse = parse_integer(pulses[i]);
      if (!pulse || *pulse < 0 || *pulse > 0xFFFF) fault("\"" + pulses[i] + "\" is no pulse width");
      ArdupilotJsonDecoder::set_servo(i, static_cast<std::uint16_t>(pulse.value_or(0)));
    }
  }

  void start(HostTime now) noexcept override {
    frame_count_ = 0;
    due_ = now;
    origin_host_.reset();
  }
  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept override {
    arrival_ = arrival;
    JsonTruthDecoder::feed(bytes, input, arrival);
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    const auto result = JsonTruthDecoder::next(truth);
    if (result == TruthResult::ok) truth.acknowledge = true;
    return result;
  }

  std::optional<HostTime> deadline() const noexcept override { return due_; }
  void poll(HostTime now, FrameBuffer& out) noexcept override {
    if (due_ && *due_ <= now) send(now, out);
  }
  void acknowledge(const Truth& truth, TruthTime, std::uint64_t, FrameBuffer& out) noexcept override {
    ++frame_count_;
    const HostTime due = paced(truth.time);
    if (due > arrival_)
      due_ = due;
    else
      send(arrival_, out);
  }
  void set_servo(std::size_t servo, std::uint16_t pulse_us) noexcept override {
    if (servo >= most_channels) return;
    if (servo >= few_channels) channels_ = most_channels;
    pulses_[servo] = pulse_us;
  }

 private:
  QuantitySet chosen(const QuantitySet& given) const noexcept override {
    return (given & quaternion_).any() ? given & ~euler_ : given;
  }

  // Returns the host's time at which a truth with this time is due.
  HostTime paced(TruthTime time) noexcept {
    constexpr Nanoseconds most_behind{100'000'000};
    constexpr double longest_wait_s = 10;  // a later truth is a jump of the simulator's time
    if (speedup_ <= 0) return arrival_;
    const double since_s = 1e-9 * (static_cast<double>(time.ns) - static_cast<double>(origin_truth_.ns)) / speedup_;
    if (origin_host_ && since_s >= 0 && since_s - seconds(arrival_ - *origin_host_) < longest_wait_s) {
      const HostTime due = *origin_host_ + nanoseconds(since_s);
      if (due > arrival_ - most_behind) return due;
    }
    origin_host_ = arrival_;
    origin_truth_ = time;
    return arrival_;
  }

  void send(HostTime now, FrameBuffer& out) noexcept {
    due_ = now + resend_after;
    const std::size_t size = header_size + 2 * channels_;
    const std::span<std::byte> room = out.room(size);
    if (room.empty()) return;
    using boost::endian::endian_store, boost::endian::order;
    auto* at = reinterpret_cast<unsigned char*>(room.data());
    endian_store<std::uint16_t, 2, order::little>(at, channels_ == few_channels ? magic_of_16 : magic_of_32);
    endian_store<std::uint16_t, 2, order::little>(at + 2, rate_hz_);
    endian_store<std::uint32_t, 4, order::little>(at + 4, frame_count_);
    for (std::size_t i = 0; i < channels_; ++i)
      endian_store<std::uint16_t, 2, order::little>(at + header_size + 2 * i, pulses_[i]);
    out.push(size);
  }

  const std::uint16_t rate_hz_;
  const double speedup_;
  const QuantitySet euler_ = set_of(TruthGroup::euler_L), quaternion_ = set_of(TruthGroup::q_LB);
  std::size_t channels_ = few_channels;
  std::array<std::uint16_t, most_channels> pulses_;
  std::uint32_t frame_count_ = 0;
  std::optional<HostTime> due_;  // of the next packet, or of its repetition
  HostTime arrival_;             // of the last datagram
  std::optional<HostTime> origin_host_;
  TruthTime origin_truth_;
};

constexpr Setting settings[] = {
    list_setting(
        "pwm",
        "pulse widths of the servo channels, us; those that are not given are 1000; more than 16: a packet of 32"),
    integer_setting("frame_rate_hz",
                    "frame rate of the servo packets, Hz: the inverse of the step that the simulator should take",
                    1000, 1, 65535),
    real_setting("speedup",
                 "simulated time by the host's time; 0: as fast as the simulator answers, with clock = \"lockstep\"",
                 1.0, 0, 1000),
};

}  // namespace

extern constexpr TruthFormat ardupilot_json_truth_format = {
    .name = "ardupilot-json",
    .summary = "a simulator for ArduPilot's JSON interface, driven by servo packets in the flight stack's place",
    .document = "ArduPilot, libraries/SITL/examples/JSON/readme.md and SIM_JSON.cpp",
    .acknowledges = true,
    .settings = settings,
    .make = make_as<TruthDecoder, ArdupilotJsonDecoder>,
    .force_from = "imu.accel_body",
    .servos = most_channels,
    .example_port = "0.0.0.0:0?peer=127.0.0.1:9002",
};

}  // namespace imud
