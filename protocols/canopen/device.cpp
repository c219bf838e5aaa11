// A CANopen slave with the objects of an inertial unit, by CiA 301 (canopen.hpp). This file has the states (NMT), and
// passes each message to the part that processes it.
//
// After power on or a reset the device is silent for its start-up time. Then it sends a boot-up message, and is
// pre-operational until a master starts it, unless it starts itself (1F80). Without a node id it waits for LSS. A bit
// rate that LSS sets is stored and reported (2002:2), but has no effect: the administrator sets the bit rate of the
// interface.

#include "protocols/canopen/sdo_server.hpp"
#include "protocols/canopen/settings.hpp"
#include "protocols/protocol.hpp"

namespace imud {
namespace {

using namespace canopen;

enum Count : unsigned { sdo_aborts, heartbeats_lost, node_id_conflicts, syncs, counted };

constexpr std::array<DeviceCounter, counted> counters = {{
    {"sdo_aborts", "SDO transfers aborted"},
    {"heartbeats_lost", "heartbeats of other nodes lost"},
    {"node_id_conflicts", "frames of another node with an identifier of this one",
     "another node on the bus sends with an identifier of this one; give one of them another node_id"},
    {"syncs", "SYNC messages processed"},
}};

enum Command : unsigned {
  start = 1,
  stop = 2,
  enter_pre_operational = 128,
  reset_node = 129,
  reset_communication = 130
};

class CanopenDevice final : public Device {
 public:
  CanopenDevice(const ObjectDictionary& delivered, const Identity& identity, unsigned node_id,
                Nanoseconds start_up) noexcept
      : start_up_(start_up), node_(delivered, identity, node_id), sdo_(node_) {
    power_on({});
  }

  void power_on(DeviceTime now) noexcept override {
    node_.lss.power_on();
    node_.load_all();
    node_.emergencies.clear_history();
    node_.has_sample = false;
    node_.sample = {};
    node_.sample_increments = {};
    node_.time_of_day.reset();
    restart(now);
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    poll(sample.time, out);
    copy(sample, node_.sample);
    node_.sample_increments = {sample.delta_angle, sample.delta_velocity, 1};
    node_.has_sample = true;
    constexpr std::uint32_t gyro = 7U * status::gyro_saturated_x,
                            accelerometer = 7U * status::accelerometer_saturated_x;
    Emergencies& emergencies = node_.emergencies;
    emergencies.set(Error::gyro_range, (sample.status & gyro) != 0, sample.status);
    emergencies.set(Error::accelerometer_range, (sample.status & accelerometer) != 0, sample.status);
    emergencies.set(Error::no_measurement, (sample.status & status::not_valid) != 0, sample.status);
    report(sample.time, out);
    if (state_ != State::operational) return;
    node_.pdos.add(sample);
    node_.pdos.on_sample(node_.reading(), out);
  }

  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override {
    const CanHeader& can = from_host.can;
    if (can.extended || can.fd || can.error || node_.alarms[Alarm::boot]) return;
    if (can.remote)
      receive_remote(can.id, now, replies);
    else
      receive_data(can.id, from_host.bytes, now, replies);
    counts_[sdo_aborts] = sdo_.aborts();
  }

  std::optional<DeviceTime> deadline() const noexcept override { return node_.alarms.next(); }

  void poll(DeviceTime now, FrameBuffer& out) noexcept override {
    while (const auto due = node_.alarms.take(now)) execute(*due, now, out);
    counts_[sdo_aborts] = sdo_.aborts();
  }

  void step_clock(Nanoseconds by) noexcept override {
    node_.alarms.step_clock(by);
    node_.emergencies.step_clock(by);
    node_.pdos.step_clock(by);
    node_.sample.time = node_.sample.time + by;
    if (node_.time_of_day) node_.time_of_day->at = node_.time_of_day->at + by;
  }

  std::span<const std::uint64_t> counts() const noexcept override { return counts_; }

 private:
  void restart(DeviceTime now) noexcept {
    node_.alarms.clear();
    state_ = State::booting;
    node_id_ = unconfigured;
    node_.alarms.set(Alarm::boot, now + start_up_);
  }

  void boot(DeviceTime now, FrameBuffer& out) noexcept {
    node_.emergencies.reset();
    node_id_ = node_.lss.node_id();
    node_.load_communication();
    sdo_.reset(node_id_);
    if (node_id_ == unconfigured) return;
    const std::array message = {static_cast<std::byte>(State::booting)};
    send(heartbeat_id + node_id_, message, out);
    node_.supervision.start(now);
    const bool starts_itself = node_.dictionary[at(0x1F80)] == 0;
    enter(starts_itself ? State::operational : State::pre_operational);
  }

  void enter(State state) noexcept {
    if (state == State::operational && state_ != State::operational) node_.pdos.start();
    if (state == State::stopped) {
      sdo_.reset(node_id_);
      node_.alarms.clear(Alarm::sync_loss);
    }
    state_ = state;
  }

  void command(unsigned command, DeviceTime now, FrameBuffer& out) noexcept {
    switch (command) {
      case start:
        enter(State::operational);
        return report(now, out);
      case stop:
        return enter(State::stopped);
      case enter_pre_operational:
        enter(State::pre_operational);
        return report(now, out);
      case reset_node:
        node_.emergencies.clear_history();
        node_.load_all();
        restart(now);
        return poll(now, out);
      case reset_communication:
        restart(now);
        return poll(now, out);
      default:
        return;
    }
  }

  // Changes the state as 1029:1 demands after an error of the communication.
  void react_to_error() noexcept {
    switch (node_.dictionary[at(0x1029, 1)]) {
      case 0:
        if (state_ == State::operational) enter(State::pre_operational);
        return;
      case 2:
        return enter(State::stopped);
      default:
        return;
    }
  }

  bool is_talking() const noexcept { return state_ == State::pre_operational || state_ == State::operational; }

  void report(DeviceTime now, FrameBuffer& out) noexcept {
    if (node_id_ != unconfigured) node_.emergencies.report(is_talking(), now, out);
    node_.pdos.set_error_register(node_.emergencies.error_register());
  }

  void execute(const Alarms::Due& due, DeviceTime now, FrameBuffer& out) noexcept {
    switch (due.reason) {
      case Alarm::boot:
        return boot(now, out);
      case Alarm::sdo_timeout:
        return sdo_.time_out(out);
      case Alarm::sdo_block:
        return sdo_.continue_block(now, out);
      case Alarm::consumer_1:
      case Alarm::consumer_2:
      case Alarm::consumer_3:
      case Alarm::consumer_4: {
        const auto i = static_cast<unsigned>(due.reason) - static_cast<unsigned>(Alarm::consumer_1);
        ++counts_[heartbeats_lost];
        node_.emergencies.set(Error::heartbeat, true, node_.supervision.lose(i));
        report(now, out);
        return react_to_error();
      }
      case Alarm::life_guarding:
        node_.emergencies.set(Error::life_guarding, true);
        report(now, out);
        return react_to_error();
      case Alarm::sync_loss:
        node_.emergencies.set(Error::sync_lost, true);
        return report(now, out);
      case Alarm::emergency:
        return report(now, out);
      case Alarm::heartbeat:
        return node_.supervision.send_heartbeat(node_id_, state_, due.time, now, out);
      case Alarm::count:
        return;
    }
  }

  void receive_remote(std::uint32_t id, DeviceTime now, FrameBuffer& out) noexcept {
    if (node_id_ == unconfigured) return;
    if (id == heartbeat_id + node_id_) {
      node_.emergencies.set(Error::life_guarding, false);
      node_.supervision.answer_guarding(node_id_, state_, now, out);
      report(now, out);
    } else if (state_ == State::operational && node_.has_sample) {
      node_.pdos.on_remote(id, node_.reading(), out);
    }
  }

  void receive_data(std::uint32_t id, std::span<const std::byte> data, DeviceTime now, FrameBuffer& out) noexcept {
    if (id == lss_request_id) {
      if (data.size() == 8) receive_lss(data.first<8>(), now, out);
      return;
    }
    if (node_id_ == unconfigured) return;
    if (is_own(id)) {
      ++counts_[node_id_conflicts];
      return;
    }
    const ObjectDictionary& dictionary = node_.dictionary;
    const std::uint32_t time_id = dictionary.u32(at(0x1012));
    if (id == nmt_id) {
      constexpr std::size_t size = 2;
      if (data.size() != size) return;
      const auto node_id = std::to_integer<unsigned>(data[1]);
      if (node_id == 0 || node_id == node_id_) command(std::to_integer<unsigned>(data[0]), now, out);
    } else if (id == (dictionary.u32(at(0x1005)) & can_id_bits)) {
      if (is_talking()) receive_sync(data, now, out);
    } else if (id == sdo_request_id + node_id_) {
      if (!is_talking() || data.size() != 8) return;
      sdo_.receive(data.first<8>(), now, out);
      report(now, out);  // an error may have ended with its supervision
    } else if (id == (time_id & can_id_bits) && (time_id & bit_31) != 0) {
      if (is_talking()) receive_time(data, now);
    } else if (id > heartbeat_id && id <= heartbeat_id + last_node_id && data.size() == 1) {
      const bool was_lost = node_.supervision.receive_heartbeat(id - heartbeat_id, now);
      if (!was_lost || node_.supervision.is_any_lost()) return;
      node_.emergencies.set(Error::heartbeat, false);
      report(now, out);
    }
  }

  // Returns true if only this node may send messages with this identifier.
  bool is_own(std::uint32_t id) const noexcept {
    const std::uint32_t emergency = node_.dictionary.u32(at(0x1014));
    return id == heartbeat_id + node_id_ || id == sdo_answer_id + node_id_ ||
           ((emergency & bit_31) == 0 && id == (emergency & can_id_bits)) || node_.pdos.uses(id);
  }

  void receive_lss(std::span<const std::byte, 8> message, DeviceTime now, FrameBuffer& out) noexcept {
    const bool was_configuring = node_.lss.is_configuring();
    node_.lss.receive(message, node_id_, out);
    const bool is_done = was_configuring && !node_.lss.is_configuring();
    if (node_id_ != unconfigured || !is_done || node_.lss.node_id() == unconfigured) return;
    restart(now);
    poll(now, out);
  }

  // A SYNC acts at once: its PDOs have the newest sample at its arrival.
  void receive_sync(std::span<const std::byte> data, DeviceTime now, FrameBuffer& out) noexcept {
    const std::size_t wanted = node_.dictionary[at(0x1019)] != 0 ? 1 : 0;
    if (data.size() != wanted) {
      node_.emergencies.set_for_once(Error::sync_length);
      return report(now, out);
    }
    ++counts_[syncs];
    node_.supervision.receive_sync(now);
    node_.emergencies.set(Error::sync_lost, false);
    report(now, out);
    if (state_ == State::operational && node_.has_sample)
      node_.pdos.on_sync(wanted == 0 ? 0 : std::to_integer<unsigned>(data[0]), node_.reading(), out);
  }

  void receive_time(std::span<const std::byte> data, DeviceTime now) noexcept {
    constexpr std::size_t size = 6;
    constexpr std::uint64_t ms_bits = 0x0FFF'FFFF;
    constexpr std::int64_t ms_per_day = 86'400'000;
    if (data.size() != size) return;
    const auto ms = static_cast<std::int64_t>(read_little(data.first<4>()) & ms_bits);
    const auto days = static_cast<std::int64_t>(read_little(data.last<2>()));
    node_.time_of_day = TimeOfDay{now, days * ms_per_day + ms};
  }

  const Nanoseconds start_up_;
  Node node_;
  SdoServer sdo_;
  State state_ = State::booting;
  unsigned node_id_ = unconfigured;
  std::array<std::uint64_t, counted> counts_ = {};
};

}  // namespace

extern constexpr Protocol canopen_protocol = {
    .name = "canopen",
    .summary = "CANopen slave: NMT, SDO, four transmit PDOs with free mapping, SYNC, EMCY, LSS; inclinometer",
    .link = Link::can,
    .document = "CiA 301 version 4.2, CiA 305; objects of CiA 410; protocols/canopen/imud.eds",
    .settings = declared_settings,
    .fields = Measurement::counter | Measurement::rate | Measurement::specific_force | Measurement::status,
    .resolution = {.rate = double{lsb_16[0]}, .specific_force = double{lsb_16[1]}},
    .range = {.rate = 0x7FFF * double{lsb_16[0]}, .specific_force = 0x7FFF * double{lsb_16[1]}},
    .counter_bits = 16,
    .status_bits = 0xFF,
    .counters = counters,
    .can_messages = canopen::can_messages,
    .can_filters = canopen::can_filters,
    .bus_name = canopen::bus_name,
    .waits_for_host = canopen::waits_for_host,
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      ObjectDictionary delivered;
      deliver(settings, delivered);
      return std::make_unique<CanopenDevice>(delivered, identity_of(settings), node_id_of(settings),
                                             std::chrono::milliseconds(settings.integer("start_up_ms")));
    },
    .make_decoder = canopen::make_decoder,
};

}  // namespace imud
