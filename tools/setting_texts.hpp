// The settings of a protocol or truth format from the texts of a command line.
#pragma once

#include <fmt/format.h>

#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "emulator/frames/frame_file.hpp"
#include "protocols/settings.hpp"

namespace imud {

// Returns `settings` after each text, KEY=VALUE, with the description that one of them names. Throws
// std::invalid_argument, which names the fault and the remedy, or ConfigError with the faults of the description.
inline Settings settings_from(Settings settings, std::span<const Setting> declared,
                              const std::vector<std::string>& texts) {
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos)
      throw std::invalid_argument(fmt::format("--set {}: right would be --set KEY=VALUE", text));
    settings.set_text(text.substr(0, equals), text.substr(equals + 1));
  }
  if (!settings.frames()) attach_frames(settings, declared);
  return settings;
}
// Returns the initial settings after each text.
inline Settings settings_from(std::span<const Setting> declared, const std::vector<std::string>& texts) {
  return settings_from(Settings(declared), declared, texts);
}

}  // namespace imud
