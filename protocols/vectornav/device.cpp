// VectorNav VN-100, VN-200 and VN-300: commands and streams. Layouts: vectornav.hpp. The estimates of the product's
// filter are the solution of the unit's own filter if the sample has one, otherwise the truth. filter_requests.hpp
// has the commands by which the host acts on this filter; its other settings can be written and read, but change
// nothing. A window of register 85 filters the measurements if its mode includes compensated measurements (2, 3);
// then the uncompensated measurements are filtered as well. The windows of temperature and pressure change nothing.
// As in the product, compensations (registers 23, 25, 84) take effect immediately, and the reference frame (26) at
// the next reset.
//
// An answer leaves at the UART at which its command came. VNASY acts on this UART, and so do registers 5 to 7, unless
// the host names the other UART (VN-200 user manual UM004, page 31; UM001, page 56).
#include <algorithm>
#include <cstdio>
#include <utility>

#include "core/numbers/dispatch.hpp"
#include "core/units.hpp"
#include "protocols/protocol.hpp"
#include "protocols/vectornav/filter_requests.hpp"
#include "protocols/vectornav/ins_mode.hpp"
#include "protocols/vectornav/vectornav.hpp"
#include "protocols/wire/command_reader.hpp"

namespace imud {
namespace {

using namespace vectornav;

class VectorNavDevice final : public Device {
 public:
  VectorNavDevice(const Model& model, unsigned host_uart, const Configuration& configuration) noexcept
      : model_(model), host_uart_(host_uart), factory_(configuration), stored_(configuration) {
    reset({});
    for (unsigned id = 75; id <= 77; ++id) count_unconnected(id, host_uart_);
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    const bool has_event = pins_.sample(active_.sync, pulse_source(), sample);
    if (active_.sync.in == SyncControl::In::imu_sample && !has_event) {
      const Sample before = sample_;
      const Sensed raw_before = raw_;
      compensate(sample);  // only its increments count
      sample_ = before;
      raw_ = raw_before;
      return;
    }
    compensate(sample);
    const std::uint64_t k = active_.sync.in == SyncControl::In::imu_sample ? events_++ : sample.number();
    const auto is_due = [&](std::uint64_t divisor) {
      if (active_.sync.in == SyncControl::In::async_all) return has_event;
      if (divisor == 0) return active_.sync.in == SyncControl::In::async_rate_0 && has_event;
      return k % divisor == 0;
    };
    for (unsigned uart = 0; uart < uarts; ++uart) {
      const auto& [baud, type, hz] = active_.ports[uart];
      if (type == 0 || !is_streaming(uart)) continue;
      if (is_due(hz == 0 ? 0 : static_cast<std::uint64_t>(model_.internal_hz) / hz)) send_async(uart, out);
    }
    for (std::size_t i = 0; i < active_.binary.size(); ++i)
      if (active_.binary[i].mode != 0 && is_due(active_.binary[i].divisor)) stream_binary(i, out);
  }

  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override {
    const unsigned uart = from_host.uart == 0 ? host_uart_ : 1 - host_uart_;
    Dialogue dialogue{uart, Form::two_digits, now, replies};
    readers_[uart].feed(
        from_host.bytes, now,
        [&](std::string_view line) {
          // The last '$' begins the command: a command that was cut off may stand before it.
          if (const std::size_t begin = line.rfind('$'); begin != std::string_view::npos)
            execute(line.substr(begin + 1), dialogue);
        },
        [&] {
          dialogue.form = Form::two_digits;
          send_error(input_overflow, dialogue);
        });
  }

  void power_on(DeviceTime now) noexcept override {
    for (Reader& reader : readers_) reader.clear();
    reset(now);
    filter_.power_on();
  }

  void step_clock(Nanoseconds by) noexcept override {
    start_ = start_ + by;
    sample_.time = sample_.time + by;
    pins_.step_clock(by);
    for (Reader& reader : readers_) reader.step_clock(by);
  }

  void set_figures(const OwnFigures& figures) noexcept override { figures_ = figures; }
  UartSettings uart() const noexcept override { return {active_.ports[host_uart_].baud}; }

  void connect_second_uart() noexcept override {
    is_second_connected_ = true;
    unconnected_outputs_[0] = 0;
  }
  UartSettings second_uart() const noexcept override { return {active_.ports[1 - host_uart_].baud}; }
  std::span<const std::uint64_t> counts() const noexcept override { return unconnected_outputs_; }

  std::optional<SensorFilters> filters() const noexcept override {
    // Register 85: the windows of magnetometer, accelerometer, gyro, temperature and pressure, then their modes.
    const auto boxcar = [this](std::size_t sensor) {
      constexpr double compensated = 2, both = 3;
      const double window = active_.number_of(85, sensor), mode = active_.number_of(85, 5 + sensor);
      SensorFilter filter;
      if ((mode == compensated || mode == both) && window > 1)
        filter.length = static_cast<int>(std::min<double>(window, longest_boxcar));
      return filter;
    };
    return SensorFilters{.gyro = boxcar(2), .accelerometer = boxcar(1), .magnetometer = boxcar(0)};
  }

  NavigationRequests navigation_requests() const noexcept override {
    return filter_.requests(active_.calibrations[0], dcm_.matrix(), active_.number_of(67, 0));
  }

  void trigger(DeviceTime time) noexcept override { pins_.edge(active_.sync, pulse_source(), time); }
  void pps(DeviceTime time) noexcept override { pins_.pps_edge(active_.sync, pulse_source(), time); }
  std::optional<Pulse> pulse() const noexcept override { return pins_.pulse(); }

 private:
  static constexpr unsigned uarts = 2;
  // Indices of sums_: the binary outputs come first, the second port's text is the last.
  static constexpr std::size_t of_polled = 3, of_text = 4;
  static constexpr std::size_t any = 99;
  using Reader = CommandReader<256>;
  struct Command {
    std::string_view name;
    std::size_t fewest, most;  // parameters
  };
  static constexpr Command commands[] = {// VNSGB, VNSFB and VNCMD change nothing
                                         {"VNRRG", 1, 2},   {"VNWRG", 1, any}, {"VNASY", 1, 1},   {"VNBOM", 1, 1},
                                         {"VNWNV", 0, 0},   {"VNTAR", 0, 0},   {"VNRFS", 0, 0},   {"VNRST", 0, 0},
                                         {"VNSGB", 0, any}, {"VNSFB", 0, any}, {"VNSIH", 0, any}, {"VNKMD", 0, any},
                                         {"VNKAD", 0, any}, {"VNCMD", 0, any}};
  // A command is answered at its UART, with its kind of checksum.
  struct Dialogue {
    unsigned uart;
    Form form;
    DeviceTime now;
    FrameBuffer& replies;
  };

  // Keeps only what was stored; discards the measurements. The time since start-up counts from `now`.
  void reset(DeviceTime now) noexcept {
    active_ = stored_;
    dcm_ = active_.reference_frame;
    q_ = Quaternion(dcm_.matrix().transpose()).normalized();
    tare_.setIdentity();
    paused_ = {};
    pins_.reset();
    events_ = 0;
    start_ = now;
    sample_ = {};
    sample_.time = now;
    raw_ = {};
    sums_ = {};
    place_.restart();
  }

  IMUD_DISPATCHED void compensate(const Sample& sample) noexcept {
    const auto& [magnetometer, accelerometer, gyro] = active_.calibrations;
    const double dt = 1 / model_.internal_hz;
    raw_ = {dcm_ * sample.magnetic_field, dcm_ * sample.specific_force, dcm_ * sample.rate};
    copy(sample, sample_);
    sample_.magnetic_field = units::gauss * magnetometer(raw_.magnetic_field / units::gauss);
    sample_.specific_force = accelerometer(raw_.specific_force);
    sample_.rate = gyro(raw_.rate);
    if (sample.solution) subtract_biases(*sample.solution);
    sample_.delta_velocity = accelerometer.gain * (dcm_ * sample.delta_velocity - dt * accelerometer.bias);
    sample_.delta_angle = gyro.gain * (dcm_ * sample.delta_angle - dt * gyro.bias);
    sample_.q_LP = sample.q_LP * q_;
    place_.hold(sample_);
    const std::size_t used = is_second_connected_ ? sums_.size() : sums_.size() - 1;
    const Lanes delta_angle = lanes(sample_.delta_angle), delta_velocity = lanes(sample_.delta_velocity);
    for (std::size_t i = 0; i < used; ++i) sums_[i].add(delta_angle, delta_velocity, dt);
  }

  // Subtracts the biases that the unit's own filter has estimated. The filter integrates the uncompensated
  // measurements of the sensors: its biases include the biases in registers 84 and 25, which are subtracted already.
  // It has no biases while it aligns, and only the gyros' if it estimates the attitude alone. The increments are not
  // compensated, as in a product as delivered (register 82).
  void subtract_biases(const Solution& solution) noexcept {
    const auto& [magnetometer, accelerometer, gyro] = active_.calibrations;
    if (solution.state == Solution::State::aligning) return;
    sample_.rate -= gyro.gain * (dcm_ * Vector3(solution.gyro_bias.cast<double>()) - gyro.bias);
    if (solution.state == Solution::State::levelled) return;
    sample_.specific_force -=
        accelerometer.gain * (dcm_ * Vector3(solution.accelerometer_bias.cast<double>()) - accelerometer.bias);
  }

  Sums& text_sums(unsigned uart) noexcept { return sums_[of_text + frame_uart(uart)]; }
  std::uint8_t frame_uart(unsigned uart) const noexcept { return uart == host_uart_ ? 0 : 1; }
  bool is_connected(unsigned uart) const noexcept { return uart == host_uart_ || is_second_connected_; }
  bool is_streaming(unsigned uart) const noexcept { return is_connected(uart) && !paused_[uart]; }
  PulseSource pulse_source() const noexcept {
    return model_.receivers == 0 ? PulseSource::none : active_.pulse_source;
  }
  Reading reading(DeviceTime now) const noexcept {
    const DeviceTime stamp = std::max(now + (sample_.stamp() - sample_.time), start_);
    return {model_, sample_, raw_, figures_, tare_, stamp - start_, stamp - sample_.time, pins_.status(now)};
  }
  Form async_form() const noexcept {  // register 30, parameter 5: 1, or 3 (2 in vnproglib)
    return active_.number_of(30, 4) >= 2 ? Form::four_digits : Form::two_digits;
  }

  void send_async(unsigned uart, FrameBuffer& out) noexcept {
    const unsigned type = active_.ports[uart].async_type;
    Message message(out, async_form(), frame_uart(uart));
    message.put(name_of(type, model_));
    const Reading now = reading(sample_.time);
    put_measurement(type, now, text_sums(uart), message);
    put_appended(active_.number_of(30, 0), active_.number_of(30, 1), now, message);
    message.send();
  }

  void stream_binary(std::size_t which, FrameBuffer& out) noexcept {
    bool is_sent = false;
    for (unsigned uart = 0; uart < uarts; ++uart) {
      if (!active_.binary[which].goes_to(uart) || !is_streaming(uart)) continue;
      if (is_sent)
        out.repeat(frame_uart(uart));
      else
        is_sent = send_binary(which, uart, sample_.time, out);
    }
  }

  // Returns false if there is no frame: the output has no fields, or there is no room.
  bool send_binary(std::size_t which, unsigned uart, DeviceTime now, FrameBuffer& out) noexcept {
    const BinaryOutput& output = active_.binary[which];
    if (output.size() == 0) return false;
    BinaryFrame frame(out, longest);
    frame.put(std::uint8_t{0xFA});
    frame.put(static_cast<std::uint8_t>(output.group_bits()));
    for (const std::uint16_t mask : output.masks)
      if (mask != 0) frame.put(mask);
    put_fields(output, reading(now), std::exchange(sums_[which], {}), frame);
    if (frame.size() == 0) return false;
    const unsigned crc = crc16(frame.written().subspan(1));
    frame.put(static_cast<std::uint8_t>(crc >> 8));
    frame.put(static_cast<std::uint8_t>(crc));
    frame.push(frame_uart(uart));
    return true;
  }

  void execute(std::string_view line, Dialogue& dialogue) noexcept {
    const std::size_t star = line.rfind('*');
    const std::string_view body = line.substr(0, star);
    const std::string_view sum = star == std::string_view::npos ? std::string_view() : line.substr(star + 1);
    dialogue.form = sum.size() == 4 ? Form::four_digits : Form::two_digits;
    Error error = bad_checksum;
    if (sum == "XX" || sum == "XXXX" || is_checksum_of(body, sum)) {
      error = bad_command;
      const bool has_parameters = body.size() > 5 && body[5] == ',';
      if (body.size() == 5 || has_parameters)
        error = execute(body.substr(0, 5), has_parameters ? body.substr(6) : std::string_view(), body, dialogue);
    }
    if (error != none) send_error(error, dialogue);
  }

  // Register 30 has the error mode: 0: no message; 1: a message; 2: a message, and the text stream stops.
  void send_error(Error error, const Dialogue& dialogue) noexcept {
    const double mode = active_.number_of(30, 6);
    if (mode == 0) return;
    if (mode == 2) active_.ports[dialogue.uart].async_type = 0;
    std::array<char, 24> text;
    std::snprintf(text.data(), text.size(), "VNERR,%02X", static_cast<unsigned>(error));
    answer(dialogue).put(text.data()).send();
  }

  Message answer(const Dialogue& dialogue) const noexcept {
    return {dialogue.replies, dialogue.form, frame_uart(dialogue.uart)};
  }

  Error execute(std::string_view name, std::string_view rest, std::string_view body,
                const Dialogue& dialogue) noexcept {
    const auto is_it = [&](const Command& command) { return command.name == name; };
    const auto* command = std::find_if(std::begin(commands), std::end(commands), is_it);
    if (command == std::end(commands)) return bad_command;
    const std::size_t given = rest.empty() ? 0 : Words(rest).count;
    if (given < command->fewest) return too_few;
    if (given > command->most) return too_many;
    if (name == "VNRRG") return read_register(rest, body.substr(0, 6), dialogue);
    if (name == "VNBOM") {
      const auto which = number_in<unsigned>(rest);
      if (!which || *which < 1 || *which > 3 || active_.binary[*which - 1].size() == 0) return bad_parameter;
      send_binary(*which - 1, dialogue.uart, dialogue.now, dialogue.replies);
      return none;
    }
    if (name == "VNWRG") {
      if (const Error error = write(rest, dialogue); error != none) return error;
    } else if (name == "VNASY") {
      if (rest != "0" && rest != "1") return bad_parameter;
      if (paused_[dialogue.uart] && rest == "1") resume(dialogue.uart);
      paused_[dialogue.uart] = rest == "0";
    } else if (name == "VNWNV") {
      stored_ = active_;
    } else if (name == "VNTAR") {
      tare_ = sample_.q_LP.conjugate();  // the present attitude becomes level and north
    } else if (name == "VNRFS") {
      stored_ = factory_;
    } else if (!filter_.execute(name, rest, q_)) {
      return bad_parameter;
    }
    answer(dialogue).put(body).send();
    if (name == "VNRFS" || name == "VNRST") {
      reset(dialogue.now);
      filter_.reset();
    }
    return none;
  }

  // Restarts the increments of the UART's outputs, except outputs that the other UART has been streaming meanwhile.
  void resume(unsigned uart) noexcept {
    const unsigned other = 1 - uart;
    for (std::size_t i = 0; i < active_.binary.size(); ++i) {
      const BinaryOutput& output = active_.binary[i];
      if (output.goes_to(uart) && !(output.goes_to(other) && is_streaming(other))) sums_[i] = {};
    }
    text_sums(uart) = {};
  }

  Error write(std::string_view rest, const Dialogue& dialogue) noexcept {
    Configuration changed = active_;
    if (const Error error = write_register(changed, model_, dialogue.uart, rest); error != none) return error;
    // The load of a UART that is not connected does not matter; count_unconnected() reports it.
    for (unsigned uart = 0; uart < uarts; ++uart) {
      const double load = line_load(changed, model_, uart);
      if (is_connected(uart) && load > 1 && load > line_load(active_, model_, uart)) return insufficient_baud;
    }
    active_ = changed;
    const Words words(rest);
    const unsigned id = number_in<unsigned>(words[0]).value_or(0);
    const unsigned uart = words.count == 3 ? uart_in(words[2], dialogue.uart).value_or(0) : dialogue.uart;
    count_unconnected(id, uart);
    // Writing an output restarts its increments.
    if (id >= 75 && id <= 77) sums_[id - 75] = {};
    if (id == 6 || id == 7) text_sums(uart) = {};
    if (id == 33) {
      if (number_in<unsigned>(words[1]) == 0U) pins_.reset_in_count();
      if (number_in<unsigned>(words[3]) == 0U) pins_.reset_out_count();
    }
    return none;
  }

  // Counts an output that register `id` directs only to the UART that is not connected.
  void count_unconnected(unsigned id, unsigned uart) noexcept {
    const unsigned other = 1 - host_uart_;
    if (is_connected(other)) return;
    const bool is_text = id == 6 && uart == other && active_.ports[other].async_type != 0;
    const bool is_binary =
        id >= 75 && id <= 77 && active_.binary[id - 75].mode == 1U << other && active_.binary[id - 75].size() != 0;
    unconnected_outputs_[0] += is_text || is_binary;
  }

  Error read_register(std::string_view rest, std::string_view name, const Dialogue& dialogue) noexcept {
    const std::size_t comma = rest.find(',');
    const std::string_view word = rest.substr(0, comma);
    const std::string_view serial_port =
        comma == std::string_view::npos ? std::string_view() : rest.substr(comma + 1);
    const auto id = number_in<unsigned>(word);
    if (!id) return bad_parameter;
    const bool is_surplus = comma != std::string_view::npos && (*id < 5 || *id > 7);
    Message message = answer(dialogue);
    message.put(name).put(word);
    const unsigned type = type_of_register(*id);
    if (is_measured(type, model_)) {
      if (is_surplus) return too_many;
      put_measurement(type, reading(dialogue.now), sums_[of_polled], message);
    } else if (const Error error = put_register(active_, model_, *id, dialogue.uart, serial_port, message);
               error != none) {
      return error;
    }
    if (is_surplus) return too_many;
    message.send();
    return none;
  }

  const Model model_;
  const unsigned host_uart_;  // the UART at the port
  bool is_second_connected_ = false;
  std::array<std::uint64_t, 1> unconnected_outputs_ = {};  // as `counters`
  const Configuration factory_;
  Configuration stored_, active_;
  std::array<bool, uarts> paused_ = {};
  SyncPins pins_;
  std::uint64_t events_ = 0;               // of SyncIn at which the IMU has sampled
  DeviceTime start_;                       // time of power-on or reset
  Gain dcm_;                               // register 26: to the host's axes
  Quaternion q_ = Quaternion::Identity();  // from the host's axes
  Quaternion tare_ = Quaternion::Identity();
  OwnFigures figures_;
  Sensed raw_;
  Sample sample_;  // the newest, compensated
  InsPlace place_;
  FilterRequests filter_;
  std::array<Sums, of_text + uarts> sums_;  // since the binary outputs, text and register 80 were last sent
  std::array<Reader, uarts> readers_;
};

constexpr DeviceCounter counters[] = {
    {"unconnected_outputs", "outputs turned to a UART that is not connected",
     "the host has turned an output to the UART that is not connected; give second_port, or device.uart for the UART "
     "at port"}};

}  // namespace

extern constexpr Protocol vectornav_protocol = {
    .name = "vectornav",
    .summary =
        "VectorNav VN-100, VN-200, VN-300 as IMU, attitude and GNSS/INS source: commands, registers, text and binary "
        "outputs",
    .link = Link::bytes,
    .document = "vnproglib 1.2; ArduPilot AP_ExternalAHRS_VectorNav",
    .settings = declared_settings,
    .fields = Measurement::rate | Measurement::specific_force | Measurement::delta_angle |
              Measurement::delta_velocity | Measurement::temperature | Measurement::status,
    .resolution = {.rate = 0x1p-18,
                   .specific_force = 0x1p-16,
                   .delta_angle = 0x1p-18 * units::degree,
                   .delta_velocity = 0x1p-20,
                   .temperature_c = 0x1p-17},
    .range = {.rate = 63, .specific_force = 255, .delta_angle = 1, .delta_velocity = 15, .temperature_c = 128},
    .counter_bits = 0,
    .status_bits = 0x3F,
    .has_checksum = true,
    .burst_bits = 16,
    .make_seal = seal_by<vectornav::reseal>,
    .has_sync_pins = true,
    .has_second_uart = true,
    .counters = counters,
    .product = vectornav::product_of,
    .preset = [](const Settings&) -> std::string_view { return "vn-100"; },
    .solves =
        [](const Settings& settings) { return model_of(settings).receivers > 0 ? Solves::place : Solves::attitude; },
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<VectorNavDevice>(model_of(settings), uart_of(settings), configuration_of(settings));
    },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return vectornav::make_decoder(); },
};

}  // namespace imud
