#include "emulator/ground/counters.hpp"

#include <algorithm>
#include <numeric>
#include <optional>

namespace imud {

bool is_shown(Show show, std::uint64_t value) noexcept {
  constexpr std::uint64_t several = 2;
  return show == Show::always || (show == Show::if_not_zero && value > 0) ||
         (show == Show::if_several && value >= several);
}

Counter::Counter(CounterGroup& group, const CounterInfo& counter_info)
    : std::atomic<std::uint64_t>(0), info(counter_info) {
  group.counters.push_back(this);
}

Level::Level(CounterGroup& group, std::string_view level_key, double initial, double level_scale)
    : std::atomic<double>(initial), key(level_key), scale(level_scale) {
  group.levels.push_back(this);
}

Durations::Durations(CounterGroup& group, std::string_view durations_key) : key(durations_key) {
  group.durations.push_back(this);
}

namespace {

struct RefusalRow {
  Refusal refusal;
  std::optional<TruthResult> result;  // of the decoder, whose cause() is the word; nullopt: the next member is
  std::string_view cause;
  std::string_view remedy;
};

constexpr std::string_view another_format = "another format? see truth.format and imud list";
constexpr auto refusals = std::to_array<RefusalRow>({
    {Refusal::too_short, TruthResult::too_short, {}, another_format},
    {Refusal::too_long, TruthResult::too_long, {}, another_format},
    {Refusal::not_this_kind, TruthResult::not_this_kind, {}, another_format},
    {Refusal::bad_version, TruthResult::bad_version, {}, another_format},
    {Refusal::bad_checksum, TruthResult::bad_checksum, {}, "damaged on its way, or another CRC than CRC-32C"},
    {Refusal::bad_number, TruthResult::bad_number, {}, "a field that must be a number is not one"},
    {Refusal::not_finite, TruthResult::not_finite, {}, "NaN or infinity: the simulation has diverged"},
    {Refusal::out_of_range, TruthResult::out_of_range, {}, "beyond the motion of any vehicle: check units"},
    {Refusal::no_columns,
     TruthResult::no_columns,
     {},
     "each required quantity must be named once: by a header row, by the keys of an object, or in truth.columns"},
    {Refusal::no_rate, {}, "no_rate", "has no rate; send it, or give truth.rate = \"derived\" (not in lockstep)"},
    {Refusal::outlier, {}, "outlier", "further from the poses around it than their noise and any motion explain"},
    {Refusal::duplicate, {}, "duplicate", "a truth of the same time was accepted before"},
    {Refusal::reordered, {}, "reordered", "it arrived after a later one, when its time had been used"},
    {Refusal::time_back,
     {},
     "time_back",
     "the sender's clock ran back; a sender that starts again sets the new-run flag"},
    {Refusal::time_jump, {}, "time_jump", "further ahead than truth.max_gap_ms"},
    {Refusal::other_stream, {}, "stream", "another vehicle; see truth.stream"},
    {Refusal::foreign_sender, {}, "foreign_sender", "sent by another than truth.from"},
});
static_assert(refusals.size() == static_cast<std::size_t>(Refusal::count));
static_assert([] {
  for (std::size_t i = 0; i < refusals.size(); ++i)
    if (refusals[i].refusal != static_cast<Refusal>(i)) return false;
  return true;
}());

const RefusalRow& row(Refusal refusal) noexcept { return refusals[static_cast<std::size_t>(refusal)]; }

}  // namespace

std::string_view cause(Refusal refusal) noexcept {
  return row(refusal).result ? cause(*row(refusal).result) : row(refusal).cause;
}

std::string_view remedy(Refusal refusal) noexcept { return row(refusal).remedy; }

Refusal refusal(TruthResult result) noexcept {
  const auto found = std::ranges::find(refusals, result, &RefusalRow::result);
  return found == refusals.end() ? Refusal::not_this_kind : found->refusal;
}

RefusalCounters::RefusalCounters() {
  for (const RefusalRow& r : refusals)
    counts_.emplace_back(*this,
                         CounterInfo{cause(r.refusal), cause(r.refusal), Show::if_not_zero, Show::if_not_zero});
}

void DeviceCounters::store(std::span<const std::uint64_t> counts, std::span<const std::uint64_t> others) noexcept {
  for (std::size_t i = 0; i < std::min(counts.size(), counts_.size()); ++i)
    counts_[i].store(counts[i] + (i < others.size() ? others[i] : 0), std::memory_order_relaxed);
}

SnapshotValues::SnapshotValues(const CounterGroup& group) {
  for (const Counter* counter : group.counters) counts.push_back(counter->load(std::memory_order_relaxed));
  for (const Level* level : group.levels) levels.push_back(level->load(std::memory_order_relaxed));
  durations.reserve(group.durations.size());
  for (const Durations* measured : group.durations) durations.emplace_back(*measured);
}

void SnapshotValues::subtract(const SnapshotValues& before) {
  for (std::size_t i = 0; i < counts.size(); ++i) counts[i] -= std::min(counts[i], before.counts[i]);
  for (std::size_t i = 0; i < durations.size(); ++i) durations[i] = durations[i].since(before.durations[i]);
}

std::uint64_t SnapshotValues::total() const noexcept {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

}  // namespace imud
