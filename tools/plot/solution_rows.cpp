#include "tools/plot/solution_rows.hpp"

#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

#include "emulator/imu/ports.hpp"
#include "protocols/protocol.hpp"

namespace imud {
namespace {

static_assert(std::is_trivially_copyable_v<SolutionRow>);

std::array<double, 3> array_of(const Vector3& v) { return {v[0], v[1], v[2]}; }

SolutionRow row_of(const Sample& sample) {
  const Navigation& place = sample.navigation;
  SolutionRow row = {.time_ns = sample.time.ns,
                     .has_place = place.is_known,
                     .q_LP = {sample.q_LP.w(), sample.q_LP.x(), sample.q_LP.y(), sample.q_LP.z()},
                     .r_E = array_of(place.r_E),
                     .v_L = array_of(place.v_L),
                     .latitude = place.latitude,
                     .longitude = place.longitude};
  if (!sample.solution) return row;
  const Solution& solution = *sample.solution;
  row.aids_used = solution.used;
  row.aids_rejected = solution.rejected;
  row.fix_age_s = static_cast<double>(solution.since_fix_s);
  const Eigen::Vector3f* const sigmas[] = {&solution.attitude, &solution.velocity, &solution.position};
  for (std::size_t i = 0; i < row.sigma.size(); ++i)
    row.sigma[i] = static_cast<double>((*sigmas[i / 3])[static_cast<Eigen::Index>(i % 3)]);
  return row;
}

class RowDevice final : public Device {
 public:
  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    const SolutionRow row = row_of(sample);
    out.append(std::as_bytes(std::span(&row, 1)));
  }
};

constexpr Protocol rows = {
    .name = "solution-rows",
    .summary = "the solution of each sample, within this process",
    .document = "",
    .make = [](const Settings&) -> std::unique_ptr<Device> { return std::make_unique<RowDevice>(); },
    .make_decoder = nullptr};

class RowPort final : public NoPort {
 public:
  explicit RowPort(std::function<void(const SolutionRow&)> receive) : receive_(std::move(receive)) {}
  void send(std::span<const Frame> frames) noexcept override {
    NoPort::send(frames);
    for (const Frame& frame : frames) {
      SolutionRow row;
      if (frame.bytes.size() != sizeof row) continue;
      std::memcpy(&row, frame.bytes.data(), sizeof row);
      receive_(row);
    }
  }

 private:
  const std::function<void(const SolutionRow&)> receive_;
};

}  // namespace

ImuConfig with_solution_rows(const ImuConfig& imu) {
  ImuConfig same = imu;
  same.protocol = &rows;
  same.settings = Settings(rows.settings);
  same.second_port.clear();
  same.also.clear();
  same.sync = {};
  return same;
}

std::unique_ptr<Port> solution_port(std::function<void(const SolutionRow&)> receive) {
  return std::make_unique<RowPort>(std::move(receive));
}

}  // namespace imud
