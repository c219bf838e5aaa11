// Sensonor STIM300: Datasheet TS1524 rev. 31 (February 2024), whose tables, sections and equations are named below.
//
// A Normal Mode datagram (Table 5-20), big-endian, two's complement; what is not in brackets is always there:
//
// | bytes  | field                                                                                  |
// |--------|----------------------------------------------------------------------------------------|
// | 1      | identifier (Table 5-21)                                                                |
// | 9, 1   | gyro x, y, z, 24 bits each; status (Table 5-23)                                        |
// | [9, 1] | accelerometer                                                                          |
// | [9, 1] | inclinometer                                                                           |
// | [6, 1] | temperature of x, y, z, 16 bits each, 2^-8 deg C; status: for each of the three above  |
// | [3, 1] | PPS, or the AUX of older units; status                                                 |
// | 1      | counter of the internal samples, 2000 a second                                         |
// | 2      | latency, us                                                                            |
// | 4      | CRC-32 with the polynomial 0x04C11DB7 from 0xFFFFFFFF, of these and zeros up to a multiple of 4 bytes |
// | [2]    | CR LF                                                                                  |
//
// What the datasheet leaves open follows captures of real units: rates end at 480 deg/s, with overload (UBC-Rocket,
// Whistler-Blackcomb-v2 d438366), the latency is 506 us (geirhovland/stim300, README).
//
// A frame leaves at its sample's instant, not a compensation of 0.5 ms later as a unit's (figure 7-4). What it says
// is what a unit says: TOV falls, and the time since PPS ends, when the latency has gone by since the sample. With an
// external trigger the sample that is sent is the newest whose compensation is done at the edge, 0.3 ms after it was
// digitized (figure 7-3); the latency is the time from it to the edge (section 7.2), and the frame leaves at the next
// sample. The PPS level behind the unit "filtered" is that of an open input.
//
// Configured and reported, but without effect: the low-pass filters and what they delay (group delays of Tables 5-3
// to 5-9). Hence the gyros' units "delayed", too: on a unit they hold the gyros back by the 4 ms by which the
// accelerometers come later (section 7.5.2.2.1); here both come together already. The g-compensation
// (section 7.5.2.2.6) takes away an error that the modelled gyros do not have.
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/units.hpp"
#include "protocols/command_reader.hpp"
#include "protocols/stim300/datagram.hpp"
#include "protocols/stim300/service.hpp"
#include "protocols/stim300/settings.hpp"

namespace imud {

namespace {

using namespace stim300;

constexpr Nanoseconds own_latency = std::chrono::microseconds(506);
// Table 5-2.
constexpr Nanoseconds between_triggers = std::chrono::microseconds(500), shortest_tov = std::chrono::microseconds(50);
constexpr Nanoseconds compensation = std::chrono::microseconds(300);  // drawn in figure 7-3

class Stim300Device final : public Device {
 public:
  Stim300Device(const Configuration& configuration, bool starts_up) noexcept {
    memory_.stored = memory_.factory = configuration;
    reset();
    if (starts_up) return;
    since_reset_ = valid;
    starting_ = 0;
    memory_.errors = {};
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    pulse_.reset();
    if (triggered_ && is_running() && is_external()) {
      if (*triggered_ - now_ >= compensation) measure_raw();
      transmit(*triggered_, *triggered_ - measured_at_, out);
    }
    triggered_.reset();
    measure_raw();
    if (sample.time < now_) {  // simulation time began anew
      busy_until_ = sample.time;
      triggered_last_ = sample.time - std::chrono::seconds(1);
      pps_.reset();
    }
    now_ = sample.time;
    raw_ = sample;
    if (!is_external()) measure_raw();
    service_.pass_sample();
    leave_service();
    if (++since_reset_ <= first_datagram) return;
    if (!is_running() || is_slot(sample.counter)) transmit(now_ + own_latency, own_latency, out);
    if (is_running() && is_external() && mode_ == Mode::normal)
      pulse_ = {now_ + own_latency, now_ + own_latency + shortest_tov};
  }

  // Table 5-2.
  void trigger(DeviceTime time) noexcept override {
    const Nanoseconds since = time - triggered_last_;
    if (since.count() >= 0 && since < between_triggers) return;
    triggered_ = triggered_last_ = time;
  }
  void pps(DeviceTime time) noexcept override { pps_ = time; }
  std::optional<Pulse> pulse() const noexcept override { return pulse_; }

  // Section 8: nothing is echoed, and what is not right is not answered.
  void receive(const Frame& from_host, DeviceTime, FrameBuffer& replies) noexcept override {
    for (std::span<const std::byte> bytes = from_host.bytes; !bytes.empty();) {
      std::size_t taken = 1;
      if (mode_ == Mode::service) {
        taken = service_.take(bytes, memory_, axes_, reading(now_ + own_latency, own_latency), replies);
        leave_service();
      } else {
        reader_.feed(bytes.first(1), now_, [&](std::string_view line) { obey_line(line, replies); });
      }
      bytes = bytes.subspan(taken);
    }
  }

  void power_on(DeviceTime) noexcept override { reset(); }
  UartSettings uart() const noexcept override { return memory_.active.line(); }

 private:
  enum class Mode { normal, utility, service };
  // Internal samples after a reset (Table 5-2: 0.2 s at most, 0.7 s nominal).
  static constexpr std::uint64_t first_datagram = 200, valid = 1400;

  void obey_line(std::string_view line, FrameBuffer& replies) noexcept {
    if (mode_ == Mode::utility) {
      if (!obey(memory_, line, replies)) mode_ = Mode::normal;
      return;
    }
    constexpr std::array<std::pair<std::string_view, Special>, 5> requests = {
        {{"N", of_part}, {"I", of_serial}, {"C", of_configuration}, {"T", of_trim}, {"E", of_errors}}};
    for (const auto& [word, special] : requests)
      if (line == word) requested_ = special;  // the last one asked for
    if (line == "R") reset();
    if (line == "UTILITYMODE") {
      mode_ = Mode::utility;
      greet(replies);
    }
    if (line == "SERVICEMODE") {
      mode_ = Mode::service;
      service_.enter(memory_, replies);
    }
  }

  void leave_service() noexcept {
    if (mode_ != Mode::service || service_.exit() == Service::Exit::none) return;
    mode_ = Mode::normal;
    if (service_.exit() == Service::Exit::to_init) reset();
  }

  // The special datagrams of the start are out: those asked for wait for their slot.
  bool is_running() const noexcept { return since_reset_ > first_datagram && starting_ == 0; }
  bool is_external() const noexcept { return memory_.active.sample_rate == external_trigger; }
  bool is_slot(std::uint64_t counter) const noexcept {
    const unsigned rate = memory_.active.sample_rate;
    return rate != external_trigger && counter % (2000 / sample_rates[rate]) == 0;
  }

  void reset() noexcept {
    memory_.load();
    memory_.errors = {};
    memory_.set_error(16);  // "Start-up phase active"
    mode_ = Mode::normal;
    since_reset_ = 0;
    requested_ = 0;
    starting_ = of_part | of_serial | of_configuration | (memory_.active.bias_trim_at_start ? of_trim : 0U);
    axes_ = {};
    raw_.reset();
    triggered_.reset();
    pps_.reset();
  }

  void measure_raw() noexcept {
    if (raw_) measure(*raw_);
    raw_.reset();
  }

  void measure(const Sample& sample) noexcept {
    if (since_reset_ == valid) memory_.errors = {};
    measured_at_ = sample.time;
    counter_ = sample.counter & 0xFFU;
    const bool outside = sample.temperature_c < -40 || sample.temperature_c > 85;  // Table 5-1
    status_ = (since_reset_ < valid ? status_bit::start_up : 0U) | (outside ? status_bit::outside : 0U) |
              ((sample.status & status::not_valid) != 0 ? status_bit::integrity : 0U);
    temperature_c_ = sample.temperature_c;
    const auto add = [&](Cluster cluster, const Vector3& value, const Vector3& step, unsigned overloaded) {
      constexpr double dt = 1 / internal_hz;
      unsigned bits = status_;
      for (unsigned i = 0; i < 3; ++i)
        if ((overloaded >> i & 1U) != 0) bits |= memory_.overload(cluster, i);
      axes_[cluster].add(value + memory_.trim[cluster], step + dt * memory_.trim[cluster], bits);
    };
    add(gyro, sample.rate / units::degree, sample.delta_angle / units::degree, sample.status & 7U);
    const Vector3 f = sample.specific_force / units::standard_gravity;
    add(accelerometer, f, sample.delta_velocity / units::standard_gravity,
        sample.status / status::accelerometer_saturated_x & 7U);
    unsigned tilted = 0;
    for (int i = 0; i < 3; ++i) tilted |= std::abs(f[i]) >= inclinometer_overload_g ? 1U << i : 0U;
    const Vector3 level = f.cwiseMax(-inclinometer_end_g).cwiseMin(inclinometer_end_g);
    add(inclinometer, level, level / internal_hz, tilted);
  }

  // What is measured goes on in every mode; what is not sent in its slot is lost. `validity`: `latency` after the
  // sample.
  void transmit(DeviceTime validity, Nanoseconds latency, FrameBuffer& out) noexcept {
    if (mode_ == Mode::normal) send(validity, latency, out);
    for (Axes& axes : axes_) axes.begin();
  }

  void send(DeviceTime validity, Nanoseconds latency, FrameBuffer& out) noexcept {
    const bool starts = !is_running();
    if (validity < busy_until_) {
      if (!starts) memory_.set_error(68);  // "UART unable to transmit"
      return;
    }
    unsigned& specials = starts ? starting_ : requested_;
    const std::size_t characters = specials != 0 ? send_special(specials, out)
                                                 : write_measurement(axes_, reading(validity, latency), memory_, out);
    const UartSettings line = memory_.active.line();
    const double on_line = static_cast<double>(characters * line.bits_per_character()) / line.baud;
    busy_until_ = validity + least_period(line, characters);
    if (!starts || memory_.active.tov_toggles) pulse_ = {validity, validity + nanoseconds(80e-6 + on_line)};
  }

  // AUX: 0 V. Filtered PPS: 1, of the pull-up. Otherwise in us (section 7.4.1); without an edge as long as can be
  // said.
  std::uint32_t pps_at(DeviceTime instant) const noexcept {
    if (memory_.active.has_aux) return 0;
    if (!memory_.active.pps_is_time()) return 1U << 22;
    const double us = pps_ ? std::round(1e6 * seconds(instant - *pps_)) : longest_pps;
    return us < -1e3 ? longest_pps : static_cast<std::uint32_t>(std::clamp(us, 0.0, double{longest_pps}));
  }

  Reading reading(DeviceTime validity, Nanoseconds latency) const noexcept {
    const std::uint32_t pps = pps_at(validity);
    return {.temperature_c = temperature_c_,
            .status = status_,
            .pps = pps,
            .pps_status = status_ | (pps == longest_pps ? status_bit::overload : 0U),
            .counter = counter_,
            .latency_us = static_cast<unsigned>(std::clamp(std::llround(1e6 * seconds(latency)), 0LL, 0xFFFFLL))};
  }

  // The first of them, which is done with then.
  std::size_t send_special(unsigned& specials, FrameBuffer& out) noexcept {
    const auto first = static_cast<Special>(specials & (~specials + 1));
    specials &= ~first;
    return write_special(first, memory_, out);
  }

  Memory memory_;
  Mode mode_ = Mode::normal;
  Service service_;
  std::uint64_t since_reset_ = 0;  // internal samples
  unsigned starting_ = 0;          // Specials that Init Mode still has to send (section 7.5.1)
  unsigned requested_ = 0;         // the Special that takes the place of the next measurement, or none (section 8)
  std::optional<Sample> raw_;      // whose compensation is not done
  DeviceTime now_, measured_at_, busy_until_, triggered_last_;
  std::optional<DeviceTime> triggered_, pps_;
  std::optional<Pulse> pulse_;
  std::array<Axes, 3> axes_;  // of the clusters
  unsigned status_ = 0;       // bits of all
  unsigned counter_ = 0;
  double temperature_c_ = 0;
  CommandReader<99> reader_;  // and CR (section 10.2.1)
};

}  // namespace

extern const Protocol stim300_protocol;
constexpr Protocol stim300_protocol = {
    .name = "stim300",
    .summary = "Sensonor STIM300: Normal Mode with every datagram, start-up, Utility and Service Mode",
    .link = Link::bytes,
    .document = "Sensonor TS1524 rev. 31, February 2024",
    .settings = declared_settings,
    .fields = Measurement::counter | Measurement::rate | Measurement::specific_force | Measurement::temperature |
              Measurement::status,
    .resolution = {.rate = 0x1p-14 * units::degree,
                   .specific_force = 0x1p-19 * units::standard_gravity,
                   .temperature_c = 0x1p-8},
    .range = {.rate = (0x1p23 - 1) * 0x1p-14 * units::degree,
              .specific_force = (0x1p23 - 1) * 0x1p-19 * units::standard_gravity,
              .temperature_c = 127.99},
    .counter_bits = 8,
    .sends_some_samples = true,
    .status_bits = 0x3F | status::not_valid,
    .has_checksum = true,
    .burst_bits = 32,
    .has_sync_pins = true,
    .product = product,
    .trial = "sample_rate=2000 bit_rate=1843200 start_up=false",
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<Stim300Device>(configuration(settings), settings.flag("start_up"));
    },
    .make_decoder = [](const Settings& settings) -> std::unique_ptr<Decoder> {
      return stim300::make_decoder(configuration(settings));
    },
};

}  // namespace imud
