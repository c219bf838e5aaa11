// The objects of the node, as SDO reads and writes them, with the parts that own them.
#pragma once

#include <span>
#include <string_view>

#include "protocols/canopen/emergency.hpp"
#include "protocols/canopen/lss.hpp"
#include "protocols/canopen/measured.hpp"
#include "protocols/canopen/pdo.hpp"
#include "protocols/canopen/supervision.hpp"

namespace imud::canopen {

// A text that the user has written (2000).
struct Note {
  std::array<char, longest_text> text = {};
  std::size_t size = 0;
};

class Node {
 public:
  Node(const ObjectDictionary& delivered, const Identity& identity, unsigned node_id) noexcept;

  // Copies the value of an object to `value`, and sets `size`. Requires room for longest_text bytes. Returns
  // Abort::none, or the reason why the object cannot be read.
  Abort read(std::uint16_t index, std::uint8_t sub, std::span<std::byte> value, std::size_t& size) noexcept;
  // Returns the reason why no value of this size can be written, or Abort::none. `size`: nullopt: not known yet.
  Abort check_write(std::uint16_t index, std::uint8_t sub, std::optional<std::size_t> size) const noexcept;
  // Writes a value that check_write() allows. Returns the reason why the object does not accept it, or Abort::none.
  Abort write(std::uint16_t index, std::uint8_t sub, std::span<const std::byte> value, DeviceTime now) noexcept;

  // Load all objects, or only the communication objects, as after power on, with the node id that LSS has set.
  void load_all() noexcept;
  void load_communication() noexcept;

  // Returns a reading with the increments of the newest sample alone.
  Reading reading() const noexcept { return {dictionary, sample, sample_increments, time_of_day}; }

  Alarms alarms;
  ObjectDictionary dictionary;
  Emergencies emergencies;
  Supervision supervision;
  TransmitPdos pdos;
  LssSlave lss;
  Sample sample;  // the newest one
  Increments sample_increments;
  bool has_sample = false;
  std::optional<TimeOfDay> time_of_day;

 private:
  std::string_view text(const Object& object) const noexcept;
  std::uint64_t number(std::size_t position) const noexcept;
  Abort check_value(std::size_t position, std::uint64_t value) const noexcept;
  Abort check_cob_id(std::size_t position, std::uint64_t value) const noexcept;
  void take_effect(std::size_t position, std::uint64_t value, DeviceTime now) noexcept;

  Note note_, stored_note_;
};

}  // namespace imud::canopen
