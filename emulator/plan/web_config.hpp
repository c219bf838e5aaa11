// WebConfig: where the web server listens, and who may speak to it.
#pragma once

#include <string>

namespace imud {

struct WebConfig {
  std::string listen;      // "ADDR:PORT" with a numeric address; port 0: the system chooses one; empty: no server
  std::string token_file;  // empty: no token is asked for
};

}  // namespace imud
