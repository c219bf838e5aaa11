#include "emulator/control/reloader.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "emulator/engine/session.hpp"

namespace imud {

std::optional<Change> Reloader::prepare() {
  if (!read_)
    throw RpcError(RpcError::refused, "reload: only a run of a file, by imud run CONFIG, can read it again");
  if (reload_ != nullptr) throw RpcError(RpcError::busy, "reload: one waits for its sample already");
  Config next;
  try {
    next = read_();
  } catch (const ConfigError& error) {
    throw RpcError(RpcError::refused, fmt::format("reload refused, nothing has changed:\n{}", error.what()));
  }
  const std::vector<KeyChange> changes = key_changes(now_, next);
  std::string refusals;
  for (const KeyChange& change : changes)
    if (change.refusal != nullptr)
      refusals +=
          fmt::format("\n{}: {}; it is {}, in the file {}", change.key, change.refusal, change.before, change.after);
  if (!refusals.empty())
    throw RpcError(RpcError::refused, fmt::format("reload refused, nothing has changed:{}", refusals));
  for (const std::string& warning : next.warnings) spdlog::warn("{}", warning);
  if (changes.empty()) return std::nullopt;

  Json changed = Json::array();
  std::string words;
  for (const KeyChange& change : changes) {
    changed.push_back({{"key", change.key}, {"from", change.before}, {"to", change.after}});
    words += fmt::format("{}{} = {}, was {}", words.empty() ? "" : "; ", change.key, change.after, change.before);
  }
  reload_ = std::make_unique<Reload>(now_, next, started_.imus, started_.seed);
  next_ = std::move(next);
  session_.set_reload(reload_.get());
  return Change{{{.kind = Command::Kind::reload}},
                fmt::format("reload: {}", words),
                {{"event", "reload"}, {"changed", std::move(changed)}}};
}

void Reloader::finish() {
  if (!next_) return;
  const std::string truth_port = now_.truth.port;  // that the system has chosen
  now_ = std::move(*next_);
  now_.truth.port = truth_port;
  cancel();
  changed_();
}

void Reloader::cancel() noexcept {
  session_.set_reload(nullptr);
  reload_.reset();
  next_.reset();
}

}  // namespace imud
