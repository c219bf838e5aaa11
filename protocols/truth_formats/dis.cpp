// DIS (IEEE 1278.1) Entity State PDUs: 144 bytes, and 16 more for each variable parameter, big-endian.
//
// | offset | type     | field                                                                          |
// |--------|----------|--------------------------------------------------------------------------------|
// | 0      | u8       | protocol version; any                                                          |
// | 2      | u8       | PDU type, 1                                                                    |
// | 4      | u32      | timestamp: bits 31 to 1 in 3600 s / 2^31 since the hour, bit 0 absolute        |
// | 8      | u16      | length                                                                         |
// | 12     | u16[3]   | entity: site, application, entity                                              |
// | 19     | u8       | number of variable parameters                                                  |
// | 36     | f32[3]   | velocity, m/s; in E with dead reckoning 1 to 5, in body axes with 6 to 9       |
// | 48     | f64[3]   | position in E, m                                                               |
// | 72     | f32[3]   | psi, theta, phi of the body relative to E, rad                                 |
// | 88     | u8       | dead reckoning algorithm                                                       |
// | 104    | f32[3]   | acceleration; not used                                                         |
// | 116    | f32[3]   | angular velocity relative to E, in body axes, rad/s; with algorithms 3, 4, 7, 8 |
//
// The other algorithms describe entities that do not rotate; then the rate is not given. B's origin is the centre of
// the entity's bounding box. A sender omits PDUs while dead reckoning is good enough. For a sensor, set the sender's
// thresholds to 0, so that it sends a PDU in each step.
//
// Sources: IEEE Std 1278.1-2012, as open-dis-cpp at b66306e (src/dis7/EntityStatePdu.cpp) and open-dis-python at
// b9c4cd0 encode it; the axes of velocity and rate by dead reckoning algorithm: opendis/DeadReckoning.py of the
// latter.
#include <boost/endian/conversion.hpp>

#include "protocols/quantities/packed_truth.hpp"

namespace imud {
namespace {

constexpr std::size_t state_offset = 36, least_size = 144, parameter_size = 16;
constexpr std::size_t type_offset = 2, time_offset = 4, length_offset = 8, entity_offset = 16, count_offset = 19,
                      algorithm_offset = 88;
constexpr unsigned entity_state = 1;
constexpr std::int64_t hour_ns = 3'600'000'000'000;

PackedTruth make_truth(bool is_in_body, bool has_rate) {
  // From byte 36 on.
  std::vector<std::string_view> fields = {
      is_in_body ? "v_BE_B_{x,y,z}_m_per_s:f32" : "v_BE_E_{x,y,z}_m_per_s:f32",
      "r_BE_E_{x,y,z}_m:f64",
      "{yaw,pitch,roll}_BE_rad:f32",
      "_:32",
  };
  if (has_rate) fields.push_back("{p,q,r}_BE_rad_per_s:f32");
  return {PackedLayout(fields, boost::endian::order::big, state_offset), {}, false};
}

class DisTruthDecoder final : public DatagramTruthDecoder {
 public:
  TruthFrame frame() const noexcept override { return truths_[1].frame(); }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    const std::span<const std::byte> pdu = datagram();
    if (result == TruthResult::too_short || result == TruthResult::too_long) {
      out << "a datagram has " << pdu.size() << " bytes; an Entity State PDU has at least " << least_size;
      if (pdu.size() >= least_size)
        out << ", and this one " << half_at(pdu, length_offset) << " by its length, " << size_of(pdu)
            << " by its variable parameters";
    } else if (used_ != nullptr) {
      used_->describe(out);
    }
    return out.size();
  }

 private:
  static unsigned byte_at(std::span<const std::byte> pdu, std::size_t at) noexcept {
    return std::to_integer<unsigned>(pdu[at]);
  }
  static unsigned half_at(std::span<const std::byte> pdu, std::size_t at) noexcept {
    return byte_at(pdu, at) << 8 | byte_at(pdu, at + 1);
  }
  static std::size_t size_of(std::span<const std::byte> pdu) noexcept {
    return least_size + parameter_size * byte_at(pdu, count_offset);
  }

  TruthResult decode(std::span<const std::byte> pdu, Truth& truth) noexcept override {
    used_ = nullptr;
    constexpr std::size_t header = 12;
    if (pdu.size() < header) return TruthResult::too_short;
    if (byte_at(pdu, type_offset) != entity_state) return TruthResult::no_state;
    if (pdu.size() < least_size || pdu.size() < size_of(pdu)) return TruthResult::too_short;
    if (pdu.size() > size_of(pdu)) return TruthResult::too_long;
    const unsigned algorithm = byte_at(pdu, algorithm_offset);
    constexpr unsigned first_in_body = 6;
    const bool is_in_body = algorithm >= first_in_body;
    const bool has_rate = algorithm == 3 || algorithm == 4 || algorithm == 7 || algorithm == 8;
    used_ = &truths_[(is_in_body ? 2U : 0U) + (has_rate ? 1U : 0U)];
    const std::uint32_t ticks =
        boost::endian::load_big_u32(reinterpret_cast<const unsigned char*>(pdu.data()) + time_offset) >> 1;
    constexpr std::int64_t numerator = 439'453'125;  // 3.6e12 ns / 2^31, cancelled down, is this / 2^18
    const std::int64_t ns = (std::int64_t{ticks} * numerator + (std::int64_t{1} << 17)) >> 18;
    const TruthResult result = used_->convert_at(pdu, time_.of(ns), truth);
    truth.stream = half_at(pdu, entity_offset);
    return result;
  }

  PackedTruth truths_[4] = {make_truth(false, false), make_truth(false, true), make_truth(true, false),
                            make_truth(true, true)};
  WrappingTime time_{hour_ns};
  PackedTruth* used_ = nullptr;
};

}  // namespace

extern constexpr TruthFormat dis_truth_format = {
    .name = "dis",
    .summary = "DIS Entity State PDUs: position and attitude relative to the Earth, float32 angles, times of 1.7 us",
    .document = "IEEE Std 1278.1-2012, Entity State PDU",
    .make = [](const Settings&) -> std::unique_ptr<TruthDecoder> { return std::make_unique<DisTruthDecoder>(); },
    .force_from = "nothing, as a PDU has no specific force: use another format, or derive it from the poses",
    .derives = true,
};

}  // namespace imud
