#include "tools/campaign/campaign_rows.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <future>
#include <optional>
#include <utility>

namespace imud {

void CampaignRows::note_missing(std::uint64_t first, std::uint64_t end) {
  if (first < end) faults_.push_back(fmt::format("the cases {} to {} are missing", first, end - 1));
}

void CampaignRows::read(const Take& take, const std::function<void(double)>& progress) {
  faults_.clear();
  found_ = 0;
  whole_.clear();
  struct Result {
    std::optional<Shard> shard;
    std::string fault;
  };
  std::vector<CaseRange> shards = folder_.list().shards;
  std::erase_if(shards, [this](const CaseRange& shard) { return shard.first >= cases(); });
  const auto begin_to_read = [&](std::size_t number) {
    return std::async(std::launch::async, [this, cases = shards[number]] {
      Result result;
      result.shard = folder_.read(cases, result.fault);
      if (result.shard && checks_arrays_) result.fault = folder_.fault_of_arrays(*result.shard);
      if (!result.fault.empty()) result.shard.reset();
      return result;
    });
  };
  std::uint64_t next = 0;  // case
  std::future<Result> reading;
  for (std::size_t i = 0; i < shards.size(); ++i) {
    const CaseRange cases = shards[i];
    const Result result = i == 0 ? begin_to_read(0).get() : reading.get();
    if (i + 1 < shards.size()) reading = begin_to_read(i + 1);
    progress(static_cast<double>(i) / static_cast<double>(shards.size()));
    note_missing(next, cases.first);
    next = cases.last + 1;
    if (!result.shard) {
      faults_.push_back(fmt::format("{} {}", (folder_.shards_path() / shard_name(cases)).string(), result.fault));
      continue;
    }
    for (std::uint64_t k = 0; k < cases.size(); ++k) take(result.shard->rows[k], cases.first + k);
    found_ += cases.size();
    whole_.push_back(cases);
  }
  note_missing(next, cases());
}

}  // namespace imud
