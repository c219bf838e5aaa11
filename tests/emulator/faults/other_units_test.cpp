// Messages of a unit with other settings: those of a run whose unit has these settings from its start.
#include "emulator/faults/other_units.hpp"

#include <gtest/gtest.h>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class OtherUnitsTest : public FaultyRunTest {
 protected:
  static constexpr std::string_view window = "at_s = 2\nfor_s = 1\n";
  static std::string other_settings(const std::string& device) {
    return fmt::format("[[fault]]\ntarget = \"message\"\nkind = \"other_settings\"\n{}{}",
                       device.empty() ? "" : fmt::format("device = {{{}}}\n", device), window);
  }
  // Returns the frames of a time after `zero`.
  static std::string text_of(const std::vector<Sent>& frames, DeviceTime zero, double from_s, double to_s) {
    std::string text;
    for (const Sent& frame : frames) {
      const double time_s = seconds(frame.time - zero);
      if (time_s >= from_s && time_s < to_s)
        text += fmt::format("{} {:x} {}\n", frame.time.ns, frame.can_id, frame.bytes);
    }
    return text;
  }
  // Frames before and after the window are those of `clean`, frames in it those of `other`, to the sample.
  static void expect_other_inside(const Result& faulty, const Result& clean, const Result& other) {
    ASSERT_FALSE(clean.frames.empty());
    const auto text = [zero = clean.frames[0].time](const Result& of, double from_s, double to_s) {
      return text_of(of.frames, zero, from_s, to_s);
    };
    EXPECT_NE(text(clean, 2, 2.01), text(other, 2, 2.01));
    EXPECT_EQ(text(faulty, 0, 2), text(clean, 0, 2));
    EXPECT_EQ(text(faulty, 2, 3), text(other, 2, 3));
    EXPECT_EQ(text(faulty, 3, 99), text(clean, 3, 99));
  }
  void expect_as_configured(const std::string& protocol, const std::string& device, const std::string& toml,
                            const std::string& always = "") {
    SCOPED_TRACE(protocol + " " + device);
    const Result clean = run("", protocol, 1, always), faulty = run(other_settings(device), protocol, 1, always),
                 other = run("", protocol, 1, always + toml);
    expect_other_inside(faulty, clean, other);
    EXPECT_EQ(faulty.labels.size(), 1U);
  }
};

// start_up = false: there are no special datagrams of the start, whose first frame would be that of another time.
TEST_F(OtherUnitsTest, AnotherUnitDatagramOrIdentifier) {
  const std::string stim = "[imu.device]\nstart_up = false\n";
  expect_as_configured("stim300", "gyro_unit = \"average\"", "gyro_unit = \"average\"\n", stim);
  expect_as_configured("stim300", "temperature = false", "temperature = false\n", stim);
  expect_as_configured("sbg-can", "id_offset = 16", "device.id_offset = 16\n");
  const std::string general =
      "rate_hz = 500\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
  expect_as_configured("native-can", "can_id = 768", "device.can_id = 768\n", general);
}

// The datasheet's resolution of 10 g is 2^-19 g, that of 5 g 2^-20 g: a host that expects 10 g reads twice the value.
TEST_F(OtherUnitsTest, ARangeThatIsLost) {
  const std::string stim = "[imu.device]\nstart_up = false\n";
  const Result clean = run("", "stim300", 1, stim),
               faulty = run(other_settings("accelerometer_range_g = 5"), "stim300", 1, stim);
  ASSERT_EQ(faulty.measurements.size(), clean.measurements.size());
  ASSERT_EQ(clean.frames.size(), clean.measurements.size());
  constexpr double lsb = 9.80665 / (1 << 19);
  for (std::size_t k = 0; k < clean.measurements.size(); ++k) {
    const double time_s = seconds(clean.frames[k].time - clean.frames[0].time);
    const double factor = time_s >= 2 && time_s < 3 ? 2 : 1;
    const Vector3 wanted = factor * clean.measurements[k].sample.specific_force;
    ASSERT_LE((faulty.measurements[k].sample.specific_force - wanted).cwiseAbs().maxCoeff(), (factor - 1) * 1.5 * lsb)
        << k;
  }
}

TEST_F(OtherUnitsTest, SettingsAsDelivered) {
  const std::string stim = "[imu.device]\nstart_up = false\n";
  const std::string own = stim + "gyro_unit = \"average\"\ncr_lf = true\n";
  expect_other_inside(run(other_settings(""), "stim300", 1, own), run("", "stim300", 1, own),
                      run("", "stim300", 1, ""));
}

// The unit as delivered, and the other one, are those after the loss of the settings.
TEST_F(OtherUnitsTest, ALossOfTheSettingsIsThatOfTheOwnUnit) {
  const std::string own = "[imu.device]\nstart_up = false\ncr_lf = true\n";
  const std::string lost = "[[fault]]\ntarget = \"power\"\nkind = \"settings_lost\"\nat_s = 1\n";
  const Result without = run(lost, "stim300", 1, own),
               both = run(lost + other_settings("cr_lf = true"), "stim300", 1, own);
  const DeviceTime zero = without.frames.at(0).time;
  EXPECT_EQ(text_of(both.frames, zero, 0, 2), text_of(without.frames, zero, 0, 2));
  EXPECT_NE(text_of(both.frames, zero, 2, 3), text_of(without.frames, zero, 2, 3));
  EXPECT_EQ(text_of(both.frames, zero, 3, 99), text_of(without.frames, zero, 3, 99));
}

TEST_F(OtherUnitsTest, WhatIsWrongIsExplained) {
  const auto wrong = [&](const std::string& fault, const std::string& protocol) -> std::string {
    try {
      static_cast<void>(load_config(write("wrong.toml", config_text(fault, protocol, 1, ""))));
      return {};
    } catch (const ConfigError& error) {
      return error.what();
    }
  };
  EXPECT_TRUE(contains(wrong(other_settings("gyro_unti = 1"), "stim300"), "fault.0.device.gyro_unti: unknown key"));
  EXPECT_TRUE(contains(wrong(other_settings("gyro_unit = \"deg\""), "stim300"), "fault.0.device.gyro_unit: "));
  EXPECT_TRUE(contains(wrong(other_settings("model = \"vn-300\""), "vectornav"),
                       "imu1: it samples at 400 Hz, imu1 at 800 Hz"));
  EXPECT_TRUE(contains(wrong("[[fault]]\ntarget = \"message\"\nkind = \"other_settings\"\ndevice = 1\n", "stim300"),
                       "fault.0.device: give settings"));
  EXPECT_TRUE(contains(wrong("[[fault]]\ntarget = \"message\"\nkind = \"missing\"\ndevice = {}\n", "stim300"),
                       "fault.0.device: unknown key"));
  const Config config =
      load_config(write("good.toml", config_text(other_settings("cr_lf = true"), "stim300", 1, "")));
  EXPECT_TRUE(contains(config.faults[0].text(), "({ cr_lf = true }), from 2 s, for 1 s")) << config.faults[0].text();
  EXPECT_EQ(load_config(write("again.toml", config.resolved())).resolved(), config.resolved());
}

}  // namespace
}  // namespace imud
