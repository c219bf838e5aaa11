#include "emulator/faults/truth_faults.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "emulator/faults/fault_kinds.hpp"

namespace imud {
namespace {

constexpr std::string_view truth_target[] = {fault_of_truth};
constexpr std::size_t most_late = 64;
constexpr FaultParameter truth_offset[] = {
    {.key = "x_m", .meaning = "by which the position is off, along N's x", .initial = 0},
    {.key = "y_m", .meaning = "along N's y", .initial = 0},
    {.key = "z_m", .meaning = "along N's z", .initial = 0}};
constexpr FaultParameter truths_late[] = {{.key = "value",
                                           .meaning = "the number of truths that arrive before it",
                                           .initial = 1,
                                           .min = 1,
                                           .max = most_late,
                                           .is_whole = true}};

constexpr std::string_view last_curve = "motion returns on the curve to the next truth";

enum class TruthFault : std::uint8_t { frozen, jump, nan, late, lost, count };

constexpr FaultKind truth_kind(TruthFault code, std::string_view name, std::string_view summary,
                               std::span<const FaultParameter> parameters, std::string_view stays) {
  return {.code = code,
          .name = name,
          .summary = summary,
          .seam = FaultSeam::truth,
          .targets = truth_target,
          .parameters = parameters,
          .is_ramped = code == TruthFault::jump,
          .stays = stays,
          .in_lockstep = code != TruthFault::late && code != TruthFault::lost};
}

constexpr FaultKind truth_table[] = {
    truth_kind(TruthFault::frozen, "frozen",
               "the motion of the last truth before the fault is sent again and again, with new times", {},
               last_curve),
    truth_kind(TruthFault::jump, "jump", "the position jumps", truth_offset, last_curve),
    truth_kind(TruthFault::nan, "nan", "numbers are no numbers, so that truth is refused", {},
               "motion is extrapolated or held to the next truth"),
    truth_kind(TruthFault::late, "late", "truth arrives late, after others that were sent later", truths_late,
               "the late truths follow at once"),
    truth_kind(TruthFault::lost, "lost", "truth does not arrive", {},
               "motion is extrapolated or held to the next truth"),
};
static_assert(has_every_code(truth_table, static_cast<std::size_t>(TruthFault::count)),
              "the rows stand in the order of the enumeration, one for each value");
static_assert(has_own_names(truth_table), "a target has two kinds of one name");

class FaultyTruthDecoder final : public TruthDecoder, public TruthFaults {
 public:
  FaultyTruthDecoder(std::unique_ptr<TruthDecoder> decoder, std::span<const FaultConfig> faults, std::uint64_t seed,
                     FaultLog& log, std::size_t most)
      : decoder_(std::move(decoder)),
        normals_(fault_normals(fault_of_truth, seed, faults.size() + most)),
        schedule_(faults, normals_, fault_of_truth, truth_number, 1, log) {
    waiting_.reserve(most_late + 1);
    losses_ = decoder_->losses();
  }
  FaultSchedule& schedule() noexcept override { return schedule_; }
  void begin_run(TruthTime first) noexcept override {
    if (begin_ == first) return;
    schedule_.begin_run();
    begin_ = first;
    count_ = 0;
  }
  void start(HostTime now) noexcept override { decoder_->start(now); }
  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept override {
    decoder_->feed(bytes, input, arrival);
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    for (;;) {
      if (!waiting_.empty() && waiting_.size() > late_) {
        truth = waiting_.front();
        waiting_.erase(waiting_.begin());
        return TruthResult::ok;
      }
      const auto result = decoder_->next(truth);
      losses_ = decoder_->losses();
      if (result != TruthResult::ok) return result;
      if (const auto changed = apply(truth)) return changed;
      if (waiting_.size() <= late_) return TruthResult::withheld;
    }
  }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    return decoder_->describe(result, room);
  }
  void set_servo(std::size_t servo, std::uint16_t pulse_us) noexcept override {
    decoder_->set_servo(servo, pulse_us);
  }
  TruthFrame frame() const noexcept override { return decoder_->frame(); }
  void end_of_file() noexcept override { decoder_->end_of_file(); }
  void finish() noexcept override {
    decoder_->finish();
    waiting_.clear();
    losses_ = decoder_->losses();
  }
  std::optional<HostTime> deadline() const noexcept override { return decoder_->deadline(); }
  void poll(HostTime now, FrameBuffer& out) noexcept override { decoder_->poll(now, out); }
  void acknowledge(const Truth& truth, TruthTime used_until, std::uint64_t samples,
                   FrameBuffer& out) noexcept override {
    decoder_->acknowledge(truth, used_until, samples, out);
  }

 private:
  // Applies the faults to a truth. Returns nullopt if the truth must not be passed on now.
  std::optional<TruthResult> apply(Truth& truth) noexcept {
    if (!begin_ || truth.new_run || truth.time < *begin_) {
      begin_.reset();
      begin_run(truth.time);
      last_.reset();
    }
    Sample sample;  // the schedule's view of a truth
    sample.counter = count_++;
    sample.time = DeviceTime{truth.time.ns};
    sample.rate = truth.omega_BN_B;
    sample.specific_force = truth.specific_force_B;
    schedule_.take(sample, truth.time - *begin_);
    late_ = 0;
    bool is_lost = false, is_nan = false;
    for (const ActiveFault& fault : schedule_.active(FaultSeam::truth)) {
      const auto& p = fault.parameters;
      switch (fault.kind->code.as<TruthFault>()) {
        case TruthFault::frozen:
          freeze(truth);
          break;
        case TruthFault::jump:
          truth.r_BN_N += fault.weight * Vector3(p[0], p[1], p[2]);
          break;
        case TruthFault::nan:
          is_nan = true;
          break;
        case TruthFault::late:
          late_ = std::max(late_, static_cast<std::size_t>(p[0]));
          break;
        case TruthFault::lost:
          is_lost = true;
          break;
        case TruthFault::count:
          break;
      }
    }
    last_ = truth;
    if (is_lost) return std::nullopt;
    if (is_nan) {
      truth.q_NB.w() = truth.omega_BN_B.x() = std::numeric_limits<double>::quiet_NaN();
      return is_finite(truth) ? TruthResult::ok : TruthResult::not_finite;
    }
    if (late_ == 0 && waiting_.empty()) return TruthResult::ok;
    waiting_.push_back(truth);
    return std::nullopt;
  }

  void freeze(Truth& truth) const noexcept {
    if (!last_) return;
    Truth frozen_truth = *last_;
    frozen_truth.time = truth.time;
    frozen_truth.stream = truth.stream;
    frozen_truth.sequence = truth.sequence;
    frozen_truth.acknowledge = truth.acknowledge;
    frozen_truth.new_run = truth.new_run;
    truth = frozen_truth;
  }

  const std::unique_ptr<TruthDecoder> decoder_;
  const std::vector<Normals> normals_;
  FaultSchedule schedule_;
  std::vector<Truth> waiting_;  // late truths, at most most_late and one
  std::size_t late_ = 0;        // how many may wait
  std::optional<TruthTime> begin_;
  std::uint64_t count_ = 0;  // truths of the run
  std::optional<Truth> last_;
};

}  // namespace

std::span<const FaultKind> truth_fault_kinds() noexcept { return truth_table; }

std::unique_ptr<TruthDecoder> with_faults(std::unique_ptr<TruthDecoder> decoder, std::span<const FaultConfig> faults,
                                          std::uint64_t seed, FaultLog& log, std::size_t most, TruthFaults*& all) {
  all = nullptr;
  if (most == 0 && std::none_of(faults.begin(), faults.end(),
                                [](const FaultConfig& fault) { return fault.acts_on(fault_of_truth); }))
    return decoder;
  auto faulty = std::make_unique<FaultyTruthDecoder>(std::move(decoder), faults, seed, log, most);
  all = faulty.get();
  return faulty;
}

}  // namespace imud
