// CasePort: stands for the port of an imu in a case of a campaign, and makes the digest of its bytes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "emulator/campaign/shards/sha256_stream.hpp"
#include "emulator/imu/ports.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// Computes the SHA-256 of the file that the transport `file` would write, or `canfile` for a CAN bus. commit() passes
// it to `end`. Opens no file.
class CasePort final : public NoPort {
 public:
  // `receive`: receives the decoded measurements as for decoding_port(), each with the time of its first frame;
  // nullptr: nothing is decoded.
  CasePort(const ImuConfig& imu, std::function<void(std::string sha256)> end,
           std::function<void(const Measurement&, DeviceTime)> receive);

  void send(std::span<const Frame> frames) noexcept override;
  void commit() override;

 private:
  const bool is_can_;
  Sha256Stream digest_;
  const std::function<void(std::string sha256)> end_;
  const std::unique_ptr<Port> decoder_;  // nullptr: nothing is decoded
};

}  // namespace imud
