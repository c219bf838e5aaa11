// Rack: which hosts run which configurations, from RACK.toml.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/time.hpp"

namespace imud {

// A run of imud on a host: an instance of systemd's unit, imud@NAME.
struct RackRun {
  std::string name;           // the stem of the file; [control] name of the run
  std::string file;           // the configuration on this machine
  std::string text() const {  // for people: "imud@nose"
    return "imud@" + name;
  }
};

struct RackHost {
  // The service manager that starts the runs, and the folder of the configurations on the host.
  enum class Service : std::uint8_t {
    system,  // systemctl, /etc/imud
    user,    // systemctl --user, ~/.config/imud
  };

  std::string name;  // for people
  std::string ssh;   // the destination for ssh(1); empty: this machine, without ssh
  Service service = Service::system;
  std::vector<RackRun> runs;
};

struct Rack {
  std::string file;
  Nanoseconds time_limit{0};  // for the answer of a host
  std::vector<RackHost> hosts;
};

// Reads the file of a rack. Throws ConfigError with every fault of it.
Rack read_rack(const std::string& path);

}  // namespace imud
