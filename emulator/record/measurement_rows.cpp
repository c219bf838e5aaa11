#include "emulator/record/measurement_rows.hpp"

#include <utility>

#include "emulator/imu/ports.hpp"

namespace imud {

static_assert(sizeof(TrueRow) == sizeof(std::int64_t) + sizeof(TrueValues));

namespace {

class DecodingPort final : public NoPort, private MeasurementSink {
 public:
  DecodingPort(const ImuConfig& imu, std::function<void(const Measurement&)> receive)
      : decoder_(imu.protocol->make_decoder(imu.settings)), receive_(std::move(receive)) {}
  void send(std::span<const Frame> frames) noexcept override {
    NoPort::send(frames);
    for (const Frame& frame : frames) decoder_->feed(frame, *this);
  }
  void commit() override { decoder_->finish(*this); }

 private:
  void on_measurement(const Measurement& measurement) override { receive_(measurement); }

  std::unique_ptr<Decoder> decoder_;
  std::function<void(const Measurement&)> receive_;
};

}  // namespace

std::unique_ptr<Port> decoding_port(const ImuConfig& imu, std::function<void(const Measurement&)> receive) {
  return std::make_unique<DecodingPort>(imu, std::move(receive));
}

}  // namespace imud
