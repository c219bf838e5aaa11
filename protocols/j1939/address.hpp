// Address claim (SAE J1939-81): a node's NAME, and how it wins, moves and loses its address.
#pragma once

#include <bitset>
#include <cstdint>
#include <optional>

#include "core/time.hpp"
#include "protocols/j1939/message.hpp"

namespace imud::j1939 {

// The NAME of a node. If two nodes contend for an address, the node with the lower NAME wins.
struct Name {
  std::uint32_t identity = 0;            // 21 bits
  unsigned manufacturer = 0;             // 11
  unsigned ecu_instance = 0;             // 3
  unsigned function_instance = 0;        // 5
  unsigned function = 0;                 // 8
  unsigned vehicle_system = 0;           // 7
  unsigned vehicle_system_instance = 0;  // 4
  unsigned industry_group = 0;           // 3
  bool arbitrary_address = false;        // the node moves to another address when it loses its own

  constexpr std::uint64_t word() const noexcept {
    return std::uint64_t{identity} | std::uint64_t{manufacturer} << 21 | std::uint64_t{ecu_instance} << 32 |
           std::uint64_t{function_instance} << 35 | std::uint64_t{function} << 40 |
           std::uint64_t{vehicle_system} << 49 | std::uint64_t{vehicle_system_instance} << 56 |
           std::uint64_t{industry_group} << 60 | std::uint64_t{arbitrary_address} << 63;
  }
};

// The addresses to which arbitrary-address capable nodes move: pool_begin to pool_end - 1.
inline constexpr std::uint8_t pool_begin = 128, pool_end = 248;

// The address of one node. Times are by the device's clock, as in Device.
class AddressClaim {
 public:
  // The node sends nothing else within `wait` after a claim. It repeats its claim each `period` (0: never).
  AddressClaim(const Name& name, Nanoseconds wait, Nanoseconds period) noexcept
      : name_(name), wait_(wait), period_(period) {}

  // Forgets the other nodes, and claims `address` at the next poll().
  void power_on(std::uint8_t address, DeviceTime now) noexcept;
  // The node's address; null_address if the node has lost its address and found no other.
  std::uint8_t address() const noexcept { return address_; }
  // Returns true if the node may send, apart from claims.
  bool may_send(DeviceTime now) const noexcept { return address_ != null_address && now >= ready_at_; }

  // Processes the claim of another node. If the claim is for this node's address, this node either claims the address
  // again, or loses it. A node that has lost its address moves to the next address of the pool that no other node has
  // used, or is silent if it must not move. Returns true if the node has lost its address.
  bool on_claim(const Message& claim, DeviceTime now, FrameBuffer& out) noexcept;
  // Notes that another node uses `address`.
  void on_other(std::uint8_t address) noexcept { taken_[address] = true; }
  // Answers a request for claims.
  void on_request(DeviceTime now, FrameBuffer& out) noexcept;
  // Claims another address, as a commanded-address message demands. `address`: at most 253.
  void command(std::uint8_t address, DeviceTime now, FrameBuffer& out) noexcept;

  std::optional<DeviceTime> deadline() const noexcept { return claim_at_; }
  void poll(DeviceTime now, FrameBuffer& out) noexcept;
  void step_clock(Nanoseconds by) noexcept;

 private:
  void claim(DeviceTime now, FrameBuffer& out) noexcept;
  void lose(DeviceTime now, FrameBuffer& out) noexcept;

  Name name_;
  Nanoseconds wait_, period_;
  std::uint8_t address_ = null_address;
  DeviceTime ready_at_;
  std::optional<DeviceTime> claim_at_;  // time of the next claim, or of the message that no address could be claimed
  std::bitset<256> taken_;              // addresses of other nodes
};

}  // namespace imud::j1939
