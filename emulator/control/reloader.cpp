#include "emulator/control/reloader.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <stdexcept>
#include <string>
#include <utility>

#include "emulator/engine/engine.hpp"

namespace imud {

std::optional<Change> Reloader::prepare() {
  if (!read_)
    throw RpcError(RpcError::refused, "reload: only a run of a file, by imud run CONFIG, can read it again");
  Config next;
  try {
    next = read_();
  } catch (const std::runtime_error& error) {
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
  std::vector<PortChange> ports;
  open_ports(ports);
  next_ = std::move(next);
  engine_.control()->reload = reload_.get();
  return Change{{{.kind = Command::Kind::reload}},
                fmt::format("reload: {}", words),
                {{"event", "reload"}, {"changed", std::move(changed)}},
                std::move(ports)};
}

// Opens the new ports of the reload. If one of them cannot be opened, cancels it and throws RpcError.
void Reloader::open_ports(std::vector<PortChange>& opened) {
  std::string refusals;
  const auto refuse = [&] {
    if (refusals.empty()) return;
    cancel();
    throw RpcError(RpcError::refused, fmt::format("reload refused, nothing has changed:{}", refusals));
  };
  for (const Reload::Line& line : reload_->lines)
    if (leaving_.has(line.after))
      refusals += fmt::format("\n{}: {} is still being closed after the reload before; try again in two seconds",
                              line.key, line.after);
  refuse();
  for (const std::string& refusal : reload_->open_ports(engine_.channels())) refusals += "\n" + refusal;
  refuse();
  for (const Reload::Line& line : reload_->lines) {
    const std::string chosen = line.port->chosen_port();
    opened.push_back({static_cast<std::uint16_t>(line.channel), line.uart == 0 ? "port" : "second port", line.before,
                      chosen.empty() ? line.after : chosen});
  }
}

void Reloader::finish() {
  if (!next_) return;
  leaving_.add(*reload_, engine_.channels());
  const std::string truth_port = now_.truth.port;  // has the number that the system has chosen
  now_ = std::move(*next_);
  now_.truth.port = truth_port;
  cancel();
  changed_();
}

void Reloader::cancel() noexcept {
  engine_.control()->reload = nullptr;
  reload_.reset();
  next_.reset();
}

}  // namespace imud
