// FlightGear's native FDM datagram (`--native-fdm=socket,out,...`), FGNetFDM version 24, which JSBSim's
// `<output type="FLIGHTGEAR">` sends as well: 408 bytes, big-endian.
//
// The attitude is of front-right-down relative to local north-east-down. Its derivatives are Euler rates relative to
// the Earth, whose rate is added. The force is taken at the pilot's eye point, which is B's origin for lever arms.
// Numbers are float32, except longitude, latitude and altitude.
//
// cur_time is the simulation's time in us with JSBSim's `<time type="simulation" resolution="1e-6"/>`, and begins
// again after 71.6 minutes. Without that element it is the constant 1234567890. In FlightGear it is the Unix time in
// whole seconds: set time = "arrival" there.
//
// Sources: net_fdm.hxx of JSBSim 1.3.2 and of FlightGear 2020.3, compared with captures of both.
#include <boost/endian/conversion.hpp>

#include "protocols/quantities/packed_datagram.hpp"

namespace imud {
namespace {

constexpr std::uint32_t version = 24;
constexpr std::size_t size = 408, time_offset = 356;
constexpr std::string_view fields[] = {
    "_:8",  // version, padding
    "{longitude,latitude}_rad:f64",
    "height_m:f64",
    "_:4",  // height above the ground
    "{roll,pitch,yaw}_rad:f32",
    "_:8",  // angle of attack, sideslip
    "{roll,pitch,yaw}_rate_rad_per_s:f32",
    "_:8",  // airspeed, climb rate
    "v_{north,east,down}_ft_per_s:f32",
    "_:12",  // velocity in body axes
    "specific_force_{x,y,z}_ft_per_s2:f32",
    "_:244",  // stall warning, slip, engines, fuel, landing gear
    "time_us:u32",
    "_:48",  // warp, visibility, control surfaces
};
constexpr std::size_t time_field = std::size(fields) - 2;
constexpr Setting settings[] = {time_setting};

std::uint32_t word_at(std::span<const std::byte> record, std::size_t offset) noexcept {
  return boost::endian::load_big_u32(reinterpret_cast<const unsigned char*>(record.data()) + offset);
}

PackedTruth make_truth(bool has_time) {
  std::vector<std::string_view> all(std::begin(fields), std::end(fields));
  if (!has_time) all[time_field] = "_:4";
  return {PackedLayout(all, boost::endian::order::big), {}, has_time};
}

class FgnetfdmTruthDecoder final : public PackedDatagramDecoder {
 public:
  explicit FgnetfdmTruthDecoder(bool has_time) : PackedDatagramDecoder(make_truth(has_time)), has_time_(has_time) {}

  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    if (result == TruthResult::bad_version)
      out << "version " << word_at(datagram(), 0) << ", and known is " << version;
    else if (result == TruthResult::out_of_range && is_stuck())
      out << "cur_time is " << word_at(datagram(), time_offset)
          << " again: JSBSim's <output> needs <time type=\"simulation\" resolution=\"1e-6\"/>; for FlightGear set "
             "time = \"arrival\"";
    else
      return PackedDatagramDecoder::describe(result, room);
    return out.size();
  }

 private:
  bool is_stuck() const noexcept { return has_time_ && repeated_ > 1; }
  TruthResult decode(std::span<const std::byte> record, Truth& truth) noexcept override {
    if (record.size() == size) {
      if (word_at(record, 0) != version) return TruthResult::bad_version;
      const std::uint32_t time = word_at(record, time_offset);
      repeated_ = last_time_ == time ? repeated_ + 1 : 0;
      last_time_ = time;
      if (is_stuck()) return TruthResult::out_of_range;
    }
    return PackedDatagramDecoder::decode(record, truth);
  }

  bool has_time_;
  std::optional<std::uint32_t> last_time_;
  std::uint32_t repeated_ = 0;  // datagrams with the same cur_time; one may be a copy on the network
};

}  // namespace

extern constexpr TruthFormat fgnetfdm_truth_format = {
    .name = "fgnetfdm",
    .summary =
        "FlightGear's native FDM, version 24, as FlightGear and JSBSim send it: force at the pilot's eye point",
    .document = "FlightGear 2020.3 and JSBSim 1.3.2, net_fdm.hxx, FG_NET_FDM_VERSION 24",
    .settings = settings,
    .make = [](const Settings& chosen) -> std::unique_ptr<TruthDecoder> {
      return std::make_unique<FgnetfdmTruthDecoder>(chosen.text("time") == time_choices[0]);
    },
    .force_from = "A_X_pilot to A_Z_pilot, which are in every datagram",
};

}  // namespace imud
