#include "emulator/faults/message_faults.hpp"

#include <algorithm>

#include "emulator/faults/fault_kinds.hpp"
#include "emulator/plan/fault_config.hpp"

namespace imud {
namespace {

constexpr std::string_view message_target[] = {"message"}, clock_target[] = {"clock"}, device_target[] = {"device"};
constexpr FaultParameter message_chance[] = {
    {.key = "each", .meaning = "the probability of each message", .initial = 1, .min = 0, .max = 1}};
constexpr FaultParameter message_copies[] = {
    {.key = "value", .meaning = "how often it is sent again", .initial = 1, .min = 1, .max = 8, .is_whole = true}};
constexpr FaultParameter message_lateness[] = {
    {.key = "delay_ms", .meaning = "by which messages are late", .min = 0, .max = 10'000},
    {.key = "jitter_ms", .meaning = "by which they are later at random", .initial = 0, .min = 0, .max = 10'000}};
constexpr FaultParameter message_batch[] = {
    {.key = "period_ms", .meaning = "the time from one batch to the next", .min = 0.001, .max = 10'000}};
constexpr FaultParameter counter_ahead[] = {
    {.key = "value", .meaning = "the number that is added", .is_whole = true}};
constexpr FaultParameter clock_ahead[] = {{.key = "value_s", .meaning = "by which the clock is ahead"}};
constexpr FaultParameter clock_fast[] = {
    {.key = "value_ppm", .meaning = "by which the clock runs fast", .min = -1e5, .max = 1e5}};

// The kinds up to out_of_order act on frames that are made.
enum class MessageFault : std::uint8_t {
  missing,
  repeated,
  late,
  batched,
  out_of_order,
  counter_stuck,
  counter_jump,
  invalid,
  valid,
  other_settings,
  self_test_failed,
  clock_jump,
  clock_drift,
  count
};

constexpr FaultKind message_kind(MessageFault code, std::string_view name, std::string_view summary,
                                 std::span<const std::string_view> targets,
                                 std::span<const FaultParameter> parameters = {}, std::string_view stays = {}) {
  return {.code = code,
          .name = name,
          .summary = summary,
          .seam = FaultSeam::message,
          .targets = targets,
          .parameters = parameters,
          .is_ramped = code == MessageFault::late,
          .stays = stays,
          .acts_on_frames = code <= MessageFault::out_of_order,
          .has_settings = code == MessageFault::other_settings,
          .needs_self_test = code == MessageFault::self_test_failed};
}

constexpr FaultKind message_table[] = {
    message_kind(MessageFault::missing, "missing", "messages are not sent", message_target, message_chance),
    message_kind(MessageFault::repeated, "repeated", "messages are sent again", message_target, message_copies),
    message_kind(MessageFault::late, "late", "messages leave late, in their order", message_target, message_lateness,
                 "messages that are still withheld leave at their times"),
    message_kind(MessageFault::batched, "batched", "messages leave together, as those of a USB adapter do",
                 message_target, message_batch, "the last batch leaves at its time"),
    message_kind(MessageFault::out_of_order, "out_of_order", "two messages change places", message_target),
    message_kind(MessageFault::counter_stuck, "counter_stuck", "the counter stands still", message_target),
    message_kind(MessageFault::counter_jump, "counter_jump", "the counter is ahead", message_target, counter_ahead),
    message_kind(MessageFault::invalid, "invalid", "good samples are marked as not valid", message_target),
    message_kind(MessageFault::valid, "valid", "saturated, stale and failed samples are marked as good",
                 message_target),
    message_kind(MessageFault::other_settings, "other_settings",
                 "messages are those of a unit with other settings, such as another unit, range or identifier",
                 message_target),
    message_kind(MessageFault::self_test_failed, "self_test_failed",
                 "the self test reports a failure, in the status or in the answer to its command", device_target, {},
                 "a status that is collected since the last message has it once more"),
    message_kind(MessageFault::clock_jump, "jump", "the sensor's clock is wrong", clock_target, clock_ahead),
    message_kind(MessageFault::clock_drift, "drift", "the sensor's clock runs away", clock_target, clock_fast),
};
static_assert(has_every_code(message_table, static_cast<std::size_t>(MessageFault::count)),
              "the rows stand in the order of the enumeration, one for each value");
static_assert(has_own_names(message_table), "a target has two kinds of one name");

void append_all(const FrameBuffer& frames, FrameBuffer& to) noexcept {
  for (const Frame& frame : frames.frames()) to.append(frame.bytes, frame.can, frame.uart);
}

// Returns the bytes for the frames that the delays of the configured faults withhold.
std::size_t ring_size(std::span<const FaultConfig> faults, std::string_view imu, double rate_hz) {
  constexpr double bytes_per_sample = 1024, least = 256 * 1024, most = 64 * 1024 * 1024;
  const auto longest_of = [](const FaultNumber& number) {
    constexpr double sigmas = 6;
    return number.law == FaultNumber::Law::normal ? number.a + sigmas * number.b : std::max(number.a, number.b);
  };
  const auto is = [](const FaultConfig& fault, MessageFault kind) {
    return fault.kind == &message_table[static_cast<std::size_t>(kind)];
  };
  double longest_ms = 0;
  for (const FaultConfig& fault : faults) {
    if (!fault.acts_on(imu)) continue;
    if (is(fault, MessageFault::batched)) longest_ms = std::max(longest_ms, longest_of(fault.parameters[0]));
    if (is(fault, MessageFault::late))
      longest_ms = std::max(longest_ms, longest_of(fault.parameters[0]) + longest_of(fault.parameters[1]));
  }
  return static_cast<std::size_t>(std::clamp(1e-3 * longest_ms * rate_hz * bytes_per_sample, least, most));
}

}  // namespace

std::span<const FaultKind> message_fault_kinds() noexcept { return message_table; }

MessageFaults::MessageFaults(std::span<const FaultConfig> faults, std::span<const Normals> normals,
                             std::string_view imu, double rate_hz)
    : normals_(normals), ring_(ring_size(faults, imu, rate_hz)) {
  next_bytes_.reserve(FrameBuffer::max_bytes);
  released_.reserve(FrameBuffer::max_bytes);
}

void MessageFaults::take(std::span<const ActiveFault> faults, std::uint64_t k, const Sample& sample) noexcept {
  is_missing_ = is_exchanged_ = false;
  status_kept_ = ~std::uint32_t{0};
  status_added_ = 0;
  std::uint64_t counter = sample.counter;
  repetitions_ = 0;
  other_unit_.reset();
  delay_ = clock_offset_ = Nanoseconds{0};
  for (const ActiveFault& fault : faults) {
    const double p = fault.parameters[0];
    const auto uniform = [&] { return normals_[fault.number].uniform(Quantity::rate, Process::fault_noise, k); };
    switch (fault.kind->code.as<MessageFault>()) {
      case MessageFault::missing:
        is_missing_ = is_missing_ || p >= 1 || uniform() < p;
        break;
      case MessageFault::repeated:
        repetitions_ += static_cast<int>(p);
        break;
      case MessageFault::late:
        delay_ += nanoseconds(1e-3 * (fault.weight * p + fault.parameters[1] * uniform()));
        break;
      case MessageFault::batched: {
        // Batches leave when the device's clock is at a multiple of the period.
        const std::int64_t period = std::max<std::int64_t>(1, nanoseconds(1e-3 * p).count());
        const std::int64_t into = ((sample.time.ns % period) + period) % period;
        delay_ = std::max(delay_, Nanoseconds{into == 0 ? 0 : period - into});
        break;
      }
      case MessageFault::out_of_order:
        is_exchanged_ = is_exchanged_ || !fault.is_last;
        break;
      case MessageFault::counter_stuck:
        if (fault.since == 0) stuck_counter_ = counter_.value_or(counter);
        counter = stuck_counter_;
        break;
      case MessageFault::counter_jump:
        counter += static_cast<std::uint64_t>(static_cast<std::int64_t>(p));
        break;
      case MessageFault::invalid:
        status_added_ |= status::not_valid;
        break;
      case MessageFault::valid:
        status_kept_ = status_added_ = 0;
        break;
      case MessageFault::other_settings:
        other_unit_ = fault.number;
        break;
      case MessageFault::self_test_failed:
        status_added_ |= status::self_test_failed;
        break;
      case MessageFault::clock_jump:
        clock_offset_ += nanoseconds(p);
        break;
      case MessageFault::clock_drift:
        clock_offset_ += nanoseconds(1e-6 * p * fault.since_s);
        break;
      case MessageFault::count:
        break;
    }
  }
  counter_ = counter;
  counter_ahead_ = counter - sample.counter;
}

void MessageFaults::forge(Sample& sample) const noexcept {
  sample.counter += counter_ahead_;
  sample.counter_error = counter_ahead_;
  sample.status = (sample.status & status_kept_) | status_added_;
}

void MessageFaults::withhold(const FrameBuffer& frames, DeviceTime due) noexcept {
  last_due_ = has_next_ ? std::max(last_due_, due) : due;  // a line keeps the order
  for (const Frame& frame : frames.frames())
    if (!ring_.push({.interface = frame.uart, .can = frame.can, .time = HostTime{last_due_.ns}}, frame.bytes))
      ++lost_;
  if (!has_next_) pop();
}

void MessageFaults::pop() noexcept { has_next_ = ring_.pop(next_, next_bytes_); }

void MessageFaults::discard() noexcept {
  while (has_next_) pop();
  exchanged_.clear();
}

void MessageFaults::shape(FrameBuffer& frames, DeviceTime time) noexcept {
  if (is_missing_) frames.clear();
  if (repetitions_ > 0 && !frames.frames().empty()) {
    copy_.clear();
    append_all(frames, copy_);
    for (int i = 0; i < repetitions_; ++i) append_all(copy_, frames);
  }
  if (is_exchanged_ && exchanged_.frames().empty()) {
    append_all(frames, exchanged_);
    frames.clear();
  } else if (!is_exchanged_ || !frames.frames().empty()) {  // not each sample has a message
    append_all(exchanged_, frames);
    exchanged_.clear();
  }
  if (delay_ <= Nanoseconds{0} && !(has_next_ && last_due_ > time)) return;
  withhold(frames, time + delay_);
  frames.clear();
}

std::optional<DeviceTime> MessageFaults::next_release() const noexcept {
  return has_next_ ? std::optional(DeviceTime{next_.time.ns}) : std::nullopt;
}

std::optional<Frame> MessageFaults::release(DeviceTime time) noexcept {
  if (!has_next_ || DeviceTime{next_.time.ns} > time) return std::nullopt;
  released_.swap(next_bytes_);
  const Frame frame{released_, next_.can, static_cast<std::uint8_t>(next_.interface)};
  pop();
  return frame;
}

}  // namespace imud
