#include "emulator/campaign/shards_at_work.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace imud {

ShardsAtWork::~ShardsAtWork() {
  for (const std::uint64_t first : claimed_) release(folder_.campaign().shard_of(first));
}

void ShardsAtWork::release(const CaseRange& shard) const noexcept {
  claims_.release(shard);
  arrays_.release(shard);
}

void ShardsAtWork::go_on(const std::vector<std::size_t>& items) {
  for (const std::size_t item : items)
    if (const std::size_t number = cases_.shard_of(item); !is_done(number))
      claimed_.insert(cases_.shards()[number].cases.first);
  claims_.refresh(claimed_);
}

void ShardsAtWork::take(std::uint64_t item, std::string row) {
  const std::size_t number = cases_.shard_of(item);
  const ShardToWrite& shard = cases_.shards()[number];
  if (is_done(number)) return;
  claimed_.insert(shard.cases.first);
  const auto [entry, is_new] = at_work_.try_emplace(number, shard.cases.first);
  AtWork& at_work = entry->second;
  if (is_new && shard.kept() > 0) at_work.rows = rows_that_stay(shard);
  const std::uint64_t index = shard.case_of_item(item - shard.before);
  const RowResult result(row);
  if (index < at_work.next || !at_work.rows.emplace(index, std::move(row)).second) return;
  ++done_;
  ++at_work.taken;
  at_work.tally.add(result);
  if (result.could_not_be_run && arrays_.are_asked_for()) arrays_.clear(shard.cases, index);
  if (!at_work.writer)
    at_work.writer = std::make_unique<ShardWriter>(folder_.shards_path(), folder_.campaign().head(shard.cases));
  for (auto next = at_work.rows.begin(); next != at_work.rows.end() && next->first == at_work.next;
       next = at_work.rows.erase(next), ++at_work.next)
    at_work.writer->add(next->second);
  if (at_work.next <= shard.cases.last) return;
  if (!is_there_as_good(shard, at_work.tally.could_not_be_run)) {
    if (!commit(at_work, shard)) {
      spdlog::warn("{}: its temporary file was removed while it was written: its cases are run again",
                   shard_name(shard.cases));
      done_ -= at_work.taken;
      at_work_.erase(entry);
      for (std::uint64_t i = 0; i < shard.items(); ++i) put_off_.insert(shard.before + i);
      return;
    }
    ++written_;
  }
  tally_.add(at_work.tally);
  end(number);
}

// Returns false if somebody has removed a temporary file.
bool ShardsAtWork::commit(AtWork& at_work, const ShardToWrite& shard) const {
  if (!arrays_.are_asked_for()) return at_work.writer->commit();
  for (std::uint64_t index = shard.cases.first; shard.kept() > 0 && index <= shard.cases.last; ++index)
    if (!std::ranges::binary_search(shard.to_run, index)) arrays_.keep(shard.cases, index);
  const std::optional<ArrayDigest> arrays = arrays_.commit(shard.cases);
  return arrays && at_work.writer->commit(arrays);
}

void ShardsAtWork::leave(std::uint64_t item) {
  const std::size_t number = cases_.shard_of(item);
  if (is_done(number)) return;
  const ShardToWrite& shard = cases_.shards()[number];
  const auto at_work = at_work_.find(number);
  done_ += shard.items() - (at_work == at_work_.end() ? 0 : at_work->second.taken);
  std::string fault;
  if (const auto there = folder_.read(shard.cases, fault))
    for (std::uint64_t i = 0; i < shard.items(); ++i)
      tally_.add(RowResult(there->rows[shard.case_of_item(i) - shard.cases.first]));
  end(number);
}

void ShardsAtWork::put_off(std::uint64_t item) {
  const std::size_t number = cases_.shard_of(item);
  if (is_done(number)) return;
  put_off_.insert(item);
  if (!at_work_.contains(number)) claimed_.erase(cases_.shards()[number].cases.first);
}

std::vector<std::size_t> ShardsAtWork::end_of_pass() {
  const std::set<std::uint64_t> items = std::exchange(put_off_, {});
  return {items.begin(), items.end()};
}

void ShardsAtWork::drop(std::uint64_t item) const {
  const std::size_t number = cases_.shard_of(item);
  if (is_done(number)) release(cases_.shards()[number].cases);
}

bool ShardsAtWork::has(std::uint64_t item) const {
  const std::size_t number = cases_.shard_of(item);
  if (is_done(number)) return true;
  const auto at_work = at_work_.find(number);
  if (at_work == at_work_.end()) return false;
  const ShardToWrite& shard = cases_.shards()[number];
  const std::uint64_t index = shard.case_of_item(item - shard.before);
  return index < at_work->second.next || at_work->second.rows.contains(index);
}

std::map<std::uint64_t, std::string> ShardsAtWork::rows_that_stay(const ShardToWrite& shard) const {
  std::string fault;
  std::optional<Shard> there = folder_.read(shard.cases, fault);
  if (!there)
    throw std::runtime_error(fmt::format("{} {} since this began; try again", shard_name(shard.cases), fault));
  std::map<std::uint64_t, std::string> rows;
  for (std::uint64_t index = shard.cases.first; index <= shard.cases.last; ++index)
    if (!std::ranges::binary_search(shard.to_run, index))
      rows.emplace(index, std::move(there->rows[index - shard.cases.first]));
  return rows;
}

// Returns true if another process has written the shard, with no more cases that could not be run than the shard
// here. A shard that is to be replaced must have fewer such cases.
bool ShardsAtWork::is_there_as_good(const ShardToWrite& shard, std::uint64_t failed) const {
  if (!folder_.has(shard.cases)) return false;
  std::string fault;
  const std::optional<Shard> there = folder_.read(shard.cases, fault);
  if (!there) return false;
  CaseTally of_others;
  for (const std::string& row : there->rows) of_others.add(RowResult(row));
  return shard.replaces ? of_others.could_not_be_run < failed : of_others.could_not_be_run <= failed;
}

void ShardsAtWork::end(std::size_t number) {
  const ShardToWrite& shard = cases_.shards()[number];
  at_work_.erase(number);
  if (claimed_.erase(shard.cases.first) > 0) release(shard.cases);
  stored_ += shard.items();
  ++ended_;
  done_ahead_.insert(number);
  while (done_ahead_.erase(first_not_done_) > 0) ++first_not_done_;
}

}  // namespace imud
