#include "tools/allan/sample_store.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace imud {

void ResidentPages::touched(std::size_t bytes) const noexcept {
  if (begin_ == nullptr) return;
  touched_ += bytes;
  if (touched_ < most) return;
  ::madvise(begin_, bytes_, MADV_DONTNEED);
  touched_ = 0;
}

class SampleStore::File {
 public:
  File() {
    std::string name = folder() + "/imud-samples-XXXXXX";
    descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (descriptor_ < 0) fail();
    ::unlink(name.c_str());
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() {
    if (mapped_ != nullptr) ::munmap(mapped_, mapped_bytes_);
    ::close(descriptor_);
  }

  void write(std::span<const double> samples) {
    auto bytes = std::as_bytes(samples);
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail();
      bytes = bytes.subspan(static_cast<std::size_t>(written));
      bytes_ += static_cast<std::size_t>(written);
    }
  }
  void map() {
    if (mapped_ != nullptr) ::munmap(mapped_, mapped_bytes_);
    mapped_ = nullptr;
    void* mapped = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0);
    if (mapped == MAP_FAILED) fail();
    mapped_ = static_cast<double*>(mapped);
    mapped_bytes_ = bytes_;
  }
  double* data() const noexcept { return mapped_; }
  ResidentPages pages() const noexcept { return {mapped_, bytes_}; }

 private:
  [[noreturn]] static void fail() {
    throw std::runtime_error(
        fmt::format("cannot write a temporary file in {}: {}; right would be another folder in TMPDIR", folder(),
                    std::strerror(errno)));
  }

  int descriptor_ = -1;
  std::size_t bytes_ = 0, mapped_bytes_ = 0;
  double* mapped_ = nullptr;
};

SampleStore::SampleStore() noexcept = default;
SampleStore::SampleStore(std::vector<double> samples) noexcept : memory_(std::move(samples)) {}
SampleStore::SampleStore(SampleStore&&) noexcept = default;
SampleStore& SampleStore::operator=(SampleStore&&) noexcept = default;
SampleStore::~SampleStore() = default;

void SampleStore::spill() {
  if (!file_) file_ = std::make_unique<File>();
  file_->write(memory_);
  in_file_ += memory_.size();
  constexpr std::size_t buffer = 1U << 15U;
  if (limit_ != buffer) memory_ = {};
  limit_ = buffer;
  memory_.clear();
  memory_.reserve(limit_);
}

void SampleStore::finish() {
  if (!file_ || file_->data() != nullptr) return;
  spill();
  memory_ = {};
  file_->map();
}

void SampleStore::scale(double factor) noexcept {
  double* samples = file_ ? file_->data() : memory_.data();
  const ResidentPages resident = pages();
  constexpr std::size_t piece = 1U << 16U;
  for (std::size_t begin = 0; begin < size(); begin += piece) {
    const std::size_t end = std::min(begin + piece, size());
    for (std::size_t i = begin; i < end; ++i) samples[i] *= factor;
    resident.touched((end - begin) * sizeof(double));
  }
}

void SampleStore::extend() {
  if (!file_) return memory_.push_back(0);
  constexpr double added = 0;
  file_->write(std::span(&added, 1));
  ++in_file_;
  file_->map();
}

const double* SampleStore::data() const noexcept { return file_ ? file_->data() : memory_.data(); }

ResidentPages SampleStore::pages() const noexcept { return file_ ? file_->pages() : ResidentPages(); }

std::string SampleStore::folder() {
  const char* folder = std::getenv("TMPDIR");
  return folder != nullptr && *folder != '\0' ? folder : "/var/tmp";
}

}  // namespace imud
