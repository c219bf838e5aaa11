#include <algorithm>
#include <cmath>

#include "core/attitude.hpp"
#include "protocols/mip/mip.hpp"

namespace imud::mip {
namespace {

constexpr std::uint8_t on[] = {1};
constexpr std::uint8_t bias_estimation[] = {0, 1};  // of the gyro
constexpr std::uint8_t identity_matrix[36] = {0x3F, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,    0x3F,
                                              0x80, 0,    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F, 0x80};
constexpr std::uint8_t accelerometer_and_magnetometer[] = {0, 3};
// Initialization of the filter: source of heading, position in latitude and longitude.
constexpr std::uint8_t from_antennas[40] = {0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
                                            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2};
constexpr std::uint8_t from_magnetometer[40] = {0, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
                                                0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2};

// Columns: set, command, reply; models; size of the key, first key, number of keys; fewest and most bytes; initial
// value; kind. Initial values and the number of events are guesses where the SDK does not state them.
constexpr KeptSetting settings[] = {
    {three_dm, 0x28, 0xA8, cv7, 0, 0, 1, 1, 1, {}, KeptSetting::source},                  // pulse per second: none
    {three_dm, 0x28, 0xA8, gq7, 0, 0, 1, 1, 1, on, KeptSetting::source},                  // receiver 1
    {three_dm, 0x2B, 0xB5, series_7, 1, 1, 8, 2, 2, {}},                                  // event control
    {three_dm, 0x2E, 0xB8, series_7, 1, 1, 8, 2, 22, {}},                                 // event trigger
    {three_dm, 0x2F, 0xB9, series_7, 1, 1, 8, 3, 19, {}},                                 // event action
    {three_dm, 0x3A, 0x9C, all, 0, 0, 1, 12, 12, {}, KeptSetting::numbers},               // hard iron offset
    {three_dm, 0x3B, 0x9D, all, 0, 0, 1, 36, 36, identity_matrix, KeptSetting::numbers},  // soft iron matrix
    {three_dm, 0x3E, 0x9E, all, 0, 0, 1, 1, 1, on, KeptSetting::flag},                    // coning and sculling
    {three_dm, 0x41, 0xC1, series_7, 1, 1, 4, 4, 4, {}, KeptSetting::pin},
    {filter_command, 0x10, 0x80, gx5_45, 0, 0, 1, 1, 1, on},  // vehicle dynamics mode: portable
    {filter_command, 0x13, 0x83, gx5_45 | cv7_ins, 0, 0, 1, 12, 12, {}, KeptSetting::numbers},  // antenna offset
    {filter_command, 0x14, 0x84, all, 0, 0, 1, 2, 2, bias_estimation},
    {filter_command, 0x15, 0x86, with_receiver, 0, 0, 1, 1, 1, on},           // source of GNSS aiding: all receivers
    {filter_command, 0x18, 0x87, gx5, 0, 0, 1, 1, 1, on},                     // heading source: magnetometer
    {filter_command, 0x19, 0x88, gx5, 0, 0, 1, 1, 1, on, KeptSetting::flag},  // automatic initialization
    {filter_command, 0x1E, 0x8D, gx5_45, 0, 0, 1, 5, 5, {}},                  // zero-velocity update
    {filter_command, 0x20, 0x8E, gx5_45, 0, 0, 1, 5, 5, {}},                  // zero-angular-rate update
    {filter_command, 0x26, 0x90, gx5, 0, 0, 1, 25, 25, {}},                   // reference position
    {filter_command, 0x41, 0xB0, gx5_25, 0, 0, 1, 2, 2, accelerometer_and_magnetometer},  // measurements that aid
    {filter_command, 0x43, 0xB2, gx5, 0, 0, 1, 5, 5, on},                                 // declination source: none
    {filter_command, 0x47, 0xB7, gx5, 0, 0, 1, 1, 1, {}},                                 // altitude aiding
    {filter_command, 0x4B, 0xBB, gx5, 0, 0, 1, 1, 1, {}},                                 // pitch and roll aiding
    {filter_command, 0x50, 0xD0, cv7_ahrs, 2, 4, 2, 3, 3, on},       // aiding measurement, by its source: 4 is
    {filter_command, 0x50, 0xD0, cv7_ins | gq7, 2, 0, 9, 3, 3, on},  // the magnetometer, 5 an external heading
    {filter_command, 0x52, 0xD2, cv7, 0, 0, 1, 40, 40, from_magnetometer},
    {filter_command, 0x52, 0xD2, gq7, 0, 0, 1, 40, 40, from_antennas},
    {filter_command, 0x54, 0xD4, gq7, 1, 1, 2, 13, 13, {}, KeptSetting::numbers},  // offset of an antenna
    {aiding, 0x01, 0x81, cv7_ins, 1, 1, 4, 27, 31, on},  // frame: Euler angles or quaternion
};

constexpr Acknowledged acknowledged[] = {
    {filter_command, 0x01, 0, all},                                    // reset
    {filter_command, 0x02, 12, all},                                   // initial attitude
    {filter_command, 0x03, 4, all},                                    // initial heading
    {filter_command, 0x05, 0, series_7},                               // run
    {filter_command, 0x16, 70, gx5_45},                                // external GNSS
    {filter_command, 0x17, 9, gx5},                                    // external heading
    {aiding, 0x21, 49, cv7_ins},                                       // position
    {aiding, 0x22, 49, cv7_ins},         {aiding, 0x23, 21, cv7_ins},  // height
    {aiding, 0x28, 37, cv7_ins},                                       // velocity
    {aiding, 0x29, 37, cv7_ins},         {aiding, 0x2A, 37, cv7_ins}, {aiding, 0x31, 21, cv7_ins},  // heading
    {aiding, 0x32, 37, cv7_ins},                                                                    // magnetic field
    {aiding, 0x33, 21, cv7_ins},                                                                    // pressure
};

constexpr std::size_t slots_before(std::size_t setting) {
  std::size_t slots = 0;
  for (std::size_t i = 0; i < setting; ++i) slots += settings[i].slots;
  return slots;
}
static_assert(slots_before(std::size(settings)) == std::tuple_size_v<decltype(Configuration::kept)>);

std::size_t first_slot(const KeptSetting& setting) noexcept {
  return slots_before(static_cast<std::size_t>(&setting - settings));
}

// The features that a pin may have are from the manual of the CV7. An encoder, on a GQ7, is
// kept and changes nothing.
bool is_good_pin(const Model& model, std::uint8_t feature, std::uint8_t behavior, std::uint8_t mode) noexcept {
  constexpr std::uint8_t most[] = {0, 3, 2, 2, 3}, pulls = 0x06;  // the highest behavior of each feature
  if (feature >= std::size(most) || (feature == Pin::encoder && !model.is(gq7))) return false;
  return behavior <= most[feature] && (feature == Pin::unused || behavior > 0) && mode < 8 && (mode & pulls) != pulls;
}

bool is_good(const KeptSetting& setting, const Model& model, std::span<const std::byte> value) noexcept {
  const auto byte = [&](std::size_t i) { return std::to_integer<std::uint8_t>(value[i]); };
  if (setting.kind == KeptSetting::source) {
    const auto source = static_cast<PulseSource>(byte(0));
    const bool is_receiver = source == PulseSource::receiver_1 || source == PulseSource::receiver_2;
    return source <= PulseSource::generated && (!is_receiver || model.is(with_receiver));
  }
  if (setting.kind == KeptSetting::pin) return is_good_pin(model, byte(0), byte(1), byte(2));
  if (setting.kind == KeptSetting::flag) return value[0] <= std::byte{1};
  if (setting.kind == KeptSetting::numbers)
    for (Reader reader(value); !reader.is_done();)
      if (!std::isfinite(reader.take<float>())) return false;
  return true;
}

}  // namespace

std::span<const KeptSetting> kept_settings() noexcept { return settings; }
std::span<const Acknowledged> acknowledged_commands() noexcept { return acknowledged; }

Configuration::Configuration() noexcept {
  Kept* next = kept.data();
  for (const KeptSetting& setting : settings)
    for (unsigned slot = 0; slot < setting.slots; ++slot, ++next) {
      next->size = setting.least;
      if (setting.key_size > 0)
        next->bytes[setting.key_size - 1U] = static_cast<std::uint8_t>(setting.first_key + slot);
      std::copy(setting.initial.begin(), setting.initial.end(), next->bytes.begin() + setting.key_size);
    }
}

const Stream* Configuration::find(std::uint8_t set) const noexcept {
  for (const Stream& stream : streams)
    if (stream.set == set && set != 0) return &stream;
  return nullptr;
}

const Kept* Configuration::find_kept(const Model& model, std::uint8_t set, std::uint8_t command,
                                     unsigned key) const noexcept {
  for (const KeptSetting& setting : settings)
    if (setting.set == set && setting.command == command && model.is(setting.models) && key >= setting.first_key &&
        key - setting.first_key < setting.slots)
      return &kept[first_slot(setting) + key - setting.first_key];
  return nullptr;
}

Memory::Code Memory::execute_kept(const KeptSetting& setting, Data data, Packet& answer) noexcept {
  if (data.size() < 1U + setting.key_size) return bad_parameter;
  const auto function = std::to_integer<std::uint8_t>(data[0]);
  const Data value = data.subspan(1);
  unsigned key = 0;
  for (unsigned i = 0; i < setting.key_size; ++i) key = key << 8 | std::to_integer<unsigned>(value[i]);
  const bool is_every = setting.key_size > 0 && key == (setting.key_size == 1 ? 0U : 0xFFFFU);
  const std::size_t first = first_slot(setting), slot = first + key - setting.first_key;
  const bool is_one = key >= setting.first_key && key - setting.first_key < setting.slots;
  switch (function) {
    case write: {
      if (!is_one || value.size() < setting.least || value.size() > setting.most) return bad_parameter;
      if (!is_good(setting, model_, value.subspan(setting.key_size))) return bad_parameter;
      Kept& kept = active_.kept[slot];
      kept = {static_cast<std::uint8_t>(value.size()), {}};
      std::transform(value.begin(), value.end(), kept.bytes.begin(),
                     [](std::byte b) { return std::to_integer<std::uint8_t>(b); });
      if (setting.kind == KeptSetting::pin) configure_pin(static_cast<std::uint8_t>(key));
      return ok;
    }
    case read: {
      if (!is_one) return bad_parameter;
      const Kept& kept = active_.kept[slot];
      answer.begin(setting.reply);
      for (unsigned i = 0; i < kept.size; ++i) answer.put(kept.bytes[i]);
      answer.end();
      return ok;
    }
    default:
      if (!is_one && !is_every) return bad_parameter;
      return transfer(function, [&](Configuration& to, const Configuration& from) {
        for (std::size_t i = 0; i < setting.slots; ++i) {
          if (!is_every && first + i != slot) continue;
          to.kept[first + i] = from.kept[first + i];
          if (setting.kind == KeptSetting::pin && &to == &active_)
            configure_pin(static_cast<std::uint8_t>(setting.first_key + i));
        }
      });
  }
}

Memory::Code Memory::vector(Vector3 Configuration::*vector, double unit, std::uint8_t descriptor, Reader& reader,
                            Packet& answer) noexcept {
  const auto function = reader.take<std::uint8_t>();
  if (function == write) {
    const Vector3 wanted = unit * reader.take_floats();
    if (!reader.is_done() || !wanted.allFinite()) return bad_parameter;
    active_.*vector = wanted;
    return ok;
  }
  if (!reader.is_whole()) return bad_parameter;
  if (function == read) {
    answer.begin(descriptor);
    answer.put_floats(active_.*vector / unit);
    answer.end();
    return ok;
  }
  return transfer(function, [&](Configuration& to, const Configuration& from) { to.*vector = from.*vector; });
}

// One rotation in four forms: 0D:11 the Euler angles of V relative to P, 0C:31 of P relative to V, 0C:32 the
// quaternion with v_V = q* v_P q, 0C:33 dcm_VP by rows.
Memory::Code Memory::rotation(std::uint8_t set, std::uint8_t command, Reader& reader, Packet& answer) noexcept {
  enum class Form { euler_VP, euler_PV, quaternion, matrix };
  const Form form = set == filter_command ? Form::euler_VP
                    : command == 0x31     ? Form::euler_PV
                    : command == 0x32     ? Form::quaternion
                                          : Form::matrix;
  constexpr double tolerance = 1e-3;
  const auto function = reader.take<std::uint8_t>();
  if (function == write) {
    Quaternion q_PV;
    if (form == Form::quaternion) {
      const double w = static_cast<double>(reader.take<float>());
      const Vector3 v = reader.take_floats();
      q_PV = Quaternion(w, v.x(), v.y(), v.z());
    } else if (form == Form::matrix) {
      Matrix3 dcm_VP;
      for (int row = 0; row < 3; ++row) dcm_VP.row(row) = reader.take_floats().transpose();
      if (!(rotation_defect(dcm_VP) < tolerance)) return bad_parameter;
      q_PV = Quaternion(dcm_VP.transpose());
    } else {
      const Vector3 rpy = reader.take_floats();
      if (!rpy.allFinite() || rpy.cwiseAbs().maxCoeff() > 10) return bad_parameter;
      const Matrix3 dcm = dcm_from_yaw_pitch_roll(rpy[2], rpy[1], rpy[0]);
      q_PV = Quaternion(form == Form::euler_VP ? Matrix3(dcm.transpose()) : dcm);
    }
    if (!reader.is_done() || !(std::abs(q_PV.norm() - 1) < tolerance)) return bad_parameter;
    active_.q_PV = q_PV.normalized();
    return ok;
  }
  if (!reader.is_whole()) return bad_parameter;
  if (function != read)
    return transfer(function, [](Configuration& to, const Configuration& from) { to.q_PV = from.q_PV; });
  const Matrix3 dcm_PV = active_.q_PV.toRotationMatrix();
  answer.begin(static_cast<std::uint8_t>(form == Form::euler_VP ? 0x81 : command + 0x80));
  if (form == Form::quaternion) {
    answer.put_float(active_.q_PV.w());
    answer.put_floats(active_.q_PV.vec());
  } else if (form == Form::matrix) {
    for (int row = 0; row < 3; ++row) answer.put_floats(dcm_PV.col(row));
  } else {
    const Vector3 ypr = yaw_pitch_roll_from_dcm(form == Form::euler_VP ? Matrix3(dcm_PV.transpose()) : dcm_PV);
    answer.put_floats({ypr[2], ypr[1], ypr[0]});
  }
  answer.end();
  return ok;
}

bool Memory::begins_capture(Data data, DeviceTime now) noexcept {
  Reader reader(data);
  const auto milliseconds = reader.take<std::uint16_t>();
  if (!reader.is_done() || milliseconds < 1000 || milliseconds > 30'000 || capture_end_) return false;
  capture_end_ = now + std::chrono::milliseconds(milliseconds);
  capture_count_ = 0;
  capture_sum_.setZero();
  return true;
}

void Memory::capture(const Sample& sample, FrameBuffer& out) noexcept {
  if (!capture_end_) return;
  capture_sum_ += sample.rate;
  ++capture_count_;
  if (sample.time >= *capture_end_) end_capture(out);
}

std::optional<DeviceTime> Memory::deadline() const noexcept {
  if (!capture_end_) return std::nullopt;
  return *capture_end_ + Nanoseconds(1);
}

void Memory::poll(DeviceTime now, FrameBuffer& out) noexcept {
  if (capture_end_ && now > *capture_end_) end_capture(out);
}

// A capture without samples fails.
void Memory::end_capture(FrameBuffer& out) noexcept {
  capture_end_.reset();
  if (capture_count_ > 0) active_.gyro_bias = capture_sum_ / capture_count_;
  Packet answer(out, three_dm);
  answer.begin(reply);
  answer.put(std::uint8_t{0x39});
  answer.put(static_cast<std::uint8_t>(capture_count_ > 0 ? ok : failed));
  answer.end();
  if (capture_count_ > 0) {
    answer.begin(0x9B);
    answer.put_floats(active_.gyro_bias);
    answer.end();
  }
  answer.finish();
}

}  // namespace imud::mip
