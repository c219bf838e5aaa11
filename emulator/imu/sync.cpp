#include "emulator/imu/sync.hpp"

#include <algorithm>

#include "protocols/sync_datagram.hpp"

namespace imud {

namespace {
constexpr Nanoseconds furthest_ahead = std::chrono::seconds(10);
constexpr int datagrams_at_a_time = 16;  // so that a flood does not delay samples
}  // namespace

Sync::Sync(const SyncConfig& config, const Ports& ports, std::size_t imu, const std::string& name, StepSink& sink)
    : sink_(sink) {
  using Of = PortUse::Of;
  open_input(trigger_, {Of::trigger, imu, 0, config.trigger_port, Role::listener}, ports, name + " trigger");
  open_input(pps_, {Of::pps, imu, 0, config.pps_port, Role::listener}, ports, name + " pps");
  if (!config.tov_port.empty()) tov_ = ports({Of::pulse, imu, 0, config.tov_port, Role::device});
}

void Sync::open_input(Input& input, const PortUse& use, const Ports& ports, const std::string& name) {
  if (use.text.empty()) return;
  input.port = ports(use);
  input.interface = sink_.add_interface(name, link_type::bytes);
}

std::optional<Port::Received> Sync::receive(Input& input) noexcept {
  auto received = input.port->receive();
  if (received) sink_.packet(input.interface, PacketDirection::inbound, sink_.now(), received->frame);
  return received;
}

void Sync::discard_edges() noexcept {
  for (Input* input : {&trigger_, &pps_}) {
    input->count = 0;
    for (int i = 0; input->port != nullptr && i < datagrams_at_a_time && receive(*input); ++i) {
    }
  }
  last_.reset();
}

void Sync::deliver_edges(Device& device, TruthTime time, DeviceTime stamp) noexcept {
  if (time < time_) {  // a new run: these edges and the time of the last sample belong to the old run
    trigger_.count = pps_.count = 0;
    last_.reset();
  }
  deliver(device, &Device::pps, pps_, time, stamp);
  deliver(device, &Device::trigger, trigger_, time, stamp);
  last_ = time_ = time;
  stamp_ = stamp;
}

void Sync::receive(Input& input, TruthTime time) noexcept {
  for (int i = 0; i < datagrams_at_a_time; ++i) {
    const auto received = receive(input);
    if (!received) break;
    const TruthTime at = decode_edge(received->frame.bytes).value_or(time);
    if (at <= time + furthest_ahead && input.count < input.edges.size())
      input.edges[input.count++] = at;
    else
      ++refused_;
  }
  // After a restart of simulation time, edges of the old run may be too far ahead: they are refused.
  const auto begin = input.edges.begin(), end = begin + static_cast<std::ptrdiff_t>(input.count);
  const auto kept = std::remove_if(begin, end, [&](TruthTime at) { return at > time + furthest_ahead; });
  refused_ += static_cast<std::size_t>(end - kept);
  input.count = static_cast<std::size_t>(kept - begin);
}

void Sync::deliver(Device& device, void (Device::*edge)(DeviceTime) noexcept, Input& input, TruthTime time,
                   DeviceTime stamp) noexcept {
  if (input.port == nullptr) return;
  receive(input, time);
  // Device seconds per second of the simulation, which may run at any rate.
  const double rate = last_ && time > *last_ ? seconds(stamp - stamp_) / seconds(time - *last_) : 1.0;
  const auto begin = input.edges.begin(), end = begin + static_cast<std::ptrdiff_t>(input.count);
  const auto later = std::find_if(begin, end, [&](TruthTime at) { return at > time; });
  std::for_each(begin, later, [&](TruthTime at) {
    (device.*edge)(stamp - nanoseconds(rate * seconds(time - std::max(at, last_.value_or(time)))));
  });
  input.count = static_cast<std::size_t>(std::move(later, end, begin) - begin);
}

void Sync::send_pulse(const Device& device) noexcept {
  const auto pulse = device.pulse();
  if (tov_ == nullptr || !pulse) return;
  const auto datagram = encode_pulse(time_ + (pulse->begin - stamp_), time_ + (pulse->end - stamp_));
  const Frame frame{datagram};
  tov_->send({&frame, 1});
}

}  // namespace imud
