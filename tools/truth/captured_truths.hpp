// CapturedTruths: the truths in a capture, decoded.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/pose/pose_fit.hpp"
#include "core/timeline.hpp"
#include "protocols/truth_format.hpp"
#include "tools/truth/truth_logs.hpp"
#include "transports/port.hpp"

namespace imud {

class CapturedTruths {
 public:
  struct Options {
    std::string capture;                  // a file, or a port that ends; a log must be a file
    std::string format;                   // a truth format or a truth log (truth_logs.hpp)
    std::vector<std::string> settings;    // of the format, KEY=VALUE
    std::optional<std::uint32_t> stream;  // vehicle; nullopt: of the first truth
    GravitationModel gravitation = {};    // to derive motion from poses, where the format lacks it
  };

  // Throws std::invalid_argument or PortError, or for a log std::runtime_error; the error names the fault and the
  // remedy.
  explicit CapturedTruths(const Options& options);

  // Returns the next truth of the vehicle, in the order of the capture; nullopt at its end, or after
  // stop_requested().
  std::optional<Truth> next();

  // Returns how much of the capture has been read, from 0 to 1; 0 if it is not known.
  double progress() const noexcept;
  // Returns the number of refused truths by cause, with the remark of the format on the first of each cause, such as
  // "3 crc, 1 short; the first short: a datagram has 4 bytes"; empty if none was refused.
  std::string refused() const;
  std::uint64_t of_other_vehicles() const { return of_other_vehicles_; }
  // Describes the end of a damaged capture, and truncated datagrams; empty if there is nothing to report.
  std::string damage() const;
  // Describes which part of a log was read; empty if the capture is no log.
  std::string note() const { return log_ ? log_->log().note : std::string(); }

 private:
  // The fit, and the order in which it needs the truths.
  struct Derivation {
    PoseFit fit;
    Timeline order;
  };
  void open_capture(const Options& options);
  std::optional<TruthResult> next_record(Truth& truth);
  void refuse(TruthResult result);
  bool feed_next();
  void derive(Truth& truth);
  bool take_derived(Truth& truth);

  std::optional<LoggedTruths> log_;  // otherwise a decoder and a port
  std::unique_ptr<TruthDecoder> decoder_;
  std::unique_ptr<Port> port_;
  std::unique_ptr<Derivation> derivation_;  // null if the format derives nothing
  bool has_ended_ = false;                  // the capture has ended; the decoder may still hold its last record
  TruthInput input_ = TruthInput::datagram;
  std::uint64_t streams_ = 0;  // PortCounters::lost_count
  std::optional<std::uint32_t> stream_;
  std::map<std::string_view, std::uint64_t> refused_;
  std::map<std::string_view, std::string> first_;  // by cause: the remark on the first record that was refused
  std::uint64_t of_other_vehicles_ = 0;
};

}  // namespace imud
