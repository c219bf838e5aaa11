// The transmit PDOs (CiA 301, 7.2.2): their times and their contents.
//
// | transmission type | sent                                                                                        |
// |-------------------|---------------------------------------------------------------------------------------------|
// | 0                 | at a SYNC, if there is a newer sample than the one sent last                                |
// | 1 to 240          | at every SYNC, every second one, ...; the first is chosen by the start value (1800:6)       |
// | 252               | at a remote request, with the sample of the last SYNC                                       |
// | 253               | at a remote request                                                                         |
// | 254, 255          | with the first sample after the event timer (1800:5) has elapsed; if it is 0, with each     |
// |                   | sample, but not before the inhibit time (1800:3) has passed                                 |
//
// A PDO without objects is never sent. A PDO of any type answers a remote request, unless bit 30 of its COB-ID
// (1800:1) forbids this. Increments are the sums over the samples since the PDO was last sent, or since the device
// became operational.
#pragma once

#include "protocols/canopen/measured.hpp"

namespace imud::canopen {

class TransmitPdos {
 public:
  explicit TransmitPdos(const ObjectDictionary& dictionary) noexcept : dictionary_(dictionary) { update(); }

  // Begins all schedules. Call this when the device becomes operational.
  void start() noexcept;
  // Reads the parameters again. Call this after a parameter has changed.
  void update() noexcept;

  // Returns the reason why a parameter (1800 to 1A03) cannot be set to this value now, or Abort::none.
  Abort check(const Object& object, std::uint64_t value) const noexcept;

  // Call these functions only while the device is operational. `reading` must have the newest sample; its increments
  // are not used.
  void add(const Sample& sample) noexcept;  // before on_sample()
  void on_sample(const Reading& reading, FrameBuffer& out) noexcept;
  // `counter` is the counter of the SYNC; 0 if the SYNC has no counter.
  void on_sync(unsigned counter, const Reading& reading, FrameBuffer& out) noexcept;
  // Answers a remote request, if a PDO has this identifier.
  void on_remote(std::uint32_t id, const Reading& reading, FrameBuffer& out) noexcept;

  void restart_increments() noexcept;
  // Returns true if a valid PDO has this identifier.
  bool uses(std::uint32_t id) const noexcept;
  void set_error_register(std::uint8_t value) noexcept { error_register_ = value; }
  void step_clock(Nanoseconds by) noexcept;

 private:
  using Payload = std::array<std::byte, 8>;
  struct Pdo {
    std::uint32_t cob_id = bit_31;
    unsigned type = 0;
    Nanoseconds timer{}, inhibit{};
    std::array<std::uint16_t, largest_mapping> mapped = {};  // positions of the objects
    unsigned mapped_count = 0;
    std::size_t size = 0;

    Increments increments;
    bool has_sample = false;         // there is a sample since the PDO was last sent
    std::optional<DeviceTime> next;  // the PDO is not sent before this time
    unsigned syncs = 0;              // SYNCs until the PDO is sent; 0: the start value is awaited
    std::optional<Payload> latched;  // type 252

    bool is_valid() const noexcept { return (cob_id & bit_31) == 0; }
    std::uint32_t id() const noexcept { return cob_id & can_id_bits; }
  };

  Abort check_communication(unsigned i, unsigned sub, std::uint64_t value) const noexcept;
  Abort check_mapping(unsigned i, unsigned sub, std::uint64_t value) const noexcept;
  bool is_due_at_sync(unsigned i, unsigned counter) noexcept;
  Payload payload(Pdo& pdo, const Reading& reading) const noexcept;
  void transmit(Pdo& pdo, const Reading& reading, FrameBuffer& out) noexcept;
  void transmit(const Pdo& pdo, const Payload& data, FrameBuffer& out) const noexcept;
  void start(unsigned i) noexcept;

  const ObjectDictionary& dictionary_;
  std::array<Pdo, tpdos> pdos_;
  std::array<std::uint8_t, tpdos> order_ = {};  // of ascending identifiers
  std::uint8_t error_register_ = 0;
};

// Returns true if no COB-ID may be set to this identifier (CiA 301, table 39).
constexpr bool is_restricted(std::uint32_t id) noexcept {
  return id <= 0x07F || (id > 0x100 && id <= 0x180) || (id > 0x580 && id <= 0x5FF) || (id > 0x600 && id <= 0x67F) ||
         (id >= 0x6E0 && id <= 0x6FF) || id > 0x700;
}
// Returns the position of the object that an entry of a mapping (1A00:1 to :8) maps. Returns object_count if the
// object is not mappable, or if its length differs from the length in the entry.
std::size_t mapped_object(std::uint32_t entry) noexcept;
// Returns the entry that maps an object.
constexpr std::uint32_t mapping_of(const Object& object) noexcept {
  return std::uint32_t{object.index} << 16 | std::uint32_t{object.sub} << 8 |
         static_cast<std::uint32_t>(8 * size_of(object.type));
}

}  // namespace imud::canopen
