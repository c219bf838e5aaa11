#include "tests/extension/protocols/throwaway_imu/decoder.hpp"

#include "protocols/wire/crc32c.hpp"
#include "protocols/wire/frame_search.hpp"
#include "tests/extension/protocols/throwaway_imu/frame.hpp"

namespace imud::throwaway_imu {
namespace {

class ThrowawayDecoder final : public Decoder {
 public:
  void feed(const Frame& frame, MeasurementSink& sink) override {
    errors_.skipped_bytes +=
        search_.feed(frame.bytes, [&](std::span<const std::byte> held) { return parse(held, sink); });
  }
  void finish(MeasurementSink&) override { errors_.skipped_bytes += search_.finish(); }

 private:
  using Search = FrameSearch<sizeof(Wire)>;

  std::size_t parse(std::span<const std::byte> held, MeasurementSink& sink) {
    if (std::memcmp(held.data(), start, std::min(held.size(), sizeof start)) != 0) return Search::reject;
    if (held.size() < sizeof(Wire)) return Search::need_more;
    const auto wire = read_wire<Wire>(held);
    if (wire.crc.value() != crc32c(held.first(crc_offset))) {
      ++errors_.checksum;
      return Search::reject;
    }
    Measurement measurement;
    measurement.fields = Measurement::counter | Measurement::rate;
    measurement.sample.counter = wire.counter.value();
    for (int i = 0; i < 3; ++i) measurement.sample.rate[i] = rate_lsb * wire.rate[i].value();
    sink.on_measurement(measurement);
    return sizeof(Wire);
  }

  Search search_;
};

}  // namespace

std::unique_ptr<Decoder> make_decoder(const Settings&) { return std::make_unique<ThrowawayDecoder>(); }

}  // namespace imud::throwaway_imu
