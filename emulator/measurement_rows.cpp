#include "emulator/measurement_rows.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "emulator/text_file.hpp"
#include "transports/output_path.hpp"

namespace imud {

static_assert(sizeof(TrueRow) == sizeof(std::int64_t) + sizeof(TrueValues));

ArrayFile::ArrayFile(std::string path, std::span<const MeasurementColumn> columns)
    : path_(std::move(path)), columns_(columns) {
  if (const std::string link = foreign_link(path_); !link.empty())
    throw OpenError(fmt::format(
        "{}: is a symbolic link that another user has made in a folder which others can write; give another path",
        link));
  file_.reset(::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666));
  // A file that is empty is not truncated: ext4 writes a file that was, before it returns from close(2).
  struct stat old {};
  if (!file_ || ::fstat(file_.get(), &old) != 0 || (old.st_size != 0 && ::ftruncate(file_.get(), 0) != 0))
    throw OpenError(fmt::format("{}: cannot write it: {}", path_, std::strerror(errno)));
  if (!S_ISREG(old.st_mode))
    throw OpenError(path_ + ": the rows of an array are written in any order; give a regular file");
}

void ArrayFile::set_shape(std::span<const std::uint64_t> shape, std::size_t row_size) noexcept {
  const std::string text = npy_header(columns_, shape);
  std::uint64_t bytes = row_size;
  for (const std::uint64_t size : shape) bytes *= size;
  if (error_ == 0 && ::ftruncate(file_.get(), static_cast<off_t>(text.size() + bytes)) != 0) error_ = errno;
  write_at(std::as_bytes(std::span(text)), 0);
}

void ArrayFile::write(std::span<const std::byte> bytes, std::uint64_t offset) noexcept {
  write_at(bytes, npy_header(columns_, {}).size() + offset);
}

void ArrayFile::check() const {
  if (error_ != 0) throw std::runtime_error(fmt::format("{}: {}", path_, std::strerror(error_)));
}

void ArrayFile::write_at(std::span<const std::byte> bytes, std::uint64_t offset) noexcept {
  while (!bytes.empty() && error_ == 0) {
    const ssize_t size = ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (size < 0) {
      if (errno != EINTR) error_ = errno;
      continue;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(size));
    offset += static_cast<std::uint64_t>(size);
  }
}

namespace {

class IdlePort : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override { counters_.count_sent(is_reply_, frames.size()); }
  std::optional<Received> receive() noexcept override { return std::nullopt; }
  bool can_receive() const noexcept override { return false; }
  bool has_room() const noexcept override { return true; }
};

class DecodingPort final : public IdlePort, private MeasurementSink {
 public:
  DecodingPort(const ImuConfig& imu, std::function<void(const Measurement&)> receive)
      : decoder_(imu.protocol->make_decoder(imu.settings)), receive_(std::move(receive)) {}
  void send(std::span<const Frame> frames) noexcept override {
    IdlePort::send(frames);
    for (const Frame& frame : frames) decoder_->feed(frame, *this);
  }
  void commit() override { decoder_->finish(*this); }

 private:
  void on_measurement(const Measurement& measurement) override { receive_(measurement); }

  std::unique_ptr<Decoder> decoder_;
  std::function<void(const Measurement&)> receive_;
};

}  // namespace

std::unique_ptr<Port> decoding_port(const ImuConfig& imu, std::function<void(const Measurement&)> receive) {
  return std::make_unique<DecodingPort>(imu, std::move(receive));
}

std::unique_ptr<Port> idle_port() { return std::make_unique<IdlePort>(); }

ImuConfig without_errors(const ImuConfig& imu) {
  ImuConfig ideal = imu;
  ideal.protocol = find_protocol("native");
  ideal.settings = Settings(ideal.protocol->settings);
  ideal.second_port.clear();
  ideal.also.clear();
  ideal.also_settings.clear();
  ideal.device_filters = false;
  ImuModel& model = ideal.model;
  model.internal_samples = 1;
  model.gyro = model.accelerometer = model.magnetometer = TriadErrors{};
  model.accelerometer_positions.setZero();
  model.sampling_jitter = Nanoseconds{0};
  model.barometer = BarometerErrors{};
  model.navigation = NavigationErrors{};
  return ideal;
}

}  // namespace imud
