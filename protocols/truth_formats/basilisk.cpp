// Basilisk's SCStatesMsgPayload as it lies in memory, 272 bytes, after the simulation time: 280 bytes, little-endian.
//
// | offset | type   | field                                                                            |
// |--------|--------|----------------------------------------------------------------------------------|
// | 0      | u64    | CurrentSimNanos                                                                  |
// | 8      | f64[3] | r_BN_N, m                                                                        |
// | 32     | f64[3] | v_BN_N, m/s                                                                      |
// | 56     | f64[3] | r_CN_N, of the centre of mass; not used                                          |
// | 80     | f64[3] | v_CN_N; not used                                                                 |
// | 104    | f64[3] | sigma_BN                                                                         |
// | 128    | f64[3] | omega_BN_B, rad/s                                                                |
// | 152    | f64[3] | omegaDot_BN_B, rad/s^2                                                           |
// | 176    | f64[3] | TotalAccumDVBdy, of the centre of mass; not used                                 |
// | 200    | f64[3] | TotalAccumDV_BN_B, m/s                                                           |
// | 224    | f64[3] | TotalAccumDV_CN_N, of the centre of mass; not used                               |
// | 248    | f64[3] | nonConservativeAccelpntB_B, m/s^2                                                |
// | 272    | u64    | MRPSwitchCount; not used                                                         |
//
// A Python SysModel sends it in UpdateState(self, CurrentSimNanos), with `m` read from scStateOutMsg, as
//   struct.pack('<Q33dQ', CurrentSimNanos, *m.r_BN_N, *m.v_BN_N, *m.r_CN_N, *m.v_CN_N, *m.sigma_BN, *m.omega_BN_B,
//               *m.omegaDot_BN_B, *m.TotalAccumDVBdy, *m.TotalAccumDV_BN_B, *m.TotalAccumDV_CN_N,
//               *m.nonConservativeAccelpntB_B, m.MRPSwitchCount)
// B's origin is the spacecraft's body frame. Source: Basilisk 2.12 at babdff7,
// src/architecture/msgPayloadDefC/SCStatesMsgPayload.h.
#include "protocols/quantities/packed_datagram.hpp"

namespace imud {
namespace {

constexpr std::string_view fields[] = {
    "time_ns:u64",
    "r_BN_N_{x,y,z}_m:f64",
    "v_BN_N_{x,y,z}_m_per_s:f64",
    "_:48",
    "sigma_BN_{1,2,3}:f64",
    "{p,q,r}_rad_per_s:f64",
    "{p,q,r}_dot_rad_per_s2:f64",
    "_:24",
    "accumulated_dv_{x,y,z}_m_per_s:f64",
    "_:24",
    "specific_force_{x,y,z}_m_per_s2:f64",
    "_:8",
};
constexpr Setting settings[] = {accumulated_dv_setting};

class BasiliskTruthDecoder final : public PackedDatagramDecoder {
 public:
  explicit BasiliskTruthDecoder(const TruthAssembly::Axes& axes)
      : PackedDatagramDecoder({PackedLayout(fields, boost::endian::order::little), axes}) {}
};

}  // namespace

extern constexpr TruthFormat basilisk_truth_format = {
    .name = "basilisk",
    .summary = "Basilisk's SCStatesMsgPayload as it lies in memory, after the time in ns: 280 bytes",
    .document = "Basilisk 2.12, msgPayloadDefC/SCStatesMsgPayload.h",
    .settings = settings,
    .make = [](const Settings& chosen) -> std::unique_ptr<TruthDecoder> {
      return std::make_unique<BasiliskTruthDecoder>(
          TruthAssembly::Axes{.accumulated_dv = TruthAssembly::accumulation(chosen)});
    },
    .force_from = "nonConservativeAccelpntB_B, which is in every datagram",
};

}  // namespace imud
