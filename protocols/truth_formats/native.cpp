// imud's own truth datagram, versions 1 and 2; its layout is in protocols/native_truth.hpp.
#include <cmath>

#include "core/attitude.hpp"
#include "protocols/native_truth.hpp"
#include "protocols/quantities/remark_writer.hpp"
#include "protocols/truth_format.hpp"
#include "protocols/wire/crc32c.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

using namespace boost::endian;
namespace flag = native_truth_flag;

constexpr std::uint8_t truth_magic[4] = {'I', 'M', 'U', 'T'};
constexpr std::uint8_t acknowledgement_magic[4] = {'I', 'M', 'U', 'A'};
constexpr std::uint16_t version = 1, stamped_version = 2;

struct TruthWire {
  std::uint8_t magic[4];
  little_uint16_buf_t version;
  little_uint16_buf_t flags;
  little_uint32_buf_t stream;
  little_uint32_buf_t sequence;
  little_int64_buf_t time_ns;
  little_float64_buf_t r_BN_N[3];
  little_float64_buf_t v_BN_N[3];
  little_float64_buf_t sigma_BN[3];
  little_float64_buf_t omega_BN_B[3];
  little_float64_buf_t omegaDot_BN_B[3];
  little_float64_buf_t specific_force_B[3];
  little_float64_buf_t accumulated_dv_B[3];
  std::uint8_t end[16];  // by version
};
static_assert(sizeof(TruthWire) == native_truth_size);

// The end of version 1.
struct PlainEnd {
  little_uint32_buf_t reserved;
  little_uint32_buf_t crc;
  std::uint8_t reserved_end[8];
};
// The end of version 2.
struct StampedEnd {
  little_int64_buf_t stamp_ns;
  little_uint32_buf_t clock;  // SharedClock
  little_uint32_buf_t crc;
};
static_assert(sizeof(PlainEnd) == sizeof TruthWire::end && sizeof(StampedEnd) == sizeof TruthWire::end);
constexpr std::size_t end_offset = offsetof(TruthWire, end);
constexpr std::size_t crc_offset = end_offset + offsetof(PlainEnd, crc);
constexpr std::size_t stamped_crc_offset = end_offset + offsetof(StampedEnd, crc);

template <class End>
End end_of(std::span<const std::byte> datagram) noexcept {
  return read_wire<End>(datagram.subspan(end_offset));
}

bool is_stamp(const StampedEnd& end) noexcept {
  return end.clock.value() <= static_cast<std::uint32_t>(SharedClock::monotonic) &&
         std::abs(static_cast<double>(end.stamp_ns.value())) < truth_limit::time_ns;
}

struct AcknowledgementWire {
  std::uint8_t magic[4];
  little_uint16_buf_t version;
  little_uint16_buf_t reserved;
  little_uint32_buf_t stream;
  little_uint32_buf_t sequence;
  little_int64_buf_t time_ns;
  little_uint64_buf_t samples;
};
static_assert(sizeof(AcknowledgementWire) == native_acknowledgement_size);

std::uint16_t flags_of(const Truth& truth) noexcept {
  unsigned flags = 0;
  if (truth.has_angular_acceleration) flags |= flag::angular_acceleration;
  if (truth.has_specific_force) flags |= flag::specific_force;
  if (truth.accumulated_dv == AccumulatedDv::inertial) flags |= flag::accumulated_dv_inertial;
  if (truth.accumulated_dv == AccumulatedDv::body_sum) flags |= flag::accumulated_dv_body_sum;
  if (truth.acknowledge) flags |= flag::acknowledge;
  if (truth.new_run) flags |= flag::new_run;
  return static_cast<std::uint16_t>(flags);
}

// The vectors of the datagram, with the limits of their components.
constexpr struct {
  std::string_view name, unit;
  little_float64_buf_t (TruthWire::*member)[3];
  double largest;
  std::uint16_t flags;  // the vector is read if one of these is set; 0: always
} vectors[] = {
    {"r_BN_N", "m", &TruthWire::r_BN_N, truth_limit::position, 0},
    {"v_BN_N", "m/s", &TruthWire::v_BN_N, truth_limit::velocity, 0},
    {"sigma_BN", "", &TruthWire::sigma_BN, 7e153, 0},
    {"omega_BN_B", "rad/s", &TruthWire::omega_BN_B, truth_limit::rate, 0},
    {"omegaDot_BN_B", "rad/s^2", &TruthWire::omegaDot_BN_B, truth_limit::angular_acceleration,
     flag::angular_acceleration},
    {"the specific force", "m/s^2", &TruthWire::specific_force_B, truth_limit::specific_force, flag::specific_force},
    {"the accumulated velocity", "m/s", &TruthWire::accumulated_dv_B, truth_limit::velocity,
     flag::accumulated_dv_inertial | flag::accumulated_dv_body_sum},
};

// Describes the first number that is not finite, or too large.
void describe_number(const TruthWire& wire, RemarkWriter& out) noexcept {
  if (const std::int64_t ns = wire.time_ns.value(); std::abs(static_cast<double>(ns)) >= truth_limit::time_ns)
    out << "time_ns is " << ns << ", and its limit is " << truth_limit::time_ns << " ns";
  for (const auto& vector : vectors) {
    if (vector.flags != 0 && (wire.flags.value() & vector.flags) == 0) continue;
    for (std::size_t i = 0; i < 3; ++i) {
      const double number = (wire.*vector.member)[i].value();
      if (std::abs(number) <= vector.largest) continue;
      out << (out.size() == 0 ? "" : "; ") << vector.name << " has " << number << " as component " << i + 1
          << ", and the limit is " << vector.largest << (vector.unit.empty() ? "" : " ") << vector.unit;
      return;
    }
  }
  constexpr std::uint16_t both = flag::accumulated_dv_inertial | flag::accumulated_dv_body_sum;
  if (out.size() == 0 && (wire.flags.value() & both) == both) out << "the flags 4 and 8 exclude one another";
}

void describe_stamp(const StampedEnd& end, RemarkWriter& out) noexcept {
  if (out.size() != 0 || is_stamp(end)) return;
  out << "the stamp is " << end.stamp_ns.value() << " ns of clock " << end.clock.value()
      << ", and the clocks are 1 (TAI), 2 (UTC) and 3 (monotonic), with times below " << truth_limit::time_ns
      << " ns";
}

class NativeTruthDecoder final : public DatagramTruthDecoder {
 public:
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    const std::span<const std::byte> record = datagram();
    const std::string_view text{reinterpret_cast<const char*>(record.data()), record.size()};
    switch (result) {
      case TruthResult::too_short:
      case TruthResult::too_long:
        out << "a datagram has " << record.size() << " bytes, and one of this format " << native_truth_size << ": ";
        out.quote(text, 24);
        break;
      case TruthResult::not_this_kind:
        (out << "a datagram begins with ").quote(text.substr(0, 4)) << ", and one of this format with \"IMUT\"";
        break;
      case TruthResult::bad_version:
        out << "version " << read_wire<TruthWire>(record).version.value() << ", and known are " << version << " and "
            << stamped_version;
        break;
      case TruthResult::not_finite:
      case TruthResult::out_of_range:
        describe_number(read_wire<TruthWire>(record), out);
        if (read_wire<TruthWire>(record).version.value() == stamped_version)
          describe_stamp(end_of<StampedEnd>(record), out);
        break;
      default:
        break;
    }
    return out.size();
  }
  void acknowledge(const Truth& truth, TruthTime used_until, std::uint64_t samples,
                   FrameBuffer& out) noexcept override {
    const std::span<std::byte> room = out.room(sizeof(AcknowledgementWire));
    if (room.empty()) return;
    AcknowledgementWire wire;
    std::memcpy(wire.magic, acknowledgement_magic, sizeof acknowledgement_magic);
    wire.version = version;
    wire.reserved = 0;
    wire.stream = truth.stream;
    wire.sequence = truth.sequence;
    wire.time_ns = used_until.ns;
    wire.samples = samples;
    write_wire(wire, room);
    out.push(sizeof(AcknowledgementWire));
  }

 private:
  TruthResult decode(std::span<const std::byte> record, Truth& truth) noexcept override {
    if (record.size() < sizeof(TruthWire)) return TruthResult::too_short;
    if (record.size() > sizeof(TruthWire)) return TruthResult::too_long;
    const auto wire = read_wire<TruthWire>(record);
    if (std::memcmp(wire.magic, truth_magic, sizeof truth_magic) != 0) return TruthResult::not_this_kind;
    const bool is_stamped = wire.version.value() == stamped_version;
    if (!is_stamped && wire.version.value() != version) return TruthResult::bad_version;
    const std::uint32_t crc =
        is_stamped ? end_of<StampedEnd>(record).crc.value() : end_of<PlainEnd>(record).crc.value();
    if (crc != crc32c(record.first(is_stamped ? stamped_crc_offset : crc_offset))) return TruthResult::bad_checksum;

    const std::uint16_t flags = wire.flags.value();
    const auto given = [flags](std::uint16_t bit) { return (flags & bit) != 0; };
    truth = {};
    truth.time.ns = wire.time_ns.value();
    truth.stream = wire.stream.value();
    truth.sequence = wire.sequence.value();
    truth.acknowledge = given(flag::acknowledge);
    truth.new_run = given(flag::new_run);
    truth.has_position = truth.has_velocity = true;
    truth.r_BN_N = get_vector(wire.r_BN_N);
    truth.v_BN_N = get_vector(wire.v_BN_N);
    truth.omega_BN_B = get_vector(wire.omega_BN_B);
    truth.has_angular_acceleration = given(flag::angular_acceleration);
    if (truth.has_angular_acceleration) truth.omegaDot_BN_B = get_vector(wire.omegaDot_BN_B);
    truth.has_specific_force = given(flag::specific_force);
    if (truth.has_specific_force) truth.specific_force_B = get_vector(wire.specific_force_B);
    const bool inertial = given(flag::accumulated_dv_inertial);
    const bool body_sum = given(flag::accumulated_dv_body_sum);
    if (inertial) truth.accumulated_dv = AccumulatedDv::inertial;
    if (body_sum) truth.accumulated_dv = AccumulatedDv::body_sum;
    if (inertial || body_sum) truth.accumulated_dv_B = get_vector(wire.accumulated_dv_B);

    const Vector3 sigma_BN = get_vector(wire.sigma_BN);
    if (!sigma_BN.allFinite() || !is_finite(truth)) return TruthResult::not_finite;
    if (!std::isfinite(sigma_BN.squaredNorm()) || (inertial && body_sum)) return TruthResult::out_of_range;
    truth.q_NB = quaternion_from_mrp(sigma_BN);
    if (is_stamped) {
      const auto end = end_of<StampedEnd>(record);
      if (!is_stamp(end)) return TruthResult::out_of_range;
      truth.stamp = {static_cast<SharedClock>(end.clock.value()), {end.stamp_ns.value()}};
    }
    return is_in_range(truth) ? TruthResult::ok : TruthResult::out_of_range;
  }
};

}  // namespace

std::size_t encode_native_truth(const Truth& truth, std::span<std::byte, native_truth_size> datagram) noexcept {
  const bool is_stamped = truth.stamp.clock != SharedClock::none;
  TruthWire wire = {};
  std::memcpy(wire.magic, truth_magic, sizeof truth_magic);
  wire.version = is_stamped ? stamped_version : version;
  wire.flags = flags_of(truth);
  wire.stream = truth.stream;
  wire.sequence = truth.sequence;
  wire.time_ns = truth.time.ns;
  put_vector(truth.r_BN_N, wire.r_BN_N);
  put_vector(truth.v_BN_N, wire.v_BN_N);
  put_vector(mrp_from_quaternion(truth.q_NB), wire.sigma_BN);
  put_vector(truth.omega_BN_B, wire.omega_BN_B);
  put_vector(truth.omegaDot_BN_B, wire.omegaDot_BN_B);
  put_vector(truth.specific_force_B, wire.specific_force_B);
  put_vector(truth.accumulated_dv_B, wire.accumulated_dv_B);
  if (is_stamped) {
    StampedEnd end = {};
    end.stamp_ns = truth.stamp.time.ns;
    end.clock = static_cast<std::uint32_t>(truth.stamp.clock);
    std::memcpy(wire.end, &end, sizeof end);
  }
  write_wire(wire, datagram);
  const std::size_t at = is_stamped ? stamped_crc_offset : crc_offset;
  const little_uint32_buf_t crc{crc32c(datagram.first(at))};
  std::memcpy(datagram.data() + at, &crc, sizeof crc);
  return native_truth_size;
}

bool decode_native_acknowledgement(std::span<const std::byte> datagram,
                                   NativeAcknowledgement& acknowledgement) noexcept {
  if (datagram.size() != sizeof(AcknowledgementWire)) return false;
  const auto wire = read_wire<AcknowledgementWire>(datagram);
  if (std::memcmp(wire.magic, acknowledgement_magic, sizeof acknowledgement_magic) != 0) return false;
  if (wire.version.value() != version) return false;
  acknowledgement = {wire.stream.value(), wire.sequence.value(), {wire.time_ns.value()}, wire.samples.value()};
  return true;
}

extern constexpr TruthFormat native_truth_format = {
    .name = "native",
    .summary = "imud's own datagram of 208 bytes, with CRC-32C and an acknowledgement for lockstep",
    .document = "protocols/native_truth.hpp, versions 1 and 2",
    .acknowledges = true,
    .make = [](const Settings&) -> std::unique_ptr<TruthDecoder> { return std::make_unique<NativeTruthDecoder>(); },
    .force_from = "the specific force with flag 2, or the accumulated velocity with flag 4 or 8",
};

}  // namespace imud
