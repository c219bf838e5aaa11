// The keys of [imu.device], and their consequences for the device, the bus and the decoder.
#pragma once

#include <vector>

#include "protocols/canopen/lss.hpp"
#include "protocols/canopen/object_dictionary.hpp"
#include "protocols/protocol.hpp"

namespace imud::canopen {

inline constexpr std::size_t setting_count = 29;
extern const Setting declared_settings[setting_count];

// A transmit PDO as configured by the settings.
struct TpdoSettings {
  bool is_enabled = false;
  unsigned type = 0;
  unsigned event_ms = 0;
  std::vector<std::size_t> mapped;  // positions of the objects

  std::size_t size() const noexcept;  // bytes
};

// These functions throw std::invalid_argument as Protocol::make does.
unsigned node_id_of(const Settings& settings);
Identity identity_of(const Settings& settings);
std::array<TpdoSettings, tpdos> tpdos_of(const Settings& settings);
// Returns the LSB, SI, of a quantity's objects with 16 bits.
float lsb_of(const Settings& settings, Quantity quantity);
// Sets the values of `dictionary` as delivered.
void deliver(const Settings& settings, ObjectDictionary& dictionary);

std::vector<CanMessage> can_messages(const Settings& settings, double rate_hz);
std::vector<CanFilter> can_filters(const Settings& settings);
// Returns the LSS address of a unit that waits for LSS to set its node id. Units with one LSS address would get one
// node id (CiA 305).
std::string bus_name(const Settings& settings);
std::string_view waits_for_host(const Settings& settings);

std::unique_ptr<Decoder> make_decoder(const Settings& settings);

}  // namespace imud::canopen
