// The LSS slave (CiA 305), by which a master sets the node id. The master selects one slave by its identity, or finds
// a slave without a node id.
#pragma once

#include "protocols/canopen/canopen.hpp"

namespace imud::canopen {

// Vendor, product code, revision, serial number: 1018.
using Identity = std::array<std::uint32_t, 4>;

class LssSlave {
 public:
  // `node_id`: 1 to 127, or `unconfigured`.
  LssSlave(const Identity& identity, unsigned node_id) noexcept : identity_(identity), stored_{node_id} {
    power_on();
  }

  // Loads the stored values.
  void power_on() noexcept;
  // Processes a message of the LSS master. `node_id`: the present node id of the device.
  void receive(std::span<const std::byte, 8> message, unsigned node_id, FrameBuffer& out) noexcept;

  // The node id that the device takes at the next reset of its communication.
  unsigned node_id() const noexcept { return pending_.node_id; }
  // The index of the bit rate (CiA 305, table 1). It has no effect: the administrator sets the bit rate of an
  // interface.
  unsigned bit_rate() const noexcept { return pending_.bit_rate; }
  bool is_configuring() const noexcept { return is_configuring_; }

 private:
  struct Configuration {
    unsigned node_id = unconfigured;
    unsigned bit_rate = 4;  // 125 kbit/s
  };

  void configure(unsigned command, std::span<const std::byte, 8> message, unsigned node_id,
                 FrameBuffer& out) noexcept;
  void identify(unsigned command, std::uint32_t number, FrameBuffer& out) noexcept;
  void scan(std::span<const std::byte, 8> message, FrameBuffer& out) noexcept;

  Identity identity_;
  Configuration stored_, pending_;
  bool is_configuring_ = false;
  unsigned selected_ = 0;  // how many numbers of the identity, in order, have matched
  unsigned identified_ = 0;
  unsigned scanned_ = 0;  // the number of the identity that fastscan scans
};

}  // namespace imud::canopen
