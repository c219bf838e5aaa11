// ShardArrays: the measurements of the cases of a shard, in a file beside it.
//
// The file FIRST-LAST.rows has a block for each imu. A block has the rows of all cases of the shard in ascending
// order, as MeasurementRow without the truth. The blocks of one imu from all shards, one after another, are therefore
// an array in the order of the cases.
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
// Returns the name of the file of a shard's arrays: "000000000-000000099.rows".
std::string array_name(const CaseRange& shard);
// Returns the cases of a file of arrays by the name; nullopt for any other name.
std::optional<CaseRange> cases_of_array(std::string_view name) noexcept;
// Returns the size and the digest of a file; nullopt if the file cannot be read.
std::optional<ArrayDigest> digest_of_array(const std::filesystem::path& path);

// The temporary files of arrays of a run. Their names have the number of the process that constructs this, also if
// workers write them. All functions throw std::runtime_error, which names the file and the cause, such as a full
// disk. Two runs of the same case write the same bytes.
class ShardArrays {
 public:
  // `folder`: the folder `shards`.
  ShardArrays(std::filesystem::path folder, ArrayShape shape)
      : folder_(std::move(folder)), shape_(std::move(shape)), mine_("") {}

  bool are_asked_for() const noexcept { return shape_.rows > 0; }
  // Returns a function that writes the block of a case and an imu, any number of times; nullptr if there are no
  // arrays.
  using Write = std::function<void(std::size_t imu, std::span<const std::byte> rows)>;
  Write writer(const CaseRange& shard, std::uint64_t index) const;
  // Writes rows without a value for a case.
  void clear(const CaseRange& shard, std::uint64_t index) const;
  // Copies the rows of a case from the present file of the shard to the temporary file.
  void keep(const CaseRange& shard, std::uint64_t index) const;
  // Waits until the temporary file is on the disk, and gives the file its name. Call this before the shard itself
  // gets its name. Returns nullopt if another process has removed the temporary file: the file is missing, or lacks
  // cases because it was created again.
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
