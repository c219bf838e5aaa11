#include "emulator/init/found_ports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <system_error>

namespace imud {
namespace {

namespace fs = std::filesystem;

// Returns the paths in a folder, sorted; none if there is no such folder.
std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> all;
  std::error_code none;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, none)) all.push_back(entry.path());
  std::sort(all.begin(), all.end());
  return all;
}

// Returns the first word of a file; empty if it cannot be read.
std::string first_word(const fs::path& path) {
  std::string word;
  std::ifstream(path) >> word;
  return word;
}

// Returns the name of the driver of a device in sysfs; empty if the device has no driver.
std::string driver_of(const fs::path& device) {
  std::error_code none;
  return fs::read_symlink(device / "device/driver", none).filename();
}

}  // namespace

std::vector<FoundPort> found_serial_ports() {
  std::vector<FoundPort> all;
  std::set<std::string> named;
  std::error_code none;
  for (const fs::path& link : entries("/dev/serial/by-id")) {
    const std::string device = fs::weakly_canonical(link, none).filename();
    named.insert(device);
    all.push_back({link, device});
  }
  for (const std::string_view kind : {"ttyUSB", "ttyACM", "ttyS"})
    for (const fs::path& path : entries("/dev")) {
      const std::string device = path.filename();
      if (!device.starts_with(kind) || named.contains(device)) continue;
      const fs::path sysfs = fs::path("/sys/class/tty") / device;
      const std::string driver = driver_of(sysfs);
      // The kernel has entries for UARTs that the board lacks: their type is 0, PORT_UNKNOWN (linux/serial.h).
      if (kind == "ttyS" && (driver.empty() || first_word(sysfs / "type") == "0")) continue;
      all.push_back({path, driver});
    }
  return all;
}

std::vector<FoundPort> found_can_interfaces() {
  constexpr std::string_view can = "280";  // ARPHRD_CAN, linux/if_arp.h
  std::vector<FoundPort> all;
  for (const fs::path& path : entries("/sys/class/net")) {
    if (first_word(path / "type") != can) continue;
    const std::string driver = driver_of(path);
    all.push_back({path.filename(), driver.empty() ? "virtual" : driver});
  }
  return all;
}

}  // namespace imud
