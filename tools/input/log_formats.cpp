#include "tools/input/log_formats.hpp"

#include "emulator/frames/described_protocols.hpp"

namespace imud {

extern const Protocol mcap_format, ulog_format;

namespace {
constexpr const Protocol* all_log_formats[] = {&mcap_format, &ulog_format};
}

std::span<const Protocol* const> log_formats() noexcept { return all_log_formats; }

const Protocol* find_input_format(std::string_view name) noexcept {
  for (const Protocol* format : log_formats())
    if (format->name == name) return format;
  return resolve_protocol(name);
}

}  // namespace imud
