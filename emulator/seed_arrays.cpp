#include "emulator/seed_arrays.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <limits>
#include <span>
#include <stdexcept>

namespace imud {

namespace {

constexpr std::size_t hold_at_most = 512;  // rows

// Takes the truth at each measurement of an imu, from its twin without errors.
class TruthRows {
 public:
  TruthRows(ArrayFile& file, std::uint64_t& rows) : file_(file), rows_(rows) {}

  // A sample of the twin, which is sent before those frames of the imu that carry it.
  void on_truth(const Measurement& truth) {
    newest_ = truth.sample;
    increments_.add(truth.sample);
    if (rows_ + held_.size() > 0 || increments_.samples == 1) return;
    // Not known, as the product may begin its sums at any sample before the first one that it sends.
    increments_.delta_angle.setConstant(std::numeric_limits<double>::quiet_NaN());
    increments_.delta_velocity = increments_.delta_angle;
  }
  void on_measurement() {
    const auto values = [](const Vector3& v) { return std::array{v[0], v[1], v[2]}; };
    held_.push_back({newest_.time.ns,
                     {values(newest_.rate), values(newest_.specific_force), values(increments_.delta_angle),
                      values(increments_.delta_velocity)}});
    increments_ = {};
    if (held_.size() >= hold_at_most) flush();
  }
  void flush() noexcept {
    file_.write(std::as_bytes(std::span(held_)), rows_ * sizeof(TrueRow));
    rows_ += held_.size();
    held_.clear();
  }

 private:
  ArrayFile& file_;
  std::uint64_t& rows_;
  Sample newest_;
  Increments increments_;
  std::vector<TrueRow> held_;
};

std::string replaced(std::string text, std::string_view placeholder, std::string_view value) {
  for (std::size_t at = 0; (at = text.find(placeholder, at)) != std::string::npos; at += value.size())
    text.replace(at, placeholder.size(), value);
  return text;
}

}  // namespace

SeedArrays::SeedArrays(const Config& config, const std::string& path) {
  if (config.imus.size() > 1 && path.find("{imu}") == std::string::npos)
    throw PortError(fmt::format("--npy {}: each imu needs a file of its own; give a name with {{imu}}", path));
  for (const ImuConfig& imu : config.imus) {
    const std::filesystem::path file = replaced(path, "{imu}", imu.name);
    std::filesystem::path truth = file;
    truth.replace_filename(fmt::format("{}_truth{}", file.stem().string(), file.extension().string()));
    for (const std::filesystem::path& output : {file, truth})
      for (const std::string& used : config.files)
        if (regular_file(output) == used)
          throw PortError(
              fmt::format("--npy {}: the run reads or writes this file already; give another", output.string()));
    imus_.push_back({imu, std::make_unique<ArrayFile>(file, measurement_columns(false)),
                     std::make_unique<ArrayFile>(truth, truth_columns()), 0});
  }
}

void SeedArrays::begin(const Config& config, std::uint64_t seeds, const Run& run) {
  Config both = config;
  both.imus.clear();
  std::vector<std::unique_ptr<TruthRows>> rows;
  for (std::size_t i = 0; i < imus_.size(); ++i) {
    // The twin comes first: its sample is sent before that of the imu, and after the frames of the imu's deadlines.
    both.imus.push_back(without_errors(config.imus[i]));
    both.imus.push_back(config.imus[i]);
    both.imus[2 * i].port = fmt::format("{}", 2 * i);
    both.imus[2 * i + 1].port = fmt::format("{}", 2 * i + 1);
    rows.push_back(std::make_unique<TruthRows>(*imus_[i].truth, imus_[i].rows));
  }
  run(both, [&](std::string_view port, const PortSettings&) -> std::unique_ptr<Port> {
    for (std::size_t i = 0; i < both.imus.size(); ++i) {
      if (both.imus[i].port != port) continue;
      TruthRows& to = *rows[i / 2];
      if (i % 2 == 0) return decoding_port(both.imus[i], [&to](const Measurement& truth) { to.on_truth(truth); });
      return decoding_port(both.imus[i], [&to](const Measurement&) { to.on_measurement(); });
    }
    return idle_port();  // of a second UART
  });
  for (std::size_t i = 0; i < imus_.size(); ++i) {
    rows[i]->flush();
    imus_[i].truth->check();
    if (imus_[i].rows == 0)
      throw std::runtime_error(
          fmt::format("{}: sends no measurement, so that there is no array", imus_[i].config.name));
    const std::array shape{seeds, imus_[i].rows};
    imus_[i].measured->set_shape(shape, row_size(false));
    imus_[i].truth->set_shape(std::span(shape).last(1), sizeof(TrueRow));
    for (const auto& file : {imus_[i].measured.get(), imus_[i].truth.get()}) file->check();
  }
}

SeedArrays::Rows::Rows(const SeedArrays& arrays, std::size_t imu, std::uint64_t seed_index)
    : arrays_(arrays), imu_(imu), begin_(seed_index * arrays.imus_[imu].rows) {
  held_.reserve(hold_at_most * row_size(false));
}

std::unique_ptr<Port> SeedArrays::Rows::port() {
  const ImuConfig& imu = arrays_.imus_[imu_].config;
  return decoding_port(imu, [this, absent = imu.protocol->absent_rates](const Measurement& measurement) {
    if (++taken_ > arrays_.imus_[imu_].rows) return;
    const MeasurementRow row(measurement, absent);
    const auto bytes = std::as_bytes(std::span(&row, 1)).first(row_size(false));
    held_.insert(held_.end(), bytes.begin(), bytes.end());
    if (held_.size() == hold_at_most * row_size(false)) flush();
  });
}

void SeedArrays::Rows::flush() noexcept {
  arrays_.imus_[imu_].measured->write(held_, (begin_ + rows_) * row_size(false));
  rows_ += held_.size() / row_size(false);
  held_.clear();
}

std::string SeedArrays::Rows::finish() {
  flush();
  const Imu& imu = arrays_.imus_[imu_];
  imu.measured->check();
  if (taken_ == imu.rows) return {};
  return fmt::format("{}: {} measurements in place of {}", imu.config.name, taken_, imu.rows);
}

}  // namespace imud
