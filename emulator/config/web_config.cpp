#include "emulator/config/config_parts.hpp"
#include "transports/port_spec.hpp"

namespace imud {

WebConfig read_web(TableReader table) {
  WebConfig web;
  web.listen = table.text("listen", "");
  web.token_file = file_named(table, "token_file", table.text("token_file", ""));
  if (!web.listen.empty()) {
    const auto address = NumericAddress::try_parse(web.listen);
    if (!address)
      table.fault("listen", "give a numeric address and a port, such as \"127.0.0.1:8080\"");
    else if (!address->is_loopback() && web.token_file.empty())
      table.fault("listen",
                  "other machines reach this address: give web.token_file, or listen at \"127.0.0.1:8080\"");
  }
  table.finish();
  return web;
}

}  // namespace imud
