// SAE J1939 inertial unit, as ACEINNA's OpenIMU335RI and OpenIMU300RI: the settings of the device (device.cpp), and
// the decoder (decoder.cpp). Parts: messages on CAN (message.hpp), address claim (address.hpp), transport protocol
// (transport.hpp), data of the sensor (measured.hpp), proprietary settings (configuration.hpp).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocols/j1939/address.hpp"
#include "protocols/j1939/configuration.hpp"
#include "protocols/protocol.hpp"

namespace imud::j1939 {

inline constexpr double internal_hz = 100;  // the packet rate is this rate over a divider

enum class ByteOrder : std::uint8_t { j1939, swapped, automatic };

// The settings of a unit that no host can change.
struct Unit {
  const Model* model = nullptr;
  Name name;
  Nanoseconds claim_wait{}, claim_period{};
  ByteOrder request_order = ByteOrder::automatic;
  bool has_texts = false;    // ECU and software identification are SAE's texts, not the firmware's 8 bytes
  bool acknowledges = true;  // settings are acknowledged
  std::uint8_t latency = 0;  // 0.5 ms
  std::string ecu_text, software_text;
};

extern const Setting declared_settings[25];
// All throw std::invalid_argument as Protocol::make does.
Unit unit_of(const Settings& settings);
Configuration configuration_of(const Settings& settings);
Product product_of(const Settings& settings);
// Returns every identifier that the unit sends from its first address. From a later address it sends the same load,
// and its identifiers are then free. Answers to hosts have a rate of 0. Answers by RTS/CTS are not listed, because
// their identifiers contain the address of the host.
std::vector<CanMessage> can_messages(const Settings& settings, double rate_hz);
std::vector<CanFilter> can_filters(const Settings& settings);
// Returns the NAME, which is the unit's alone (SAE J1939-81): claims and commanded addresses are for a NAME.
std::string bus_name(const Settings& settings);

// Returns a decoder of the rates and accelerations of one unit, from ARI and ACCS, or from their forms of high
// resolution if the unit sends these. If the unit moves to another address, the decoder follows it by its NAME.
std::unique_ptr<Decoder> make_decoder(const Settings& settings);

}  // namespace imud::j1939
