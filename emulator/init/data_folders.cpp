#include "emulator/init/data_folders.hpp"

#include <system_error>

namespace imud {

std::array<std::filesystem::path, 2> data_folders() {
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe");
  const std::filesystem::path beside = program.parent_path().parent_path();
  return {beside / "share/imud", beside.parent_path()};
}

std::filesystem::path data_path(std::string_view name) {
  std::error_code none;
  for (const std::filesystem::path& folder : data_folders())
    if (std::filesystem::exists(folder / name, none)) return folder / name;
  return name;
}

}  // namespace imud
