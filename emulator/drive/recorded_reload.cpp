// The reloads of a recorded run.
#include <exception>
#include <utility>

#include "emulator/config/load_config.hpp"
#include "emulator/drive/recorded_run.hpp"
#include "emulator/imu/reload.hpp"

namespace imud {

void RecordedRun::add_to_reload(std::span<const std::byte> piece) {
  reload_text_.append(reinterpret_cast<const char*>(piece.data()), piece.size());
  if (static_cast<std::int64_t>(reload_text_.size()) < reload_->c) return;
  const RecordEvent event = *std::exchange(reload_, std::nullopt);
  try {
    Config next = config_of_text(reload_text_);
    Reload reload(config_, next, imus_, config_.seed);
    config_ = std::move(next);
    const Step::Content content{.reload = &reload};
    engine_->apply(Step::command({.kind = Command::Kind::reload}, HostTime{event.a}, &content));
    --reloads_missing_;
  } catch (const std::exception&) {  // of a damaged record
  }
}

}  // namespace imud
