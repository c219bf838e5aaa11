#include "tools/truth/truth_logs.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace imud {

namespace {

constexpr std::string_view state_fields[] = {
    "time_ns",          "q_NB_w",      "q_NB_x",      "q_NB_y",           "q_NB_z",
    "r_BN_N_x_m",       "r_BN_N_y_m",  "r_BN_N_z_m",  "v_BN_N_x_m_per_s", "v_BN_N_y_m_per_s",
    "v_BN_N_z_m_per_s", "p_rad_per_s", "q_rad_per_s", "r_rad_per_s"};
constexpr std::size_t first_velocity = 8, first_rate = 11;

}  // namespace

const TruthLog* truth_log_of_file(std::string_view path) noexcept {
  for (const TruthLog* log : truth_logs())
    if (path.ends_with(log->extension)) return log;
  return nullptr;
}

LoggedTruths::LoggedTruths(LoggedStates states) : log_(std::move(states)) {
  QuantitySet given;
  for (std::size_t i = 0; i < std::size(state_fields); ++i) {
    fields_.push_back(*find_truth_field(state_fields[i]));
    if (i < first_velocity || (i < first_rate ? log_.has_velocity : log_.has_rate)) given.set(fields_[i].quantity);
  }
  assembly_ = TruthAssembly(given, log_.axes);
}

std::optional<TruthResult> LoggedTruths::next(Truth& truth) {
  if (next_ == log_.states.size()) return std::nullopt;
  const LoggedStates::State& state = log_.states[next_++];
  TruthReading reading;
  if (const auto result = reading.set(fields_[0], state.time_ns); result != TruthResult::ok) return result;
  const Quaternion& q = state.q_NB;
  const Vector3 &r = state.r_BN_N, &v = state.v_BN_N, &rate = state.rate_B;
  const std::array<double, std::size(state_fields) - 1> numbers = {
      q.w(), q.x(), q.y(), q.z(), r.x(), r.y(), r.z(), v.x(), v.y(), v.z(), rate.x(), rate.y(), rate.z()};
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (assembly_.given()[fields_[i + 1].quantity])
      if (const auto result = reading.set(fields_[i + 1], numbers[i]); result != TruthResult::ok) return result;
  return assembly_.convert(reading, truth);
}

void read_log(const std::string& path, const std::function<void(std::span<const std::byte>)>& read) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(fmt::format("{}: {}", path, std::strerror(errno)));
  std::vector<char> piece(std::size_t{1} << 20U);
  while (file.read(piece.data(), static_cast<std::streamsize>(piece.size())), file.gcount() > 0)
    read(std::as_bytes(std::span(piece).first(static_cast<std::size_t>(file.gcount()))));
  if (file.bad() || !file.eof()) throw std::runtime_error(fmt::format("{}: cannot be read", path));
}

}  // namespace imud
