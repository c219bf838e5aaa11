#include <algorithm>

#include "protocols/dronecan/settings.hpp"

namespace imud::dronecan {
namespace {

// Decodes RawIMU of one node: the node of the setting or, if this is 0, the first node that sends a whole transfer.
class DroneCanDecoder final : public Decoder {
 public:
  explicit DroneCanDecoder(unsigned node_id) noexcept : node_id_(node_id), source_(node_id) {}

  void feed(const Frame& frame, MeasurementSink& sink) override {
    const CanHeader& can = frame.can;
    if (!can.extended || can.remote || can.error || can.fd || frame.bytes.empty()) return;
    const Identifier identifier = Identifier::parse(can.id);
    if (identifier.is_service || identifier.is_anonymous() || identifier.type != raw_imu.id) return;
    if (node_id_ == anonymous && Tail::parse(frame.bytes.back()).is_first && source_ != identifier.source) {
      source_ = identifier.source;
      reception_.clear();
    }
    if (identifier.source != source_ || !reception_.feed(frame.bytes, raw_imu, errors_)) return;
    node_id_ = source_;
    decode(reception_.payload(), sink);
  }

  void finish(MeasurementSink&) override {
    errors_.incomplete += reception_.is_active();
    reception_.clear();
  }

 private:
  void decode(std::span<const std::byte> payload, MeasurementSink& sink) {
    const auto wire = payload.size() >= sizeof(RawImuWire) ? read_wire<RawImuWire>(payload) : RawImuWire{};
    Measurement measurement;
    Sample& sample = measurement.sample;
    measurement.fields = Measurement::rate | Measurement::specific_force;
    sample.rate = get_halves(wire.rate);
    sample.specific_force = get_halves(wire.specific_force);
    if (wire.integration_interval.value() > 0) {
      measurement.fields |= Measurement::delta_angle | Measurement::delta_velocity;
      sample.delta_angle = get_vector(wire.delta_angle);
      sample.delta_velocity = get_vector(wire.delta_velocity);
    }
    constexpr std::uint64_t latest = INT64_MAX / 1000;  // in us, that ns can express
    if (const std::uint64_t us = wire.time_us.value(); us != 0) {
      measurement.fields |= Measurement::time;
      sample.time.ns = static_cast<std::int64_t>(std::min(us, latest)) * 1000;
    }
    const std::size_t covariances = payload.size() - sizeof(RawImuWire);
    const bool is_finite = sample.rate.allFinite() && sample.specific_force.allFinite() &&
                           sample.delta_angle.allFinite() && sample.delta_velocity.allFinite();
    if (payload.size() < sizeof(RawImuWire) || covariances > most_covariances * sizeof(Half) ||
        covariances % sizeof(Half) != 0 || !is_finite)
      ++errors_.malformed;
    else
      sink.on_measurement(measurement);
  }

  unsigned node_id_;  // anonymous: not chosen yet
  unsigned source_;   // of the transfer that is received
  Reception reception_;
};

}  // namespace

std::unique_ptr<Decoder> make_decoder(const Settings& settings) {
  return std::make_unique<DroneCanDecoder>(static_cast<unsigned>(settings.integer("node_id")));
}

}  // namespace imud::dronecan
