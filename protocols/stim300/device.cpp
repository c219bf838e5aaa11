// Sensonor STIM300: Datasheet TS1524 rev. 31 (February 2024), whose tables, sections and equations are named below.
//
// A Normal Mode datagram (Table 5-20), big-endian, two's complement; fields in brackets are optional:
//
// | bytes  | field                                                                                  |
// |--------|----------------------------------------------------------------------------------------|
// | 1      | identifier (Table 5-21)                                                                |
// | 9, 1   | gyro x, y, z, 24 bits each; status (Table 5-23)                                        |
// | [9, 1] | accelerometer                                                                          |
// | [9, 1] | inclinometer                                                                           |
// | [6, 1] | temperature of x, y, z, 16 bits each, 2^-8 deg C; status: for each cluster above       |
// | [3, 1] | PPS, or the AUX of older units; status                                                 |
// | 1      | counter of the internal samples, 2000 a second                                         |
// | 2      | latency, us                                                                            |
// | 4      | CRC-32: polynomial 0x04C11DB7, initial value 0xFFFFFFFF; see crc_of()                  |
// | [2]    | CR LF                                                                                  |
//
// Where the datasheet has no information, the device behaves as captures of real units show: rates saturate at
// 480 deg/s, with the overload bit (UBC-Rocket, Whistler-Blackcomb-v2 d438366), and the latency is 506 us
// (geirhovland/stim300, README).
//
// A frame is sent at the instant of its sample. A real unit needs another 0.5 ms for compensation (figure 7-4). The
// reported times are as in a real unit: the TOV pulse begins, and the time since PPS is measured, one latency after
// the sample. With an external trigger, the frame has the newest sample whose compensation is complete at the edge,
// 0.3 ms after the sample was digitized (figure 7-3). The latency is the time from that sample to the edge (section
// 7.2). The frame is sent at the next sample. With the PPS unit "filtered", the level is as for an open input.
//
// The low-pass filters are of second order, and designed by the cut-off frequency alone. Their group delays therefore
// differ from the datasheet's (Tables 5-3 to 5-9). The filter of the inclinometers is of first order, with their own
// 17 Hz. Their nonlinearity, and the growth of their noise by 35 % towards 1 g (Table 5-8, note 5), are left out.
//
// One setting is stored and reported, but has no effect: the gyros' units "delayed". A real unit then delays the
// gyros by 4 ms to align them with the accelerometers (section 7.5.2.2.1). Here both are aligned already.
//
// The g-compensation (section 7.5.2.2.6) subtracts the bias that the calibration of the gyros predicts for the
// acceleration that the accelerometers or inclinometers have measured, with their own errors and ranges. The
// calibration knows six sevenths of the gyros' sensitivity: with compensation, 1 deg/h/g of 7 is left (Table 5-3,
// from memory). The compensation of the scale factor has nothing to remove, because the modelled scale factor does
// not depend on acceleration.
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/units.hpp"
#include "protocols/stim300/datagram.hpp"
#include "protocols/stim300/measured.hpp"
#include "protocols/stim300/service.hpp"
#include "protocols/stim300/settings.hpp"
#include "protocols/wire/command_reader.hpp"

namespace imud {
namespace {

using namespace stim300;

constexpr Nanoseconds own_latency = std::chrono::microseconds(506);
// Table 5-2.
constexpr Nanoseconds between_triggers = std::chrono::microseconds(500), shortest_tov = std::chrono::microseconds(50);
constexpr Nanoseconds to_first_datagram = std::chrono::milliseconds(100), to_valid = std::chrono::milliseconds(700);
constexpr Nanoseconds compensation = std::chrono::microseconds(300);  // read off figure 7-3
constexpr Nanoseconds internal_step = std::chrono::microseconds(500);

// sample() and poll() begin with advance(). Therefore it makes no difference whether a deadline at the time of a
// sample is polled before this sample. The unit acts on its own only at the instants of its internal samples:
// multiples of 0.5 ms after the newest sample, or after power-on if there was no sample.
class Stim300Device final : public Device {
 public:
  Stim300Device(const Configuration& configuration, bool starts_up) noexcept : starts_up_(starts_up) {
    memory_.stored = memory_.factory = configuration;
    power_on({});
  }

  void power_on(DeviceTime now) noexcept override {
    grid_ = now - internal_step;
    busy_until_ = now;
    triggered_last_.reset();
    pulse_.reset();
    reader_ = {};
    reset(now);
    if (starts_up_) return;
    starting_ = 0;
    valid_at_.reset();
    memory_.errors = {};
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    const DeviceTime now = sample.time;
    advance(now, out);
    measure_raw();
    if (is_external())
      raw_ = sample;
    else
      measure(sample);
    grid_ = now;
    if (!is_running(now))
      measured_.begin_sums();
    else if (is_slot(sample.number()))
      transmit(now + own_latency, own_latency, out);
    if (requested_ != 0) await_slot(now);
    if (starting_ == 0 && is_external() && mode_ == Mode::normal)
      pulse_ = {now + own_latency, now + own_latency + shortest_tov};
  }

  // Table 5-2.
  void trigger(DeviceTime time) noexcept override {
    if (triggered_last_ && time - *triggered_last_ < between_triggers) return;
    triggered_ = triggered_last_ = time;
  }
  void pps(DeviceTime time) noexcept override { pps_ = time; }
  std::optional<Pulse> pulse() const noexcept override { return pulse_; }

  // Section 8: input is not echoed, and wrong input is not answered.
  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override {
    for (std::span<const std::byte> bytes = from_host.bytes; !bytes.empty();) {
      std::size_t taken = 1;
      if (mode_ == Mode::service) {
        const DeviceTime measured_at = measured_.time().value_or(now);
        taken = service_.receive(bytes, next_instant(now) - internal_step, memory_, measured_.axes(),
                                 reading(measured_at + own_latency, own_latency), replies);
        leave_service(now);
      } else {
        reader_.feed(bytes.first(1), now, [&](std::string_view line) { execute_line(line, now, replies); });
      }
      bytes = bytes.subspan(taken);
    }
  }

  std::optional<DeviceTime> deadline() const noexcept override {
    std::optional<DeviceTime> first = valid_at_;
    const auto add = [&](DeviceTime time) { first = std::min(first.value_or(time), time); };
    if (mode_ == Mode::service && service_.exit() != Service::Exit::none) add(service_.leaves_at());
    if (mode_ == Mode::normal && starting_ != 0) add(special_at_);
    if (waits_for_slot()) add(slot_);
    return first;
  }

  void poll(DeviceTime now, FrameBuffer& out) noexcept override {
    advance(now, out);
    if (!waits_for_slot() || now < slot_) return;
    send(now + own_latency, own_latency, out);
    special_sent_ = now;
    await_slot(now);
  }

  void step_clock(Nanoseconds by) noexcept override {
    for (DeviceTime* time : {&grid_, &special_at_, &slot_, &busy_until_}) *time = *time + by;
    for (std::optional<DeviceTime>* time : {&valid_at_, &special_sent_, &triggered_, &triggered_last_, &pps_})
      if (*time) *time = **time + by;
    if (raw_) raw_->time = raw_->time + by;
    if (pulse_) pulse_ = {pulse_->begin + by, pulse_->end + by};
    measured_.step_clock(by);
    service_.step_clock(by);
    reader_.step_clock(by);
  }

  void set_figures(const OwnFigures& figures) noexcept override {
    constexpr double calibrated = 6.0 / 7;
    g_sensitivity_ = calibrated * figures.g_sensitivity;
  }
  UartSettings uart() const noexcept override { return memory_.active.line(); }

  std::optional<SensorFilters> filters() const noexcept override {
    SensorFilters filters;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<int>(i);
      filters.gyro.cut_off_hz[axis] = filters_hz[memory_.active.filters[gyro][i]];
      filters.accelerometer.cut_off_hz[axis] = filters_hz[memory_.active.filters[accelerometer][i]];
      filters.inclinometer.cut_off_hz[axis] = inclinometer_filters_hz[memory_.active.filters[inclinometer][i]];
    }
    filters.inclinometer.order = 1;
    return filters;
  }

 private:
  enum class Mode { normal, utility, service };

  // Returns the instant of the next internal sample, at `now` or later.
  DeviceTime next_instant(DeviceTime now) const noexcept {
    const std::int64_t step = internal_step.count(), since = (now - grid_).count();
    return grid_ + std::max<std::int64_t>(1, (since + step - 1) / step) * internal_step;
  }

  void execute_line(std::string_view line, DeviceTime now, FrameBuffer& replies) noexcept {
    if (mode_ == Mode::utility) {
      if (!execute(memory_, line, replies)) enter_normal(now);
      return;
    }
    constexpr std::array<std::pair<std::string_view, Special>, 5> requests = {
        {{"N", of_part}, {"I", of_serial}, {"C", of_configuration}, {"T", of_trim}, {"E", of_errors}}};
    for (const auto& [word, special] : requests)
      if (line == word) {
        requested_ = special;  // a newer request replaces an older one
        await_slot(now);
      }
    if (line == "R") reset(next_instant(now));
    if (line == "UTILITYMODE") {
      mode_ = Mode::utility;
      greet(replies);
    }
    if (line == "SERVICEMODE") {
      mode_ = Mode::service;
      service_.enter(memory_, replies);
    }
  }

  void enter_normal(DeviceTime now) noexcept {
    mode_ = Mode::normal;
    special_at_ = std::max(special_at_, next_instant(now));
    await_slot(now);
  }

  void leave_service(DeviceTime now) noexcept {
    if (mode_ != Mode::service || service_.exit() == Service::Exit::none || now < service_.leaves_at()) return;
    enter_normal(now);
    if (service_.exit() == Service::Exit::to_init) reset(next_instant(now));
  }

  // Returns true if Init Mode has sent all its special datagrams before `now`.
  bool is_running(DeviceTime now) const noexcept {
    return starting_ == 0 && (!special_sent_ || now > *special_sent_);
  }
  bool is_external() const noexcept { return memory_.active.sample_rate == external_trigger; }
  std::uint64_t samples_per_slot() const noexcept { return 2000 / sample_rates[memory_.active.sample_rate]; }
  bool is_slot(std::uint64_t number) const noexcept { return !is_external() && number % samples_per_slot() == 0; }

  // Restarts the unit. `first` is the instant of its first internal sample.
  void reset(DeviceTime first) noexcept {
    memory_.load();
    memory_.errors = {};
    memory_.set_error(16);  // "Start-up phase active"
    mode_ = Mode::normal;
    special_at_ = first + to_first_datagram;
    valid_at_ = first + to_valid;
    special_sent_.reset();
    requested_ = 0;
    starting_ = of_part | of_serial | of_configuration | (memory_.active.bias_trim_at_start ? of_trim : 0U);
    measured_ = {};
    raw_.reset();
    pps_.reset();
  }

  // Performs all that is scheduled up to `now`, in order of time.
  void advance(DeviceTime now, FrameBuffer& out) noexcept {
    if (special_sent_ != now) pulse_.reset();
    become_valid(now);
    transmit_edge(now, out);
    leave_service(now);
    start_up(now, out);
  }

  void transmit_edge(DeviceTime now, FrameBuffer& out) noexcept {
    if (!triggered_ || *triggered_ > now) return;
    if (is_running(*triggered_) && is_external()) {
      if (raw_ && *triggered_ - raw_->time >= compensation) measure_raw();
      if (const auto from = measured_.time()) transmit(*triggered_, *triggered_ - *from, out);
    }
    triggered_.reset();
  }

  void become_valid(DeviceTime now) noexcept {
    if (!valid_at_ || now < *valid_at_) return;
    valid_at_.reset();
    memory_.errors = {};
  }

  // Sends the next special datagram of Init Mode when it is due (section 7.5.1). Except in Normal Mode, it waits.
  void start_up(DeviceTime now, FrameBuffer& out) noexcept {
    if (mode_ != Mode::normal || starting_ == 0 || now < special_at_) return;
    const DeviceTime validity = now + own_latency;
    if (validity >= busy_until_) {
      const std::size_t characters = send_special(starting_, out);
      occupy(validity, characters, memory_.active.tov_toggles);
      special_sent_ = now;
      if (starting_ == 0) await_slot(now);
    }
    special_at_ = std::max(next_instant(busy_until_ - own_latency), next_instant(now + Nanoseconds{1}));
  }

  // A special datagram that the host requests is sent in the slot of a sample, or by poll() at `slot_` if no sample
  // arrives until then.
  bool waits_for_slot() const noexcept {
    return requested_ != 0 && starting_ == 0 && mode_ == Mode::normal && !is_external();
  }
  void await_slot(DeviceTime now) noexcept {
    if (is_external()) return;
    slot_ = std::max(next_instant(now) + samples_per_slot() * internal_step, next_instant(busy_until_ - own_latency));
  }

  void measure(const Sample& sample) noexcept {
    measured_.add(sample, valid_at_.has_value(), g_sensitivity_, memory_);
  }
  void measure_raw() noexcept {
    if (raw_) measure(*raw_);
    raw_.reset();
  }

  // Sends a measurement or the requested special datagram. The unit measures in every mode, but outside Normal Mode
  // the measurement is lost. `validity`: the time of the sample plus `latency`.
  void transmit(DeviceTime validity, Nanoseconds latency, FrameBuffer& out) noexcept {
    if (mode_ == Mode::normal) send(validity, latency, out);
    measured_.begin_sums();
  }

  void send(DeviceTime validity, Nanoseconds latency, FrameBuffer& out) noexcept {
    if (validity < busy_until_) {
      memory_.set_error(68);  // "UART unable to transmit"
      return;
    }
    const std::size_t characters =
        requested_ != 0 ? send_special(requested_, out)
                        : write_measurement(measured_.axes(), reading(validity, latency), memory_, out);
    occupy(validity, characters, true);
  }

  void occupy(DeviceTime validity, std::size_t characters, bool toggles_tov) noexcept {
    const UartSettings line = memory_.active.line();
    const double on_line = static_cast<double>(characters * line.bits_per_character()) / line.baud;
    busy_until_ = validity + least_period(line, characters);
    if (toggles_tov) pulse_ = {validity, validity + nanoseconds(80e-6 + on_line)};
  }

  // Returns the content of the PPS or AUX field. AUX is 0 V. A filtered PPS is 1, the level of the pull-up. Otherwise
  // the field is the time since the last edge, us (section 7.4.1), or the largest time if there was no edge.
  std::uint32_t pps_at(DeviceTime instant) const noexcept {
    if (memory_.active.has_aux) return 0;
    if (!memory_.active.pps_is_time()) return 1U << 22;
    const double us = pps_ ? std::round(1e6 * seconds(instant - *pps_)) : longest_pps;
    return static_cast<std::uint32_t>(std::clamp(us, 0.0, double{longest_pps}));
  }

  Reading reading(DeviceTime validity, Nanoseconds latency) const noexcept {
    return measured_.reading(pps_at(validity), latency);
  }

  // Sends the first of `specials` and removes it from the set. Returns its number of characters.
  std::size_t send_special(unsigned& specials, FrameBuffer& out) noexcept {
    const auto first = static_cast<Special>(specials & (~specials + 1));
    specials &= ~first;
    return write_special(first, memory_, out);
  }

  const bool starts_up_;
  Memory memory_;
  Mode mode_ = Mode::normal;
  Service service_;
  unsigned starting_ = 0;                   // Specials that Init Mode still has to send (section 7.5.1)
  unsigned requested_ = 0;                  // the Special that replaces the next measurement (section 8); 0: none
  DeviceTime grid_;                         // time of the newest internal sample
  DeviceTime special_at_;                   // time at which the next of `starting_` is sent
  DeviceTime slot_;                         // time at which `requested_` is sent, if there is no sample before
  DeviceTime busy_until_;                   // until when the UART is sending
  std::optional<DeviceTime> valid_at_;      // end of the status "start-up"; nullopt: it has ended
  std::optional<DeviceTime> special_sent_;  // the newest special datagram that was sent without a sample
  std::optional<Sample> raw_;               // with an external trigger the newest sample, until it is compensated
  std::optional<DeviceTime> triggered_, triggered_last_, pps_;
  std::optional<Pulse> pulse_;
  Matrix3 g_sensitivity_ = Matrix3::Zero();  // of the gyros, by their calibration
  Measured measured_;
  CommandReader<99> reader_;  // 99 characters and CR (section 10.2.1)
};

}  // namespace

extern constexpr Protocol stim300_protocol = {
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
    .make_seal = seal_by<stim300::reseal>,
    .has_sync_pins = true,
    .has_self_test = true,
    .product = product,
    .preset = [](const Settings&) -> std::string_view { return "stim300"; },
    .check = [](const Settings& chosen, double) { check(chosen); },
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<Stim300Device>(configuration(settings), settings.flag("start_up"));
    },
    .make_decoder = [](const Settings& settings) -> std::unique_ptr<Decoder> {
      return stim300::make_decoder(configuration(settings));
    },
};

}  // namespace imud
