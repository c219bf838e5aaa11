// Pose tables and FlightGear's rows: known rows of their own datasets and encoder.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/units.hpp"
#include "tests/support/decode_truth.hpp"

namespace imud {
namespace {

class TruthTable : public testing::Test {
 protected:
  void make(const char* name, std::initializer_list<std::pair<std::string_view, SettingValue>> values = {}) {
    const TruthFormat& format = *find_truth_format(name);
    Settings settings(format.settings);
    for (const auto& [key, value] : values) settings.set(key, value);
    decoder_ = format.make(settings);
  }
  TruthResult decode(std::string_view row) { return decode_truth(*decoder_, std::as_bytes(std::span(row)), truth_); }

  std::unique_ptr<TruthDecoder> decoder_;
  Truth truth_;
};

// The first rows of the TUM RGB-D benchmark's rgbd_dataset_freiburg1_xyz/groundtruth.txt.
TEST_F(TruthTable, Tum) {
  make("tum");
  EXPECT_EQ(decode("# timestamp tx ty tz qx qy qz qw"), TruthResult::no_state);
  ASSERT_EQ(decode("1305031098.6659 1.3563 0.6305 1.6380 0.6132 0.5962 -0.3311 -0.3986"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 1'305'031'098'665'900'000);
  EXPECT_EQ(truth_.r_BN_N, Vector3(0.6305, 1.3563, -1.638));
  EXPECT_TRUE(truth_.has_position);
  EXPECT_FALSE(truth_.has_rate || truth_.has_specific_force || truth_.has_velocity);
  // The camera's z axis, which looks at a desk from above: 2 (xz + wy), 2 (yz - wx), w^2 - x^2 - y^2 + z^2 in the
  // benchmark's world.
  const Vector3 looks_at = truth_.q_NB * Vector3(0, 0, 1);
  EXPECT_NEAR(looks_at.y(), -0.8814, 1e-3);
  EXPECT_NEAR(looks_at.x(), 0.0940, 1e-3);
  EXPECT_NEAR(-looks_at.z(), -0.4630, 1e-3);
  make("tum", {{"level", std::string("ned")}});
  ASSERT_EQ(decode("1305031098.6758 1.3543 0.6306 1.6360 0.6129 0.5966 -0.3316 -0.3980"), TruthResult::ok);
  EXPECT_EQ(truth_.r_BN_N, Vector3(1.3543, 0.6306, 1.636));
  EXPECT_EQ(decode("1305031098.6758 1.3543 0.6306 1.6360 0.6129 0.5966 -0.3316"), TruthResult::too_short);
  make("tum", {{"columns", std::vector<std::string>{"time_s", "q_NB_w", "q_NB_x", "q_NB_y", "q_NB_z"}}});
  ASSERT_EQ(decode("1 1 0 0 0"), TruthResult::ok);
  EXPECT_FALSE(truth_.has_position);
}

// The first row of MH_01_easy's state_groundtruth_estimate0/data.csv. The vehicle stands: the dataset's
// accelerometer, whose axes are the body's, measures (8.15, -0.38, -2.40) m/s^2 a second before (imu0/data.csv, first
// row).
TEST_F(TruthTable, Euroc) {
  make("euroc");
  EXPECT_EQ(
      decode("#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
             "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad "
             "s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]"),
      TruthResult::no_state);
  ASSERT_EQ(decode("1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152,-0.027876,"
                   "0.033207,0.800006,-0.003172,0.021267,0.078502,-0.025266,0.136696,0.075593"),
            TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 1'403'636'580'838'555'648);
  EXPECT_EQ(truth_.r_BN_N, Vector3(-1.786938, 4.688319, -0.783338));
  EXPECT_TRUE(truth_.has_velocity);
  EXPECT_EQ(truth_.v_BN_N, Vector3(0.033207, -0.027876, -0.800006));
  const Vector3 up_B = truth_.q_NB.conjugate() * Vector3(0, 0, -1);
  EXPECT_GT(up_B.dot(Vector3(8.15, -0.38, -2.40).normalized()), 0.98);
  EXPECT_EQ(decode("1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152"),
            TruthResult::too_short);
}

TEST_F(TruthTable, TheColumnsAreNoMap) {
  for (const char* format : {"tum", "euroc", "flightgear"}) {
    std::string fault;
    try {
      make(format, {{"columns", std::vector<std::string>{"time_s=0", "q_NB_w=1"}}});
    } catch (const std::invalid_argument& error) {
      fault = error.what();
    }
    EXPECT_EQ(fault,
              "columns: this format has no names of columns, and takes no table; give the list of the quantities in "
              "the order of the columns, as in [\"time_s\", \"_\", \"q_NB_w\"], where _ is not used")
        << format;
  }
}

// Rows of FlightGear's own FGGeneric::gen_message() (flightgear at 85a9c13, release/2020.3, src/Network/generic.cxx,
// with SimGear 2020.3.16) for FGDATA's Protocol/insgns-imu.xml at 0508a7a: elapsed 12.345 and 3600.12345678 s, of
// which it reads a float32; pi, qi, ri .0123456789 -.25 1.5 rad/s; pilot's acceleration 1 -.5 -32.174049 ft/s^2.
TEST_F(TruthTable, FlightgearImu) {
  make("flightgear");
  ASSERT_EQ(decode("12.3450\t0.012346\t-0.250000\t1.500000\t0.30480\t-0.15240\t-9.80665\n"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 12'345'000'000);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.012346, -0.25, 1.5));
  EXPECT_LE((truth_.specific_force_B - units::foot * Vector3(1, -0.5, -32.174049)).norm(), 1e-5);
  EXPECT_TRUE(truth_.q_NB.isApprox(Quaternion::Identity()));
  ASSERT_EQ(decode("3600.1235\t0.012346\t-0.250000\t1.500000\t0.30480\t-0.15240\t-9.80665\n"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 3'600'123'500'000);

  make("flightgear");
  ASSERT_EQ(decode("12.3450\t0.001000\t-0.002000\t0.003000\t0.10000\t0.20000\t-9.80000\n"), TruthResult::ok);
  ASSERT_EQ(decode("13.3450\t0.001000\t-0.002000\t0.003000\t0.10000\t0.20000\t-9.80000\n"), TruthResult::ok);
  EXPECT_NEAR(truth_.q_NB.angularDistance(Quaternion::Identity()), Vector3(0.001, -0.002, 0.003).norm(), 1e-9);
}

// The same for Protocol/insgns-truth.xml: 47 deg, 8 deg, 1640.4199475 ft; 100 -50 10 ft/s; heading, pitch, roll 90
// -10 30 deg.
TEST_F(TruthTable, FlightgearTruth) {
  make("flightgear", {{"protocol", std::string("insgns-truth")}});
  ASSERT_EQ(decode("12.3450\t0.820304748437\t0.139626340160\t-500.000\t30.47999954\t-15.23999977\t3.04800010\t"
                   "1.57080\t-0.17453\t0.52360\n"),
            TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 12'345'000'000);
  EXPECT_TRUE(truth_.has_position && truth_.has_velocity);
  EXPECT_FALSE(truth_.has_rate || truth_.has_specific_force);
  const double latitude = 47 * units::degree, longitude = 8 * units::degree;
  const Quaternion q_EN = exp(Vector3(0, 0, -units::earth_rate * 12.345));
  const Matrix3 dcm_LE = dcm_EL(latitude, longitude).transpose();
  EXPECT_LE((q_EN * truth_.r_BN_N - r_E_of({latitude, longitude, 500})).norm(), 1e-5);
  const Vector3 v_N = truth_.v_BN_N - Vector3(0, 0, units::earth_rate).cross(truth_.r_BN_N);
  EXPECT_LE((dcm_LE * (q_EN * v_N) - units::foot * Vector3(100, -50, 10)).norm(), 1e-6);
  const Matrix3 dcm_BL = dcm_from_yaw_pitch_roll(90 * units::degree, -10 * units::degree, 30 * units::degree);
  EXPECT_LE((dcm_LE * (q_EN * truth_.q_NB).toRotationMatrix() - dcm_BL.transpose()).norm(), 2e-5);
  make("flightgear", {{"columns", std::vector<std::string>{"time_s", "roll_deg", "_", "pitch_deg", "yaw_deg"}}});
  ASSERT_EQ(decode("1,90,7,0,0"), TruthResult::ok);
  EXPECT_LE((truth_.q_NB * Vector3(0, 1, 0) - Vector3(0, 0, 1)).norm(), 1e-15);
}

}  // namespace
}  // namespace imud
