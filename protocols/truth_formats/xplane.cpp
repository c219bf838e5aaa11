// X-Plane by UDP. X-Plane's port is 49000. There are two ways:
//
// RREF: imud requests each dataref by a datagram of 413 bytes ("RREF", 0, i32 times per second, i32 index, 400
// characters). It repeats the requests every 2 s, because X-Plane may have been restarted. X-Plane answers with each
// of its frames: "RREF" and a byte ("," since version 11, "O" in 10), then for each dataref an i32 index and a
// float32.
//
// DATA: X-Plane sends the rows 1, 4, 16, 17, 20 and 21 of its Data Output screen to imud: "DATA" and a byte, then for
// each row an i32 number and eight float32. The rows are: times; Mach and g-loads; rates; attitude; place; position
// and velocity. Row 16 has P, Q, R in deg/s since X-Plane 12, and Q, P, R in rad/s before.
//
// All is little-endian. Attitude is of front-right-down relative to north-east-down. The rate is relative to the
// Earth; the Earth's rate is added. B's origin is the centre of gravity. X-Plane's local axes are east, up, south at
// the origin of the scenery, and count as the axes at the aircraft. The g-loads are specific force in g: the side
// load is positive to the right, the normal load upwards, and the axial load backwards as a dataref and forwards in
// row 4.
//
// A time in float32 is coarse: 0.2 ms after an hour. With time = "arrival", the time has the network's jitter
// instead.
//
// Sources: "Sending Data to X-Plane" (Laminar Research), section "SEND ME ALL THE DATAREFS I WANT: RREF";
// DataRefs.txt of X-Plane 11. Signs of the g-loads as datarefs: px4xplane at 971a855a (src/MAVLinkManager.cpp:
// -axial, +side, -normal, from captures of three aircraft) and INAV-X-Plane-HITL at 05f1153f (src/simData.cpp). Order
// of the rows' numbers: XPlaneConnect at 11a5f35 (xpcPlugin/DataManager.cpp). Row 16 of X-Plane 12: ArduPilot at
// 00bc4884 (libraries/SITL/SIM_XPlane.cpp). Row 4: +axial, +side, -normal are the accelerometers of three programs
// that fly autopilots by it: ArduPilot there, QGroundControl at 023fa901 (src/comm/QGCXPlaneLink.cc; at standstill it
// replaces them by the values at rest) and dRonin at 6a1b8cb9
// (ground/gcs/src/plugins/hitl/xplanesimulator.cpp). No capture was found.
#include <algorithm>
#include <array>
#include <bitset>
#include <cstring>

#include "protocols/quantities/packed_truth.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

struct Dataref {
  std::string_view name, field;
};
constexpr Dataref datarefs[] = {
    {"sim/time/total_running_time_sec", "time_s:f32"},
    {"sim/flightmodel/position/latitude", "latitude_deg:f32"},
    {"sim/flightmodel/position/longitude", "longitude_deg:f32"},
    {"sim/flightmodel/position/elevation", "height_m:f32"},
    {"sim/flightmodel/position/true_psi", "yaw_deg:f32"},
    {"sim/flightmodel/position/true_theta", "pitch_deg:f32"},
    {"sim/flightmodel/position/true_phi", "roll_deg:f32"},
    {"sim/flightmodel/position/Prad", "p_BE_rad_per_s:f32"},
    {"sim/flightmodel/position/Qrad", "q_BE_rad_per_s:f32"},
    {"sim/flightmodel/position/Rrad", "r_BE_rad_per_s:f32"},
    {"sim/flightmodel/position/local_vx", "v_east_m_per_s:f32"},
    {"sim/flightmodel/position/local_vy", "v_up_m_per_s:f32"},
    {"sim/flightmodel/position/local_vz", "v_north_m_per_s:f32*-1"},
    {"sim/flightmodel/forces/g_axil", "specific_force_x_g:f32*-1"},
    {"sim/flightmodel/forces/g_side", "specific_force_y_g:f32"},
    {"sim/flightmodel/forces/g_nrml", "specific_force_z_g:f32*-1"},
};
constexpr std::int32_t rows[] = {1, 4, 16, 17, 20, 21};
constexpr std::size_t row_size = 32;
constexpr std::string_view row_fields[] = {
    // 1: real and total time, s
    "_:4",
    "time_s:f32",
    "_:24",
    // 4: Mach, climb, normal, axial and side g-load
    "_:16",
    "specific_force_z_g:f32*-1",
    "specific_force_{x,y}_g:f32",
    "_:4",
    // 16: P, Q, R
    "{p,q,r}_BE_deg_per_s:f32",
    "_:20",
    // 17: pitch, roll, true heading
    "{pitch,roll,yaw}_deg:f32",
    "_:20",
    // 20: latitude, longitude, altitude above sea level
    "{latitude,longitude}_deg:f32",
    "height_ft:f32",
    "_:20",
    // 21: position and velocity in local axes
    "_:12",
    "v_{east,up}_m_per_s:f32",
    "v_north_m_per_s:f32*-1",
    "_:8",
};
constexpr std::string_view time_word = "time_s:f32";
constexpr std::string_view rates = "{p,q,r}_BE_deg_per_s:f32", rates_before_12 = "{q,p,r}_BE_rad_per_s:f32";
constexpr std::int64_t version_12 = 12;

constexpr std::string_view source_choices[] = {"rref", "data"};
constexpr Setting settings[] = {
    text_setting("source",
                 "\"rref\": imud requests datarefs; \"data\": rows 1, 4, 16, 17, 20 and 21 of X-Plane's Data Output",
                 "rref", source_choices),
    integer_setting("request_hz", "how often X-Plane should send the datarefs, at most once each of its frames, Hz",
                    100, 1, 999),
    integer_setting(
        "version",
        "version of X-Plane whose Data Output is sent: its rates are P, Q, R in deg/s since 12, Q, P, R in rad/s "
        "before",
        version_12, 9, version_12),
    time_setting,
};

PackedTruth make_truth(bool is_rref, std::int64_t version, bool has_time) {
  std::vector<std::string_view> fields;
  if (is_rref)
    for (const Dataref& dataref : datarefs) fields.push_back(dataref.field);
  else
    fields.assign(std::begin(row_fields), std::end(row_fields));
  if (!is_rref && version < version_12) *std::ranges::find(fields, rates) = rates_before_12;
  if (!has_time) *std::ranges::find(fields, time_word) = "_:4";
  return {PackedLayout(fields, boost::endian::order::little), {}, has_time};
}

class XplaneTruthDecoder final : public DatagramTruthDecoder {
 public:
  XplaneTruthDecoder(bool is_rref, std::int64_t version, std::uint32_t request_hz, bool has_time)
      : is_rref_(is_rref),
        request_hz_(request_hz),
        parts_(is_rref ? std::size(datarefs) : std::size(rows)),
        part_size_(is_rref ? sizeof(float) : row_size),
        truth_(make_truth(is_rref, version, has_time)) {
    if (!has_time) needless_.set(0);
  }

  void start(HostTime now) noexcept override {
    if (is_rref_) next_request_ = now;
  }
  std::optional<HostTime> deadline() const noexcept override { return next_request_; }
  void poll(HostTime now, FrameBuffer& out) noexcept override {
    constexpr Nanoseconds between_requests = std::chrono::seconds(2);
    constexpr std::size_t request_size = 413, rate_offset = 5, index_offset = 9, name_offset = 13;
    if (!next_request_ || now < *next_request_) return;
    next_request_ = now + between_requests;
    for (std::size_t i = 0; i < std::size(datarefs); ++i) {
      const std::span<std::byte> room = out.room(request_size);
      if (room.empty()) return;
      std::ranges::fill(room.first(request_size), std::byte{0});
      std::memcpy(room.data(), datarefs_word.data(), datarefs_word.size());
      write_little(request_hz_, room.subspan(rate_offset, sizeof(std::int32_t)));
      write_little(i, room.subspan(index_offset, sizeof(std::int32_t)));
      std::memcpy(room.data() + name_offset, datarefs[i].name.data(), datarefs[i].name.size());
      out.push(request_size);
    }
  }

  TruthFrame frame() const noexcept override { return truth_.frame(); }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    const std::string_view text{reinterpret_cast<const char*>(datagram().data()), datagram().size()};
    if (result == TruthResult::not_this_kind)
      (out << "a datagram begins with ").quote(text.substr(0, head_size))
          << ", and one of X-Plane with RREF, or DATA";
    else if (result == TruthResult::too_short && is_rref_)
      out << "a datagram of RREF has " << datagram().size() << " bytes; 5, and 8 for each dataref, are expected";
    else if (result == TruthResult::too_short)
      out << "rows of the Data Output are missing; select 1, 4, 16, 17, 20 and 21 for the network";
    else if (result != TruthResult::ok)
      truth_.describe(out);
    return out.size();
  }

 private:
  static constexpr std::string_view datarefs_word = "RREF", data = "DATA";
  static constexpr std::size_t head_size = 5, most_parts = 32;

  std::size_t part_of(std::uint32_t number) const noexcept {
    if (is_rref_) return number;
    return static_cast<std::size_t>(std::ranges::find(rows, static_cast<std::int32_t>(number)) - std::begin(rows));
  }

  TruthResult decode(std::span<const std::byte> bytes, Truth& truth) noexcept override {
    const std::string_view text{reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    const bool is_data = text.starts_with(data);
    if (bytes.size() < head_size || (!is_data && !text.starts_with(datarefs_word))) return TruthResult::not_this_kind;
    if (is_data == is_rref_) return TruthResult::no_state;
    const std::size_t entry = sizeof(std::int32_t) + part_size_;
    std::span<const std::byte> rest = bytes.subspan(head_size);
    if (rest.empty() || rest.size() % entry != 0) return TruthResult::too_short;
    for (; !rest.empty(); rest = rest.subspan(entry)) {
      const auto number = static_cast<std::uint32_t>(read_little(rest.first(sizeof(std::int32_t))));
      const std::size_t part = part_of(number);
      if (part >= parts_) continue;
      std::memcpy(record_.data() + part * part_size_, rest.data() + sizeof(std::int32_t), part_size_);
      has_.set(part);
    }
    // The datarefs of a frame may come in several datagrams. A truth is complete when all its parts were received.
    if ((has_ | needless_).count() < parts_) return is_rref_ ? TruthResult::no_state : TruthResult::too_short;
    has_.reset();
    return truth_.convert(record_, arrival(), truth);
  }

  bool is_rref_;
  std::uint32_t request_hz_;
  std::size_t parts_, part_size_;
  PackedTruth truth_;
  std::array<std::byte, std::size(rows)* row_size> record_ = {};
  std::bitset<most_parts> has_, needless_;  // the parts that the record has, and the parts that it does not need
  std::optional<HostTime> next_request_;
};

}  // namespace

extern constexpr TruthFormat xplane_truth_format = {
    .name = "xplane",
    .summary = "X-Plane: datarefs that imud requests (RREF), or rows of its Data Output (DATA)",
    .document = "Laminar Research, Sending Data to X-Plane (X-Plane 11 and 12): RREF, DATA",
    .settings = settings,
    .make = [](const Settings& chosen) -> std::unique_ptr<TruthDecoder> {
      return std::make_unique<XplaneTruthDecoder>(
          chosen.text("source") == source_choices[0], chosen.integer("version"),
          static_cast<std::uint32_t>(chosen.integer("request_hz")), chosen.text("time") == time_choices[0]);
    },
    .force_from = "sim/flightmodel/forces/g_axil, g_side and g_nrml, or row 4",
    .example_port = "0.0.0.0:0?peer=127.0.0.1:49000",
};

}  // namespace imud
