#include "transports/port.hpp"

#include <fmt/format.h>

namespace imud {

std::unique_ptr<Port> open_port(std::string_view text, Role role) {
  const PortSpec spec = PortSpec::parse(text);
  if (const Transport* transport = find_transport(spec.scheme)) {
    transport->check(spec, role);
    return transport->open(spec, role);
  }
  std::string known;
  for (const Transport* transport : transports()) known += fmt::format(" {}:", transport->name);
  throw PortError(fmt::format("'{}': there is no transport '{}'; right would be one of{}", text, spec.scheme, known));
}

}  // namespace imud
