#include "tools/campaign/campaign_rows.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <future>
#include <optional>
#include <utility>

namespace imud {
namespace {

// Returns the text as one word of a POSIX shell, in quotes where it needs them.
std::string in_shell_quotes(std::string_view text) {
  constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./:,=+@%";
  if (!text.empty() && text.find_first_not_of(plain) == text.npos) return std::string(text);
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

}  // namespace

void CampaignRows::note_missing(std::uint64_t first, std::uint64_t end) {
  if (first < end) faults_.push_back(fmt::format("the cases {} to {} are missing", first, end - 1));
}

void CampaignRows::read(const Take& take, const std::function<void(double)>& progress) {
  faults_.clear();
  found_ = 0;
  struct Result {
    std::optional<Shard> shard;
    std::string fault;
  };
  const std::vector<CaseRange> shards = folder_.list().shards;
  const auto begin_to_read = [&](std::size_t number) {
    return std::async(std::launch::async, [this, cases = shards[number]] {
      Result result;
      result.shard = folder_.read(cases, result.fault);
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
  }
  note_missing(next, folder_.campaign().cases);
}

std::string CampaignRows::resume_command() const {
  return "imud campaign resume " + in_shell_quotes(folder_.path().string());
}

std::string CampaignRows::repeat_command(std::uint64_t index) const {
  return fmt::format("imud campaign repeat {} {} --record case_{}.pcapng", in_shell_quotes(folder_.path().string()),
                     index, index);
}

}  // namespace imud
