// FilesInUse: the files that a program reads and writes, so that no output overwrites another of these files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace imud {

// Returns the path without symbolic links, `.` and `..`; empty if the path cannot be resolved.
std::string canonical_path(const std::string& path);
// Returns the canonical path of a regular file, or of one that does not exist; empty for everything else.
std::string regular_file(const std::string& path);

// Two paths are equal if they lead to the same file, directly or by a symbolic or hard link, or if both name
// standard output in any spelling.
class FilesInUse {
 public:
  // Adds a file under the words that describe it, such as "the input".
  void add(const std::string& path, std::string_view use);
  // Adds the file of an input: PATH, PATH?OPTIONS, or a port's text. Standard input is no file.
  void add_input(std::string_view text, std::string_view use);
  // Returns the use of the file; empty if it is not in use.
  std::string_view use_of(const std::string& path) const;
  // Adds an output; an empty path adds none. Returns the fault if the file is in use already, such as "PATH: is
  // the input; give another file"; otherwise an empty text. Several outputs may go to the same device or named
  // pipe; one alone to standard output.
  [[nodiscard]] std::string claim(const std::string& path, std::string_view use);

 private:
  struct File {
    std::string path, use;
  };
  std::vector<File> files_;
};

}  // namespace imud
