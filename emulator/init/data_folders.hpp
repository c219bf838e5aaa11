// The folders in which an installed imud, and one in its build, finds the files that users copy and run.
#pragma once

#include <array>
#include <filesystem>
#include <string_view>

namespace imud {

// Returns share/imud beside the program's own folder, then the source tree around a build. Either may not exist.
std::array<std::filesystem::path, 2> data_folders();
// Returns the path of a file or folder in the first of these that has it; `name` itself if none has.
std::filesystem::path data_path(std::string_view name);

}  // namespace imud
