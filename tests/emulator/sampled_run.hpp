// Shared by the tests of whole runs with faults: an analytic flight, and what each imu sends with each sample.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>

#include <array>
#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/ground/host.hpp"
#include "protocols/native_truth.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tools/truth/motion.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

class SampledRunTest : public RunTest {
 protected:
  static constexpr int truth_rate_hz = 50;

  // An occurrence of a fault, which outlives its run.
  struct Acted {
    const FaultKind* kind;
    std::string imu;
    std::uint64_t first, last;  // samples; truths for a fault of truth
    std::array<double, FaultKind::max_parameters> parameters;
  };
  struct Sampled {
    // By imu, then by sample: the frames that were sent from this sample's instant until the next, with their
    // identifiers on a bus.
    std::vector<std::vector<std::string>> sent;
    std::vector<Acted> acted;
  };
  // An imu: its table after the name, and its rate.
  struct Unit {
    std::string name, text;
    double rate_hz;
  };

  static Unit native_unit(const std::string& name = "imu1", const std::string& more = "") {
    return {name,
            "protocol = \"native\"\nrate_hz = 200\nmodel = \"white\"\ngyro.max_rad_per_s = 10\n"
            "gyro.angle_random_walk_rad_per_rt_s = 1e-3\naccelerometer.max_m_per_s2 = 100\n"
            "accelerometer.velocity_random_walk_m_per_s_per_rt_s = 1e-2\n" +
                more + "port = \"file:" + name + "\"\n",
            200};
  }

  // Runs for `seconds` from truth time 0. `clock`: "fast" or "lockstep".
  Sampled run(const std::vector<Unit>& units, const std::string& faults, double seconds, std::uint64_t seed = 7,
              const std::string& clock = "fast") const {
    const bool is_live = clock == "lockstep";
    std::string text = fmt::format(
        "seed = {}\nclock = \"{}\"\n{}[truth]\nport = \"{}\"\nformat = \"native\"\n[earth]\nframe = \"local\"\n"
        "latitude_deg = 47\nlongitude_deg = 11\nheight_m = 500\n",
        seed, clock, faults, is_live ? "udp:127.0.0.1:9810" : "pcap:flight.pcap?port=9810");
    for (const Unit& unit : units) text += fmt::format("[[imu]]\nname = \"{}\"\n{}\n", unit.name, unit.text);
    const Config config = load_config(write("faults.toml", text));
    Sampled result;
    result.sent.resize(units.size());
    std::atomic<bool> stop = false;
    Assembly assembly(config, [&](const PortUse& use) -> std::unique_ptr<Port> {
      if (use.of == PortUse::Of::truth) return std::make_unique<Flight>(seconds, is_live ? &stop : nullptr);
      return std::make_unique<Kept>(units[use.imu].rate_hz, seconds, result.sent[use.imu]);
    });
    Engine& engine = assembly.engine();
    MonotonicHost host;
    assembly.run(host, stop);
    engine.finish_faults();
    std::vector<std::string> names;
    for (const Unit& unit : units) names.push_back(unit.name);
    for (const FaultLabel& label : fault_labels(engine.faults().all(), names, engine.faults().log()))
      result.acted.push_back(
          {label.fault->kind, label.imu, label.first.sample, label.last.sample, label.first.parameters});
    EXPECT_EQ(engine.faults().log().lost(), 0U);
    return result;
  }

 private:
  // The truth of a spiral. With `stop`, a live truth, which sets `stop` at its end.
  class Flight final : public Port {
   public:
    Flight(double seconds, std::atomic<bool>* stop)
        : truths_(static_cast<std::uint32_t>(seconds * truth_rate_hz) + 1),
          stop_(stop),
          readable_(::open("/dev/zero", O_RDONLY | O_CLOEXEC)) {}
    void send(std::span<const Frame>) noexcept override {}
    std::optional<Received> receive() noexcept override {
      if (next_ == truths_) {
        if (stop_ != nullptr) *stop_ = true;
        return std::nullopt;
      }
      Truth truth = spiral_.at(TruthTime{std::int64_t{next_} * (1'000'000'000 / truth_rate_hz)}, {});
      truth.sequence = next_++;
      truth.acknowledge = stop_ != nullptr;
      encode_native_truth(truth, bytes_);
      return Received{{bytes_}, {}};
    }
    bool at_end() const noexcept override { return stop_ == nullptr && next_ == truths_; }
    int descriptor() const noexcept override { return stop_ == nullptr ? -1 : readable_.get(); }

   private:
    const Motion& spiral_ = *find_motion("spiral");
    const std::uint32_t truths_;
    std::uint32_t next_ = 0;
    std::atomic<bool>* stop_;
    FileDescriptor readable_;
    std::array<std::byte, native_truth_size> bytes_{};
  };
  // Keeps what a device sends.
  class Kept final : public Port {
   public:
    Kept(double rate_hz, double seconds, std::vector<std::string>& sent) : rate_hz_(rate_hz), sent_(sent) {
      sent_.assign(static_cast<std::size_t>(seconds * rate_hz + 1.5), {});
    }
    void send(std::span<const Frame> frames) noexcept override {
      counters_.count_sent(is_reply_, frames.size());
      const auto k = static_cast<std::size_t>(1e-9 * static_cast<double>(time_.ns) * rate_hz_ + 1e-6);
      if (k >= sent_.size()) return;
      for (const Frame& frame : frames) {
        if (frame.can != CanHeader{}) sent_[k] += fmt::format("{:x}{}#", frame.can.id, frame.can.error ? "e" : "");
        sent_[k].append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
      }
    }
    std::optional<Received> receive() noexcept override { return std::nullopt; }
    bool has_room() const noexcept override { return true; }
    bool can_receive() const noexcept override { return false; }

   private:
    const double rate_hz_;
    std::vector<std::string>& sent_;
  };
};

}  // namespace imud
