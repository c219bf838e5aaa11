#include "tools/truth/truth_source.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "tools/stop_signal.hpp"
#include "tools/truth/truth_csv.hpp"

namespace imud {
namespace {

class NativeSource final : public TruthSource {
 public:
  explicit NativeSource(const MotionTruths::Options& options) : truths_(options) {}

  std::optional<TimedDatagram> next() override {
    const auto truth = truths_.next();
    if (!truth) return std::nullopt;
    encode_native_truth(*truth, datagram_);
    return TimedDatagram{truths_.offset(), datagram_, truth->stream, truth->sequence};
  }

 private:
  MotionTruths truths_;
  std::array<std::byte, native_truth_size> datagram_;
};

class CsvSource final : public TruthSource {
 public:
  explicit CsvSource(const MotionTruths::Options& options) : truths_(options) {}

  std::optional<TimedDatagram> next() override {
    if (row_.empty()) {
      row_ = truth_csv_header();
      return TimedDatagram{Nanoseconds{}, std::as_bytes(std::span(row_))};
    }
    const auto truth = truths_.next();
    if (!truth) return std::nullopt;
    row_ = truth_csv_row(*truth);
    return TimedDatagram{truths_.offset(), std::as_bytes(std::span(row_))};
  }

 private:
  MotionTruths truths_;
  std::string row_;
};

class CaptureSource final : public TruthSource {
 public:
  CaptureSource(Port& port, std::optional<double> for_s) : port_(port) {
    if (for_s) last_ = nanoseconds(*for_s);
  }

  std::optional<TimedDatagram> next() override {
    auto received = port_.receive();
    while (!received && !port_.at_end() && !stop_requested()) {  // packets to other ports are skipped
      pollfd input{port_.descriptor(), POLLIN, 0};               // standard input may have to be waited for
      if (input.fd >= 0) ::poll(&input, 1, 100);
      received = port_.receive();
    }
    if (!received) return std::nullopt;
    if (received->is_piece)
      throw std::runtime_error(
          "the truth came by TCP, which keeps no borders of datagrams; right would be imud replay, which reads it");
    if (!first_) first_ = received->time;
    // Time stamps may step back; the order of the datagrams stays.
    offset_ = std::max(offset_, received->time - *first_);
    if (last_ && offset_ > *last_) return std::nullopt;
    return TimedDatagram{offset_, received->frame.bytes};
  }

  std::string warning() const override { return std::string(port_.end_warning()); }

 private:
  Port& port_;
  std::optional<Nanoseconds> last_;
  std::optional<HostTime> first_;
  Nanoseconds offset_{};
};

}  // namespace

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
  if (!is_finite(truth) || !is_in_range(truth))
    throw std::runtime_error(fmt::format("at {} s the motion exceeds the valid range of truth (core/truth.hpp)",
                                         seconds(time - TruthTime{})));
  ++next_;
  return truth;
}

std::unique_ptr<TruthSource> native_source(const MotionTruths::Options& options) {
  return std::make_unique<NativeSource>(options);
}

std::unique_ptr<TruthSource> csv_source(const MotionTruths::Options& options) {
  return std::make_unique<CsvSource>(options);
}

std::unique_ptr<TruthSource> capture_source(Port& port, std::optional<double> for_s) {
  return std::make_unique<CaptureSource>(port, for_s);
}

}  // namespace imud
