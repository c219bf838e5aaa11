// Shared by the tests of records: a sensor's line that keeps its bytes, and the repetition of a run.
#pragma once

#include <functional>

#include "emulator/drive/assembly.hpp"
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {

// A sensor's line that keeps what is sent, with the borders of the frames.
class KeptLine : public Port {
 public:
  explicit KeptLine(std::string& sent) : sent_(sent) {}
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames)
      sent_.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size()).append("|");
    counters_.count_sent(is_reply_, frames.size());
  }
  std::optional<Received> receive() noexcept override { return std::nullopt; }

 private:
  std::string& sent_;
};

class RecordTest : public RealtimeTest {
 protected:
  // Repeats the run of the record, and returns what each line of a sensor sends, in the order of the configuration.
  // `look` is called at the end.
  std::vector<std::string> repeat(
      Config config, SimulatedHost& host, const std::function<void(const Engine&)>& look = [](const Engine&) {}) {
    config.truth.port = "record:" + path("run.pcapng");
    std::vector<std::string> sent;
    for (const ImuConfig& imu : config.imus) sent.resize(sent.size() + (imu.second_port.empty() ? 1 : 2));
    std::size_t next = 0;
    Assembly run(config, [&](const PortUse&) { return std::make_unique<KeptLine>(sent[next++]); }, {.repeats = true});
    host.end = SimulatedHost::never;
    run.run(host, host.stop);
    EXPECT_EQ(run.difference(), "");
    EXPECT_TRUE(run.engine().intake().at_end());
    look(run.engine());
    return sent;
  }
  std::vector<std::string> repeat(Config config) {
    SimulatedHost host;
    config.clock = ClockMode::fast;
    return repeat(config, host);
  }
  RecordOptions options() const { return {.file = path("run.pcapng"), .max_bytes = 0, .max_files = 0}; }
};

}  // namespace imud
