#include "emulator/seeds/seed_arrays.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/algorithm/string/replace.hpp>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "emulator/ground/text_file.hpp"
#include "emulator/plan/fault.hpp"
#include "transports/file/output_path.hpp"

namespace imud {

namespace {

constexpr std::size_t hold_at_most = 512;  // rows

// Returns true if the fault can add measurements to the imu's measurements. A device that restarts may send a
// message with its first sample, whatever the time since the message before.
bool adds_rows(const FaultConfig& fault) {
  return fault.kind->seam == FaultSeam::wire || fault.kind->seam == FaultSeam::power ||
         fault.kind->name == "repeated" || fault.kind->name == "late" || fault.kind->name == "other_settings";
}

template <class Row>
std::span<const std::byte> bytes_of(const Row& row, std::size_t size) {
  return std::as_bytes(std::span(&row, 1)).first(size);
}

}  // namespace

std::vector<std::string> array_paths(const Config& config, const std::string& path) {
  if (config.imus.size() > 1 && path.find("{imu}") == std::string::npos)
    throw PortError(fmt::format("--npy {}: each imu needs a file of its own; give a name with {{imu}}", path));
  if (is_standard_output(path))
    throw OpenError(fmt::format("--npy {}: an array cannot go to a stream; give a file", path));
  std::vector<std::string> all;
  for (const ImuConfig& imu : config.imus) {
    const std::filesystem::path file = boost::replace_all_copy(path, "{imu}", imu.name);
    std::filesystem::path truth = file;
    truth.replace_filename(fmt::format("{}_truth{}", file.stem().string(), file.extension().string()));
    all.insert(all.end(), {file.string(), truth.string()});
  }
  return all;
}

SeedArrays::SeedArrays(const Config& config, const std::string& path, std::span<const FaultConfig> begun)
    : faults_(config.faults) {
  faults_.insert(faults_.end(), begun.begin(), begun.end());
  const bool is_faulty_truth =
      std::any_of(faults_.begin(), faults_.end(), [](const FaultConfig& f) { return f.acts_on(fault_of_truth); });
  const std::vector<std::string> paths = array_paths(config, path);
  for (const ImuConfig& imu : config.imus) {
    Imu& added = imus_.emplace_back();
    added.config = imu;
    added.measured = std::make_unique<ArrayFile>(paths[2 * imus_.size() - 2], measurement_columns(false));
    added.truth = std::make_unique<ArrayFile>(paths[2 * imus_.size() - 1], truth_columns());
    const OscillatorModel& clock = imu.model.oscillator;
    added.wanders = clock.phase_random_walk > 0 || clock.frequency_random_walk > 0;
    added.is_changed = added.wanders && is_faulty_truth;
    added.is_faulty = is_faulty_truth || added.wanders;
    for (const FaultConfig& fault : faults_) {
      if (!fault.acts_on(imu.name)) continue;
      added.is_faulty = true;
      added.is_changed = added.is_changed || changes_rows(fault);
    }
  }
}

void SeedArrays::begin(const Config& config, const Seeds& seeds, const Run& run) {
  seeds_ = seeds.count;
  can_be_completed_ = seeds.count > 1 && !seeds.origin.empty();
  RunTruth truth = truth_of_run(config, run, [&](std::size_t i) { return imus_[i].is_changed && !imus_[i].wanders; });
  const auto require_rows = [&](const Imu& imu, std::string_view why) {
    if (imu.rows > 0) return;
    throw std::runtime_error(fmt::format("{}: sends no measurement, so that there is no array{}{}", imu.config.name,
                                         why.empty() ? "" : ": ", why));
  };
  for (std::size_t i = 0; i < imus_.size(); ++i) {
    imus_[i].rows = truth.imus[i].rows.size();
    require_rows(imus_[i], truth.cause);
    imus_[i].samples = std::move(truth.imus[i].samples);
  }
  make_room(config, seeds, run);
  for (std::size_t i = 0; i < imus_.size(); ++i) {
    Imu& imu = imus_[i];
    require_rows(imu, "its faults leave none");
    const std::array shape{seeds.count, imu.rows};
    const std::string origin = fmt::format("{}, seeds {}..{}, {} measurements of {}", seeds.origin, seeds.first,
                                           seeds.first + seeds.count - 1, imu.rows, imu.config.name);
    const auto begin_file = [&](ArrayFile& file, std::span<const std::uint64_t> of, std::size_t size) {
      const std::string other = file.begin(of, size, origin, seeds.count);
      if (!other.empty())
        throw OpenError(
            fmt::format("{}: is the part of another array, of {}; this one is of {}; remove it, or give "
                        "another --npy FILE",
                        file.incomplete_path(), other, origin));
    };
    begin_file(*imu.truth, imu.varies() ? std::span(shape) : std::span(shape).last(1), sizeof(TrueRow));
    begin_file(*imu.measured, shape, row_size(false));
    if (!imu.varies()) imu.truth->write(std::as_bytes(std::span(truth.imus[i].rows)), 0);
    for (const auto& file : {imu.truth.get(), imu.measured.get()}) file->check();
  }
}

// Determines the number of rows of imus whose measurements depend on the seed: the greater of the numbers in a run
// without faults and in the run with the first seed, and some more if faults or the clock add measurements.
void SeedArrays::make_room(const Config& config, const Seeds& seeds, const Run& run) {
  if (std::none_of(imus_.begin(), imus_.end(), [](const Imu& imu) { return imu.varies(); })) return;
  Config first = config;
  first.seed = seeds.first;
  const std::vector<std::uint64_t> counts = count_measurements(first, run);
  for (std::size_t i = 0; i < imus_.size(); ++i) {
    if (!imus_[i].varies()) continue;
    const std::uint64_t without = std::exchange(imus_[i].rows, counts[i]);
    if (seeds.count == 1) continue;
    imus_[i].rows = std::max(without, counts[i]);
    constexpr std::uint64_t part = 16;
    if (imus_[i].wanders || std::any_of(faults_.begin(), faults_.end(), [&](const FaultConfig& fault) {
          return fault.acts_on(imus_[i].config.name) && adds_rows(fault);
        }))
      imus_[i].rows += part + imus_[i].rows / part;
  }
}

bool SeedArrays::is_done(std::uint64_t seed_index) const noexcept {
  return std::all_of(imus_.begin(), imus_.end(), [&](const Imu& imu) { return imu.measured->is_done(seed_index); });
}

void SeedArrays::commit() {
  for (const Imu& imu : imus_) {
    imu.truth->commit();
    imu.measured->commit();
  }
}

std::string SeedArrays::keep() noexcept {
  const auto has_any = [&] {
    for (std::uint64_t i = 0; i < seeds_; ++i)
      if (is_done(i)) return true;
    return false;
  };
  if (!can_be_completed_ || !has_any()) return {};
  const MeasurementRow row = no_row();
  const TrueRow truth = no_truth();
  for (const Imu& imu : imus_) {
    imu.measured->keep(bytes_of(row, row_size(false)));
    imu.truth->keep(imu.varies() ? bytes_of(truth, sizeof truth) : std::span<const std::byte>());
  }
  return imus_.front().measured->incomplete_path();
}

SeedArrays::Rows::Rows(const SeedArrays& arrays, std::size_t imu, std::uint64_t seed_index, std::vector<MadeRow> made,
                       RunTruth::OfImu truth)
    : arrays_(arrays),
      imu_(imu),
      truth_(std::move(truth)),
      truths_(arrays.imus_[imu].wanders ? truth_.samples : arrays.imus_[imu].samples, std::move(made)),
      begin_(seed_index * arrays.imus_[imu].rows) {
  held_.reserve(hold_at_most * row_size(false));
}

std::unique_ptr<Port> SeedArrays::Rows::port() {
  return decoding_port(arrays_.imus_[imu_].config, [this](const Measurement& measurement) {
    if (++taken_ > arrays_.imus_[imu_].rows) return;
    const MeasurementRow row(measurement);
    const auto bytes = bytes_of(row, row_size(false));
    held_.insert(held_.end(), bytes.begin(), bytes.end());
    if (arrays_.imus_[imu_].varies()) held_truths_.push_back(truth_of(row));
    if (held_.size() == hold_at_most * row_size(false)) flush();
  });
}

// Returns the truth of the measurement that was taken last.
TrueRow SeedArrays::Rows::truth_of(const MeasurementRow& row) noexcept {
  if (arrays_.imus_[imu_].is_changed) return truths_.of(row);
  return taken_ <= truth_.rows.size() ? truth_.rows[taken_ - 1] : no_truth();
}

void SeedArrays::Rows::flush() noexcept {
  arrays_.imus_[imu_].measured->write(held_, (begin_ + rows_) * row_size(false));
  if (!held_truths_.empty())
    arrays_.imus_[imu_].truth->write(std::as_bytes(std::span(held_truths_)), (begin_ + rows_) * sizeof(TrueRow));
  rows_ += held_.size() / row_size(false);
  held_.clear();
  held_truths_.clear();
}

std::string SeedArrays::Rows::finish() {
  flush();
  const Imu& imu = arrays_.imus_[imu_];
  const MeasurementRow none = no_row();
  while (rows_ < imu.rows) {
    for (std::uint64_t i = rows_; i < std::min<std::uint64_t>(imu.rows, rows_ + hold_at_most); ++i) {
      const auto bytes = bytes_of(none, row_size(false));
      held_.insert(held_.end(), bytes.begin(), bytes.end());
      if (imu.varies()) held_truths_.push_back(no_truth());
    }
    flush();
  }
  imu.measured->check();
  imu.truth->check();
  if (taken_ == imu.rows || (imu.is_faulty && taken_ < imu.rows)) return {};
  return fmt::format("{}: {} measurements in place of {}", imu.config.name, taken_, imu.rows);
}

}  // namespace imud
