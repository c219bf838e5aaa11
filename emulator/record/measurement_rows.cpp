#include "emulator/record/measurement_rows.hpp"

#include <utility>

#include "emulator/imu/ports.hpp"
#include "protocols/measurements/collecting_decoder.hpp"

namespace imud {

static_assert(sizeof(TrueRow) == sizeof(std::int64_t) + sizeof(TrueValues));

namespace {

class DecodingPort final : public NoPort, private MeasurementSink {
 public:
  DecodingPort(const ImuConfig& imu, std::function<void(const Measurement&, std::int64_t)> receive,
               std::function<std::int64_t()> now)
      : decoder_(imu.protocol->make_decoder(imu.settings)),
        collecting_(dynamic_cast<const CollectingDecoder*>(decoder_.get())),
        receive_(std::move(receive)),
        now_(std::move(now)) {}
  void send(std::span<const Frame> frames) noexcept override {
    NoPort::send(frames);
    sent_ = now_();
    for (const Frame& frame : frames) {
      if (collecting_ == nullptr || !collecting_->holds_measurement()) begun_ = sent_;
      decoder_->feed(frame, *this);
    }
  }
  void commit() override { decoder_->finish(*this); }

 private:
  void on_measurement(const Measurement& measurement) override {
    receive_(measurement, std::exchange(begun_, sent_));  // the frame that is fed begins the next one
  }

  std::unique_ptr<Decoder> decoder_;
  const CollectingDecoder* collecting_;  // the decoder; nullptr: its measurements are complete with their last frame
  std::function<void(const Measurement&, std::int64_t)> receive_;
  std::function<std::int64_t()> now_;
  std::int64_t sent_ = 0, begun_ = 0;  // the instants of this send(), and of the measurement's first frame
};

}  // namespace

std::unique_ptr<Port> decoding_port(const ImuConfig& imu, std::function<void(const Measurement&)> receive) {
  return decoding_port(
      imu, [receive = std::move(receive)](const Measurement& measurement, std::int64_t) { receive(measurement); },
      [] { return std::int64_t{0}; });
}

std::unique_ptr<Port> decoding_port(const ImuConfig& imu,
                                    std::function<void(const Measurement&, std::int64_t)> receive,
                                    std::function<std::int64_t()> now) {
  return std::make_unique<DecodingPort>(imu, std::move(receive), std::move(now));
}

}  // namespace imud
