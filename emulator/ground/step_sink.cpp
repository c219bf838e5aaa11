#include "emulator/ground/step_sink.hpp"

#include <algorithm>

namespace imud {
namespace {

class NoSink final : public StepSink {
 public:
  NoSink() noexcept : StepSink(false) {}
  std::uint16_t add_interface(std::string, std::uint16_t) override { return 0; }
  void set_truth_address(const Endpoint&) override {}

 private:
  void keep_event(const RecordEvent&) noexcept override {}
  void keep_packet(std::uint16_t, PacketDirection, HostTime, const Frame&, const Endpoint&) noexcept override {}
};

}  // namespace

StepSink& StepSink::none() noexcept {
  static NoSink sink;
  return sink;
}

void StepSink::keep_frames(std::uint16_t interface, std::span<const Frame> frames, std::uint64_t dropped) noexcept {
  const std::size_t left = frames.size() - std::min<std::uint64_t>(dropped, frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i)
    keep_packet(static_cast<std::uint16_t>(interface + (i < left ? 0 : 2)), PacketDirection::outbound, now_,
                frames[i], {});
}

}  // namespace imud
