// ShardArrays: the measurements of the cases of a shard, in a file beside it.
//
// The file FIRST-LAST.rows has, imu after imu, the rows of each case of the shard, as MeasurementRow without the
// truth: with the files of all shards one after another, the rows of an imu are an array in the order of the cases.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emulator/campaign/shards/shard.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// The arrays of a campaign.
struct ArrayShape {
  // A quantity that the cases vary; the first one varies slowest.
  struct Dimension {
    std::string name;                      // the axis, "draw" or "seed"
    std::vector<std::string> values = {};  // of an axis, as in tables
    std::uint64_t first = 0, count = 0;    // of draws and seeds
    std::uint64_t size() const noexcept { return values.empty() ? count : values.size(); }
  };
  std::uint64_t rows = 0;  // of each case and imu; 0: there are no arrays
  std::vector<std::string> imus = {};
  std::vector<Dimension> dimensions = {};

  // Return the bytes of one case and imu, and of all imus in so many cases.
  std::uint64_t block_bytes() const noexcept;
  std::uint64_t bytes(std::uint64_t cases) const noexcept { return cases * imus.size() * block_bytes(); }
};

// Returns so many rows without a value.
std::vector<std::byte> rows_without_value(std::uint64_t count);
// Returns the name of the file: "000000000-000000099.rows".
std::string array_name(const CaseRange& shard);
// Returns the cases of such a name; nullopt if it is another one.
std::optional<CaseRange> cases_of_array(std::string_view name) noexcept;
// Returns the digest of such a file; nullopt if it cannot be read.
std::optional<ArrayDigest> digest_of_array(const std::filesystem::path& path);

// The temporary files of a run, in the name of this process, also if its workers write them. All functions throw
// std::runtime_error, which names the file and the cause, such as a full disk. Two runs write the same bytes.
class ShardArrays {
 public:
  // `folder`: of the shards.
  ShardArrays(std::filesystem::path folder, ArrayShape shape)
      : folder_(std::move(folder)), shape_(std::move(shape)), mine_("") {}

  bool are_asked_for() const noexcept { return shape_.rows > 0; }
  // Returns a function that writes the block of a case and an imu, any number of times; nullptr if there are no
  // arrays.
  using Write = std::function<void(std::size_t imu, std::span<const std::byte> rows)>;
  Write writer(const CaseRange& shard, std::uint64_t index) const;
  // Makes the rows of a case without value.
  void clear(const CaseRange& shard, std::uint64_t index) const;
  // Takes the rows of a case from the file that the shard has.
  void keep(const CaseRange& shard, std::uint64_t index) const;
  // Waits until the disk has the file, and gives it its name: before the shard gets its own. Returns nullopt if
  // somebody has removed the temporary file meanwhile: then there is none, or it lacks cases.
  std::optional<ArrayDigest> commit(const CaseRange& shard) const;
  // Removes the temporary file, if there is one.
  void release(const CaseRange& shard) const noexcept;

 private:
  std::filesystem::path temporary(const CaseRange& shard) const;
  FileDescriptor open(const CaseRange& shard) const;
  std::uint64_t place(const CaseRange& shard, std::size_t imu, std::uint64_t index) const noexcept;
  bool lacks_cases(int file, const CaseRange& shard) const;

  const std::filesystem::path folder_;
  const ArrayShape shape_;
  const TemporaryFile mine_;
};

}  // namespace imud
