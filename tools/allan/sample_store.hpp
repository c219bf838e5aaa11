// SampleStore: samples of one channel, in memory or, above a certain length, in a temporary file.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace imud {

// Counts the touched bytes of a mapped file, which a pass over the file reports, and releases the pages of the
// file from time to time. Released pages stay in the system's cache and do not count as the program's memory.
class ResidentPages {
 public:
  ResidentPages() = default;  // of nothing
  ResidentPages(void* begin, std::size_t bytes) noexcept : begin_(begin), bytes_(bytes) {}
  void touched(std::size_t bytes) const noexcept;

 private:
  static constexpr std::size_t most = 24U << 20U;  // bytes
  void* begin_ = nullptr;
  std::size_t bytes_ = 0;
  mutable std::size_t touched_ = 0;
};

// Used by one thread. A temporary file has no name, and disappears with the store or at the end of the program.
class SampleStore {
 public:
  static constexpr std::size_t most_in_memory = 1U << 19U;  // samples

  SampleStore() noexcept;
  SampleStore(std::vector<double> samples) noexcept;  // NOLINT(google-explicit-constructor): they stay in memory
  SampleStore(SampleStore&&) noexcept;
  SampleStore& operator=(SampleStore&&) noexcept;
  ~SampleStore();

  // Throws std::runtime_error, with the folder and the remedy, if the file cannot be written.
  void push_back(double sample) {
    if (memory_.size() == limit_) spill();
    memory_.push_back(sample);
  }
  // Call it after the last push_back(). A store of more than most_in_memory samples cannot be read before. Throws
  // as push_back().
  void finish();
  // Multiplies all samples. Requires finish().
  void scale(double factor) noexcept;
  // Adds a sample of 0 at the end. Requires finish(). Throws as push_back().
  void extend();

  std::size_t size() const noexcept { return in_file_ + memory_.size(); }
  bool is_in_file() const noexcept { return file_ != nullptr; }
  const double* data() const noexcept;
  const double* begin() const noexcept { return data(); }
  const double* end() const noexcept { return data() + size(); }
  double operator[](std::size_t i) const noexcept { return data()[i]; }
  double& operator[](std::size_t i) noexcept { return const_cast<double&>(std::as_const(*this).data()[i]); }
  double front() const noexcept { return data()[0]; }
  std::vector<double> vector() const { return {begin(), end()}; }
  ResidentPages pages() const noexcept;

  // The folder of temporary files: TMPDIR, or /var/tmp.
  static std::string folder();

 private:
  class File;
  void spill();

  std::vector<double> memory_;
  std::size_t limit_ = most_in_memory;  // of memory_
  std::size_t in_file_ = 0;             // samples
  std::unique_ptr<File> file_;
};

}  // namespace imud
