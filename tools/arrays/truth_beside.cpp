#include "tools/arrays/truth_beside.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "tools/child_program.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port.hpp"

namespace imud {

namespace {

constexpr std::size_t most_skipped = 65536;

// Returns the name of the imu that is wanted.
std::string imu_name(const TruthBeside::Options& options, const nlohmann::json& imus, const Protocol& protocol) {
  std::string known;
  for (const auto& imu : imus) {
    const std::string name = imu.at("name"), its_protocol = imu.at("protocol");
    known += fmt::format("{}{} ({})", known.empty() ? "" : ", ", name, its_protocol);
    if (its_protocol == protocol.name && (options.imu.empty() || options.imu == name)) return name;
  }
  throw std::invalid_argument(fmt::format("{}: has no imu{} with the protocol {}; there are {}", options.config,
                                          options.imu.empty() ? "" : " " + options.imu, protocol.name, known));
}

}  // namespace

TruthBeside::Mapped::~Mapped() {
  if (map_ != nullptr) ::munmap(map_, size_);
}

void TruthBeside::Mapped::open(const std::string& path, std::size_t row_size) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!file || ::fstat(file.get(), &status) != 0) throw std::runtime_error(path + ": " + std::strerror(errno));
  size_ = static_cast<std::size_t>(status.st_size);
  void* map = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file.get(), 0);
  if (map == MAP_FAILED) throw std::runtime_error(path + ": " + std::strerror(errno));
  map_ = map;
  ::madvise(map_, size_, MADV_SEQUENTIAL);
  constexpr std::size_t before = 10;  // magic, version, length of the header
  const char* bytes = static_cast<const char*>(map_);
  const auto length = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(bytes[i])); };
  const std::size_t header = before + (length(8) | length(9) << 8U);
  begin_ = bytes + header;
  row_size_ = row_size;
  rows_ = (size_ - header) / row_size;
}

TruthBeside::TruthBeside(const Options& options, const Protocol& protocol) : options_(options) {
  // A line's pace belongs to a port, which is not opened.
  constexpr const char* unpaced = "imu.*.pace=none";
  config_ = resolve_config(options.config, {"truth.port=" + capture_port(options.capture), "clock=fast", unpaced});
  const std::string name = imu_name(options, config_.checked.at("config").at("imu"), protocol);
  folder_ = std::filesystem::temp_directory_path() / "imu-decode-XXXXXX";
  if (::mkdtemp(folder_.data()) == nullptr) throw std::runtime_error(folder_ + ": " + std::strerror(errno));
  try {
    const ChildResult result =
        run_child(imud_program(), {"replay", options.config, options.capture, "--npy", folder_ + "/{imu}.npy",
                                   "--jobs", "1", "--quiet", "--set", unpaced});
    constexpr int incomplete = 3;  // so was the run that is decoded
    if (result.exit_code != 0 && result.exit_code != incomplete)
      throw std::runtime_error(fmt::format("imud replay: exit code {}", result.exit_code));
    measured_.open(fmt::format("{}/{}.npy", folder_, name), row_size(false));
    truth_.open(fmt::format("{}/{}_truth.npy", folder_, name), sizeof(std::int64_t) + sizeof(TrueValues));
  } catch (...) {
    std::filesystem::remove_all(folder_);
    throw;
  }
}

TruthBeside::~TruthBeside() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

TrueValues TruthBeside::at(const MeasurementRow& row) {
  constexpr std::uint32_t identity = Measurement::time | Measurement::counter;
  const std::size_t end = std::min({measured_.rows(), truth_.rows(), next_ + most_skipped});
  is_by_order_ = (row.fields & identity) == 0;
  for (std::size_t i = next_; i < end; ++i) {
    // The number and the time stand first; each has its own value where it is not carried.
    constexpr std::size_t compared = sizeof row.time_ns + sizeof row.counter;
    if (std::memcmp(measured_.row(i), &row, compared) != 0) continue;
    next_ = i + 1;
    ++with_;
    TrueValues values;
    std::memcpy(static_cast<void*>(&values), truth_.row(i) + sizeof(std::int64_t), sizeof values);
    return values;
  }
  ++without_;
  return {};
}

std::string TruthBeside::finish() const {
  if (with_ == 0 && without_ > 0)
    throw std::runtime_error(fmt::format(
        "--truth {} {}: no sample is one of a replay of this; give the record of the run that was decoded, or the "
        "configuration and the capture of the `imud replay`",
        options_.config, options_.capture));
  if (without_ > 0) return fmt::format("{} samples have none, of {}", without_, with_ + without_);
  if (is_by_order_ && with_ != measured_.rows())
    return fmt::format("by order, as the samples have neither time nor number, but there are {}, and {} in a replay",
                       with_, measured_.rows());
  return {};
}

}  // namespace imud
