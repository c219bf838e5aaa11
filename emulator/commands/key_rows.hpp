// The rows of the reference. A row describes a configuration key, or several keys with the same meaning.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace imud {

// A page of the reference in Markdown, which CMake builds into the program: emulator/CONFIGURATION.md and
// emulator/faults/README.md.
struct ReferencePage {
  std::string_view name;
  std::string_view text;
};
std::span<const ReferencePage> reference_pages() noexcept;

struct KeyRow {
  std::vector<std::string> keys;  // with their tables: imu.gyro.bias_deg_per_s, fault.at_s
  std::string protocol;           // the protocol of a key of [imu.device]; empty for other keys
  std::vector<std::pair<std::string, std::string>> cells;  // title and text of the other columns, such as "default"
};

// Returns the rows of all pages in the order of the pages.
std::vector<KeyRow> key_rows();

// Returns the key without the number or the name of an imu: imu.gyro.x for imu.0.gyro.x and imu.NAME.gyro.x. `rows`:
// key_rows().
std::string without_imu(const std::string& key, const std::vector<KeyRow>& rows);

}  // namespace imud
