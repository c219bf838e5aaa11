// Rows of text whose columns are quantities of truth, by name, by a map or by number.
#include "protocols/quantities/mapped_columns.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "core/units.hpp"
#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

class MappedCsv : public testing::Test {
 protected:
  void make(const std::vector<std::string>& columns, const std::string& level = "ned") {
    const TruthFormat& format = *find_truth_format("csv");
    Settings settings(format.settings);
    settings.set("columns", columns);
    settings.set("level", level);
    decoder_ = format.make(settings);
  }
  TruthResult decode(std::string_view row) {
    row_ = row;
    decoder_->feed(std::as_bytes(std::span(row_)), TruthInput::datagram, {});
    TruthResult last = TruthResult::no_state;
    while (const auto result = decoder_->next(truth_)) last = *result;
    return last;
  }
  std::string remark(TruthResult result) const {
    std::array<char, 400> room;
    return {room.data(), decoder_->describe(result, room)};
  }
  std::string remark_on(std::string_view row) { return remark(decode(row)); }
  std::string fault(const std::vector<std::string>& columns) {
    try {
      make(columns);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "none";
  }

  std::unique_ptr<TruthDecoder> decoder_;
  Truth truth_;
  std::string row_;  // the last one, which a remark may quote
};

const std::vector<std::string> mapped_euler = {"time_s=t",      "yaw_deg=psi",   "pitch_deg=theta",  "roll_deg=phi",
                                               "p_deg_per_s=P", "q_deg_per_s=Q", "r_deg_per_s=R [d]"};

TEST_F(MappedCsv, AMapNamesTheColumnsOfTheHeaderRow) {
  make(mapped_euler);
  EXPECT_EQ(remark(TruthResult::no_state), "");
  EXPECT_EQ(remark_on("0,0,0,0,0,0,0"),
            "there was no header row before the row \"0,0,0,0,0,0,0\", required are \"t\", \"psi\", \"theta\", "
            "\"phi\", \"P\", \"Q\", \"R [d]\"");
  for (const char delimiter : {',', ';', '\t'}) {
    const auto with = [&](std::string row) {
      std::ranges::replace(row, ',', delimiter);
      return row;
    };
    ASSERT_EQ(decode(with("\xEF\xBB\xBF\"R [d]\",Q,P,other,phi, theta ,psi,t\r\n")), TruthResult::no_state);
    EXPECT_EQ(remark(TruthResult::no_state), "columns that are not used: \"other\"");
    ASSERT_EQ(decode(with("3,2,1,x,0,0,\"90\",1.000000001\r\n")), TruthResult::ok) << delimiter;
    EXPECT_EQ(truth_.time.ns, 1'000'000'001);
    EXPECT_LE((truth_.omega_BN_B - units::degree * Vector3(1, 2, 3)).norm(), 1e-15);
    EXPECT_LE((truth_.q_NB * Vector3(1, 0, 0) - Vector3(0, 1, 0)).norm(), 1e-15);
    EXPECT_TRUE(truth_.has_rate);
    EXPECT_FALSE(truth_.has_specific_force || truth_.has_position);
  }
}

TEST_F(MappedCsv, AHeaderRowMayBeginWithANumberSignAndMayComeAgain) {
  make(mapped_euler);
  EXPECT_EQ(decode("# a comment about t and psi"), TruthResult::no_state);
  EXPECT_EQ(decode("1,0,0,0,0,0,0"), TruthResult::no_columns);
  ASSERT_EQ(decode("#t,psi,theta,phi,P,Q,R [d]"), TruthResult::no_state);
  ASSERT_EQ(decode("1,0,0,0,4,0,0"), TruthResult::ok);
  ASSERT_EQ(decode("P,psi,theta,phi,t,Q,R [d]"), TruthResult::no_state);
  ASSERT_EQ(decode("5,0,0,0,2,0,0"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 2'000'000'000);
  EXPECT_NEAR(truth_.omega_BN_B.x(), 5 * units::degree, 1e-15);
}

TEST_F(MappedCsv, AHeaderRowThatIsNotSufficientIsDescribed) {
  make(mapped_euler);
  EXPECT_EQ(remark_on("t,psi,theta,phi,P"), "the header row lacks \"Q\" (q_deg_per_s), \"R [d]\" (r_deg_per_s)");
  EXPECT_EQ(decode("1,0,0,0,0"), TruthResult::no_columns);
  EXPECT_EQ(remark_on("t,psi,theta,phi,P,Q,R [d],psi"), "the header row has yaw twice");
}

TEST_F(MappedCsv, ColumnsByNumberNeedNoHeaderRow) {
  make({"time_s=1", "q_NB_w=5", "q_NB_x=2", "q_NB_y=3", "q_NB_z=4"});
  EXPECT_EQ(decode("name,time,x,y,z,w"), TruthResult::no_state);
  for (const std::string_view row :
       {"9,2.5,0,0,0,1", "9;2.5;0;0;0;1;;7", "9\t2.5\t0\t0\t0\t1", "9  2.5 0 0   0 1", "vehicle,2.5,0,0,0,1"}) {
    ASSERT_EQ(decode(row), TruthResult::ok) << row;
    EXPECT_EQ(truth_.time.ns, 2'500'000'000);
    EXPECT_FALSE(truth_.has_rate);
  }
  EXPECT_EQ(remark_on("9,2.5,0,0,0"), "a row has 5 fields, and there are 6 columns: \"9,2.5,0,0,0\"");
  EXPECT_EQ(remark_on("9,2.5,0,fast,0,1"), "the column 3 (q_NB_y) has \"fast\"");
  EXPECT_EQ(remark_on("9;2.5;0;0,5;0;1"), "the column 3 (q_NB_y) has \"0,5\"; the decimal sign must be a point");
  EXPECT_EQ(decode("hello"), TruthResult::too_short);
}

TEST_F(MappedCsv, NamesOfQuantitiesNeedNoMap) {
  make({});
  ASSERT_EQ(decode("time_ns,q_NB_w,q_NB_x,q_NB_y,q_NB_z,p_rad_per_s,q_rad_per_s,r_rad_per_s,note,-r_BN_N_x_ft,"
                   "r_BN_N_y_ft,r_BN_N_z_ft"),
            TruthResult::no_state);
  EXPECT_EQ(remark(TruthResult::no_state), "columns that are not used: \"note\"");
  ASSERT_EQ(decode("7,1,0,0,0,0.1,0.2,0.3,,10,20,30"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 7);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.1, 0.2, 0.3));
  EXPECT_LE((truth_.r_BN_N - Vector3(-3.048, 6.096, 9.144)).norm(), 1e-12);
  EXPECT_EQ(remark_on("7,1,0,0,0,0.1,2e5,0.3,,0,0,0"), "q is 2e+05 in SI, and its limit is 1e+05");
  EXPECT_EQ(decode("7,1,0,0,0,0.1,nan,0.3,,0,0,0"), TruthResult::not_finite);
  EXPECT_EQ(remark_on("7,1,1,0,0,0.1,0,0.3,,0,0,0"),
            "q_NB_w is 1, and with those that belong to it no rotation, or no place");

  EXPECT_EQ(remark_on("time_s,yaw_deg,pitch_deg"), "with yaw, pitch, roll belong together, and missing are roll");
  EXPECT_EQ(decode("7,0,0"), TruthResult::no_columns);
  EXPECT_TRUE(remark_on("time_s,yaw_deg,pitch_deg,roll_deg,q_NB_w,q_NB_x,q_NB_y,q_NB_z")
                  .starts_with("the attitude is given twice, by "));
  EXPECT_EQ(remark_on("time_s,time_ms,yaw_deg"), "the header row has time twice");

  // Basilisk's names come later.
  ASSERT_EQ(decode("time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z"),
            TruthResult::no_state);
  ASSERT_EQ(decode("9,0,0,0,1,2,3"), TruthResult::ok);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(1, 2, 3));
}

TEST_F(MappedCsv, QuantitiesWithoutATimeAndBesideBasilisksNamesAreNamed) {
  make({});
  EXPECT_EQ(remark_on("t,yaw_deg,pitch_deg,roll_deg"),
            "the time is missing; give time_s, unix_time_s, utc or another: \"t,yaw_deg,pitch_deg,roll_deg\"");
  const std::string mixed = "time_s,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z";
  EXPECT_EQ(
      remark_on(mixed),
      "the header row lacks \"time_ns\" (is it \"time_s\"?): \"" + mixed +
          "\"; required are time_ns, sigma_BN_1 to _3, omega_BN_B_x to _z; a quantity such as \"time_s\" is not "
          "used beside Basilisk's names");
  EXPECT_EQ(remark_on("a,b,c").find("quantity"), std::string::npos);
}

TEST_F(MappedCsv, AMisspeltQuantityIsNamed) {
  make({});
  EXPECT_EQ(remark_on("time_s,yaw_deg,pitch_deg,rol_deg"),
            "with yaw, pitch, roll belong together, and missing are roll; \"rol_deg\" is no quantity (did you mean "
            "\"roll_deg\"?)");
  EXPECT_EQ(remark_on("time_s,yaw,q_NB_w"),
            "with q_NB_w, q_NB_x, q_NB_y, q_NB_z belong together, and missing are q_NB_x, q_NB_y, q_NB_z; \"yaw\" is "
            "no quantity (did you mean \"yaw_rad\"?)");
  EXPECT_EQ(remark_on("time_s,yaw_deg,pitch_deg,roll_deg,presure_pa,time_ss,note"),
            "columns that are not used: \"presure_pa\" (did you mean \"pressure_pa\"?), \"time_ss\", \"note\"");
}

TEST_F(MappedCsv, HasStatesOfTheVehicle) {
  make({});
  ASSERT_EQ(
      decode("time_s,yaw_deg,pitch_deg,roll_deg,rotor_speed_rpm,throttle,airspeed_km_per_h,dynamic_pressure_hpa"),
      TruthResult::no_state);
  ASSERT_EQ(decode("1,0,0,0,6000,0.5,72,2"), TruthResult::ok);
  EXPECT_NEAR(truth_.vehicle[VehicleState::rotor_speed].value(), 628.3185307179587, 1e-9);
  EXPECT_EQ(truth_.vehicle[VehicleState::throttle].value(), 0.5);
  EXPECT_NEAR(truth_.vehicle[VehicleState::airspeed].value(), 20, 1e-12);
  EXPECT_EQ(truth_.vehicle[VehicleState::dynamic_pressure].value(), 200);
  EXPECT_FALSE(truth_.vehicle[VehicleState::current]);
  EXPECT_EQ(decode("1,0,0,0,6000,nan,72,2"), TruthResult::not_finite);
  EXPECT_EQ(decode("1,0,0,0,6000,1e12,72,2"), TruthResult::out_of_range);
}

TEST_F(MappedCsv, AListOfQuantitiesIsTheOrderOfTheColumns) {
  make({"time_s", "_", "yaw_rad", "pitch_rad", "roll_rad", "north_m", "east_m", "up_m"}, "enu");
  ASSERT_EQ(decode("1,x,0,0,0,10,20,30"), TruthResult::ok);
  EXPECT_EQ(truth_.r_BN_N, Vector3(10, 20, -30));
}

TEST_F(MappedCsv, AMapThatIsWrongIsRefused) {
  EXPECT_EQ(fault({"time_s=t", "degs=P"}), "columns: unknown quantity \"degs\"; `imud list csv` prints all");
  EXPECT_EQ(fault({"time_s=t", "yaw=psi"}),
            "columns: unknown quantity \"yaw\"; it needs a unit: yaw_rad yaw_deg yaw_mrad yaw_arcsec yaw_deg_e7");
  EXPECT_EQ(fault({"time_s=t", "time_ms=T"}),
            "columns: the quantity time is named twice, as time_s and as time_ms; give one of them");
  EXPECT_EQ(fault({"q_NB_w=w", "q_NB_x=x", "q_NB_y=y", "q_NB_z=z"}),
            "columns: the time is missing; give time_s, unix_time_s, utc or another");
  EXPECT_EQ(fault({"time_s=t"}),
            "columns: the attitude is missing; give q_NB_w to _z, yaw, pitch and roll, or another");
  EXPECT_EQ(fault({"time_s=t", "yaw_deg=y"}),
            "columns: with yaw, pitch, roll belong together, and missing are pitch, roll");
  EXPECT_EQ(fault({"time_s=t", "yaw_deg="}),
            "columns: \"yaw_deg=\" lacks the name that the simulator has; give our name = \"their name\"");
  EXPECT_EQ(fault({"time_s=0", "yaw_deg=1", "pitch_deg=2", "roll_deg=phi"}),
            "columns: some are given by name and some by number; give either for all");
  EXPECT_EQ(fault({"time_s=0", "yaw_deg=1", "pitch_deg=2", "roll_deg=256"}),
            "columns: roll_deg is column 256; the largest is 255");
  EXPECT_EQ(fault({"time_s=0", "yaw_deg=1", "pitch_deg=2", "roll_deg=1"}),
            "columns: column 1 is given twice; the second time for roll_deg");
  EXPECT_EQ(fault({"time_s=t", "yaw_deg=y", "pitch_deg=p", "roll_deg=y"}),
            "columns: column \"y\" is given twice; the second time for roll_deg");
  EXPECT_EQ(fault({"-time_s=0"}).substr(0, 35), "columns: unknown quantity \"-time_s\"");
}

// Python's datetime.isoformat() ends a date of UTC in +00:00.
TEST_F(MappedCsv, DatesAreThoseOfUtc) {
  make({});
  ASSERT_EQ(decode("utc,yaw_deg,pitch_deg,roll_deg"), TruthResult::no_state);
  for (const std::string_view date : {"1970-01-02T00:00:00.5Z", "1970-01-02 00:00:00.500000+00:00",
                                      "1970-01-02T00:00:00.5", "1970-002-00:00:00.5"}) {
    ASSERT_EQ(decode(std::string(date) + ",0,0,0"), TruthResult::ok) << date;
    EXPECT_EQ(truth_.time.ns, 86'400'500'000'000) << date;
  }
  for (const std::string_view date :
       {"1970-01-02T00:00:00.5+01:00", "02.01.1970 00:00:00", "1970-01-02T00:00:00+00:00Z", "1970-366-00:00:00"})
    EXPECT_EQ(remark_on(std::string(date) + ",0,0,0"), "the column 0 (utc) has \"" + std::string(date) +
                                                           "\"; a date is UTC, in the form 2026-01-31T12:00:00.5Z");
}

// An absolute time is counted from the first truth where N is inertial, and again after the stream has ended.
TEST_F(MappedCsv, AStreamThatBeginsAgainHasANewOrigin) {
  make({});
  const auto feed = [&](std::string_view text) {
    decoder_->feed(std::as_bytes(std::span(text)), TruthInput::stream, {});
    TruthResult last = TruthResult::no_state;
    while (const auto result = decoder_->next(truth_)) last = *result;
    return last;
  };
  ASSERT_EQ(feed("utc,yaw_deg,pitch_deg,roll_deg,latitude_deg,longitude_deg\n"), TruthResult::no_state);
  ASSERT_EQ(feed("2026-01-31T12:00:00Z,0,0,0,47,8\n2026-01-31T12:00:00.5Z,0,0,0,47,8\n"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 500'000'000);
  decoder_->finish();
  ASSERT_EQ(feed("2026-01-31T12:00:07Z,0,0,0,47,8\n"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 0);
}

}  // namespace
}  // namespace imud
