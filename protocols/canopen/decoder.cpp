// Decodes the transmit PDOs with the mapping of the settings. PDOs with the same type and event timer are sent at the
// same time, and form a set: one measurement. The PDOs of a set must arrive in the order of their identifiers, and
// their counters, if any, must agree.
#include <cmath>

#include "protocols/canopen/pdo.hpp"
#include "protocols/canopen/settings.hpp"

namespace imud::canopen {
namespace {

constexpr std::size_t none = tpdos;

std::int64_t sign_extended(std::uint64_t value, std::size_t size) noexcept {
  const auto shift = static_cast<unsigned>(64 - 8 * size);
  return static_cast<std::int64_t>(value << shift) >> shift;
}

class CanopenDecoder final : public Decoder {
 public:
  explicit CanopenDecoder(const Settings& settings) : node_id_(node_id_of(settings)), tpdos_(tpdos_of(settings)) {
    for (unsigned q = 0; q < quantities; ++q) {
      lsbs_[q][0] = double{lsb_of(settings, static_cast<Quantity>(q))};
      lsbs_[q][1] = double{lsb_32[q]};
    }
    // A PDO belongs to the set of the first PDO with the same schedule.
    std::array<std::size_t, tpdos> last_of_set = {none, none, none, none};
    for (std::size_t i = 0; i < tpdos; ++i) {
      if (!tpdos_[i].is_enabled) continue;
      std::size_t first = i;
      for (std::size_t k = i; k > 0; --k)
        if (tpdos_[k - 1].is_enabled && tpdos_[k - 1].type == tpdos_[i].type &&
            tpdos_[k - 1].event_ms == tpdos_[i].event_ms)
          first = k - 1;
      set_of_[i] = first;
      before_[i] = last_of_set[first];
      if (last_of_set[first] != none) is_last_[last_of_set[first]] = false;
      last_of_set[first] = i;
      is_last_[i] = true;
    }
  }

  void feed(const Frame& frame, MeasurementSink& sink) override {
    const CanHeader& can = frame.can;
    if (can.remote || can.error || can.fd || can.extended || node_id_ == unconfigured) return;
    if (can.id < first_tpdo_id + node_id_ || (can.id - first_tpdo_id - node_id_) % 0x100 != 0) return;
    const std::size_t i = (can.id - first_tpdo_id - node_id_) / 0x100;
    if (i >= tpdos || !tpdos_[i].is_enabled) return;
    Set& set = sets_[set_of_[i]];
    if (before_[i] == none) {
      abandon(set);
      set = {};
    }
    Parts parts{set, true};
    if (frame.bytes.size() != tpdos_[i].size() || !decode(i, frame.bytes, parts)) {
      ++errors_.malformed;
      set.newest = none;
      set.is_refused = true;
      return;
    }
    if (set.newest != before_[i] || !parts.counters_agree) {
      abandon(set);
      if (!set.is_refused) ++errors_.incomplete;  // a set whose first frame is missing
      set.is_refused = true;
      return;
    }
    set.newest = i;
    if (!is_last_[i]) return;
    set.newest = none;
    set.is_refused = true;  // only the first frame of the next set may follow
    if (set.measurement.fields != 0) sink.on_measurement(set.measurement);
  }

  void finish(MeasurementSink&) override {
    for (Set& set : sets_) abandon(set);
  }

 private:
  struct Set {
    Measurement measurement;
    std::array<unsigned, quantities> axes = {};  // a bit for each axis that was received
    std::size_t counter_size = 0;                // bytes of the longest counter that was received
    std::size_t newest = none;                   // the last PDO received; none: the set has not begun
    bool is_refused = false;                     // the set is refused, and was counted
  };
  struct Parts {
    Set& set;
    bool counters_agree;
  };

  // Drops an unfinished set, if there is one, and counts it as incomplete.
  void abandon(Set& set) noexcept {
    if (set.newest == none) return;
    ++errors_.incomplete;
    set.newest = none;
    set.is_refused = true;
  }

  // Returns false if a number is not finite.
  bool decode(std::size_t i, std::span<const std::byte> bytes, Parts& parts) noexcept {
    bool is_finite = true;
    for (const std::size_t position : tpdos_[i].mapped) {
      const Object& object = objects[position];
      const std::size_t size = size_of(object.type);
      is_finite = decode(object, read_little(bytes.first(size)), parts) && is_finite;
      bytes = bytes.subspan(size);
    }
    return is_finite;
  }

  bool decode(const Object& object, std::uint64_t bits, Parts& parts) noexcept {
    Measurement& measurement = parts.set.measurement;
    Sample& sample = measurement.sample;
    switch (object.index) {
      case 0x2160:
        measurement.fields |= Measurement::temperature;
        sample.temperature_c = object.sub == 1 ? 0.01 * static_cast<double>(sign_extended(bits, 2)) : real(bits);
        return std::isfinite(sample.temperature_c);
      case 0x2170:
        decode_time(object, bits, measurement);
        return true;
      case 0x2180:
        decode_counter(bits, size_of(object.type), parts);
        return true;
      case 0x2190:
      case 0x1002:
        measurement.fields |= Measurement::status;
        sample.status |= static_cast<std::uint32_t>(bits);
        return true;
      default:
        break;
    }
    const unsigned q = (object.index - first_quantity) / 0x10U;
    constexpr std::array<Vector3 Sample::*, 4> vectors = {&Sample::rate, &Sample::specific_force,
                                                          &Sample::delta_angle, &Sample::delta_velocity};
    if (object.index < first_quantity || q >= vectors.size()) return true;
    const std::size_t format = object.index & 0xFU;
    const double value =
        format == 2 ? real(bits) : static_cast<double>(sign_extended(bits, size_of(object.type))) * lsbs_[q][format];
    (sample.*vectors[q])[object.sub - 1] = value;
    parts.set.axes[q] |= 1U << (object.sub - 1U);
    if (parts.set.axes[q] == 7) measurement.fields |= Measurement::rate << q;
    return std::isfinite(value);
  }

  static double real(std::uint64_t bits) noexcept {
    return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
  }

  // Unwraps the time: takes the time with these low bits that is nearest to the previous time. The first time is
  // taken unchanged.
  void decode_time(const Object& object, std::uint64_t bits, Measurement& measurement) noexcept {
    if (object.type == Type::time_of_day) return;
    constexpr std::array<std::int64_t, 3> units = {100'000, 1000, 1};  // ns
    const std::size_t which = object.sub - 1U, size = size_of(object.type);
    std::uint64_t& ticks = ticks_[which];
    ticks = has_ticks_[which] ? ticks + static_cast<std::uint64_t>(sign_extended(bits - ticks, size)) : bits;
    has_ticks_[which] = true;
    measurement.fields |= Measurement::time;
    measurement.sample.time.ns = static_cast<std::int64_t>(ticks * static_cast<std::uint64_t>(units[which]));
  }

  static void decode_counter(std::uint64_t bits, std::size_t size, Parts& parts) noexcept {
    Set& set = parts.set;
    std::uint64_t& counter = set.measurement.sample.counter;
    if (set.counter_size != 0 && sign_extended(bits ^ counter, std::min(size, set.counter_size)) != 0)
      parts.counters_agree = false;
    if (size > set.counter_size) {
      counter = bits;
      set.counter_size = size;
    }
    set.measurement.fields |= Measurement::counter;
  }

  unsigned node_id_;
  std::array<TpdoSettings, tpdos> tpdos_;
  std::array<std::array<double, 2>, quantities> lsbs_ = {};
  std::array<std::size_t, tpdos> set_of_ = {}, before_ = {none, none, none, none};  // of each PDO
  std::array<bool, tpdos> is_last_ = {};
  std::array<Set, tpdos> sets_;
  std::array<std::uint64_t, 3> ticks_ = {};
  std::array<bool, 3> has_ticks_ = {};
};

}  // namespace

std::unique_ptr<Decoder> make_decoder(const Settings& settings) { return std::make_unique<CanopenDecoder>(settings); }

}  // namespace imud::canopen
