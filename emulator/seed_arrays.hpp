// SeedArrays: the arrays that replays with many seeds write.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/config.hpp"
#include "emulator/measurement_rows.hpp"
#include "emulator/sync.hpp"

namespace imud {

// For each imu a file of (seeds, measurements), and one of the truth at the measurements. True increments are sums
// since the measurement before, and NaN in the first one if samples that are not sent precede it.
class SeedArrays {
 public:
  // `path`: has `{imu}` for an imu's name if there are several. Throws PortError if it has not, OpenError if a file
  // cannot be written.
  SeedArrays(const Config& config, const std::string& path);

  // Writes the truth, by a run of `config` and of its imus without errors; `run` runs a configuration with that way
  // to open a port. Then the files have room for `seeds` runs. Throws std::runtime_error if an imu sends no
  // measurement, or a file cannot be written.
  using Run = std::function<void(const Config& config, const Sync::OpenPort& open)>;
  void begin(const Config& config, std::uint64_t seeds, const Run& run);

  // Collects the measurements of one run and one imu. Called after the fork.
  class Rows {
   public:
    Rows(const SeedArrays& arrays, std::size_t imu, std::uint64_t seed_index);
    std::unique_ptr<Port> port();
    // Writes the last rows. Returns what is missing, or a text of length 0. Throws std::runtime_error if the file
    // cannot be written.
    std::string finish();

   private:
    void flush() noexcept;
    const SeedArrays& arrays_;
    const std::size_t imu_;
    std::uint64_t begin_, rows_ = 0, taken_ = 0;
    std::vector<std::byte> held_;  // rows
  };

 private:
  struct Imu {
    ImuConfig config;
    std::unique_ptr<ArrayFile> measured, truth;
    std::uint64_t rows = 0;
  };
  std::vector<Imu> imus_;
};

}  // namespace imud
