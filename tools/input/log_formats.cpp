#include "tools/input/log_formats.hpp"

#include "emulator/frames/described_protocols.hpp"

namespace imud {

const Protocol* find_input_format(std::string_view name) noexcept {
  const Protocol* format = find_log_format(name);
  return format != nullptr ? format : resolve_protocol(name);
}

}  // namespace imud
