// FrameSettings: the settings of a description, and what messages and requests say about them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"
#include "protocols/frames/layout/frame_description.hpp"

namespace imud {

// Returns true if the texts are equal; `ignores_case`: but for the case of letters of ASCII.
bool is_same_text(std::string_view a, std::string_view b, bool ignores_case) noexcept;

// A setting and the index of one of its values.
struct FrameChosen {
  std::size_t setting = 0;
  std::uint8_t value = 0;
};

// The values that one setting must have: bits of their indices.
struct FrameCondition {
  std::size_t setting = 0;
  std::uint64_t values = 0;
};

// Returns true if all conditions hold with these values of all settings.
bool all_hold(std::span<const FrameCondition> conditions, std::span<const std::uint8_t> values) noexcept;
// Returns true if no values of the settings let all conditions of both hold.
bool exclude(std::span<const FrameCondition> some, std::span<const FrameCondition> others) noexcept;

// When a message is sent, as far as settings decide.
struct FrameSwitch {
  std::vector<FrameCondition> when;  // all must hold
  std::optional<std::size_t> rate;   // the setting that has the rate
  std::vector<Nanoseconds> periods;  // of its values; 0: nothing is sent
  bool is_streamed = true;           // false: only sent when a request polls it

  // Returns true if the message is streamed with these values of all settings.
  bool is_on(std::span<const std::uint8_t> values) const noexcept;
  // Returns true if no values of the settings let both be sent.
  bool excludes(const FrameSwitch& other) const noexcept { return exclude(when, other.when); }
  bool is_always_on() const noexcept { return is_streamed && when.empty() && !rate; }
};

// The functions that are not noexcept throw std::invalid_argument, whose message has the fault and the remedy.
class FrameSettings {
 public:
  using Setting = FrameHostDescription::Setting;

  // Refuses nothing: `faults()` has what is wrong.
  explicit FrameSettings(const FrameDescription& description);
  // Returns the faults of the settings themselves.
  std::vector<FrameFault> faults() const;

  std::size_t size() const noexcept { return all_.size(); }
  const Setting& operator[](std::size_t index) const noexcept { return all_[index]; }

  std::optional<std::size_t> find(std::string_view name, bool ignores_case = false) const noexcept;
  // Returns the index of the value that the text is; of a number any text of it, such as "0100" for 100.
  std::optional<std::uint8_t> find_value(std::size_t setting, std::string_view text,
                                         bool ignores_case = false) const noexcept;
  // Returns the index of the value that has the code; the code of a value.
  std::optional<std::uint8_t> find_code(std::size_t setting, std::uint64_t code) const noexcept;
  std::uint64_t code(FrameChosen chosen) const noexcept { return codes_[chosen.setting][chosen.value]; }

  // Returns the index of the setting of that name, or of a value of it.
  std::size_t at(const std::string& name) const;
  std::uint8_t value_at(std::size_t setting, const std::string& text) const;
  FrameCondition condition(const FrameHostDescription::Choice& choice) const;
  // Returns when the message is sent. Adds what is wrong with it to `faults`.
  FrameSwitch switch_of(const FrameDescription::Message& message, std::vector<FrameFault>& faults) const;
  // Refuses a setting of which a value has no code.
  void require_codes(std::size_t setting) const;
  // Returns the periods of a setting whose values are rates in Hz; 0 for the rate 0, at which nothing is sent.
  std::vector<Nanoseconds> periods(std::size_t setting) const;
  // Returns the bit rates that are the values of a setting.
  std::vector<unsigned> bauds(std::size_t setting) const;

 private:
  double number(std::size_t setting, std::size_t value) const noexcept;

  std::vector<Setting> all_;
  std::vector<std::vector<std::uint64_t>> codes_;  // of the values; those without one have `no_code`
  static constexpr std::uint64_t no_code = ~std::uint64_t{0};
};

}  // namespace imud
