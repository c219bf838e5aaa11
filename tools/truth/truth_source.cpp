#include "tools/truth/truth_source.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "emulator/ground/host.hpp"
#include "emulator/plan/epoch.hpp"
#include "tools/stop_signal.hpp"
#include "tools/truth/truth_csv.hpp"

namespace imud {
MotionTruths::MotionTruths(const Options& options) : options_(options), grid_(options.rate_hz) {}

std::optional<Truth> MotionTruths::next() {
  const Nanoseconds offset = grid_.offset(next_);
  if (options_.for_s && offset > nanoseconds(*options_.for_s)) return std::nullopt;
  const TruthTime time = TruthTime{} + nanoseconds(options_.start_s) + offset;
  Truth truth = options_.motion->at(time, options_.parameters);
  truth.stream = options_.stream;
  truth.sequence = static_cast<std::uint32_t>(next_);
  truth.acknowledge = options_.acknowledge;
  truth.new_run = options_.new_run && next_ == 0;
  truth.stamp = options_.first_stamp;
  truth.stamp.time = truth.stamp.time + offset;
  if (!is_finite(truth) || !is_in_range(truth))
    throw std::runtime_error(fmt::format("at {} s the motion exceeds the valid range of truth (core/truth.hpp)",
                                         seconds(time - TruthTime{})));
  ++next_;
  return truth;
}

ClockStamp clock_stamp(std::string_view clock, HostTime time) {
  for (const Word<Epoch>& one : epoch_words) {
    if (one.word != clock || one.value == Epoch::none) continue;
    const clockid_t id = one.value == Epoch::tai   ? CLOCK_TAI
                         : one.value == Epoch::utc ? CLOCK_REALTIME
                                                   : CLOCK_MONOTONIC;
    return {one.value, SharedTime{(time + MonotonicHost().ahead(id).by).ns}};
  }
  throw std::invalid_argument(fmt::format("--stamp {}: right would be tai, utc or monotonic", clock));
}

TruthSource native_source(const MotionTruths::Options& options) {
  return [truths = MotionTruths(options),
          datagram = std::array<std::byte, native_truth_size>()]() mutable -> std::optional<TimedDatagram> {
    const auto truth = truths.next();
    if (!truth) return std::nullopt;
    encode_native_truth(*truth, datagram);
    return TimedDatagram{truths.offset(), datagram, truth->stream, truth->sequence};
  };
}

TruthSource csv_source(const MotionTruths::Options& options) {
  return [truths = MotionTruths(options), row = std::string()]() mutable -> std::optional<TimedDatagram> {
    if (row.empty()) {
      row = truth_csv_header();
      return TimedDatagram{Nanoseconds{}, std::as_bytes(std::span(row))};
    }
    const auto truth = truths.next();
    if (!truth) return std::nullopt;
    row = truth_csv_row(*truth);
    return TimedDatagram{truths.offset(), std::as_bytes(std::span(row))};
  };
}

TruthSource capture_source(Port& port, std::optional<double> for_s) {
  return [&port, for_s, first = std::optional<HostTime>(),
          offset = Nanoseconds()]() mutable -> std::optional<TimedDatagram> {
    auto received = port.receive();
    while (!received && !port.at_end() && !stop_requested()) {  // packets to other ports are skipped
      pollfd input{port.descriptor(), POLLIN, 0};               // standard input may have to be waited for
      if (input.fd >= 0) ::poll(&input, 1, 100);
      received = port.receive();
    }
    if (!received) return std::nullopt;
    if (received->is_piece)
      throw std::runtime_error(
          "the truth came by TCP, which keeps no borders of datagrams; right would be imud replay, which reads it");
    if (!first) first = received->time;
    // Time stamps may step back; the order of the datagrams stays.
    offset = std::max(offset, received->time - *first);
    if (for_s && offset > nanoseconds(*for_s)) return std::nullopt;
    return TimedDatagram{offset, received->frame.bytes};
  };
}

}  // namespace imud
