// NASA's NOS3 generic_imu: answers requests of flight software on CAN. Big-endian; no checksum.
//
// Layouts: nasa-itc/generic_imu, fsw/shared/generic_imu_device.c and sim/src/generic_imu_hardware_model.cpp, whose
// code differs from its README. The flight software's library sends a request, waits 5 ms, and takes the first frame
// that has arrived, whatever its identifier. Therefore no other frames may be sent on its interface.
//
// | frame        | identifier   | data                                                               |
// |--------------|--------------|--------------------------------------------------------------------|
// | request      | `request_id` | 80, command: 0 no operation, 1 housekeeping, 2, 3, 4 axis x, y, z  |
// | housekeeping | `reply_id`   | u32 number of commands so far, u32 status (0)                      |
// | axis         | `reply_id`   | u32 (acceleration/g + 10) * 214748364, u32 (rate/(deg/s) + 400) * 5368709 |
//
// NOS3's simulator rounds down; here numbers are rounded to nearest. The simulator does not answer command 0 and
// unknown commands. It counts command 0.
#include "protocols/signals/signal_product.hpp"

namespace imud {
namespace {

constexpr std::size_t request_size = 2, reply_size = 8;
constexpr std::byte request_mark{0x80};
constexpr unsigned no_operation = 0, housekeeping = 1, axis_x = 2, axis_z = 4;
constexpr double force_lsb = 1 / 214748364.0, rate_lsb = 1 / 5368709.0;  // g, deg/s
constexpr double requests_per_s = 100;                                   // an assumption: four every 40 ms

constexpr CanSignal axis(int field, std::string_view source) {
  return field == 0 ? CanSignal{"Acceleration", 7, 32, motorola_unsigned, force_lsb, -10, source}
                    : CanSignal{"Rate", 39, 32, motorola_unsigned, rate_lsb, -400, source};
}
constexpr CanSignal axes[3][2] = {{axis(0, "specific_force_x_g"), axis(1, "rate_x_deg_per_s")},
                                  {axis(0, "specific_force_y_g"), axis(1, "rate_y_deg_per_s")},
                                  {axis(0, "specific_force_z_g"), axis(1, "rate_z_deg_per_s")}};

class Nos3Device final : public Device {
 public:
  explicit Nos3Device(const Settings& settings)
      : request_id_(static_cast<std::uint32_t>(settings.integer("request_id"))),
        reply_id_(static_cast<std::uint32_t>(settings.integer("reply_id"))),
        with_requests_(settings.flag("with_requests")) {}

  void power_on(DeviceTime) noexcept override { commands_ = 0; }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    newest_ = sample;
    if (!with_requests_) return;
    for (unsigned command = axis_x; command <= axis_z; ++command) {
      const std::span<std::byte> room = out.room(request_size);
      if (room.empty()) return;
      room[0] = request_mark;
      room[1] = static_cast<std::byte>(command);
      out.push(request_size, {.id = request_id_});
      answer(command, out);
    }
  }

  void receive(const Frame& from_host, DeviceTime, FrameBuffer& replies) noexcept override {
    const CanHeader& can = from_host.can;
    if (can.id != request_id_ || can.extended || can.remote || can.error || can.fd) return;
    if (from_host.bytes.size() != request_size || from_host.bytes[0] != request_mark) {
      ++refused_;
    } else {
      answer(std::to_integer<unsigned>(from_host.bytes[1]), replies);
    }
  }

  std::span<const std::uint64_t> counts() const noexcept override { return {&refused_, 1}; }

 private:
  void answer(unsigned command, FrameBuffer& out) noexcept {
    if (command > axis_z) {
      ++refused_;
      return;
    }
    if (const std::span<std::byte> room = out.room(reply_size);
        command != no_operation && room.size() == reply_size) {
      if (command == housekeeping) {
        write_bits(room, 7, 32, true, commands_);
        write_bits(room, 39, 32, true, 0);
      } else {
        codecs_[command - axis_x].encode({newest_}, 0, room);
      }
      out.push(reply_size, {.id = reply_id_});
    }
    ++commands_;
  }

  std::uint32_t request_id_, reply_id_;
  bool with_requests_;
  const CanSignalCodec codecs_[3] = {{reply_size, axes[0]}, {reply_size, axes[1]}, {reply_size, axes[2]}};
  Sample newest_;
  std::uint32_t commands_ = 0;  // wraps
  std::uint64_t refused_ = 0;
};

// Decodes replies. A reply does not state its axis: the decoder needs the requests as well.
class Nos3Decoder final : public Decoder {
 public:
  explicit Nos3Decoder(const Settings& settings)
      : request_id_(static_cast<std::uint32_t>(settings.integer("request_id"))),
        reply_id_(static_cast<std::uint32_t>(settings.integer("reply_id"))) {}

  void feed(const Frame& frame, MeasurementSink& sink) override {
    const CanHeader& can = frame.can;
    if (can.extended || can.remote || can.error || can.fd) return;
    if (can.id == request_id_ && frame.bytes.size() == request_size) {
      command_ = frame.bytes[0] == request_mark ? std::to_integer<unsigned>(frame.bytes[1]) : 0;
      if (command_ == axis_x) begin();
    } else if (can.id == reply_id_) {
      if (frame.bytes.size() != reply_size) {
        ++errors_.malformed;
      } else if (command_ >= axis_x && command_ <= axis_z) {
        static_cast<void>(codecs_[command_ - axis_x].decode(frame.bytes, read_));
        if (command_ == axis_z) end(sink);
      }
      command_ = 0;
    }
  }
  void finish(MeasurementSink&) override { begin(); }

 private:
  static constexpr std::uint32_t all = 0x3F;
  void begin() noexcept {
    if (read_.components != 0) ++errors_.incomplete;
    read_ = {};
  }
  void end(MeasurementSink& sink) {
    if (read_.components == all) {
      read_.measurement.fields = Measurement::rate | Measurement::specific_force;
      sink.on_measurement(read_.measurement);
      read_ = {};
    }
    begin();
  }

  std::uint32_t request_id_, reply_id_;
  const CanSignalCodec codecs_[3] = {{reply_size, axes[0]}, {reply_size, axes[1]}, {reply_size, axes[2]}};
  unsigned command_ = 0;  // of the last request, not answered yet; 0: none
  ReadBack read_;
};

constexpr Setting settings[] = {
    real_setting("sample_rate_hz", "samples per second; a reply has the newest", 200.0, 1, 10'000),
    integer_setting("request_id", "identifier of the requests", 0x00F, 0, 0x7FF),
    integer_setting("reply_id", "identifier of the replies; NOS3's simulator has 0", 0, 0, 0x7FF),
    flag_setting(
        "with_requests",
        "sends the requests of all axes with every sample, and their replies: a recording without flight software",
        false),
};

constexpr DeviceCounter counters[] = {{"requests_refused", "requests refused",
                                       "the flight software has sent a request that the unit does not know: it must "
                                       "have 2 bytes, 80 and a command from "
                                       "0 to 4"}};

}  // namespace

extern constexpr Protocol nos3_imu_protocol = {
    .name = "nos3-imu",
    .summary = "NASA NOS3 generic_imu: answers the flight software's requests",
    .link = Link::can,
    .document = "nasa-itc/generic_imu, fsw/shared/generic_imu_device.c",
    .settings = settings,
    .fields = Measurement::rate | Measurement::specific_force,
    .resolution = {.rate = rate_lsb * units::degree, .specific_force = force_lsb * units::standard_gravity},
    .range = {.rate = 400 * units::degree, .specific_force = 10 * units::standard_gravity},
    .status_bits = 0,
    .counters = counters,
    .can_messages = [](const Settings& chosen, double rate_hz) -> std::vector<CanMessage> {
      const auto request_id = static_cast<std::uint32_t>(chosen.integer("request_id"));
      const auto reply_id = static_cast<std::uint32_t>(chosen.integer("reply_id"));
      if (!chosen.flag("with_requests")) return {{{.id = reply_id}, reply_size, requests_per_s}};
      if (request_id == reply_id) return {{{.id = reply_id}, reply_size, 6 * rate_hz}};
      return {{{.id = request_id}, request_size, 3 * rate_hz}, {{.id = reply_id}, reply_size, 3 * rate_hz}};
    },
    .can_filters = [](const Settings& chosen) -> std::vector<CanFilter> {
      return {{.id = static_cast<std::uint32_t>(chosen.integer("request_id")), .remote = false}};
    },
    .waits_for_host = [](const Settings& chosen) -> std::string_view {
      return chosen.flag("with_requests") ? "" : "with_requests = true";
    },
    .product =
        [](const Settings& chosen) {
          Product product;
          product.rate_hz = chosen.real("sample_rate_hz");
          product.gyro.max = 400 * units::degree;
          product.accelerometer.max = 10 * units::standard_gravity;
          return product;
        },
    .make = make_as<Device, Nos3Device>,
    .make_decoder = make_as<Decoder, Nos3Decoder>,
};

}  // namespace imud
