#include "emulator/report/log.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <string_view>
#include <utility>

#include "emulator/ground/progress_line.hpp"
#include "emulator/report/journal_sink.hpp"

namespace imud {
namespace {

bool is_journal(int descriptor) {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat status {};
  if (stream == nullptr || ::fstat(descriptor, &status) != 0) return false;
  return fmt::format("{}:{}", status.st_dev, status.st_ino) == stream;
}

// The priority of a line as the journal reads it.
class Priority final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    fmt::format_to(std::back_inserter(out), "<{}>", journal_priority(message.level));
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<Priority>(); }
};

// Removes the line of progress; otherwise a line of the log would be appended to it.
class Removal final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg&, const std::tm&, spdlog::memory_buf_t& out) override {
    const std::string_view text = ProgressLine::removal();
    out.append(text.begin(), text.end());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<Removal>(); }
};

// Leaves lines out while the reader of standard error takes none, such as a stopped terminal or pager: the thread
// that logs also serves clients and signals. The first line waits a while for a reader that is only slow.
class PatientSink final : public spdlog::sinks::stderr_color_sink_mt {
 public:
  using Base = spdlog::sinks::stderr_color_sink_mt;
  void log(const spdlog::details::log_msg& message) override {
    constexpr int longest_ms = 1000;
    pollfd output{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&output, 1, lost_ > 0 ? 0 : longest_ms) == 0) {
      ++lost_;
      return;
    }
    if (const std::uint64_t lost = lost_.exchange(0); lost > 0)
      Base::log({message.logger_name, spdlog::level::warn,
                 fmt::format("{} lines of the log were lost: its reader has taken none", lost)});
    Base::log(message);
  }

 private:
  std::atomic<std::uint64_t> lost_ = 0;
};

thread_local LogFields::Values fields;

}  // namespace

LogFields::LogFields(std::string_view imu, std::string_view counter) noexcept
    : before_(std::exchange(fields, {imu, counter})) {}
LogFields::~LogFields() { fields = before_; }
LogFields::Values LogFields::now() noexcept { return fields; }

void set_up_log(LogLevel level) {
  const auto sink = std::make_shared<PatientSink>();
  std::shared_ptr<spdlog::sinks::sink> chosen = sink;
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  if (is_journal(STDERR_FILENO)) {
    formatter->add_flag<Priority>('*').set_pattern("%*%v");
    sink->set_color_mode(spdlog::color_mode::never);
    chosen = std::make_shared<JournalSink>(sink);
  } else {
    formatter->add_flag<Removal>('*').set_pattern("%*%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
    if (std::getenv("NO_COLOR") != nullptr) sink->set_color_mode(spdlog::color_mode::never);
  }
  auto logger = std::make_shared<spdlog::logger>("imud", std::move(chosen));
  logger->set_formatter(std::move(formatter));
  spdlog::set_default_logger(std::move(logger));
  set_log_level(level);
}

void set_log_level(LogLevel level) {
  spdlog::default_logger()->set_level(level == LogLevel::quiet     ? spdlog::level::warn
                                      : level == LogLevel::verbose ? spdlog::level::debug
                                                                   : spdlog::level::info);
}

}  // namespace imud
