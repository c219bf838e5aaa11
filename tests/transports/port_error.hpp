// The message of a port's error.
#pragma once

#include <string>
#include <string_view>

#include "transports/port.hpp"

namespace imud {

// Returns the message of the PortError that opening `spec` throws; empty if it opens.
inline std::string error_of(std::string_view spec, const PortSettings& settings = Role::device) {
  try {
    open_port(spec, settings);
  } catch (const PortError& error) {
    return error.what();
  }
  return {};
}

inline bool mentions(std::string_view text, std::string_view word) {
  return text.find(word) != std::string_view::npos;
}

}  // namespace imud
