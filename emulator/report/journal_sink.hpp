// JournalSink: the log in systemd's journal, with fields that journalctl filters by.
#pragma once

#include <spdlog/sinks/base_sink.h>

#include <memory>
#include <mutex>
#include <string>

#include "transports/file_descriptor.hpp"

namespace imud {

// Sends each message as a datagram of systemd's native protocol (systemd, docs/JOURNAL_NATIVE_PROTOCOL.md), with
// PRIORITY and the fields of LogFields. A message that the journal does not take, such as one that is longer than
// a datagram, goes to the sink `other`.
class JournalSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  static constexpr const char* socket_path = "/run/systemd/journal/socket";

  explicit JournalSink(spdlog::sink_ptr other);

 private:
  void sink_it_(const spdlog::details::log_msg& message) override;
  void flush_() override { other_->flush(); }
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    other_->set_formatter(std::move(formatter));
  }
  void set_pattern_(const std::string& pattern) override { other_->set_pattern(pattern); }

  const spdlog::sink_ptr other_;
  const FileDescriptor socket_;
};

// Returns the priority of a level, as in syslog(3).
int journal_priority(spdlog::level::level_enum level) noexcept;

}  // namespace imud
