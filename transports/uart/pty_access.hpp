// PtyAccess: who may open a pty, from the options `mode`, `owner` and `group` of its port.
#pragma once

#include <sys/types.h>

#include <array>
#include <optional>

#include "transports/port_spec.hpp"

namespace imud {

// Permissions and owners of a pty's slave; options not given stay as the kernel has set them.
class PtyAccess {
 public:
  static constexpr std::array<PortOption, 3> options = {{
      {.key = "mode", .help = "permissions of the pty, octal, such as 0660", .device_only = true},
      {.key = "owner", .help = "user who owns the pty, by name or number", .device_only = true},
      {.key = "group", .help = "group of the pty, by name or number", .device_only = true},
  }};

  // Looks the names up in the system's databases. Throws PortError if a name is unknown, or if the mode is not an
  // octal number from 0600 to 0666 by which the owner can read and write.
  explicit PtyAccess(const PortSpec& spec);

  // Applies the options to an open slave. Returns 0, or the errno of the failure. A process that is not root may give
  // only its own user, and groups that it belongs to.
  int apply(int slave) const noexcept;
  // Returns the error to throw if apply() has returned `error`.
  static PortError refusal(const PortSpec& spec, int error);

 private:
  std::optional<mode_t> mode_;
  std::optional<uid_t> owner_;
  std::optional<gid_t> group_;
};

}  // namespace imud
