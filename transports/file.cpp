// Bytes to and from files, pipes and the standard streams.
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "transports/file/file_input.hpp"
#include "transports/file/file_writer.hpp"
#include "transports/file/output_path.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

bool is_standard_output(const PortSpec& spec) { return imud::is_standard_output(spec.address); }

// Returns a remark if these bytes begin a log that is no truth; otherwise an empty text.
std::string_view log_of(std::span<const std::byte> begin) noexcept {
  constexpr std::pair<std::string_view, std::string_view> logs[] = {
      {"ULog\x01\x12\x35",
       "a ULog of PX4: imu-truth capture FILE --csv truth.csv makes truth of it, of the format csv"},
      {"\x89MCAP0\r\n", "an MCAP log: imu-truth capture FILE --csv truth.csv makes truth of it, of the format csv"}};
  const std::string_view bytes(reinterpret_cast<const char*>(begin.data()), begin.size());
  for (const auto& [magic, content] : logs)
    if (bytes.starts_with(magic)) return content;
  return {};
}

class FileReader final : public Port {
 public:
  explicit FileReader(const PortSpec& spec) : file_(spec) {}

  void send(std::span<const Frame> frames) noexcept override { counters_.dropped += frames.size(); }
  std::optional<Received> receive() noexcept override {
    const std::size_t size = file_.read(buffer_);
    if (size == 0) return std::nullopt;
    if (counters_.received == 0) content_ = log_of(std::span(buffer_).first(size));
    ++counters_.received;
    return Received{{{buffer_.data(), size}}, host_now()};
  }

  bool at_end() const noexcept override { return file_.at_end(); }
  std::string_view end_warning() const noexcept override { return file_.end_warning(); }
  std::string_view other_content() const noexcept override { return content_; }
  int descriptor() const noexcept override { return file_.descriptor(); }
  std::optional<double> progress() const noexcept override { return file_.progress(); }

 private:
  FileInput file_;
  std::string_view content_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(128 * 1024);
};

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  if (settings.role == Role::device) return std::make_unique<FileWriter>(spec, settings);
  return std::make_unique<FileReader>(spec);
}

}  // namespace

extern constexpr Transport file_transport = {
    .name = "file",
    .summary = "bytes to a file or pipe, or from one (also .gz, .zst); - is standard output or input",
    .syntax = "file:PATH",
    .example = "file:imu1.bin",
    .document = "open(2), pipe(7)",
    .ends = true,
    .brings_truth = true,
    .has_path = true,
    .reads_standard_input = true,
    .has_private_copy = true,
    .suffixes = ".csv .txt",
    .open = open,
    .is_standard_output = is_standard_output,
};

}  // namespace imud
