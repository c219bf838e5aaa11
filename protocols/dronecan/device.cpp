// An IMU on DroneCAN (UAVCAN v0): measurements, node status, services, parameters, a fixed or allocated node id, and
// the time of the bus. The unit is no vendor's product: it sends the messages of AP_Periph and PX4's cannode, with a
// name and versions from the settings. Its parts: transfer.hpp (frames), messages.hpp (layouts), services.hpp
// (answers to hosts), parameters.hpp, allocation.hpp (the node id), bus_time.hpp (the time), settings.hpp (the keys
// of [imu.device]), gnss.hpp (the receiver); decoder.cpp reads RawIMU.
//
// A parameter that the host changes takes effect at once; the node id takes effect at the next restart.
#include <algorithm>
#include <array>
#include <utility>

#include "core/units.hpp"
#include "protocols/dronecan/bus_time.hpp"
#include "protocols/dronecan/gnss.hpp"
#include "protocols/dronecan/services.hpp"
#include "protocols/dronecan/settings.hpp"
#include "protocols/wire/deadlines.hpp"

namespace imud {
namespace {

using namespace dronecan;

enum Count : std::size_t { node_id_conflicts, transfers_timed_out, transfers_malformed, counts_size };
constexpr DeviceCounter counters[] = {
    {"node_id_conflicts", "frames of another node with the same node id",
     "another node has the same node id, so that receivers take both for one; give one of them another node_id"},
    {"transfers_timed_out", "received transfers that timed out"},
    {"transfers_malformed", "received transfers that were malformed"}};
static_assert(std::size(counters) == counts_size);

class DroneCanDevice final : public Device {
 public:
  explicit DroneCanDevice(const Configuration& c) noexcept
      : allocation_(c.identity.unique_id), is_device_time_(c.is_device_time) {
    node_.identity = c.identity;
    node_.memory = {.factory = c.values, .stored = c.values, .active = c.values, .sample_rate = c.sample_rate};
    power_on({});
  }

  void power_on(DeviceTime now) noexcept override {
    node_.memory.active = node_.memory.stored;
    node_.statistics = {};
    node_.power_on = now;
    node_.health = health_ok;
    receiver_.clear();
    bus_time_.clear();
    transfer_ids_ = {};
    samples_ = 0;
    increments_ = {};
    node_.id = static_cast<unsigned>(node_.memory.active[node_id_key]);
    allocation_.stop();
    if (node_.id == anonymous)
      allocation_.start(now);
    else
      next_status_ = now;
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    constexpr std::uint32_t saturated = 7 * (status::gyro_saturated_x | status::accelerometer_saturated_x);
    if ((sample.status & saturated) != 0) node_.health = std::max(node_.health, health_warning);
    if ((sample.status & (status::not_valid | status::self_test_failed)) != 0)
      node_.health = std::max(node_.health, health_error);
    if (node_.id == anonymous || !node_.is_operational(sample.time)) return;
    increments_.add(sample);
    ++samples_;
    for (const Stream& stream : streams)
      if (const std::int64_t hz = node_.memory.active[stream.rate];
          hz != 0 && samples_ % (node_.memory.sample_rate / hz) == 0)
        send_measurement(*stream.type, sample, out);
  }

  void receive(const Frame& frame, DeviceTime now, FrameBuffer& replies) noexcept override {
    const CanHeader& can = frame.can;
    node_.statistics.frame_errors += can.error;
    if (!can.extended || can.remote || can.error || can.fd || frame.bytes.empty()) return;
    ++node_.statistics.frames_received;
    const Identifier from = Identifier::parse(can.id);
    const auto source = from.source;
    if (node_.id != anonymous && source == node_.id) {
      ++counts_[node_id_conflicts];
    } else if (from.is_service) {
      receive_service(from, frame.bytes, now, replies);
    } else if (from.is_anonymous()) {
      if (from.type == (allocation.id & 3U)) allocation_.wait(now);
    } else if (from.type == global_time_sync.id) {
      if (const auto message = receiver_.feed(from, global_time_sync, frame.bytes, now);
          is_long_enough(message, sizeof(GlobalTimeSyncWire)))
        bus_time_.receive(source, Tail::parse(frame.bytes.back()).transfer_id,
                          read_wire<GlobalTimeSyncWire>(*message).previous_us.value(), now);
    } else if (from.type == allocation.id && node_.id == anonymous) {
      if (const auto message = receiver_.feed(from, allocation, frame.bytes, now); is_long_enough(message, 1))
        if (const auto id = allocation_.receive(*message, now)) {
          node_.id = *id;
          allocation_.stop();
          next_status_ = now;
        }
    }
    count_errors();
  }

  // ArduPilot's AP_Periph sends the latest values behind its filters of second order, INS_GYRO_FILTER and
  // INS_ACCEL_FILTER (20 Hz as delivered), and integrals that are not filtered. (ArduPilot at 4908787:
  // Tools/AP_Periph/imu.cpp, can_imu_update(); libraries/AP_InertialSensor/AP_InertialSensor.cpp,
  // DEFAULT_GYRO_FILTER, and AP_InertialSensor_Backend.cpp, apply_gyro_filters().)
  std::optional<SensorFilters> filters() const noexcept override {
    const auto low_pass = [this](Key key) {
      const std::int64_t hz = node_.memory.active[key];
      SensorFilter filter;
      if (2 * hz < node_.memory.sample_rate) filter.cut_off_hz = Vector3::Constant(static_cast<double>(hz));
      return filter;
    };
    return SensorFilters{
        .gyro = low_pass(gyro_filter_hz), .accelerometer = low_pass(accelerometer_filter_hz), .magnetometer = {}};
  }

  std::optional<DeviceTime> deadline() const noexcept override {
    return earlier(node_.id != anonymous ? next_status_ : allocation_.deadline(), receiver_.deadline());
  }

  void poll(DeviceTime now, FrameBuffer& out) noexcept override {
    receiver_.poll(now);
    count_errors();
    if (node_.id != anonymous) {
      if (now < next_status_) return;
      next_status_ = next_status_ + ((now - next_status_) / status_period + 1) * status_period;
      broadcast(node_status, status_priority, node_.status(now), out);
      node_.health = health_ok;
    } else if (const auto due = allocation_.deadline(); due && *due <= now) {
      const Identifier identifier{.priority = status_priority,
                                  .type = allocation.id,
                                  .discriminator = discriminator_of(node_.identity.unique_id)};
      send(identifier, allocation, next_transfer_id(allocation), allocation_.poll(now).bytes(), out);
    }
  }

  void step_clock(Nanoseconds by) noexcept override {
    node_.power_on = node_.power_on + by;
    next_status_ = next_status_ + by;
    receiver_.step_clock(by);
    bus_time_.step_clock(by);
    allocation_.step_clock(by);
  }

  void set_figures(const OwnFigures& figures) noexcept override { figures_ = figures; }

  std::span<const std::uint64_t> counts() const noexcept override { return counts_; }

 private:
  static constexpr Nanoseconds status_period = std::chrono::seconds(1);

  void receive_service(const Identifier& from, std::span<const std::byte> bytes, DeviceTime now,
                       FrameBuffer& replies) noexcept {
    if (!from.is_request || node_.id == anonymous || from.destination != node_.id || from.source == anonymous) return;
    const DataType* service = find_service(from.type);
    if (service == nullptr) return;
    const auto request = receiver_.feed(from, *service, bytes, now);
    if (!request) return;
    ++node_.statistics.transfers_received;
    Payload response;
    const Served served = serve(*service, *request, now, node_, response);
    if (served == Served::malformed) {
      ++refused_;
      return;
    }
    Identifier to = from;
    to.is_request = false;
    to.source = node_.id;
    to.destination = from.source;
    send(to, *service, Tail::parse(bytes.back()).transfer_id, response.bytes(), replies);
    if (served == Served::restart) power_on(now);
  }

  // Counts the message, if there is one, as received, and as refused if it is shorter than `size`. Returns true if
  // there is a message of at least this size.
  bool is_long_enough(const std::optional<std::span<const std::byte>>& message, std::size_t size) noexcept {
    if (!message) return false;
    ++node_.statistics.transfers_received;
    refused_ += message->size() < size;
    return message->size() >= size;
  }

  void count_errors() noexcept {
    const DecodeErrors& errors = receiver_.errors();
    const std::uint64_t malformed = errors.checksum + errors.malformed + errors.incomplete + refused_;
    const std::uint64_t timed_out = receiver_.timed_out();
    node_.statistics.transfer_errors +=
        malformed - counts_[transfers_malformed] + timed_out - counts_[transfers_timed_out];
    counts_[transfers_malformed] = malformed;
    counts_[transfers_timed_out] = timed_out;
  }

  void send_measurement(const DataType& type, const Sample& sample, FrameBuffer& out) noexcept {
    const Nanoseconds since = sample.stamp() - node_.power_on;
    const std::uint64_t time = is_device_time_
                                   ? static_cast<std::uint64_t>(microseconds(std::max(since, Nanoseconds{0})))
                                   : bus_time_.at(sample.stamp());
    const auto priority = static_cast<unsigned>(node_.memory.active[priority_key]);
    switch (type.id) {
      case raw_imu.id:
        broadcast(type, priority, raw_imu_of(sample, time), out);
        increments_ = {};
        break;
      case solution.id: {
        SolutionWire wire{};
        wire.time_us = time;
        const Quaternion& q = sample.q_LP;
        wire.orientation[0] = to_half(q.x());
        wire.orientation[1] = to_half(q.y());
        wire.orientation[2] = to_half(q.z());
        wire.orientation[3] = to_half(q.w());
        put_halves(sample.rate, wire.rate);
        put_halves(sample.specific_force, wire.specific_force);
        broadcast(type, priority, wire, out);
        break;
      }
      case magnetic_field.id: {
        if (sample.magnetic_field.isZero(0)) break;
        MagneticFieldWire wire{};
        wire.sensor_id = static_cast<std::uint8_t>(node_.memory.active[sensor_id_key]);
        put_halves(sample.magnetic_field / units::gauss, wire.field);
        broadcast(type, priority, wire, out);
        break;
      }
      case static_pressure.id:
        if (sample.pressure > 0)
          broadcast(type, priority, StaticPressureWire{little_float32_buf_t(to_float(sample.pressure)), to_half(0)},
                    out);
        break;
      case gnss_auxiliary.id:
        broadcast(type, priority, auxiliary_of(sample.fix()).bytes(), out);
        break;
      case gnss_fix2.id:
        broadcast(type, priority, fix2_of(sample, figures_, time).bytes(), out);
        break;
      default: {
        constexpr double zero_celsius = 273.15;
        broadcast(type, priority, StaticTemperatureWire{to_half(sample.temperature_c + zero_celsius), to_half(0)},
                  out);
        break;
      }
    }
  }

  RawImuWire raw_imu_of(const Sample& sample, std::uint64_t time) const noexcept {
    RawImuWire wire{};
    wire.time_us = time;
    put_halves(sample.rate, wire.rate);
    put_halves(sample.specific_force, wire.specific_force);
    if (node_.memory.active[integrals_key] == 0) return wire;
    wire.integration_interval =
        to_float(static_cast<double>(increments_.samples) / static_cast<double>(node_.memory.sample_rate));
    put_vector(increments_.delta_angle, wire.delta_angle);
    put_vector(increments_.delta_velocity, wire.delta_velocity);
    return wire;
  }

  template <WireLayout T>
  void broadcast(const DataType& type, unsigned priority, const T& wire, FrameBuffer& out) noexcept {
    broadcast(type, priority, std::as_bytes(std::span(&wire, 1)), out);
  }
  void broadcast(const DataType& type, unsigned priority, std::span<const std::byte> payload,
                 FrameBuffer& out) noexcept {
    send({.priority = priority, .type = type.id, .source = node_.id}, type, next_transfer_id(type), payload, out);
  }

  void send(const Identifier& identifier, const DataType& type, unsigned transfer_id,
            std::span<const std::byte> payload, FrameBuffer& out) noexcept {
    const std::size_t frames = dronecan::send(identifier, type, transfer_id, payload, out);
    node_.statistics.frames_sent += frames;
    node_.statistics.transfers_sent += frames > 0;
  }

  // Returns the transfer id of the next message of a type that the device sends.
  unsigned next_transfer_id(const DataType& type) noexcept {
    std::size_t i = 0;
    while (i < streams.size() && streams[i].type != &type) ++i;
    if (&type == &allocation) ++i;
    return std::exchange(transfer_ids_[i], static_cast<std::uint8_t>((transfer_ids_[i] + 1) % transfer_ids));
  }

  Node node_;
  Receiver receiver_;
  Allocation allocation_;
  BusTime bus_time_;
  bool is_device_time_;
  OwnFigures figures_;
  DeviceTime next_status_;
  std::array<std::uint8_t, streams.size() + 2> transfer_ids_;  // of the streams, NodeStatus, Allocation
  std::int64_t samples_ = 0;                                   // since the node became operational
  Increments increments_;                                      // since the last RawIMU
  std::uint64_t refused_ = 0;                                  // received transfers whose content was impossible
  std::array<std::uint64_t, counts_size> counts_ = {};
};

}  // namespace

extern constexpr Protocol dronecan_protocol = {
    .name = "dronecan",
    .summary =
        "an IMU on DroneCAN (UAVCAN v0): RawIMU, Solution, magnetic field, air data, GNSS; services, parameters",
    .link = Link::can,
    .document = "DroneCAN specification, CAN bus transport layer; github.com/dronecan/DSDL at b4653c7",
    .settings = declared_settings,
    .fields =
        Measurement::rate | Measurement::specific_force | Measurement::delta_angle | Measurement::delta_velocity,
    .resolution = {.time_s = 1e-6,
                   .rate = 0x1p-11,
                   .specific_force = 0x1p-7,
                   .delta_angle = 0x1p-24,
                   .delta_velocity = 0x1p-24},
    .range = {.rate = 1, .specific_force = 16, .delta_angle = 1, .delta_velocity = 1},
    .counter_bits = 0,
    .status_bits = 0,
    .has_checksum = true,
    .burst_bits = 14,
    .make_seal = seal_by<dronecan::reseal, dronecan::transfer_frames>,
    .has_self_test = true,
    .counters = counters,
    .can_messages = dronecan::can_messages,
    .can_filters = dronecan::can_filters,
    .waits_for_host = [](const Settings& settings) -> std::string_view {
      return settings.integer("node_id") == anonymous ? "node_id = 42" : "";
    },
    .product = dronecan::product_of,
    .preset = [](const Settings&) -> std::string_view { return "icm-42688-p"; },
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<DroneCanDevice>(configuration_of(settings));
    },
    .make_decoder = dronecan::make_decoder,
};

}  // namespace imud
