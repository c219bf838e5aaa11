// Log: messages for people, on standard error, in the form that its reader expects.
#pragma once

namespace imud {

enum class LogLevel { quiet, normal, verbose };  // from warnings, from information, from details for debugging

// Sets spdlog up. A terminal or a file gets the time in ISO 8601 and the level in each line, a terminal in colour
// unless NO_COLOR is set. If standard error is systemd's journal (JOURNAL_STREAM, systemd.exec(5)), a line begins
// with its priority, such as "<4>" (sd-daemon(3)), and the journal adds the time. May be called again.
void set_up_log(LogLevel level = LogLevel::normal);

// Changes the level alone.
void set_log_level(LogLevel level);

}  // namespace imud
