// VectorNav VN-100, VN-200 and VN-300: commands and streams. Layouts: vectornav.hpp. The estimates of the product's
// filter are the truth; the filter's settings can be written and read, but change nothing. As in the product,
// compensations (registers 23, 25, 84) take effect immediately, and the reference frame (26) at the next reset.
#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "protocols/command_reader.hpp"
#include "protocols/protocol.hpp"
#include "protocols/vectornav/conformance.hpp"
#include "protocols/vectornav/vectornav.hpp"

namespace imud {

namespace {

using namespace vectornav;

class VectorNavDevice final : public Device {
 public:
  VectorNavDevice(const Model& model, const Configuration& configuration) noexcept
      : model_(model), factory_(configuration), stored_(configuration) {
    reset({});
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    compensate(sample);
    for (Sums& sums : sums_) sums.add(sample_, 1 / model_.internal_hz);
    if (paused_) return;
    const auto ascii_divisor = static_cast<std::uint64_t>(model_.internal_hz) / std::max(1U, port().async_hz);
    if (port().async_type != 0 && sample.counter % ascii_divisor == 0) send_async(out);
    for (std::size_t i = 0; i < active_.binary.size(); ++i)
      if (active_.binary[i].is_streamed() && sample.counter % active_.binary[i].divisor == 0)
        send_binary(i, sample.time, out);
  }

  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override {
    reader_.feed(
        from_host.bytes, now,
        [&](std::string_view line) {
          // The last '$' begins the command: a command that was cut off may stand before it.
          if (const std::size_t begin = line.rfind('$'); begin != std::string_view::npos)
            execute(line.substr(begin + 1), now, replies);
        },
        [&] { send_error(input_overflow, Form::two_digits, replies); });
  }

  void power_on(DeviceTime now) noexcept override {
    reader_.clear();
    reset(now);
  }

  void step_clock(Nanoseconds by) noexcept override {
    start_ = start_ + by;
    sample_.time = sample_.time + by;
    raw_.time = raw_.time + by;
    reader_.step_clock(by);
  }

  UartSettings uart() const noexcept override { return {port().baud}; }

 private:
  static constexpr std::size_t of_ascii = 3, of_polled = 4;
  static constexpr std::size_t any = 99;
  struct Command {
    std::string_view name;
    std::size_t fewest, most;  // parameters
  };
  static constexpr Command commands[] = {// those from VNSGB on change nothing
                                         {"VNRRG", 1, 2},   {"VNWRG", 1, any}, {"VNASY", 1, 1},   {"VNBOM", 1, 1},
                                         {"VNWNV", 0, 0},   {"VNTAR", 0, 0},   {"VNRFS", 0, 0},   {"VNRST", 0, 0},
                                         {"VNSGB", 0, any}, {"VNSFB", 0, any}, {"VNSIH", 0, any}, {"VNKMD", 0, any},
                                         {"VNKAD", 0, any}, {"VNCMD", 0, any}};

  // Keeps only what was stored; discards the measurements. The time since start-up counts from `now`.
  void reset(DeviceTime now) noexcept {
    active_ = stored_;
    dcm_ = active_.reference_frame;
    tare_.setIdentity();
    paused_ = false;
    start_ = now;
    sample_ = {};
    sample_.time = now;
    raw_ = sample_;
    sums_ = {};
  }

  void compensate(const Sample& sample) noexcept {
    const auto& [magnetometer, accelerometer, gyro] = active_.calibrations;
    const double dt = 1 / model_.internal_hz;
    raw_ = sample;
    sample_ = sample;
    for (Vector3* vector :
         {&raw_.magnetic_field, &raw_.specific_force, &raw_.rate, &sample_.delta_angle, &sample_.delta_velocity})
      *vector = dcm_ * *vector;
    constexpr double gauss = 1e-4;
    sample_.magnetic_field = gauss * magnetometer(raw_.magnetic_field / gauss);
    sample_.specific_force = accelerometer(raw_.specific_force);
    sample_.rate = gyro(raw_.rate);
    sample_.delta_velocity = accelerometer.gain * (sample_.delta_velocity - dt * accelerometer.bias);
    sample_.delta_angle = gyro.gain * (sample_.delta_angle - dt * gyro.bias);
    sample_.q_LP = sample.q_LP * Quaternion(dcm_.transpose()).normalized();
  }

  const Configuration::SerialPort& port() const noexcept { return active_.ports[0]; }
  Reading reading(DeviceTime now) const noexcept {
    return {model_, sample_, raw_, tare_, now - start_, now - sample_.time};
  }
  Form async_form() const noexcept {  // register 30, parameter 5: 1, or 3 (2 in vnproglib)
    return active_.number_of(30, 4) >= 2 ? Form::four_digits : Form::two_digits;
  }

  void send_async(FrameBuffer& out) noexcept {
    Message message(out, async_form());
    message.put(name_of(port().async_type, model_));
    const Reading now = reading(sample_.time);
    put_measurement(port().async_type, now, sums_[of_ascii], message);
    put_appended(active_.number_of(30, 0), active_.number_of(30, 1), now, message);
    message.send();
  }

  void send_binary(std::size_t which, DeviceTime now, FrameBuffer& out) noexcept {
    const BinaryOutput& output = active_.binary[which];
    if (output.size() == 0) return;
    BinaryFrame frame(out, longest);
    frame.put(std::uint8_t{0xFA});
    frame.put(static_cast<std::uint8_t>(output.group_bits()));
    for (const std::uint16_t mask : output.masks)
      if (mask != 0) frame.put(mask);
    put_fields(output, reading(now), std::exchange(sums_[which], {}), frame);
    if (frame.size() == 0) return;
    const unsigned crc = crc16(frame.written().subspan(1));
    frame.put(static_cast<std::uint8_t>(crc >> 8));
    frame.put(static_cast<std::uint8_t>(crc));
    frame.push();
  }

  // --- Commands ---
  void execute(std::string_view line, DeviceTime now, FrameBuffer& replies) noexcept {
    const std::size_t star = line.rfind('*');
    const std::string_view body = line.substr(0, star);
    const std::string_view sum = star == std::string_view::npos ? std::string_view() : line.substr(star + 1);
    const Form form = sum.size() == 4 ? Form::four_digits : Form::two_digits;
    Error error = bad_checksum;
    if (sum == "XX" || sum == "XXXX" || is_checksum_of(body, sum)) {
      error = bad_command;
      const bool has_parameters = body.size() > 5 && body[5] == ',';
      if (body.size() == 5 || has_parameters)
        error = execute(body.substr(0, 5), has_parameters ? body.substr(6) : std::string_view(), body, form, now,
                        replies);
    }
    if (error != none) send_error(error, form, replies);
  }

  // Register 30 has the error mode: 0: no message; 1: a message; 2: a message, and the text stream stops.
  void send_error(Error error, Form form, FrameBuffer& replies) noexcept {
    const double mode = active_.number_of(30, 6);
    if (mode == 0) return;
    if (mode == 2) active_.ports[0].async_type = 0;
    std::array<char, 24> text;
    std::snprintf(text.data(), text.size(), "VNERR,%02X", static_cast<unsigned>(error));
    Message(replies, form).put(text.data()).send();
  }

  Error execute(std::string_view name, std::string_view rest, std::string_view body, Form form, DeviceTime now,
                FrameBuffer& replies) noexcept {
    const auto is_it = [&](const Command& command) { return command.name == name; };
    const auto* command = std::find_if(std::begin(commands), std::end(commands), is_it);
    if (command == std::end(commands)) return bad_command;
    const std::size_t given = rest.empty() ? 0 : Words(rest).count;
    if (given < command->fewest) return too_few;
    if (given > command->most) return too_many;
    if (name == "VNRRG") return read_register(rest, body.substr(0, 6), form, now, replies);
    if (name == "VNBOM") {
      const auto which = number_in<unsigned>(rest);
      if (!which || *which < 1 || *which > 3 || active_.binary[*which - 1].size() == 0) return bad_parameter;
      send_binary(*which - 1, now, replies);
      return none;
    }
    if (name == "VNWRG") {
      Configuration changed = active_;
      if (const Error error = write_register(changed, model_, rest); error != none) return error;
      const double load = line_load(changed, model_);
      if (load > 1 && load > line_load(active_, model_)) return insufficient_baud;
      active_ = changed;
      begin_sums(Words(rest));
    } else if (name == "VNASY") {
      if (rest != "0" && rest != "1") return bad_parameter;
      if (paused_ && rest == "1") std::fill_n(sums_.begin(), of_polled, Sums());
      paused_ = rest == "0";
    } else if (name == "VNWNV") {
      stored_ = active_;
    } else if (name == "VNTAR") {
      tare_ = sample_.q_LP.conjugate();  // the present attitude becomes level and north
    } else if (name == "VNRFS") {
      stored_ = factory_;
    }
    Message(replies, form).put(body).send();
    if (name == "VNRFS" || name == "VNRST") reset(now);
    return none;
  }

  // Writing an output restarts its increments.
  void begin_sums(const Words& words) noexcept {
    const unsigned id = number_in<unsigned>(words[0]).value_or(0);
    const bool is_other_port = words.count == 3 && words[2] == "2";
    if (id >= 75 && id <= 77) sums_[id - 75] = {};
    if ((id == 6 || id == 7) && !is_other_port) sums_[of_ascii] = {};
  }

  Error read_register(std::string_view rest, std::string_view name, Form form, DeviceTime now,
                      FrameBuffer& replies) noexcept {
    const std::size_t comma = rest.find(',');
    const std::string_view word = rest.substr(0, comma);
    const std::string_view serial_port =
        comma == std::string_view::npos ? std::string_view() : rest.substr(comma + 1);
    const auto id = number_in<unsigned>(word);
    if (!id) return bad_parameter;
    const bool is_surplus = comma != std::string_view::npos && (*id < 5 || *id > 7);
    Message message(replies, form);
    message.put(name).put(word);
    const unsigned type = type_of_register(*id);
    if (type != 0 && !name_of(type, model_).empty()) {
      if (is_surplus) return too_many;
      put_measurement(type, reading(now), sums_[of_polled], message);
    } else if (const Error error = put_register(active_, model_, *id, serial_port, message); error != none) {
      return error;
    }
    if (is_surplus) return too_many;
    message.send();
    return none;
  }

  const Model& model_;
  const Configuration factory_;
  Configuration stored_, active_;
  bool paused_ = false;
  DeviceTime start_;                   // time of power-on or reset
  Matrix3 dcm_ = Matrix3::Identity();  // register 26: to the host's axes
  Quaternion tare_ = Quaternion::Identity();
  Sample raw_, sample_;       // the newest sample, as sensed and compensated
  std::array<Sums, 5> sums_;  // since the binary outputs, text and register 80 were last sent
  CommandReader<256> reader_;
};

constexpr std::array<std::string_view, 3> model_names = {models[0].keyword, models[1].keyword, models[2].keyword};
constexpr Setting declared[] = {
    {.key = "model", .help = "the device", .initial = models[0].keyword, .choices = model_names},
    {.key = "baud", .help = "speed of the line, bit/s", .initial = std::int64_t{115200}, .min = 9600, .max = 921600},
    {.key = "async_type",
     .help = "register 6: number of the text message that is streamed; 0: none",
     .initial = std::int64_t{14},
     .min = 0,
     .max = 33},
    {.key = "async_hz",
     .help = "register 7: text messages per second, Hz",
     .initial = std::int64_t{40},
     .min = 1,
     .max = 200},
    {.key = "binary_1",
     .help = "register 75: binary output 1, such as \"1,16,01,0029\"",
     .initial = std::string_view("")},
    {.key = "binary_2", .help = "register 76: binary output 2", .initial = std::string_view("")},
    {.key = "binary_3", .help = "register 77: binary output 3", .initial = std::string_view("")},
};

const Model& model_of(const Settings& settings) {
  for (const Model& model : models)
    if (model.keyword == settings.text("model")) return model;
  return models[0];
}

Configuration configuration(const Settings& settings) {
  Configuration c;
  Configuration::SerialPort& port = c.ports[0];
  port.baud = static_cast<unsigned>(settings.integer("baud"));
  if (std::find(bauds.begin(), bauds.end(), port.baud) == bauds.end())
    throw std::invalid_argument("baud: give 9600, 19200, 38400, 57600, 115200, 128000, 230400, 460800 or 921600");
  port.async_type = static_cast<unsigned>(settings.integer("async_type"));
  if (port.async_type != 0 && name_of(port.async_type, model_of(settings)).empty())
    throw std::invalid_argument("async_type: this model has no such message; register 6 of its manual lists them");
  port.async_hz = static_cast<unsigned>(settings.integer("async_hz"));
  if (static_cast<unsigned>(model_of(settings).internal_hz) % port.async_hz != 0)
    throw std::invalid_argument("async_hz: give 1, 2, 4, 5, 10, 20, 25, 40, 50, 100 or 200");
  constexpr std::array<const char*, 3> keys = {"binary_1", "binary_2", "binary_3"};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string& text = settings.text(keys[i]);
    if (text.empty()) continue;
    Error error{};
    const auto output = BinaryOutput::parse(text, error);
    if (!output || text.size() >= Configuration::register_size)
      throw std::invalid_argument(std::string(keys[i]) +
                                  ": give mode, divisor, groups and their masks, such as \"1,16,01,0029\"");
    c.binary[i] = *output;
    Configuration::store(c.binary_text[i], text);
  }
  return c;
}

// From the VN-100's data sheet: 0.0035 deg/s, 0.14 mg and 140 uG per sqrt(Hz); 2000 deg/s, 16 g, 2.5 G; the
// barometer's resolution of 0.042 mbar.
Product product(const Settings& settings) {
  configuration(settings);
  constexpr double gauss = 1e-4;
  Product product;
  product.rate_hz = model_of(settings).internal_hz;
  product.gyro = TriadErrors::white(0.0035 * units::degree, product.rate_hz, 2000 * units::degree);
  product.accelerometer =
      TriadErrors::white(0.14e-3 * units::standard_gravity, product.rate_hz, 16 * units::standard_gravity);
  product.magnetometer = TriadErrors::white(140e-6 * gauss, product.rate_hz, 2.5 * gauss);
  product.barometer.noise = 4.2;
  return product;
}

}  // namespace

extern const Protocol vectornav_protocol;
constexpr Protocol vectornav_protocol = {
    .name = "vectornav",
    .summary =
        "VectorNav VN-100, VN-200, VN-300 as IMU, attitude and GNSS/INS source: commands, registers, text and binary "
        "outputs",
    .link = Link::bytes,
    .document = "vnproglib 1.2; ArduPilot AP_ExternalAHRS_VectorNav",
    .settings = declared,
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
    .product = product,
    .conformance_settings = vectornav::conformance_settings,
    .host_inputs = vectornav::host_inputs,
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<VectorNavDevice>(model_of(settings), configuration(settings));
    },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return vectornav::make_decoder(); },
};

}  // namespace imud
