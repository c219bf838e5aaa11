// SeedArrays: the arrays that replays with many seeds write.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "emulator/plan/config.hpp"
#include "emulator/record/array_file.hpp"
#include "emulator/record/measurement_rows.hpp"
#include "emulator/record/row_truths.hpp"
#include "emulator/record/twin_rows.hpp"

namespace imud {

// Returns the names of the files: for each imu the one of the measurements and the one of the truth. Throws PortError
// if `path` has no `{imu}`, but there are several imus, and OpenError if it is a stream.
std::vector<std::string> array_paths(const Config& config, const std::string& path);

// For each imu a file of (seeds, measurements), and one of the truth at the measurements: the motion without any
// fault. If faults can change which measurements of an imu arrive, or when, or its clock wanders at random, the truth
// has the shape of the measurements, and rows behind the last one of a seed have no value. Rows of seeds that have
// not run have none either. True increments are sums since the measurement before, and NaN in the first one if
// samples that are not sent precede it. Where a run has extrapolated or held motion, its truth is the later truth for
// the same instant; NaN if none came.
class SeedArrays {
 public:
  // Returns a row without values.
  static MeasurementRow no_row() noexcept { return MeasurementRow(Measurement{}); }

  // `path`: has `{imu}` for an imu's name if there are several. `begun`: the faults that clients began in a record.
  // Throws as array_paths(), and OpenError if a file cannot be written.
  SeedArrays(const Config& config, const std::string& path, std::span<const FaultConfig> begun = {});

  struct Seeds {
    std::uint64_t first = 1, count = 1;
    std::string origin;  // the other inputs of the arrays; empty: an incomplete array cannot be completed
  };
  using Run = TwinRun;
  // Writes the truth, by a run of `config` and of its imus without errors, both without faults. Then the files have
  // room for the runs of all seeds. Throws std::runtime_error if an imu sends no measurement, or a file cannot be
  // written; OpenError if an array of another origin was left behind.
  void begin(const Config& config, const Seeds& seeds, const Run& run);

  // Returns true if the run of that seed is in all arrays already.
  bool is_done(std::uint64_t seed_index) const noexcept;
  // Records that the arrays of that imu have the run of that seed.
  void mark(std::size_t imu, std::uint64_t seed_index) noexcept {
    if (imus_[imu].varies()) imus_[imu].truth->mark(seed_index);
    imus_[imu].measured->mark(seed_index);
  }
  // Ends the arrays, which replace the old ones. Throws std::runtime_error.
  void commit();
  // Leaves the arrays incomplete, if they can be completed. Returns the name of one of them; empty if none is left.
  std::string keep() noexcept;

  // Returns true if faults can change which measurements of an imu arrive, or when.
  bool is_changed(std::size_t imu) const noexcept { return imus_[imu].is_changed; }
  // Returns true if the instants of an imu's samples depend on the seed, because its clock wanders at random.
  bool wanders(std::size_t imu) const noexcept { return imus_[imu].wanders; }
  // Collects the measurements of one run and one imu. Called after the fork.
  class Rows {
   public:
    // `made`: the rows that the imu makes; used if it is_changed(). `truth`: of this seed, if the imu wanders().
    Rows(const SeedArrays& arrays, std::size_t imu, std::uint64_t seed_index, std::vector<MadeRow> made = {},
         RunTruth::OfImu truth = {});
    std::unique_ptr<Port> port();
    // Writes the rows that are left, and rows without values for measurements that are missing. Returns the
    // shortfall; empty if there is none. Throws std::runtime_error if the file cannot be written.
    std::string finish();

   private:
    TrueRow truth_of(const MeasurementRow& row) noexcept;
    void flush() noexcept;
    const SeedArrays& arrays_;
    const std::size_t imu_;
    const RunTruth::OfImu truth_;
    RowTruths truths_;  // if the imu is_changed()
    std::uint64_t begin_, rows_ = 0, taken_ = 0;
    std::vector<std::byte> held_;  // rows
    std::vector<TrueRow> held_truths_;
  };

 private:
  struct Imu {
    ImuConfig config;
    std::unique_ptr<ArrayFile> measured, truth;
    std::uint64_t rows = 0;
    bool wanders = false;          // the instants of its samples depend on the seed
    bool is_changed = false;       // faults can change which measurements arrive, or when
    bool is_faulty = false;        // the imu may lack measurements
    std::vector<TrueRow> samples;  // the truth at each sample, if the imu is_changed and does not wander
    // Returns true if the truth at its measurements depends on the seed.
    bool varies() const noexcept { return wanders || is_changed; }
  };
  void make_room(const Config& config, const Seeds& seeds, const Run& run);

  std::vector<FaultConfig> faults_;  // of the configuration and of the record
  std::vector<Imu> imus_;
  std::uint64_t seeds_ = 0;
  bool can_be_completed_ = false;
};

}  // namespace imud
