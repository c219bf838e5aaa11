// Shard: a file with the results of consecutive cases of a campaign.
//
// A shard has lines of JSON: a header, a row for each case in ascending order, and a footer with the SHA-256 of all
// bytes before the footer (emulator/campaign/README.md). The file has its name only when it is whole.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/campaign/shards/sha256_stream.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

struct CaseRange {
  std::uint64_t first = 0, last = 0;  // both included
  std::uint64_t size() const noexcept { return last - first + 1; }
  // Reads "0..99", or "7" for one case; returns nullopt for any other text.
  static std::optional<CaseRange> parse(std::string_view text) noexcept;
  friend bool operator==(const CaseRange&, const CaseRange&) = default;
};

struct ShardHead {
  std::string plan;     // the SHA-256 of the plan's text
  std::string version;  // of imud
  std::string build;    // of imud; empty in a shard of an imud that did not store it
  CaseRange cases;
  friend bool operator==(const ShardHead&, const ShardHead&) = default;
};

// The size and the digest of the file with the measurements of the cases (shard_arrays.hpp), as in the footer.
struct ArrayDigest {
  std::uint64_t bytes = 0;
  std::string sha256;
  friend bool operator==(const ArrayDigest&, const ArrayDigest&) = default;
};

struct Shard {
  ShardHead head;
  std::vector<std::string> rows;                     // of each case: JSON in one line
  std::optional<ArrayDigest> arrays = std::nullopt;  // nullopt: there are none
};

// The result in a row.
struct RowResult {
  int exit_code = 1;
  bool could_not_be_run = false;    // the row has an `error`
  bool expectation_failed = false;  // at least one
  std::string error = {};
  std::string shortfall = {};  // the first one, of a case that was run

  // `row`: from a whole shard, or from CaseRunner. Throws nlohmann::json::exception for other texts.
  explicit RowResult(std::string_view row);
};

// How cases have ended.
struct CaseTally {
  std::uint64_t could_not_be_run = 0;     // cases with an error in place of a run
  std::uint64_t expectations_failed = 0;  // cases with an expectation that does not hold
  std::uint64_t incomplete = 0;           // other cases whose exit code is not 0
  int exit_code = 0;                      // worse_exit_code() of all

  void add(const RowResult& row) noexcept;
  void add(const CaseTally& other) noexcept;
  // Returns the line about these counts that is printed at the end of a run.
  std::string text() const;
};

// Returns the text of the fault that the row of case `index` in a shard cannot be read.
std::string no_result_in_row_of(std::uint64_t index);
// Returns the name of a shard's file in the folder `shards`: "000000000-000000099.jsonl".
std::string shard_name(const CaseRange& cases);
// Returns the cases of a shard by the name of its file; nullopt for any other name.
std::optional<CaseRange> cases_of_shard(std::string_view name) noexcept;

// Reads a shard. Returns nullopt if the file is not whole; then `fault` has the reason, such as "is cut short after
// 12 of 100 rows".
std::optional<Shard> read_shard(const std::filesystem::path& path, std::string& fault);

// The name of the temporary file into which a process writes a shard, or another file of the campaign's folder, until
// this file is whole: `.NAME.HOST.SPACE.PID.tmp`.
struct TemporaryFile {
  std::string name, host;
  std::string space;  // process numbers are unique within it: a boot of the host, and a container
  pid_t process = 0;

  // A temporary file of this process.
  explicit TemporaryFile(std::string name);
  // Returns the temporary file of this process for a shard.
  static TemporaryFile of_shard(const CaseRange& cases);
  // Reads the parts of a temporary file's name; returns nullopt for any other name.
  static std::optional<TemporaryFile> parse(std::string_view file_name);
  std::string file_name() const;
  // Returns true if the file is of this host and of this process's space, and its process has ended. Returns false if
  // this cannot be known.
  bool is_left_behind() const;

 private:
  TemporaryFile() = default;
};

// Writes a shard into its temporary file, which may exist already. The destructor removes this file if the shard is
// not whole. All functions throw std::runtime_error, which names the file and the cause, such as a full disk.
class ShardWriter {
 public:
  ShardWriter(std::filesystem::path folder, const ShardHead& head);
  ShardWriter(const ShardWriter&) = delete;
  ShardWriter& operator=(const ShardWriter&) = delete;
  ~ShardWriter();

  // Adds the row of the next case.
  void add(std::string_view row);
  // Writes the footer, waits until the file is on the disk, and gives the file the name of the shard. Throws if a row
  // is missing. Returns false, without a shard, if the temporary file was removed by another process.
  bool commit(const std::optional<ArrayDigest>& arrays = std::nullopt);

 private:
  void write(std::string_view line);
  void flush();

  const std::filesystem::path folder_;
  const CaseRange cases_;
  const std::filesystem::path temporary_;
  FileDescriptor file_;
  std::string held_;  // not written yet
  Sha256Stream digest_;
  std::uint64_t rows_ = 0;
  bool is_whole_ = false;
};

// Writes a new file with `text`, whole or not at all. If `path` exists already, it is left unchanged, and the
// function returns false. Throws std::runtime_error.
bool write_once(const std::filesystem::path& path, std::string_view text);

}  // namespace imud
