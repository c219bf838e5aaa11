// Shared by the tests of faults: a run of a flight in this process, and the bytes that it sends.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/engine/closing.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/protocol.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {

class FaultyRunTest : public RunTest {
 protected:
  // A frame that was sent, with the time of the device's sample at that moment.
  struct Sent {
    DeviceTime time;
    std::string bytes;
    std::uint32_t can_id = 0;
  };
  struct Result {
    std::vector<Sent> frames;               // of the first imu
    std::vector<Measurement> measurements;  // decoded of these
    std::vector<FaultLabel> labels;
    std::string all_bytes;  // of all imus, by imu
  };
  // Stores what a device sends.
  class StoringPort final : public Port, private MeasurementSink {
   public:
    StoringPort(const ImuConfig& imu, Result& result, std::string& bytes, bool is_first)
        : decoder_(imu.protocol->make_decoder(imu.settings)), result_(result), bytes_(bytes), is_first_(is_first) {}
    void send(std::span<const Frame> frames) noexcept override {
      counters_.count_sent(is_reply_, frames.size());
      for (const Frame& frame : frames) {
        const std::string text(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
        bytes_ += text;
        if (!is_first_) continue;
        result_.frames.push_back({time_, text, frame.can.id});
        decoder_->feed(frame, *this);
      }
    }
    std::optional<Received> receive() noexcept override { return std::nullopt; }
    bool has_room() const noexcept override { return true; }
    bool can_receive() const noexcept override { return false; }

   private:
    void on_measurement(const Measurement& measurement) override { result_.measurements.push_back(measurement); }
    std::unique_ptr<Decoder> decoder_;
    Result& result_;
    std::string& bytes_;
    bool is_first_;
  };

  static constexpr double rate_hz = 500;
  static constexpr double period_s = 1 / rate_hz;

  // The text of a configuration with `imus` imus of this protocol, and these faults. `truth`: further keys of
  // [truth].
  static std::string config_text(const std::string& faults, const std::string& protocol, int imus,
                                 const std::string& errors, const std::string& truth = "") {
    std::string text = fmt::format(
        "seed = 7\nclock = \"fast\"\n[truth]\nport = \"pcap:{}?port=5140\"\n"
        "format = \"jsbsim\"\n{}",
        IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap", truth);
    for (int i = 1; i <= imus; ++i)
      text += fmt::format("[[imu]]\nname = \"imu{0}\"\nprotocol = \"{1}\"\nport = \"{3}:{0}\"\n{2}\n", i, protocol,
                          errors, resolve_protocol(protocol)->link == Link::can ? "canfile" : "file");
    return text + faults;
  }

  Result run(const std::string& faults, const std::string& protocol = "native", int imus = 1,
             const std::string& errors =
                 "rate_hz = 500\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
                 "accelerometer.max_m_per_s2 = 100\n",
             const std::string& truth = "") {
    const Config config = load_config(write("faults.toml", config_text(faults, protocol, imus, errors, truth)));
    Result result;
    std::vector<std::string> bytes(config.imus.size());
    Assembly assembly(config, [&](const PortUse& use) -> std::unique_ptr<Port> {
      if (use.of != PortUse::Of::line) return real_ports(use);
      return std::make_unique<StoringPort>(config.imus[use.imu], result, bytes[use.imu], use.imu == 0);
    });
    Engine& engine = assembly.engine();
    MonotonicHost host;
    assembly.run(host, false);
    drain(engine, std::chrono::milliseconds(0));
    engine.finish_faults();
    std::vector<std::string> names;
    for (const ImuConfig& imu : config.imus) names.push_back(imu.name);
    result.labels = fault_labels(engine.faults().all(), names, engine.faults().log());
    // The labels outlive the engine's faults. Only members that the labels own may be used.
    for (const std::string& of_imu : bytes) result.all_bytes += of_imu;
    return result;
  }
};

}  // namespace imud
