// TruthBeside: the truth at each measurement of an imu, from its record, or from the configuration and the capture
// that it ran with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "protocols/measurements/measurement_row.hpp"
#include "protocols/protocol.hpp"
#include "tools/resolved_config.hpp"

namespace imud {

// Has imud replay the capture into arrays (`imud replay --npy`), in a folder of its own in $TMPDIR or /tmp with 232
// bytes for each measurement, which the destructor removes.
class TruthBeside {
 public:
  struct Options {
    std::string config, capture;  // as for `imud replay`; a record is both
    std::string imu;              // name; empty: the first with the protocol
  };
  // Throws std::invalid_argument if the configuration has faults, which imud has reported on standard error, or no
  // such imu; std::runtime_error if imud fails.
  TruthBeside(const Options& options, const Protocol& protocol);
  ~TruthBeside();
  TruthBeside(const TruthBeside&) = delete;
  TruthBeside& operator=(const TruthBeside&) = delete;

  // Returns the truth at the next measurement of the run with the same time and counter, as far as
  // the protocol carries them, within the next 65536; otherwise the truth at the run's next
  // measurement. NaN if there is none.
  TrueValues at(const MeasurementRow& row);

  // Call it after the last measurement. Returns a text if measurements have no truth, or an order without time and
  // counter does not fit; otherwise an empty one. Throws std::runtime_error if no measurement is one of the run.
  std::string finish() const;

  const ResolvedConfig& config() const noexcept { return config_; }

 private:
  // A file's bytes, mapped.
  class Mapped {
   public:
    Mapped() = default;
    ~Mapped();
    Mapped(const Mapped&) = delete;
    Mapped& operator=(const Mapped&) = delete;
    // Maps an array of rows of that size. Throws std::runtime_error.
    void open(const std::string& path, std::size_t row_size);
    std::size_t rows() const noexcept { return rows_; }
    const char* row(std::size_t i) const noexcept { return begin_ + i * row_size_; }

   private:
    void* map_ = nullptr;
    std::size_t size_ = 0, row_size_ = 0, rows_ = 0;
    const char* begin_ = nullptr;
  };

  const Options options_;
  ResolvedConfig config_;
  std::string folder_;
  Mapped measured_, truth_;
  std::size_t next_ = 0;
  std::uint64_t with_ = 0, without_ = 0;
  bool is_by_order_ = false;
};

}  // namespace imud
