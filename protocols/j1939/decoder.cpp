#include <utility>

#include "protocols/j1939/j1939.hpp"

namespace imud::j1939 {
namespace {

enum Kind : unsigned { rate, force };

// Pairs the rates and accelerations of one sample. The frames have no counter, but the frame with the lower
// identifier always comes first. Therefore frames of two samples are never paired.
class Pair {
 public:
  Pair(const Header& of_rate, const Header& of_force) noexcept : ids_{of_rate.id(), of_force.id()} {}

  // Adds a frame. Returns true if the pair is complete. Counts frames without their other half in `incomplete`.
  bool add(Kind kind, std::uint32_t id, const std::array<double, 3>& numbers, std::uint64_t& incomplete) noexcept {
    ids_[kind] = id;
    values_[kind] = numbers;
    const bool is_first = id < ids_[1U - kind];
    incomplete += is_begun_ == is_first;
    const bool is_complete = is_begun_ && !is_first;
    is_begun_ = is_first;
    return is_complete;
  }
  // Forgets the first frame of an incomplete pair. Returns true if there was one.
  bool abandon() noexcept { return std::exchange(is_begun_, false); }

  const std::array<double, 3>& operator[](Kind kind) const noexcept { return values_[kind]; }

 private:
  std::array<std::uint32_t, 2> ids_;  // without the source
  std::array<std::array<double, 3>, 2> values_ = {};
  bool is_begun_ = false;  // the first frame of the pair is there
};

class J1939Decoder final : public Decoder {
 public:
  explicit J1939Decoder(const Settings& settings)
      : configuration_(configuration_of(settings)),
        name_(unit_of(settings).name.word()),
        source_(configuration_.address),
        pair_(configuration_.header_of(ari), configuration_.header_of(accs)) {
    const Model& model = *unit_of(settings).model;
    for (unsigned bit = 0; bit < model.packet_bits.size(); ++bit) {
      if ((configuration_.packet_types >> bit & 1U) == 0) continue;
      is_fine_[rate] = is_fine_[rate] || model.packet_bits[bit] == ari_fine;
      is_fine_[force] = is_fine_[force] || model.packet_bits[bit] == accs_fine;
    }
  }

  void feed(const Frame& frame, MeasurementSink& sink) override {
    const auto message = Message::parse(frame);
    if (!message) return;
    const Header& header = message->header;
    if (header.pgn == pgn::address_claimed && message->data.size() == 8 && header.source < null_address &&
        read_little(message->data) == name_)
      source_ = header.source;
    if (header.source != source_) return;
    struct Kinds {
      Packet packet;
      Kind kind;
      const Scale& scale;
      bool is_fine;
    };
    static constexpr Kinds kinds[] = {{ari, rate, rate_scale, false},
                                      {accs, force, force_scale, false},
                                      {ari_fine, rate, fine_rate_scale, true},
                                      {accs_fine, force, fine_force_scale, true}};
    for (const Kinds& one : kinds)
      if (header.pgn == configuration_.header_of(one.packet).pgn)
        return add(*message, one.scale, one.kind, one.is_fine, sink);
  }

  void finish(MeasurementSink&) override { errors_.incomplete += pair_.abandon(); }

 private:
  void add(const Message& message, const Scale& scale, Kind kind, bool is_fine, MeasurementSink& sink) {
    std::array<double, 3> numbers{};
    if (message.data.size() != 8 || !decode(scale, read_little(message.data), numbers)) {
      ++errors_.malformed;
      return;
    }
    if (is_fine_[kind] && !is_fine) return;
    std::uint64_t unused = 0;
    const bool is_change = is_fine && !is_fine_[kind];
    if (is_change) pair_.abandon();
    is_fine_[kind] = is_fine;
    const std::uint32_t id = message.header.id() & ~0xFFU;
    if (!pair_.add(kind, id, numbers, is_change ? unused : errors_.incomplete)) return;
    Measurement measurement;
    measurement.fields = Measurement::rate | Measurement::specific_force;
    measurement.sample.rate = in_axes(pair_[rate]);
    measurement.sample.specific_force = in_axes(pair_[force]);
    sink.on_measurement(measurement);
  }

  // Returns a vector in the sensor's axes from the slots of the wire.
  Vector3 in_axes(const std::array<double, 3>& slots) const noexcept {
    Vector3 v(slots[0], slots[1], slots[2]);
    if ((configuration_.behavior & swap_slots) != 0) std::swap(v.x(), v.y());
    if ((configuration_.behavior & z_up) != 0) v = Vector3(v.x(), -v.y(), -v.z());
    return v;
  }

  Configuration configuration_;
  std::uint64_t name_;
  std::uint8_t source_;
  Pair pair_;
  std::array<bool, 2> is_fine_ = {};  // index: Kind; the unit sends the numbers in high resolution
};

}  // namespace

std::unique_ptr<Decoder> make_decoder(const Settings& settings) { return std::make_unique<J1939Decoder>(settings); }

}  // namespace imud::j1939
