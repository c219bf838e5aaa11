// The vocabulary of truth, and the truths that are assembled from it.
#include "protocols/quantities/truth_assembly.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <string_view>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

using Values = std::map<std::string, double>;

constexpr double deg = units::degree;

// A truth from quantities by name, and the assembly that has made it.
struct Assembled {
  Truth truth;
  TruthResult result = TruthResult::ok;
  std::string remark;
};

QuantitySet set_of(const Values& values) {
  QuantitySet set;
  for (const auto& [name, value] : values) set.set(find_truth_field(name).value().quantity);
  return set;
}

TruthReading reading_of(const Values& values) {
  TruthReading reading;
  for (const auto& [name, value] : values)
    EXPECT_EQ(reading.set(find_truth_field(name).value(), value), TruthResult::ok) << name;
  return reading;
}

Assembled assemble(const Values& values, const TruthAssembly::Axes& axes = {}) {
  Assembled made;
  TruthAssembly assembly(set_of(values), axes);
  const TruthReading reading = reading_of(values);
  made.result = assembly.convert(reading, made.truth);
  std::array<char, 200> room;
  RemarkWriter out(room);
  assembly.describe(reading, out);
  made.remark.assign(room.data(), out.size());
  return made;
}

std::string fault_of(const Values& values) {
  try {
    TruthAssembly assembly(set_of(values), {});
  } catch (const std::invalid_argument& fault) {
    return fault.what();
  }
  return "none";
}

void expect_near(const Vector3& a, const Vector3& b, double bound, std::string_view what) {
  EXPECT_LE((a - b).cwiseAbs().maxCoeff(), bound) << what << ": " << a.transpose() << " and " << b.transpose();
}

Values operator+(Values a, const Values& b) {
  a.insert(b.begin(), b.end());
  return a;
}

const Values time_zero = {{"time_s", 0}};
const Values level_attitude = {{"yaw_deg", 0}, {"pitch_deg", 0}, {"roll_deg", 0}};

TEST(TruthQuantities, EveryNameIsFoundWithEveryUnit) {
  std::size_t names = 0;
  QuantitySet seen;
  for (const QuantityGroup& group : quantity_groups())
    for (const std::string_view name : group.names) {
      std::vector<std::string_view> suffixes(unit_suffixes(group.kind).begin(), unit_suffixes(group.kind).end());
      if (suffixes.empty()) suffixes.emplace_back("");
      for (const std::string_view suffix : suffixes) {
        const auto field = find_truth_field(std::string(name) + std::string(suffix));
        ASSERT_TRUE(field) << name << suffix;
        EXPECT_EQ(quantity_name(field->quantity), name);
        seen.set(field->quantity);
        ++names;
      }
    }
  EXPECT_GT(names, 300U);
  EXPECT_EQ(seen.count(), quantity_groups().back().first + 1);
}

TEST(TruthQuantities, UnitsAreTheirFactors) {
  const std::map<std::string, std::pair<double, double>> known = {
      // name, {number, SI}
      {"p_deg_per_s", {180, units::pi}},
      {"p_rpm", {60, 2 * units::pi}},
      {"r_BN_N_x_ft", {1, 0.3048}},
      {"specific_force_z_g", {-1, -9.80665}},
      {"specific_force_x_mg", {1000, 9.80665}},
      {"latitude_deg_e7", {900'000'000, units::pi / 2}},
      {"v_north_kt", {3600, 1852}},
      {"v_north_kn", {3600, 1852}},
      {"p_deg_per_hr", {3600 * 180, units::pi}},
      {"p_deg_per_h", {3600 * 180, units::pi}},
      {"specific_force_y_ug", {1e6, 9.80665}},
      {"pressure_bar", {1, 1e5}},
      {"temperature_k", {273.15, 0}},
      {"temperature_f", {212, 100}},
      {"magnetic_field_y_gauss", {1, 1e-4}},
      {"pressure_hpa", {1013.25, 101'325}},
      {"q_NB_w", {0.5, 0.5}},
      {"v_BN_N_x_km_per_h", {3.6, 1}},
      {"yaw_arcsec", {3600, deg}},
      {"rotor_speed_rpm", {60, 2 * units::pi}},
      {"current_ma", {1500, 1.5}},
  };
  ASSERT_EQ(known.size(), 21U);
  for (const auto& [name, values] : known) {
    const auto field = find_truth_field(name);
    ASSERT_TRUE(field) << name;
    TruthReading reading;
    ASSERT_EQ(reading.set(*field, values.first), TruthResult::ok);
    EXPECT_NEAR(reading[field->quantity], values.second, 1e-12 * std::max(1.0, std::abs(values.second))) << name;
  }
  for (const char* wrong : {"p", "p_degs", "p_deg_per_s2", "q_NB_w_m", "speed_m", "", "time"})
    EXPECT_FALSE(find_truth_field(wrong)) << wrong;
  EXPECT_EQ(unknown_quantity("height"),
            "unknown quantity \"height\"; it needs a unit: height_m height_ft height_km height_cm height_mm");
  EXPECT_EQ(unknown_quantity("pressure_torr"),
            "unknown quantity \"pressure_torr\"; its units are: pressure_pa pressure_hpa pressure_kpa pressure_inhg "
            "pressure_mbar pressure_bar");
  EXPECT_NE(unknown_quantity("p").find(" p_deg_per_hr "), std::string::npos) << unknown_quantity("p");
  EXPECT_EQ(unknown_quantity("speed"), "unknown quantity \"speed\"; `imud list csv` prints all");
}

TEST(TruthQuantities, TimesAreExact) {
  struct {
    const char* name;
    const char* text;
    std::int64_t ns;
  } const known[] = {
      {"time_s", "12.000000001", 12'000'000'001},
      {"time_s", "-0.5", -500'000'000},
      {"time_s", "1e-3", 1'000'000},
      {"time_ms", "1.5", 1'500'000},
      {"time_us", "0.0019", 2},
      {"time_us", "0.0014999", 1},
      {"time_s", "-9.8299999999995", -9'830'000'000},
      {"unix_time_ns", "1403636579763555584", 1'403'636'579'763'555'584},  // EuRoC MH_01, first row
      {"unix_time_s", "1403636579.763555584", 1'403'636'579'763'555'584},
      {"utc", "1970-01-02T00:00:00Z", 86'400'000'000'000},
      {"utc", "2000-02-29 12:00:00.25", 951'825'600'250'000'000},
      {"utc", "2016-061-00:00:01.000000001", 1'456'790'401'000'000'001},  // 1 March of a leap year
  };
  for (const auto& time : known) {
    TruthReading reading;
    EXPECT_EQ(reading.set(find_truth_field(time.name).value(), std::string_view(time.text)), TruthResult::ok);
    EXPECT_EQ(reading.time_ns(), time.ns) << time.text;
  }
  for (const char* wrong : {"", "x", "1.2.3", "1,5", "--1", "99999999999999999999"}) {
    TruthReading reading;
    EXPECT_NE(reading.set(find_truth_field("time_s").value(), std::string_view(wrong)), TruthResult::ok) << wrong;
  }
  for (const char* wrong :
       {"2000-02-30 12:00:00", "2000-1-1 12:00:00", "12:00:00", "2000-01-01T25:00:00", "20000101"}) {
    TruthReading reading;
    EXPECT_EQ(reading.set(find_truth_field("utc").value(), std::string_view(wrong)), TruthResult::bad_number)
        << wrong;
  }
}

TEST(TruthAssembly, AttitudesInEveryFormAreOne) {
  const double yaw = 0.7, pitch = -0.4, roll = 2.1;
  const Matrix3 dcm = dcm_from_yaw_pitch_roll(yaw, pitch, roll);
  const Quaternion q(Matrix3(dcm.transpose()));
  const Vector3 sigma = mrp_from_quaternion(q);
  Values rows, columns;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const std::string suffix = std::to_string(i + 1) + std::to_string(j + 1);
      rows["dcm_BN_" + suffix] = dcm(i, j);
      columns["dcm_NB_" + suffix] = dcm(j, i);
    }
  const Values forms[] = {
      {{"q_NB_w", q.w()}, {"q_NB_x", q.x()}, {"q_NB_y", q.y()}, {"q_NB_z", q.z()}},
      {{"q_BN_w", -q.w()}, {"q_BN_x", q.x()}, {"q_BN_y", q.y()}, {"q_BN_z", q.z()}},
      {{"q_LB_w", 1.001 * q.w()}, {"q_LB_x", 1.001 * q.x()}, {"q_LB_y", 1.001 * q.y()}, {"q_LB_z", 1.001 * q.z()}},
      {{"sigma_BN_1", sigma.x()}, {"sigma_BN_2", sigma.y()}, {"sigma_BN_3", sigma.z()}},
      {{"yaw_rad", yaw}, {"pitch_rad", pitch}, {"roll_rad", roll}},
      {{"yaw_BN_deg", yaw / deg}, {"pitch_BN_deg", pitch / deg}, {"roll_BN_deg", roll / deg}},
      rows,
      columns,
  };
  for (const Values& form : forms) {
    const Assembled made = assemble(time_zero + form);
    ASSERT_EQ(made.result, TruthResult::ok) << form.begin()->first;
    EXPECT_LE(made.truth.q_NB.angularDistance(q), 1e-7) << form.begin()->first;
    EXPECT_FALSE(made.truth.has_rate);
  }
}

// A vehicle in east-north-up and front-left-up axes, heading east: its x axis is east, y north, z up.
TEST(TruthAssembly, EnuAndFluBecomeNedAndFrd) {
  const Values values = {{"time_s", 1},
                         {"q_NB_w", 1},
                         {"q_NB_x", 0},
                         {"q_NB_y", 0},
                         {"q_NB_z", 0},
                         {"r_BN_N_x_m", 1},
                         {"r_BN_N_y_m", 2},
                         {"r_BN_N_z_m", 3},
                         {"v_BN_N_x_m_per_s", 4},
                         {"v_BN_N_y_m_per_s", 5},
                         {"v_BN_N_z_m_per_s", 6},
                         {"p_rad_per_s", 0.1},
                         {"q_rad_per_s", 0.2},
                         {"r_rad_per_s", 0.3},
                         {"a_BN_N_x_m_per_s2", 1},
                         {"a_BN_N_y_m_per_s2", 0},
                         {"a_BN_N_z_m_per_s2", 0}};
  const Assembled made = assemble(values, {.is_enu = true, .is_flu = true});
  ASSERT_EQ(made.result, TruthResult::ok);
  expect_near(made.truth.q_NB * Vector3(1, 0, 0), {0, 1, 0}, 1e-15, "front is east");
  expect_near(made.truth.q_NB * Vector3(0, 1, 0), {-1, 0, 0}, 1e-15, "right is south");
  expect_near(made.truth.q_NB * Vector3(0, 0, 1), {0, 0, 1}, 1e-15, "down is down");
  expect_near(made.truth.r_BN_N, {2, 1, -3}, 0, "position");
  expect_near(made.truth.v_BN_N, {5, 4, -6}, 0, "velocity");
  expect_near(made.truth.omega_BN_B, {0.1, -0.2, -0.3}, 0, "rate");
  expect_near(made.truth.specific_force_B, {1, 0, -9.80665}, 1e-15, "specific force: 1 to the front, and gravity");
}

// At rest on the Earth, each way to give a rate and an acceleration has the Earth's rate and normal gravity.
TEST(TruthAssembly, AtRestOnTheEarthEveryWayIsTheSame) {
  const double latitude = 47 * deg;
  const Values place = {{"time_s", 100}, {"latitude_deg", 47}, {"longitude_deg", 8}, {"height_m", 400}};
  const Vector3 rate_L = units::earth_rate * Vector3(std::cos(latitude), 0, -std::sin(latitude));
  const Values rates[] = {{{"p_BE_rad_per_s", 0}, {"q_BE_rad_per_s", 0}, {"r_BE_rad_per_s", 0}},
                          {{"yaw_rate_rad_per_s", 0}, {"pitch_rate_rad_per_s", 0}, {"roll_rate_rad_per_s", 0}},
                          {{"p_rad_per_s", rate_L.x()}, {"q_rad_per_s", 0}, {"r_rad_per_s", rate_L.z()}}};
  const Values forces[] = {
      {{"acceleration_x_g", 0}, {"acceleration_y_g", 0}, {"acceleration_z_g", 0}},
      {{"acceleration_north_g", 0}, {"acceleration_east_g", 0}, {"acceleration_up_g", 0}},
  };
  for (const Values& rate : rates)
    for (const Values& force : forces) {
      const Assembled made = assemble(place + level_attitude + rate + force);
      ASSERT_EQ(made.result, TruthResult::ok) << made.remark;
      expect_near(made.truth.omega_BN_B, rate_L, 1e-18, "rate");
      expect_near(made.truth.specific_force_B, {0, 0, -normal_gravity(latitude, 400)}, 1e-12, "force");
    }
}

// A vehicle at rest on the Earth moves on a circle in N: the acceleration in N is centripetal. At a height of 400 m
// gravity is tilted by the curve of the plumb line, 3.2e-6 m/s^2.
TEST(TruthAssembly, AccelerationInAnInertialFrameLosesGravitation) {
  const double latitude = 47 * deg, w = units::earth_rate;
  const Vector3 r_E = r_E_of({latitude, 8 * deg, 400});
  const Vector3 a = -w * w * Vector3(r_E.x(), r_E.y(), 0);
  const Assembled made = assemble(Values{{"time_s", 0},
                                         {"r_BE_E_x_m", r_E.x()},
                                         {"r_BE_E_y_m", r_E.y()},
                                         {"r_BE_E_z_m", r_E.z()},
                                         {"v_BE_E_x_m_per_s", 0},
                                         {"v_BE_E_y_m_per_s", 0},
                                         {"v_BE_E_z_m_per_s", 0},
                                         {"a_BN_N_x_m_per_s2", a.x()},
                                         {"a_BN_N_y_m_per_s2", a.y()},
                                         {"a_BN_N_z_m_per_s2", a.z()}} +
                                  level_attitude);
  ASSERT_EQ(made.result, TruthResult::ok);
  expect_near(made.truth.specific_force_B, {0, 0, -normal_gravity(latitude, 400)}, 4e-6, "force");
  expect_near(made.truth.v_BN_N, Vector3(-w * r_E.y(), w * r_E.x(), 0), 1e-9, "velocity");
  expect_near(made.truth.r_BN_N, r_E, 1e-9, "position");
}

// Without a place, a position relative to the Earth's centre makes N inertial. At rest on the equator the specific
// force is what WGS 84 has for gravity there, 9.7803253359 m/s^2 (NGA.STND.0036, table 3.6), whether the acceleration
// is that in N, centripetal, or that relative to the Earth, 0. In a hall it is 9.80665 m/s^2.
TEST(TruthAssembly, APositionFromTheEarthsCentreHasItsGravitation) {
  const double a = 6'378'137.0, w = 7.292115e-5, gravity = 9.7803253359;
  const Values rate = {{"time_s", 0}, {"p_rad_per_s", w}, {"q_rad_per_s", 0}, {"r_rad_per_s", 0}};
  const Values on_equator = {{"r_BN_N_x_m", a},       {"r_BN_N_y_m", 0},           {"r_BN_N_z_m", 0},
                             {"v_BN_N_x_m_per_s", 0}, {"v_BN_N_y_m_per_s", w * a}, {"v_BN_N_z_m_per_s", 0}};
  const Values in_hall = {{"r_BN_N_x_m", 3}, {"r_BN_N_y_m", 2}, {"r_BN_N_z_m", -1}};
  // Front to the north, N's z; down to the centre, against N's x.
  const Values attitude = {{"q_NB_w", std::sqrt(0.5)}, {"q_NB_x", 0}, {"q_NB_y", -std::sqrt(0.5)}, {"q_NB_z", 0}};
  const Values level = {{"q_NB_w", 1}, {"q_NB_x", 0}, {"q_NB_y", 0}, {"q_NB_z", 0}};
  const auto a_N = [](double x) {
    return Values{{"a_BN_N_x_m_per_s2", x}, {"a_BN_N_y_m_per_s2", 0}, {"a_BN_N_z_m_per_s2", 0}};
  };
  const Values to_earth = {
      {"acceleration_x_m_per_s2", 0}, {"acceleration_y_m_per_s2", 0}, {"acceleration_z_m_per_s2", 0}};
  const auto force = [](const Values& values) { return assemble(values).truth.specific_force_B; };
  expect_near(force(rate + on_equator + attitude + a_N(-w * w * a)), {0, 0, -gravity}, 1e-8, "inertial");
  expect_near(force(rate + on_equator + attitude + to_earth), {0, 0, -gravity}, 1e-8, "relative to the Earth");
  expect_near(force(rate + in_hall + level + a_N(0.5)), {0.5, 0, -9.80665}, 1e-12, "local");
  expect_near(force(rate + level + a_N(0.5)), {0.5, 0, -9.80665}, 1e-12, "without a position");
  // 90 deg east of N's x axis at the beginning, front to the north, at a quarter of a turn later: Earth-fixed.
  const Values fixed = {{"r_BE_E_x_m", 0}, {"r_BE_E_y_m", a}, {"r_BE_E_z_m", 0}};
  const double quarter_s = units::pi / 2 / w;
  const Values late = {{"time_s", quarter_s}, {"p_rad_per_s", w}, {"q_rad_per_s", 0}, {"r_rad_per_s", 0}};
  expect_near(force(late + fixed + level_attitude + a_N(w * w * a)), {0, 0, -gravity}, 1e-8, "Earth-fixed");
}

// In free fall nothing is sensed: the attraction of a circular orbit is all of its acceleration. GM is that of WGS
// 84, 3.986004418e14 m^3/s^2; its J2 is 1.08262982131e-3. The terms that follow it are below 2e-5 of the attraction.
TEST(TruthAssembly, FreeFallInAnInertialFrameIsWeightless) {
  const double r = 7e6, gm = 3.986004418e14, a = 6'378'137.0, j2 = 1.08262982131e-3;
  const double attraction = gm / (r * r) * (1 + 1.5 * j2 * a * a / (r * r));
  const Assembled made = assemble({{"time_s", 0},
                                   {"q_NB_w", 1},
                                   {"q_NB_x", 0},
                                   {"q_NB_y", 0},
                                   {"q_NB_z", 0},
                                   {"r_BN_N_x_m", 0},
                                   {"r_BN_N_y_m", r},
                                   {"r_BN_N_z_m", 0},
                                   {"a_BN_N_x_m_per_s2", 0},
                                   {"a_BN_N_y_m_per_s2", -attraction},
                                   {"a_BN_N_z_m_per_s2", 0}});
  ASSERT_EQ(made.result, TruthResult::ok);
  expect_near(made.truth.specific_force_B, Vector3::Zero(), 2e-5 * attraction, "force");
}

// Each truth relates N to the Earth, if its quantities do: at truth time 0 N coincides with E, unless the Earth's
// angle is given.
TEST(TruthAssembly, TruthsOnTheEarthHaveItsAngle) {
  const Values rate = {{"p_rad_per_s", 0}, {"q_rad_per_s", 0}, {"r_rad_per_s", 0}};
  const Values place = {{"latitude_deg", 47}, {"longitude_deg", 8}, {"height_m", 400}};
  const Values pose = {{"q_NB_w", 1}, {"q_NB_x", 0}, {"q_NB_y", 0}, {"q_NB_z", 0}};
  const Truth on_earth = assemble(rate + place + level_attitude + Values{{"time_s", 100}}).truth;
  EXPECT_TRUE(on_earth.has_earth_angle);
  EXPECT_EQ(on_earth.earth_angle, 0);
  const Truth angled =
      assemble(rate + place + level_attitude + Values{{"time_s", 100}, {"earth_angle_rad", 1.5}}).truth;
  EXPECT_TRUE(angled.has_earth_angle);
  EXPECT_NEAR(angled.earth_angle, 1.5 - 100 * 7.292115e-5, 1e-15);
  EXPECT_FALSE(assemble(rate + pose + time_zero).truth.has_earth_angle);

  using Kind = TruthFrame::Kind;
  const auto frame = [](const Values& values, const TruthAssembly::Axes& axes = {}) {
    return TruthAssembly(set_of(values), axes).frame();
  };
  EXPECT_EQ(frame(time_zero + rate + place + level_attitude).kind, Kind::earth);
  EXPECT_EQ(frame(time_zero + rate + place + level_attitude).angle, 0.0);
  EXPECT_FALSE(frame(time_zero + place + level_attitude + Values{{"earth_angle_rad", 0}}).angle);
  EXPECT_EQ(frame(time_zero + rate + level_attitude).kind, Kind::local);
  EXPECT_EQ(frame(time_zero + rate + pose).kind, Kind::unknown);
  EXPECT_EQ(frame(time_zero + rate + pose, {.is_enu = true}).kind, Kind::local);
}

TEST(TruthAssembly, ATimeOfDayGoesOnOverMidnight) {
  const Values rest = {{"p_rad_per_s", 0}, {"q_rad_per_s", 0}, {"r_rad_per_s", 0}};
  for (const bool is_on_earth : {false, true}) {
    Values values = rest + Values{{"time_of_day_s", 0}};
    if (is_on_earth) values = values + level_attitude + Values{{"latitude_deg", 47}, {"longitude_deg", 8}};
    TruthAssembly assembly(set_of(values), {});
    const auto time = [&](double time_s) {
      values["time_of_day_s"] = time_s;
      Truth truth;
      EXPECT_EQ(assembly.convert(reading_of(values), truth), TruthResult::ok);
      return truth.time.ns;
    };
    const std::int64_t first = time(86'399.75);
    EXPECT_EQ(time(86'399.875) - first, 125'000'000);
    EXPECT_EQ(time(0) - first, 250'000'000) << "midnight";
    EXPECT_EQ(time(0.5) - first, 750'000'000);
    EXPECT_EQ(time(86'399.9375) - first, 187'500'000) << "a late one of the day before";
  }
}

// A vehicle that moves east at 100 m/s senses the acceleration of Coriolis and its curve: level acceleration 0 in the
// turning axes is what an Eotvos correction describes.
TEST(TruthAssembly, VelocitiesOnTheEarthCauseCoriolis) {
  const double latitude = 30 * deg, v = 100, w = units::earth_rate;
  const Assembled made = assemble(Values{{"time_s", 0},
                                         {"latitude_deg", 30},
                                         {"longitude_deg", -20},
                                         {"height_m", 0},
                                         {"v_north_m_per_s", 0},
                                         {"v_east_m_per_s", v},
                                         {"v_down_m_per_s", 0},
                                         {"acceleration_north_m_per_s2", 0},
                                         {"acceleration_east_m_per_s2", 0},
                                         {"acceleration_down_m_per_s2", 0}} +
                                  level_attitude);
  ASSERT_EQ(made.result, TruthResult::ok);
  const Vector3 coriolis = 2 * w * v * Vector3(std::sin(latitude), 0, std::cos(latitude));
  expect_near(made.truth.specific_force_B, coriolis - Vector3(0, 0, normal_gravity(latitude, 0)), 1e-12, "force");
}

TEST(TruthAssembly, EulerRatesAreBodyRates) {
  // d/dt of the attitude by a central difference is the independent answer.
  const auto q = [](double t) {
    return Quaternion(Matrix3(dcm_from_yaw_pitch_roll(0.3 + 0.5 * t, 0.6 - 0.2 * t, -1.0 + 0.9 * t).transpose()));
  };
  const double h = 1e-5;
  const Vector3 expected = log(q(-h).conjugate() * q(h)) / (2 * h);
  const Assembled made = assemble({{"time_s", 0},
                                   {"yaw_rad", 0.3},
                                   {"pitch_rad", 0.6},
                                   {"roll_rad", -1.0},
                                   {"yaw_rate_rad_per_s", 0.5},
                                   {"pitch_rate_rad_per_s", -0.2},
                                   {"roll_rate_rad_per_s", 0.9}});
  ASSERT_EQ(made.result, TruthResult::ok);
  expect_near(made.truth.omega_BN_B, expected, 1e-9, "rate");
}

TEST(TruthAssembly, ARateAloneIsIntegrated) {
  // Coning at 2 Hz, rates at 100 Hz: the attitude after a turn is that of its closed form.
  const double half_angle = 0.1, w = 2 * units::pi * 2, h = 0.01;
  const auto attitude = [&](double t) { return exp(half_angle * Vector3(std::cos(w * t), std::sin(w * t), 0)); };
  const auto rate = [&](double t) {
    return Vector3(log(attitude(t - 1e-5).conjugate() * attitude(t + 1e-5)) / 2e-5);
  };
  const Values first = {{"time_s", 0}, {"p_rad_per_s", 0}, {"q_rad_per_s", 0}, {"r_rad_per_s", 0}};
  TruthAssembly assembly(set_of(first), {});
  Truth truth;
  for (int i = 0; i <= 50; ++i) {
    const Vector3 omega = rate(i * h);
    ASSERT_EQ(assembly.convert(reading_of({{"time_s", i * h},
                                           {"p_rad_per_s", omega.x()},
                                           {"q_rad_per_s", omega.y()},
                                           {"r_rad_per_s", omega.z()}}),
                               truth),
              TruthResult::ok);
    EXPECT_TRUE(truth.has_rate);
  }
  EXPECT_LE(truth.q_NB.angularDistance(attitude(0).conjugate() * attitude(0.5)),
            1.2e-4);  // 1.6e-4 without the coning of a step
}

TEST(TruthAssembly, AbsoluteTimesOfAnInertialFrameBeginAtTheFirstTruth) {
  const Values values = {
      {"gps_time_of_week_ms", 1000}, {"gps_week", 2400}, {"latitude_deg", 0}, {"longitude_deg", 0}};
  TruthAssembly assembly(set_of(values + level_attitude), {});
  Truth truth;
  const auto time = [&](double week, double ms) {
    const Values now = {{"gps_time_of_week_ms", ms}, {"gps_week", week}, {"latitude_deg", 0}, {"longitude_deg", 0}};
    EXPECT_EQ(assembly.convert(reading_of(now + level_attitude), truth), TruthResult::ok);
    return truth.time.ns;
  };
  EXPECT_EQ(time(2400, 604'799'000), 0);
  EXPECT_EQ(time(2401, 500), 1'500'000'000);
  assembly.begin();
  EXPECT_EQ(time(2401, 500), 0);
  // Where N is local, an absolute time is kept.
  EXPECT_EQ(assemble({{"unix_time_s", 12}, {"q_NB_w", 1}, {"q_NB_x", 0}, {"q_NB_y", 0}, {"q_NB_z", 0}}).truth.time.ns,
            12'000'000'000);
}

TEST(TruthAssembly, SaysWhatIsMissingOrGivenTwice) {
  EXPECT_NE(fault_of(level_attitude).find("the time is missing"), std::string::npos);
  EXPECT_NE(fault_of(time_zero).find("the attitude is missing"), std::string::npos);
  EXPECT_EQ(fault_of(time_zero + level_attitude + Values{{"unix_time_s", 0}}),
            "the time is given twice, by time and by unix_time; give one of them");
  EXPECT_EQ(fault_of(time_zero + level_attitude + Values{{"sigma_BN_1", 0}, {"sigma_BN_2", 0}, {"sigma_BN_3", 0}}),
            "the attitude is given twice, by sigma_BN_1, sigma_BN_2, sigma_BN_3 and by yaw, pitch, roll; give one of "
            "them");
  EXPECT_EQ(fault_of({{"time_s", 0}, {"yaw_deg", 0}, {"roll_deg", 0}}),
            "with yaw, pitch, roll belong together, and missing are pitch");
  EXPECT_NE(fault_of(time_zero + level_attitude + Values{{"height_m", 0}}).find("needs latitude and longitude"),
            std::string::npos);
  EXPECT_NE(fault_of(time_zero + level_attitude + Values{{"earth_angle_rad", 0}}).find("needs the place"),
            std::string::npos);
  EXPECT_NE(fault_of(time_zero + level_attitude + Values{{"v_north_m_per_s", 0}, {"v_east_m_per_s", 0}})
                .find("need v_down or v_up"),
            std::string::npos);
}

TEST(TruthAssembly, RefusesWhatIsNoAttitudeOrOutOfRange) {
  const Values zero = {{"q_NB_w", 0}, {"q_NB_x", 0}, {"q_NB_y", 0}, {"q_NB_z", 0}};
  const Assembled no_rotation = assemble(time_zero + zero);
  EXPECT_EQ(no_rotation.result, TruthResult::out_of_range);
  EXPECT_EQ(no_rotation.remark, "q_NB_w is 0, and with those that belong to it no rotation, or no place");
  const Assembled fast =
      assemble(time_zero + level_attitude + Values{{"p_rad_per_s", 2e5}, {"q_rad_per_s", 0}, {"r_rad_per_s", 0}});
  EXPECT_EQ(fast.result, TruthResult::out_of_range);
  EXPECT_EQ(fast.remark, "p is 2e+05 in SI, and its limit is 1e+05");
  const Assembled deep =
      assemble(time_zero + level_attitude + Values{{"r_BE_E_x_m", 1}, {"r_BE_E_y_m", 0}, {"r_BE_E_z_m", 0}});
  EXPECT_EQ(deep.result, TruthResult::out_of_range);
  TruthReading reading;
  EXPECT_EQ(reading.set(find_truth_field("p_rad_per_s").value(), std::nan("")), TruthResult::not_finite);
}

}  // namespace
}  // namespace imud
