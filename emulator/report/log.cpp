#include "emulator/report/log.hpp"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

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

thread_local LogFields::Values fields;

}  // namespace

LogFields::LogFields(std::string_view imu, std::string_view counter) noexcept
    : before_(std::exchange(fields, {imu, counter})) {}
LogFields::~LogFields() { fields = before_; }
LogFields::Values LogFields::now() noexcept { return fields; }

void set_up_log(LogLevel level) {
  const auto sink = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
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
