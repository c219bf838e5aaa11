// MicroStrain MIP as the 3DM-GX5-25, 3DM-GX5-45, 3DM-CV7-AHRS, 3DM-CV7-INS and 3DM-GQ7 use it. The layouts are from
// MicroStrain's mip_sdk (mip/mip.hpp); the tests compare them with its capture of a real device.
//
// Where the document has no information, the device behaves as a user would expect: a unit as delivered streams
// (mip.cpp); reference time is the sensor's own clock; filter and receivers report the truth. These settings have an
// effect: biases, hard and soft iron, mounting, pins, events that an edge triggers, and the settings of the unit's
// own filter in filter_requests.cpp. Other settings of the filter and of events can be written and read, but change
// nothing.
#include <algorithm>
#include <bit>
#include <stdexcept>
#include <tuple>

#include "core/units.hpp"
#include "protocols/mip/field_table.hpp"
#include "protocols/mip/mip.hpp"
#include "protocols/mip/pins.hpp"
#include "protocols/protocol.hpp"
#include "protocols/wire/frame_search.hpp"

namespace imud {
namespace {

using namespace mip;

class MipDevice final : public Device {
 public:
  MipDevice(const Model& model, const Configuration& configuration) noexcept : memory_(model, configuration) {}

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    const std::size_t before = out.frames().size();
    advance(sample.time, out);
    fields_.set_sample(sample);
    if (!memory_.is_idle()) stream(sample, out);
    pins_.sample(sample.time, out);
    memory_.capture(sample, out);
    count(0, out, before);
  }

  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override {
    const std::size_t before = replies.frames().size();
    advance(now, replies);
    if (search_.is_empty()) begun_ = now;
    search_.feed(from_host.bytes, [&](std::span<const std::byte> held) { return parse(held, now, replies); });
    count(from_host.bytes.size(), replies, before);
  }

  std::optional<DeviceTime> deadline() const noexcept override {
    const std::optional<DeviceTime> capture = memory_.deadline();
    if (search_.is_empty()) return capture;
    const DeviceTime command = begun_ + timeout();
    return capture ? std::min(*capture, command) : command;
  }

  void poll(DeviceTime now, FrameBuffer& out) noexcept override {
    const std::size_t before = out.frames().size();
    advance(now, out);
    count(0, out, before);
  }

  void power_on(DeviceTime now) noexcept override {
    search_.finish();
    pins_.restart();
    memory_.restart(fields_, now);
  }

  void step_clock(Nanoseconds by) noexcept override {
    begun_ = begun_ + by;
    pins_.step_clock(by);
    fields_.step_clock(by);
    memory_.step_clock(by);
  }

  void set_figures(const OwnFigures& figures) noexcept override { fields_.set_figures(figures); }
  UartSettings uart() const noexcept override { return {memory_.active().baud}; }

  // Each low-pass filter has a single pole. It acts on all fields of its quantity, also on fields of the filter data.
  std::optional<SensorFilters> filters() const noexcept override {
    const Configuration& active = memory_.active();
    const auto filter = [&](LowPassed quantity) {
      return SensorFilter{.cut_off_hz = Vector3::Constant(active.cut_off_hz(active.low_passes[quantity])),
                          .order = 1};
    };
    return SensorFilters{filter(of_gyros), filter(of_accelerometers), filter(of_magnetometers)};
  }

  NavigationRequests navigation_requests() const noexcept override { return fields_.requests(); }

  void trigger(DeviceTime time) noexcept override { pins_.trigger(time); }
  void pps(DeviceTime time) noexcept override { pins_.pps(time); }
  std::optional<Pulse> pulse() const noexcept override { return pins_.pulse(); }

 private:
  using Search = FrameSearch<longest>;

  // Returns the time, from its first byte on, after which an unfinished command is discarded: 100 ms (mip_parser.h,
  // MIP_PARSER_DEFAULT_TIMEOUT_MS), or one and a half times the duration of the longest packet if this is longer
  // (mip_parser.c, mip_timeout_from_baudrate()).
  Nanoseconds timeout() const noexcept {
    constexpr std::int64_t bits_a_byte = 10, milliseconds = 1500 * bits_a_byte * longest;
    return std::chrono::milliseconds(std::max<std::int64_t>(100, milliseconds / memory_.active().baud));
  }

  // If its time is over, discards a command that was cut off, and executes commands found behind its first byte. Ends
  // a capture of the gyro bias if its time is over.
  void advance(DeviceTime now, FrameBuffer& out) noexcept {
    if (!search_.is_empty() && now >= begun_ + timeout()) {
      begun_ = now;
      search_.resync([&](std::span<const std::byte> held) { return parse(held, now, out); });
    }
    memory_.poll(now, out);
  }

  void count(std::size_t read, const FrameBuffer& out, std::size_t before) noexcept {
    std::size_t written = 0;
    for (const Frame& frame : out.frames().subspan(before)) written += frame.bytes.size();
    memory_.count_bytes(read, written);
  }

  std::size_t parse(std::span<const std::byte> held, DeviceTime now, FrameBuffer& replies) noexcept {
    const auto size = packet_size(held);
    if (size && held.size() < *size) return Search::need_more;
    begun_ = now;  // the bytes after this packet begin now
    if (!size || !is_intact(held.first(*size))) return Search::reject;
    memory_.execute(held.first(*size), now, fields_, replies);
    return *size;
  }

  void stream(const Sample& sample, FrameBuffer& out) noexcept {
    for (const Stream& stream : memory_.active().streams) {
      if (!stream.enabled || stream.count == 0) continue;
      const auto divisor = static_cast<std::uint64_t>(internal_hz) / stream.base_hz;
      if (sample.number() % divisor != 0) continue;
      const std::uint64_t tick = sample.number() / divisor;
      std::uint32_t due = 0;  // bit k: field k
      static_assert(std::tuple_size_v<decltype(stream.format)> <= 32);
      for (std::size_t k = 0; k < stream.count; ++k) due |= (tick % stream.format[k].decimation == 0 ? 1U : 0U) << k;
      if (due == 0) continue;
      const auto for_each_due = [&](auto&& act) {
        for (std::uint32_t left = due; left != 0; left &= left - 1)
          act(stream.format[static_cast<std::size_t>(std::countr_zero(left))].descriptor);
      };
      Packet packet(out, stream.set);
      for_each_due([&](std::uint8_t descriptor) { fields_.put(packet, stream.set, descriptor); });
      packet.finish();
      for_each_due([&](std::uint8_t descriptor) { fields_.sent(stream.set, descriptor); });
    }
  }

  Memory memory_;
  Fields fields_{memory_};
  Pins pins_{memory_, fields_};
  DeviceTime begun_;  // time at which the first of the held bytes was received
  Search search_;
};

constexpr std::array<std::string_view, 5> model_names = {"3dm-gx5-25", "3dm-gx5-45", "3dm-cv7-ahrs", "3dm-cv7-ins",
                                                         "3dm-gq7"};
constexpr std::array<std::string_view, 1> models_own = {default_name};
constexpr std::span<const std::string_view> own = models_own;
constexpr Setting declared[] = {
    text_setting("model", "the device", model_names[0], model_names),
    integer_setting("sensor_rate_hz", "rate of the sensor data, Hz; a divisor of 1000", 100, 1, 1000),
    list_setting(
        "sensor_fields",
        "fields of the sensor data that are streamed, in this order; default: of a GX5 and a GQ7 acceleration, "
        "rate, magnetic_field, pressure; of a CV7 reference_time, acceleration, rate, then of an AHRS "
        "delta_angle, delta_velocity, of an INS magnetic_field, pressure, then temperature, overrange",
        own, field_names<sensor>),
    integer_setting("filter_rate_hz",
                    "rate of the filter data, Hz; a divisor of its base rate; 0: that of the model as delivered", 0,
                    0, 1000),
    list_setting("filter_fields",
                 "fields of the filter data that are streamed; default: of a GX5 none; of a CV7-AHRS "
                 "filter_reference_time, filter_status, filter_euler; of a CV7-INS and a GQ7 filter_shared_gps_time, "
                 "filter_status, filter_position, filter_velocity, filter_quaternion, then of a CV7-INS filter_euler",
                 own, field_names<filter>),
    integer_setting("gnss_rate_hz",
                    "rate of the receivers' data, Hz; a divisor of their base rate (GX5-45: 4, GQ7: 2); 0: that rate",
                    0, 0, 4),
    list_setting("gnss_fields",
                 "fields of the receivers' data that are streamed, by a model with a receiver; default: of a GX5-45 "
                 "none; of a GQ7 gnss_position, gnss_velocity, gnss_dop, gnss_fix",
                 own, field_names<gnss>),
    integer_setting("baud", "speed of the line, bit/s", 115200, 9600, 921600),
};

const Model& model_of(const Settings& settings) {
  return *std::find_if(models.begin(), models.end(),
                       [&](const Model& m) { return m.keyword == settings.text("model"); });
}

std::uint8_t descriptor_of(const Model& model, std::uint8_t set, std::string_view name, const std::string& key) {
  std::string known;
  for (const DataField& field : data_fields()) {
    if (find_field(model, set, field.descriptor) != &field || field.name.empty()) continue;
    if (field.name == name) return field.descriptor;
    known += " " + std::string(field.name);
  }
  throw std::invalid_argument(key + ": there is no \"" + std::string(name) + "\"; known:" + known +
                              "; or give default alone");
}

Stream stream(const Settings& settings, const Model& model, std::uint8_t set, const std::string& prefix,
              std::uint16_t base_hz, std::uint16_t delivered_hz, std::span<const std::string_view> delivered) {
  const std::string rate_key = prefix + "_rate_hz", fields_key = prefix + "_fields";
  const std::vector<std::string>& fields = settings.list(fields_key);
  const bool is_default = fields.size() == 1 && fields[0] == models_own[0];
  Stream stream;
  if (set == 0) {
    if (!is_default && !fields.empty())
      throw std::invalid_argument(fields_key + ": a " + std::string(model.name) + " has none; leave it out");
    return stream;
  }
  const std::int64_t wanted_hz = settings.integer(rate_key), hz = wanted_hz == 0 ? delivered_hz : wanted_hz;
  if (hz > base_hz || base_hz % hz != 0)
    throw std::invalid_argument(rate_key + ": give a divisor of " + std::to_string(base_hz));
  const auto decimation = static_cast<std::uint16_t>(base_hz / hz);
  stream.set = set;
  stream.base_hz = base_hz;
  if (is_default)
    for (const std::string_view name : delivered) stream.add(descriptor_of(model, set, name, fields_key), decimation);
  else
    for (const std::string& name : fields) stream.add(descriptor_of(model, set, name, fields_key), decimation);
  if (fields.size() > stream.format.size() || !fits_a_packet(model, stream))
    throw std::invalid_argument(fields_key + ": they do not fit in one packet; give at most " +
                                std::to_string(stream.format.size()) +
                                " fields, and 255 bytes with the 2 bytes that each field adds");
  return stream;
}

Configuration configuration(const Settings& settings) {
  const Model& model = model_of(settings);
  Configuration c;
  c.baud = static_cast<std::uint32_t>(settings.integer("baud"));
  const auto read = [&](std::uint8_t set, const char* prefix, std::uint16_t base_hz, std::uint16_t delivered_hz,
                        std::span<const std::string_view> delivered) {
    c.streams[slot_of(set == 0 ? std::uint8_t{gnss} : set)] =
        stream(settings, model, set, prefix, base_hz, delivered_hz, delivered);
  };
  constexpr auto sensor_hz = static_cast<std::uint16_t>(internal_hz);
  read(sensor, "sensor", sensor_hz, sensor_hz, model.sensor_fields);
  read(filter, "filter", model.filter_hz, model.filter_stream_hz, model.filter_fields);
  read(model.receivers[0], "gnss", model.gnss_hz, model.gnss_hz, model.gnss_fields);
  if (model.receivers[1] != 0) read(model.receivers[1], "gnss", model.gnss_hz, model.gnss_hz, model.gnss_fields);
  if (model.is(series_7)) {
    c.streams[slot_of(system)].set = system;
    c.streams[slot_of(system)].base_hz = sensor_hz;
  }
  return c;
}

// The magnetometer's 8 G and 400 uG/sqrt(Hz), and the barometer's 0.01 hPa, were taken from memory of the
// 3DM-GX5-25's data sheet.
Product product(const Settings& settings) {
  const Model& model = model_of(settings);
  Product product;
  product.rate_hz = internal_hz;
  product.gyro = TriadErrors::white(model.gyro_noise, internal_hz, model.gyro_max);
  product.accelerometer =
      TriadErrors::white(model.accelerometer_noise, internal_hz, model.accelerometer_max_g * units::standard_gravity);
  product.magnetometer = TriadErrors::white(400e-10, internal_hz, 8e-4);
  product.barometer.noise = 1;
  return product;
}

}  // namespace

extern constexpr Protocol mip_protocol = {
    .name = "mip",
    .summary = "MicroStrain 3DM-GX5-25, -45, 3DM-CV7-AHRS, -INS, 3DM-GQ7: MIP commands, sensor, filter and GNSS data",
    .link = Link::bytes,
    .document = "mip_sdk e5a847d, src/c/mip/definitions",
    .settings = declared,
    .fields = Measurement::rate | Measurement::specific_force,
    .resolution = {.rate = 0x1p-21,
                   .specific_force = 0x1p-20 * units::standard_gravity,
                   .delta_angle = 0x1p-24,
                   .delta_velocity = 0x1p-24 * units::standard_gravity,
                   .temperature_c = 0x1p-17},
    .range = {.rate = 8,
              .specific_force = 15.99 * units::standard_gravity,
              .delta_angle = 1,
              .delta_velocity = 0.99 * units::standard_gravity,
              .temperature_c = 128},
    .counter_bits = 0,
    .status_bits = 0x3F,
    .has_checksum = true,
    .burst_bits = 8,
    .make_seal = seal_by<mip::reseal>,
    .has_sync_pins = true,
    .has_self_test = true,
    .product = product,
    .preset = [](const Settings& settings) { return model_of(settings).preset; },
    .solves = [](const Settings& s) { return model_of(s).is(mip::ins) ? Solves::place : Solves::attitude; },
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<MipDevice>(model_of(settings), configuration(settings));
    },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return mip::make_decoder(); },
};

}  // namespace imud
