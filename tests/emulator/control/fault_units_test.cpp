// The units of the parameters of faults, for those who begin them by control.
#include <gtest/gtest.h>

#include "emulator/control/fault_change.hpp"

namespace imud {
namespace {

Json units_of(const std::string& kind, const std::string& key) {
  for (const Json& one : fault_kinds_json())
    for (const Json& parameter : one["parameters"])
      if (one["name"] == kind && one["seam"] == "sensor" && parameter["key"] == key) return parameter["units"];
  return {};
}

TEST(FaultUnits, AParameterHasTheUnitOfEachTargetOrThatOfItsKey) {
  EXPECT_EQ(units_of("bias", "value"),
            Json::parse(R"({"gyro": "rad_per_s", "accelerometer": "m_per_s2", "magnetometer": "t",
                            "inclinometer": "m_per_s2", "barometer": "pa",
                            "temperature": "c"})"));
  EXPECT_EQ(units_of("drift", "value")["gyro"], "rad_per_s_per_s");
  EXPECT_EQ(units_of("scale", "value"), Json::object()) << "a factor";
  EXPECT_EQ(units_of("vibration", "hz"), Json::object());
}

}  // namespace
}  // namespace imud
