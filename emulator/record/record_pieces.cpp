#include "emulator/record/record_pieces.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

namespace imud {
namespace {

constexpr std::string_view end_of_piece = ".pcapng";

// Returns the names of the pieces without their numbers: FILE- of FILE.pcapng.
std::string stem_of(const RecordOptions& options) {
  std::string_view stem = options.file;
  if (stem.ends_with(end_of_piece)) stem.remove_suffix(end_of_piece.size());
  return fmt::format("{}-", stem);
}

// Returns true for "00001" and "100000", the numbers in the names.
bool is_number(std::string_view text) {
  constexpr std::size_t digits = 5;
  return text.size() >= digits && text.find_first_not_of("0123456789") == text.npos;
}

}  // namespace

std::string piece_of(const RecordOptions& options, std::uint64_t number) {
  return fmt::format("{}{:05}{}", stem_of(options), number, end_of_piece);
}

std::vector<std::string> pieces_of(const RecordOptions& options) {
  if (options.max_bytes == 0) return {};
  std::vector<std::string> all = {piece_of(options, 1)};
  const std::filesystem::path stem = stem_of(options), folder = stem.parent_path();
  const std::string begin = stem.filename().string();
  std::error_code none;
  for (std::filesystem::directory_iterator entry(folder.empty() ? "." : folder, none), end; !none && entry != end;
       entry.increment(none)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(begin) || !name.ends_with(end_of_piece)) continue;
    const std::size_t around = begin.size() + end_of_piece.size();
    if (name.size() < around || !is_number(std::string_view(name).substr(begin.size(), name.size() - around)))
      continue;
    if (std::string path = (folder / name).string(); path != all.front()) all.push_back(std::move(path));
  }
  return all;
}

}  // namespace imud
