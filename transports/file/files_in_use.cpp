#include "transports/file/files_in_use.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "transports/file/output_path.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

bool is_same_file(const std::string& a, const std::string& b) {
  std::error_code error;
  return a == b || fs::equivalent(a, b, error);
}

std::string name_of(const std::string& path) { return is_standard_output(path) ? "-" : canonical_path(path); }

}  // namespace

std::string canonical_path(const std::string& path) {
  std::error_code error;
  const fs::path all = fs::weakly_canonical(fs::absolute(path, error), error);
  return error ? std::string() : all.string();
}

std::string regular_file(const std::string& path) {
  std::error_code error;
  const auto type = fs::status(path, error).type();
  const bool fits = type == fs::file_type::regular || type == fs::file_type::not_found;
  return fits ? canonical_path(path) : std::string();
}

void FilesInUse::add(const std::string& path, std::string_view use) {
  if (!path.empty()) files_.push_back({name_of(path), std::string(use)});
}

void FilesInUse::add_input(std::string_view text, std::string_view use) {
  for (const std::string_view part : {text, text.substr(text.find(':') + 1)})
    for (const std::string_view path : {part, part.substr(0, part.find('?'))})
      if (!is_standard_output(std::string(path))) add(std::string(path), use);
}

std::string_view FilesInUse::use_of(const std::string& path) const {
  const std::string name = name_of(path);
  for (const File& file : files_)
    if (is_same_file(file.path, name)) return file.use;
  return {};
}

std::string FilesInUse::claim(const std::string& path, std::string_view use) {
  if (path.empty()) return {};
  if (const std::string_view in_use = use_of(path); !in_use.empty())
    return fmt::format("{}: is {}; give another file", path, in_use);
  if (is_standard_output(path) || !regular_file(path).empty()) add(path, use);
  return {};
}

}  // namespace imud
