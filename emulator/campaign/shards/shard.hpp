// Shard: a file with the results of consecutive cases of a campaign.
//
// A shard has lines of JSON: a header, a row for each case in their order, and a footer with the SHA-256 of all bytes
// before it (emulator/campaign/README.md). It has its name from the moment on at which it is whole.
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
  // Returns the range of "0..99", or "7"; nullopt if the text is neither.
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

// The file with the measurements of the cases (shard_arrays.hpp). The footer has its size and its digest.
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
  bool could_not_be_run = false;    // it has an `error`
  bool expectation_failed = false;  // one of them
  std::string error = {};
  std::string shortfall = {};  // the first one, of a case that was run

  // `row` is of a shard that is whole, or of a case that was run. Throws nlohmann::json::exception for other texts.
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
  // Returns the line of it at the end of a run.
  std::string text() const;
};

// Returns the fault of a shard in which the row of a case cannot be read.
std::string no_result_in_row_of(std::uint64_t index);
// Returns the name of the file in the folder `shards`: "000000000-000000099.jsonl".
std::string shard_name(const CaseRange& cases);
// Returns the cases of such a name; nullopt if it is the name of no shard.
std::optional<CaseRange> cases_of_shard(std::string_view name) noexcept;

// Reads a shard. Returns nullopt if it is not whole; then `fault` has the reason, such as "is cut short after 12 of
// 100 rows".
std::optional<Shard> read_shard(const std::filesystem::path& path, std::string& fault);

// The file into which a shard, or another file of the campaign's folder, is written until it is whole:
// `.NAME.HOST.PID.tmp`.
struct TemporaryFile {
  std::string name, host;
  std::string space;  // of the numbers of processes: of a boot of the host, and of a container
  pid_t process = 0;

  // A file of this process.
  explicit TemporaryFile(std::string name);
  // The file of this process for a shard.
  static TemporaryFile of_shard(const CaseRange& cases);
  // Returns the parts of a file's name; nullopt if it is the name of no temporary file.
  static std::optional<TemporaryFile> parse(std::string_view file_name);
  std::string file_name() const;
  // Returns true if its process had a number of this space and has ended. Another process may run.
  bool is_left_behind() const;

 private:
  TemporaryFile() = default;
};

// Writes a shard into a temporary file, also one that is there already, which the destructor removes if the shard is
// not whole. All functions throw std::runtime_error, which names the file and the cause, such as a full disk.
class ShardWriter {
 public:
  ShardWriter(std::filesystem::path folder, const ShardHead& head);
  ShardWriter(const ShardWriter&) = delete;
  ShardWriter& operator=(const ShardWriter&) = delete;
  ~ShardWriter();

  // Adds the row of the next case.
  void add(std::string_view row);
  // Writes the footer, waits until the disk has the file, and gives it its name. The rows of all cases were added.
  // Returns false if somebody has removed the temporary file: then there is no shard.
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

// Writes a file of `text` at `path`, whole or not at all, unless there is one: then that one stays, and the function
// returns false. Throws std::runtime_error.
bool write_once(const std::filesystem::path& path, std::string_view text);

}  // namespace imud
