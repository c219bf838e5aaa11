// Sync: the trigger, PPS and output pins of one imu, as UDP datagrams with time stamps (protocols/sync_datagram.hpp).
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "core/time.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/imu/ports.hpp"
#include "emulator/plan/sync_config.hpp"
#include "protocols/protocol.hpp"
#include "transports/port.hpp"

namespace imud {

// An edge with a time waits for the first sample at or after it. An edge whose time is past is delivered as one at
// the last sample, an edge without a time as one at the next sample. An edge more than 10 s ahead, or beyond 64 that
// wait at a pin, is refused and counted. No function waits or allocates. One thread.
class Sync {
 public:
  // `imu`: the imu's number, and its name. `sink` takes the datagrams received. Throws PortError.
  Sync(const SyncConfig& config, const Ports& ports, std::size_t imu = 0, const std::string& name = {},
       StepSink& sink = StepSink::none());

  // Delivers the edges up to `time` to the device. Call it before the device's sample at `time`, whose stamp is
  // `stamp`.
  void deliver_edges(Device& device, TruthTime time, DeviceTime stamp) noexcept;
  // Sends the output pulse of the device's last sample, if there is one, in simulation time.
  void send_pulse(const Device& device) noexcept;
  // Discards all edges, because the sensor does not sample the truth now.
  void discard_edges() noexcept;
  // Discards the time of the last sample, because simulation time may restart.
  void begin_run() noexcept { last_.reset(); }
  // Return the ports that the system has chosen (Port::chosen_port()); empty: none.
  std::string chosen_trigger_port() const { return trigger_.port ? trigger_.port->chosen_port() : ""; }
  std::string chosen_pps_port() const { return pps_.port ? pps_.port->chosen_port() : ""; }
  // Returns the number of edges refused.
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  struct Input {
    std::unique_ptr<Port> port;
    std::uint16_t interface = 0;           // of the record
    std::array<TruthTime, 64> edges = {};  // waiting for a sample
    std::size_t count = 0;
  };
  void open_input(Input& input, const PortUse& use, const Ports& ports, const std::string& name);
  std::optional<Port::Received> receive(Input& input) noexcept;
  void receive(Input& input, TruthTime time) noexcept;
  void deliver(Device& device, void (Device::*edge)(DeviceTime) noexcept, Input& input, TruthTime time,
               DeviceTime stamp) noexcept;

  StepSink& sink_;
  Input trigger_, pps_;
  std::unique_ptr<Port> tov_;
  std::uint64_t refused_ = 0;
  std::optional<TruthTime> last_;  // time of the last sample
  TruthTime time_;                 // time of the last sample of any run, and its stamp
  DeviceTime stamp_;
};

}  // namespace imud
