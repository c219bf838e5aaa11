#include "emulator/campaign/shards/shard_claims.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <system_error>

namespace imud {

std::filesystem::path ShardClaims::path_of(const CaseRange& shard) const {
  TemporaryFile file = mine_;
  file.name = std::filesystem::path(shard_name(shard)).stem();
  return folder_.shards_path() / file.file_name();
}

bool ShardClaims::is_look_due() const noexcept {
  constexpr int share = 40;  // of two looks
  return !looked_ || host_now() - *looked_ > share * look_took_;
}

void ShardClaims::look() {
  const HostTime begin = host_now();
  others_.clear();
  for (const auto& [file, cases] : folder_.list().temporaries) {
    if (file.process == mine_.process && file.space == mine_.space && file.host == mine_.host) continue;
    const std::string name = file.file_name();
    const auto [other, is_first] = others_.try_emplace(cases.first, name);
    if (!is_first) other->second = std::min(other->second, name);
  }
  looked_ = host_now();
  look_took_ = *looked_ - begin;
}

bool ShardClaims::claim(const CaseRange& shard, bool yields) {
  const std::filesystem::path path = path_of(shard);
  if (::access(path.c_str(), F_OK) == 0) return true;
  const bool looks = yields && is_look_due();
  if (looks) look();
  if (yields && others_.contains(shard.first)) return false;
  constexpr mode_t mode = 0666;
  // The writer says why it cannot be created.
  static_cast<void>(FileDescriptor(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode)));
  if (!looks) return true;
  // If two runs claim a shard at the same instant, one of them at least sees the other here.
  look();
  const auto other = others_.find(shard.first);
  if (other == others_.end() || path.filename().string() < other->second) return true;
  release(shard);
  return false;
}

void ShardClaims::release(const CaseRange& shard) const noexcept { ::unlink(path_of(shard).c_str()); }

void ShardClaims::refresh(const std::set<std::uint64_t>& first_cases) {
  constexpr std::chrono::minutes age(1);
  constexpr std::chrono::milliseconds between_looks(200);
  if (not_before_ && host_now() < *not_before_) return;
  not_before_ = host_now() + between_looks;
  for (const std::uint64_t first : first_cases) {
    const std::filesystem::path path = path_of(folder_.campaign().shard_of(first));
    std::error_code error;
    const auto written = std::filesystem::last_write_time(path, error);
    if (error || std::filesystem::file_time_type::clock::now() - written < age) continue;
    ::utimensat(AT_FDCWD, path.c_str(), nullptr, 0);
    not_before_ = host_now() + age;
  }
}

}  // namespace imud
