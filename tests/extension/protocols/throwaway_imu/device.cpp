// A serial product that exists for one test: it sends its rate, and answers '?' with "here".
#include <algorithm>
#include <cmath>
#include <string_view>

#include "protocols/protocol.hpp"
#include "protocols/wire/crc32c.hpp"
#include "tests/extension/protocols/throwaway_imu/decoder.hpp"
#include "tests/extension/protocols/throwaway_imu/frame.hpp"

namespace imud {
namespace {

using namespace throwaway_imu;

void seal(std::span<std::byte> frame) noexcept {
  const boost::endian::little_uint32_buf_t crc{crc32c(frame.first(crc_offset))};
  std::memcpy(frame.data() + crc_offset, &crc, sizeof crc);
}

std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader&) noexcept {
  if (frame.size() != sizeof(Wire) || std::memcmp(frame.data(), start, sizeof start) != 0) return {};
  seal(frame);
  return frame.subspan(sizeof start, crc_offset - sizeof start);
}

class ThrowawayDevice final : public Device {
 public:
  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    const std::span<std::byte> room = out.room(sizeof(Wire));
    if (room.empty()) return;
    Wire wire;
    std::memcpy(wire.start, start, sizeof start);
    wire.counter = static_cast<std::uint32_t>(sample.counter);
    for (int i = 0; i < 3; ++i)
      wire.rate[i] =
          static_cast<std::int32_t>(std::llround(std::clamp(sample.rate[i], -rate_range, rate_range) / rate_lsb));
    write_wire(wire, room);
    seal(room);
    out.push(sizeof(Wire));
  }

  void receive(const Frame& from_host, DeviceTime, FrameBuffer& replies) noexcept override {
    constexpr std::string_view answer = "here";
    for (const std::byte byte : from_host.bytes) {
      if (byte != std::byte{'?'}) continue;
      const std::span<std::byte> room = replies.room(answer.size());
      if (room.empty()) return;
      std::memcpy(room.data(), answer.data(), answer.size());
      replies.push(answer.size());
    }
  }

  UartSettings uart() const noexcept override { return {57'600, Parity::even, 1}; }
};

}  // namespace

extern constexpr Protocol throwaway_imu_protocol = {
    .name = "throwaway-imu",
    .summary = "the rate, and an answer",
    .link = Link::bytes,
    .document = "none",
    .fields = Measurement::counter | Measurement::rate,
    .resolution = {.rate = rate_lsb},
    .range = {.rate = rate_range},
    .counter_bits = 32,
    .status_bits = 0,
    .has_checksum = true,
    .burst_bits = 32,
    .make_seal = seal_by<reseal>,
    .make = [](const Settings&) -> std::unique_ptr<Device> { return std::make_unique<ThrowawayDevice>(); },
    .make_decoder = make_decoder,
};

}  // namespace imud
