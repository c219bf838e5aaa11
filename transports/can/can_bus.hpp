// The bit rates of a CAN bus. The port's text gives them, because an interface need not have bit rates.
#pragma once

#include "transports/can/can_bits.hpp"
#include "transports/port.hpp"

namespace imud {

inline constexpr PortOption bitrate_option = {
    .key = "bitrate", .help = "nominal bit rate of the bus, bit/s; for its load", .min = 5'000, .max = 1'000'000};
inline constexpr PortOption data_bitrate_option = {.key = "data_bitrate",
                                                   .help = "bit rate of the data phase of CAN FD, bit/s (`bitrate`)",
                                                   .min = 5'000,
                                                   .max = 20'000'000};

class CanBus {
 public:
  explicit CanBus(const PortSpec& spec)
      : bit_rate_(static_cast<double>(spec.integer(bitrate_option).value_or(0))),
        data_bit_rate_(
            static_cast<double>(spec.integer(data_bitrate_option).value_or(static_cast<std::int64_t>(bit_rate_)))) {}

  // Returns how long these bits take, s; 0 if the bit rate is not given.
  double seconds(const CanBits& bits) const noexcept {
    return bit_rate_ == 0 ? 0 : bits.nominal / bit_rate_ + bits.data / data_bit_rate_;
  }

  WireTime wire_time(const Frame& frame) const noexcept {
    const CanBits most = most_can_bits(frame.can, frame.bytes.size()),
                  average = average_can_bits(frame.can, frame.bytes.size()), own = can_bits(frame);
    return {.bits = most.nominal + most.data,
            .average_bits = average.nominal + average.data,
            .own_bits = own.nominal + own.data,
            .bit_rate = bit_rate_,
            .seconds = seconds(most),
            .average_seconds = seconds(average),
            .own_seconds = seconds(own)};
  }

 private:
  double bit_rate_, data_bit_rate_;  // bit/s; 0: not given
};

// Transport::wire_time of a CAN port.
inline WireTime can_wire_time(const PortSpec& spec, const PortSettings&, const Frame& frame) {
  return CanBus(spec).wire_time(frame);
}

}  // namespace imud
