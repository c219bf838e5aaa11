// JSBSim's rows, with the first datagrams of a run as JSBSim sent them.
#include <gtest/gtest.h>

#include <stdexcept>

#include "core/attitude.hpp"
#include "protocols/quantities/columns.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"

namespace imud {
namespace {

// JSBSim 1.3.2.dev1 (0b688c80), script c1722.xml, `<output type="SOCKET">` over UDP at 200 Hz, precision 16: the
// first four datagrams, captured on loopback.
constexpr std::string_view labels =
    "<LABELS> ,Time,lat-geod-rad,long-gc-rad,geod-alt-ft,ecef-x-ft,ecef-y-ft,ecef-z-ft,ecef-x-fps,ecef-y-fps,"
    "ecef-z-fps,eci-x-ft,eci-y-ft,eci-z-ft,eci-x-fps,eci-y-fps,eci-z-fps,epa-rad,phi-rad,theta-rad,psi-rad,"
    "p-rad sec,q-rad sec,r-rad sec,pi-rad sec,qi-rad sec,ri-rad sec,a-pilot-x-ft sec2,a-pilot-y-ft sec2,"
    "a-pilot-z-ft sec2,uidot-ft sec2,vidot-ft sec2,widot-ft sec2,gravity-ft sec2\n";
constexpr std::string_view row_0 =
    "           0,0.4914811522726799,-1.570796326794897,3999.999999997706,1.130720904405466e-09,"
    "-18466073.73150721,9818585.568798663,-57.72649692322258,-74.84951372540385,-139.8292636944188,"
    "1.130720904405466e-09,-18466073.73150721,9818585.568798663,1288.840835563075,-74.8495137254038,"
    "-139.8292636944188,           0,5.394347446754877e-17,-9.536727962995451e-17,3.490658503988659,           0,"
    "           0,           0,-6.041267426748367e-05,2.198841520578379e-05,-3.441384171974223e-05,"
    "-4.366535973853004,0.2093184925476611,-18.32428446835562,0.8661002514721972,14.39982696925942,"
    "-4.956386076145304,32.19979750642828\n";
constexpr std::string_view row_1 =
    "       0.005,0.4914811142132333,-1.570796342425324,4000.000001003369,-0.2886326199384879,-18466074.1057559,"
    "9818584.869652344,-57.722220977132,-74.77829384967396,-139.8538687716644,6.444204178946094,"
    "-18466074.10575478,9818584.869652344,1288.845166064332,-74.77784497673815,-139.8538687716552,3.6460575e-07,"
    "6.782389516855168e-11,4.047733093269282e-08,3.49065849661216,0.001163627750147414,0.00986614581965526,"
    "-0.0001266031336421987,0.001103215075879928,0.009888134234861045,-0.0001610169753619421,-4.608748853400161,"
    "0.2259343833902385,-18.64315837443834,-0.9976043043559674,11.68823550622692,-9.3145223614603,"
    "32.19979750454212\n";
constexpr std::string_view row_2 =
    "        0.01,0.4914810761593149,-1.570796358053517,3999.99928720524,-0.577224012777112,-18466074.47932001,"
    "9818584.170270227,-57.73192272778052,-74.72708051968782,-139.9113367241757,12.88844985739851,"
    "-18466074.47931552,9818584.170270227,1288.83551878142,-74.72618277786459,-139.9113367241758,7.292115e-07,"
    "5.818254487079685e-06,4.941168031951312e-05,3.490657856372324,0.003269283321429292,0.02056733161717864,"
    "-1.657855296944736e-05,0.00320887233097963,0.02058931979390986,-5.09955027798263e-05,0.6831938905814109,"
    "0.4563463968514265,-19.1612193723748,-0.9992229210661758,11.34609072004657,-9.137458848064041,"
    "32.19979750485849\n";

Settings jsbsim_settings(std::initializer_list<std::pair<std::string_view, SettingValue>> values = {}) {
  Settings settings(find_truth_format("jsbsim")->settings);
  for (const auto& [key, value] : values) settings.set(key, value);
  return settings;
}

std::string replaced(std::string_view text, std::string_view what, std::string_view by) {
  std::string changed(text);
  for (std::size_t at = 0; (at = changed.find(what, at)) != std::string::npos; at += by.size())
    changed.replace(at, what.size(), by);
  return changed;
}

class JsbsimTruth : public testing::Test {
 protected:
  TruthResult decode(std::string_view text) {
    return decode_truth(*decoder_, std::as_bytes(std::span(text)), truth_);
  }
  void make(const Settings& settings) { decoder_ = find_truth_format("jsbsim")->make(settings); }
  // Returns `row` with another text in column `number`.
  static std::string with(std::string_view row, std::size_t number, std::string_view text) {
    std::string changed;
    for (std::size_t i = 0; row.data() != nullptr; ++i) {
      const std::string_view field = take_field(row);
      changed.append(i == 0 ? "" : ",").append(i == number ? text : field);
    }
    return changed;
  }

  std::unique_ptr<TruthDecoder> decoder_ = find_truth_format("jsbsim")->make(jsbsim_settings());
  Truth truth_;
};

// dcm_NB of the first and the second row, computed with 40 digits from the definitions: north, east and down from the
// ellipsoid's normal, then psi, theta and phi.
TEST_F(JsbsimTruth, FirstRows) {
  ASSERT_EQ(decode(labels), TruthResult::no_state);
  ASSERT_EQ(decode(row_0), TruthResult::ok);
  Matrix3 dcm_NB;
  dcm_NB << -0.34202014332566882, -0.93969262078590835, 4.2084776404639818e-16,  //
      -0.44347124417176648, 0.16141033263152252, 0.88163482242509383,            //
      -0.82846573686075542, 0.30153686832673099, -0.47193224077983193;
  EXPECT_LE((truth_.q_NB.toRotationMatrix() - dcm_NB).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(truth_.time.ns, 0);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(-6.041267426748367e-05, 2.198841520578379e-05, -3.441384171974223e-05));
  EXPECT_LE((truth_.r_BN_N - Vector3(3.4464373166278604e-10, -5628459.2733633971, 2992704.8813698325)).norm(), 2e-9);
  EXPECT_LE((truth_.v_BN_N - Vector3(392.83868667962525, -22.814131783503077, -42.619959574058854)).norm(), 2e-13);
  ASSERT_TRUE(truth_.has_specific_force);
  EXPECT_LE(
      (truth_.specific_force_B - Vector3(-1.3309201648303957, 0.063800276528527105, -5.5852419059547934)).norm(),
      2e-15);
  EXPECT_FALSE(truth_.has_angular_acceleration);
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::none);
  EXPECT_FALSE(truth_.acknowledge || truth_.new_run);

  ASSERT_EQ(decode(row_1), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 5000000);
  dcm_NB << -0.3420199816334835, -0.93969267963698019, -3.2144912526045592e-7,  //
      -0.44347136887424724, 0.16140999001418036, 0.8816348224250353,            //
      -0.82846573686075452, 0.30153686832673366, -0.4719322407798318;
  EXPECT_LE((truth_.q_NB.toRotationMatrix() - dcm_NB).cwiseAbs().maxCoeff(), 1e-15);
}

// In the first row the body does not turn relative to the Earth (p = q = r = 0), so that pi, qi, ri are the Earth's
// rate.
TEST_F(JsbsimTruth, AttitudeAgreesWithTheEarthsRate) {
  ASSERT_EQ(decode(labels), TruthResult::no_state);
  ASSERT_EQ(decode(row_0), TruthResult::ok);
  EXPECT_LE((truth_.q_NB * truth_.omega_BN_B - Vector3(0, 0, 7.292115e-5)).norm(), 1e-19);
}

// JSBSim integrates its attitude by one Euler step with the rate of the row before, an angle of 2 atan(rate dt/2):
// the remainder is (rate dt)^3/12 at most.
TEST_F(JsbsimTruth, AttitudeAgreesWithTheRateOverAStep) {
  ASSERT_EQ(decode(labels), TruthResult::no_state);
  ASSERT_EQ(decode(row_1), TruthResult::ok);
  const Truth before = truth_;
  ASSERT_EQ(decode(row_2), TruthResult::ok);
  const Vector3 rotation = log(before.q_NB.conjugate() * truth_.q_NB);
  EXPECT_GT(rotation.norm(), 4e-5);
  EXPECT_LE((rotation - before.omega_BN_B * 0.005).norm(), 1e-13);
}

TEST_F(JsbsimTruth, RateRelativeToTheEarthWillDo) {
  for (const std::string_view row : {row_0, row_1, row_2}) {
    ASSERT_EQ(decode(labels), TruthResult::no_state);
    ASSERT_EQ(decode(row), TruthResult::ok);
    const Vector3 inertial = truth_.omega_BN_B;
    ASSERT_EQ(decode(replaced(labels, "qi-rad sec", "something")), TruthResult::no_state);
    ASSERT_EQ(decode(row), TruthResult::ok);
    EXPECT_LE((truth_.omega_BN_B - inertial).norm(), 1e-17);
  }
  EXPECT_EQ(decode(replaced(replaced(labels, "qi-rad", "x"), "q-rad", "x")), TruthResult::no_columns);
}

TEST_F(JsbsimTruth, AngularAccelerationIsTaken) {
  ASSERT_EQ(decode(replaced(replaced(replaced(labels, "uidot-ft", "pidot-rad"), "vidot-ft", "qidot-rad"), "widot-ft",
                            "ridot-rad")),
            TruthResult::no_state);
  ASSERT_EQ(decode(row_0), TruthResult::ok);
  EXPECT_TRUE(truth_.has_angular_acceleration);
  EXPECT_EQ(truth_.omegaDot_BN_B, Vector3(0.8661002514721972, 14.39982696925942, -4.956386076145304));
}

TEST_F(JsbsimTruth, OptionalColumnsMayBeMissing) {
  ASSERT_EQ(decode(replaced(labels, "-z-", "-Z-")), TruthResult::no_state);
  ASSERT_EQ(decode(row_0), TruthResult::ok);
  EXPECT_FALSE(truth_.has_specific_force);
  EXPECT_TRUE(truth_.r_BN_N.isZero() && truth_.v_BN_N.isZero() && truth_.specific_force_B.isZero());
}

// A listener that joined late needs the setting `columns`; the names of the properties are accepted as well.
TEST_F(JsbsimTruth, ConfiguredColumns) {
  ASSERT_EQ(decode(labels), TruthResult::no_state);
  ASSERT_EQ(decode(row_1), TruthResult::ok);
  const Truth wanted = truth_;
  std::vector<std::string> names;
  std::string_view rest = labels;
  for (take_field(rest); rest.data() != nullptr;)
    names.push_back("some/path/" + replaced(trim(take_field(rest)), " ", "_"));
  make(jsbsim_settings({{"columns", names}}));
  ASSERT_EQ(decode(row_1), TruthResult::ok);
  EXPECT_EQ(truth_.q_NB.coeffs(), wanted.q_NB.coeffs());
  EXPECT_EQ(truth_.omega_BN_B, wanted.omega_BN_B);
  EXPECT_EQ(truth_.specific_force_B, wanted.specific_force_B);
  names.erase(names.begin());
  EXPECT_THROW(make(jsbsim_settings({{"columns", names}})), std::invalid_argument);
}

// As `<output type="CSV">` and `type="TABULAR">` write it.
TEST_F(JsbsimTruth, AFileHasWholeNamesAndNoWordLabels) {
  ASSERT_EQ(decode(labels), TruthResult::no_state);
  ASSERT_EQ(decode(row_1), TruthResult::ok);
  const Truth wanted = truth_;
  for (const char delimiter : {',', '\t'}) {
    std::string header = "Time", row = replaced(row_1, ",", {&delimiter, 1});
    std::string_view rest = labels;
    for (take_field(rest), take_field(rest); rest.data() != nullptr;)
      header += delimiter + ("/fdm/jsbsim/velocities/" + replaced(trim(take_field(rest)), " ", "_"));
    ASSERT_EQ(decode(header), TruthResult::no_state);
    ASSERT_EQ(decode(row), TruthResult::ok);
    EXPECT_EQ(truth_.q_NB.coeffs(), wanted.q_NB.coeffs());
    EXPECT_EQ(truth_.specific_force_B, wanted.specific_force_B);
  }
}

// FGOutputSocket's own labels, of <rates> and <propagate>.
TEST_F(JsbsimTruth, StandardLabelsAreNamed) {
  ASSERT_EQ(
      decode("<LABELS> ,Time,P,Q,R,PDot,QDot,RDot,Altitude,Phi (deg),Tht (deg),Psi (deg),Alpha (deg),Beta (deg),"
             "Latitude (deg),Longitude (deg)\n"),
      TruthResult::no_columns);
  const std::string text = remark(*decoder_, TruthResult::no_columns);
  EXPECT_TRUE(
      text.starts_with("the header row lacks \"lat-geod-rad\", \"long-gc-rad\", \"epa-rad\", \"phi-rad\", "
                       "\"theta-rad\", \"psi-rad\": \"<LABELS> ,Time,P,Q,R,"))
      << text;
  EXPECT_TRUE(text.ends_with("pi-rad_sec to ri-rad_sec, each a <property> of the <output>")) << text;
}

TEST_F(JsbsimTruth, RemarksNameTheColumns) {
  const std::string misspelt = replaced(labels, "qi-rad sec", "Qi-rad_sec");
  ASSERT_EQ(decode(misspelt), TruthResult::no_state);
  EXPECT_EQ(
      remark(*decoder_, TruthResult::no_state),
      "columns that are not used: \"geod-alt-ft\", \"ecef-x-ft\", \"ecef-y-ft\", \"ecef-z-ft\", \"ecef-x-fps\", "
      "\"ecef-y-fps\", \"ecef-z-fps\", \"pi-rad sec\" (needs \"qi-rad sec\"), \"Qi-rad_sec\" (did you mean "
      "\"qi-rad sec\"?), \"ri-rad sec\" (needs \"qi-rad sec\"), \"uidot-ft sec2\", \"vidot-ft sec2\", "
      "\"widot-ft sec2\", \"gravity-ft sec2\"");
  const auto remark_on = [this](const std::string& row) { return remark(*decoder_, decode(row)); };
  EXPECT_EQ(remark_on(with(row_0, 26, "1e9")),
            "the column \"a-pilot-x-ft sec2\" has \"1e9\", and its limit is 328083989.5013123 ft/s^2");
  EXPECT_EQ(remark_on(with(row_0, 0, "1e12")),
            "the column \"Time\" has \"1e12\", and its limit is 4611686018.427388 s");
}

TEST_F(JsbsimTruth, EveryCause) {
  EXPECT_EQ(decode(row_0), TruthResult::no_columns);
  for (const std::string_view name :
       {"Time", "lat-geod-rad", "long-gc-rad", "epa-rad", "phi-rad", "theta-rad", "psi-rad"})
    EXPECT_EQ(decode(replaced(labels, name, "x")), TruthResult::no_columns) << name;
  ASSERT_EQ(decode(labels), TruthResult::no_state);
  EXPECT_EQ(decode("\n"), TruthResult::no_state);
  EXPECT_EQ(decode("<STATUS>something to tell, or two"), TruthResult::no_state);
  EXPECT_EQ(decode(row_0.substr(0, row_0.rfind(','))), TruthResult::too_short);
  EXPECT_EQ(decode(replaced(row_0, "\n", ",1\n")), TruthResult::too_long);
  for (const std::size_t column : {0U, 1U, 2U, 16U, 17U, 18U, 19U, 23U, 24U, 25U, 10U, 15U, 26U, 28U}) {
    EXPECT_EQ(decode(with(row_0, column, "0")), TruthResult::ok) << column;
    EXPECT_EQ(decode(with(row_0, column, "1.2.3")), TruthResult::bad_number) << column;
    EXPECT_EQ(decode(with(row_0, column, "")), TruthResult::bad_number) << column;
    EXPECT_EQ(decode(with(row_0, column, "nan")), TruthResult::not_finite) << column;
    EXPECT_EQ(decode(with(row_0, column, " -inf")), TruthResult::not_finite) << column;
    EXPECT_EQ(decode(with(row_0, column, "1e300")), TruthResult::out_of_range) << column;
  }
  EXPECT_EQ(decode(with(row_0, 3, "not needed")), TruthResult::ok);
}

TEST_F(JsbsimTruth, TimeIsRoundedToTheNanosecond) {
  ASSERT_EQ(decode(labels), TruthResult::no_state);
  for (const auto& [text, ns] : {std::pair<std::string_view, std::int64_t>{"0.4950000000000003", 495000000},
                                 {"1.005", 1005000000},
                                 {"59.995", 59995000000},
                                 {"9.8299999999995", 9830000000},
                                 {"  86400.00833333333", 86400008333333}}) {
    ASSERT_EQ(decode(with(row_0, 0, text)), TruthResult::ok);
    EXPECT_EQ(truth_.time.ns, ns);
  }
}

}  // namespace
}  // namespace imud
