// Log: messages for people, on standard error, in the form that its reader expects.
#pragma once

#include <string_view>

namespace imud {

enum class LogLevel { quiet, normal, verbose };  // from warnings, from information, from details for debugging

// Sets spdlog up. A terminal or a file gets the time in ISO 8601 and the level in each line, a terminal in colour
// unless NO_COLOR is set. If standard error is systemd's journal (JOURNAL_STREAM, systemd.exec(5)), the journal gets
// each message with its priority and the fields of LogFields; while it cannot be reached, a line begins with the
// priority, such as "<4>" (sd-daemon(3)). Lines that the reader of standard error does not take within a second are
// left out and counted. May be called again.
void set_up_log(LogLevel level = LogLevel::normal);

// While a LogFields exists, the messages that its thread logs concern this imu and this counter: in the journal
// these messages have the fields IMU and COUNTER. COUNTER is the counter's name as in --require.
class LogFields {
 public:
  struct Values {
    std::string_view imu, counter;  // empty: none
  };
  // The texts must outlive this.
  explicit LogFields(std::string_view imu, std::string_view counter = {}) noexcept;
  ~LogFields();
  LogFields(const LogFields&) = delete;
  LogFields& operator=(const LogFields&) = delete;

  // Returns the fields of the newest LogFields of this thread.
  static Values now() noexcept;

 private:
  const Values before_;
};

// Changes the level alone.
void set_log_level(LogLevel level);

}  // namespace imud
