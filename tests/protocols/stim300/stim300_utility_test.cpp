// Utility Mode of the STIM300 against its datasheet, TS1524 rev. 31, section 10.
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "tests/protocols/stim300/stim300_unit.hpp"

namespace imud {
namespace {

using namespace stim300_test;

// The examples of section 10, with the CRCs printed there.
TEST(Stim300Utility, UtilityModeAnswersAsTheDatasheetShows) {
  Stim300Unit unit;
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
  EXPECT_TRUE(unit.run(100).empty()) << "no measurements meanwhile";
  EXPECT_EQ(unit.send_line("$isn,28"), "#isn,0,N25582405002002,252\r");
  EXPECT_EQ(unit.send_line("ibto,160"), "#,1,180\r");
  EXPECT_EQ(unit.send_line("$sbto,0.00123,12"), "#,2,139\r");
  EXPECT_EQ(unit.send_line("$dbto,0.00123,0"), "#,3,158\r");
  EXPECT_EQ(unit.send_line("$sbto,0.0123,g,y,0,2"), "#sbto,4,136\r");
  EXPECT_EQ(unit.ask("sbto,0.0123,s,y"), "#sbto,5");
  EXPECT_EQ(unit.send_line("$iaf,192"), "#iaf,0,4,4,4,51\r");
  EXPECT_EQ(unit.send_line("$iax,65"), "#iax,0,XYZ,XYZ,XYZ,212\r");
  EXPECT_EQ(unit.send_line("$iconf,t,211"), "#iconf,T,0,43\r");
  EXPECT_EQ(unit.send_line("$ifw,148"), "#ifw,0,SWD12404 REV 0,208\r");
  EXPECT_EQ(unit.send_line("$ihw,184"), "#ihw,0,M5728 REV 11,215\r");
  EXPECT_EQ(unit.send_line("$in,95"), "#in,0,STIM300,247\r");
  EXPECT_EQ(unit.send_line("$irng,74"), "#irng,0,400,400,400,10,10,10,1.7,1.7,1.7,NA,61\r");
  EXPECT_EQ(unit.send_line("$ix,118"), "#ix,0,84167-4400003-321,K,174\r");
  EXPECT_EQ(unit.send_line("$sau,1,27"), "#sau,0,1,150\r");
  EXPECT_EQ(unit.send_line("$iau,168"), "#iau,0,1,31\r");
  EXPECT_EQ(unit.send_line("$sconf,v,5,222"), "#sconf,V,5,77\r");
  EXPECT_EQ(unit.send_line("$sd,1,148"), "#sd,0,1,242\r");
  EXPECT_EQ(unit.send_line("$sgf,x,3,214"), "#sgf,0,X,3,125\r");
  EXPECT_EQ(unit.send_line("$sgu,2,111"), "#sgu,0,2,101\r");
  EXPECT_EQ(unit.send_line("$sif,y,0,217"), "#sif,0,Y,0,132\r");
  EXPECT_EQ(unit.send_line("$siu,0,23"), "#siu,0,0,105\r");
  EXPECT_EQ(unit.send_line("$sm,4,115"), "#sm,0,4,213\r");
  EXPECT_EQ(unit.send_line("$im,96"), "#im,0,4,85\r");
  EXPECT_EQ(unit.send_line("$spf,4,87"), "#spf,0,4,62\r");
  EXPECT_EQ(unit.send_line("$srf,43638,122"), "#srf,0,43638,69\r");
  EXPECT_EQ(unit.send_line("$irf,223"), "#irf,43638,44\r");
  EXPECT_EQ(unit.send_line("$sbto,0,165"),
            "#sbto,0,0.00000,0.00000,0.00000,0.000000,0.000000,0.000000,0.0000000,0.0000000,0.0000000,177\r");
  EXPECT_EQ(unit.send_line("$sbto,3.4e-03,g,y,128").substr(0, 24), "#sbto,0,0.00000,0.00340,");
  EXPECT_EQ(unit.send_line("$sg,x,1,1,2,0,0.5,243"), "#sg,0,X,1,1,2,0,0.500,79\r");
  EXPECT_EQ(unit.send_line("$ig,x,167"), "#ig,0,X,1,1,2,0,0.500,150\r");
  EXPECT_EQ(unit.ask("ig,y"), "#ig,0,Y,0,0,0,0,0.500") << "one filter for all axes";
  EXPECT_EQ(unit.ask("sg,y,1,1,2,0,0.0009"), "#sg,5");
  EXPECT_EQ(unit.ask("sg,y,1,1,2,0,5.001"), "#sg,5");
  EXPECT_EQ(unit.ask("sg,y,1,1,2,0,0.001"), "#sg,0,Y,1,1,2,0,0.001");
  EXPECT_EQ(unit.ask("sg,y,1,1,2,0,5"), "#sg,0,Y,1,1,2,0,5.000");
  EXPECT_EQ(unit.ask("sg,y,1,1,3,0,0.5"), "#sg,5");
  EXPECT_EQ(unit.send_line("$sfs,1,70"), "#sfs,0,1,115\r");
  EXPECT_EQ(unit.ask("ig,x"), "#ig,0,X,0,0,0,0,0.010");
  EXPECT_EQ(unit.ask("sgu, b"), "#sgu,0,b");
  EXPECT_EQ(unit.ask("sgu,4"), "#sgu,5");
  EXPECT_EQ(unit.ask("sgu, "), "#sgu,5");
  EXPECT_EQ(unit.ask("st,921600,2,n,1,0,0"), "#st,0,921600,2,N,1,0,0");
  EXPECT_EQ(unit.device->uart(), (UartSettings{921600, Parity::none, 2}));
  EXPECT_EQ(unit.ask("st,115200,2,n,1,0,0"), "#st,0,115200,2,N,1,0,0");
  EXPECT_EQ(unit.ask("st,500000,2,n,1,0,0"), "#st,0,499663,2,N,1,0,0") << "82944000/166 (section 9.12.1)";
  EXPECT_EQ(unit.device->uart(), (UartSettings{499663, Parity::none, 2}));
  EXPECT_EQ(unit.ask("st,1499,2,n,1,0,0"), "#st,5");
  EXPECT_EQ(unit.ask("st,5184001,2,n,1,0,0"), "#st,5");
  EXPECT_EQ(unit.send_line("$xn,150"), "#xn,0,125\r");
  EXPECT_EQ(unit.send_line("$xn,150"), "") << "back in Normal Mode";
  EXPECT_FALSE(unit.run(10).empty());
}

// Section 10.2.1 h: 100 characters with CR.
TEST(Stim300Utility, ACommandHasAHundredCharactersAtMost) {
  Stim300Unit unit;
  unit.send_line("UTILITYMODE");
  EXPECT_EQ(unit.send_line('$' + std::string(98, 'x')), "#,2,139\r") << "its CRC is wrong";
  EXPECT_EQ(unit.send_line('$' + std::string(99, 'x')), "") << "is left out";
}

// Section 10's answers to $save. Its #save,7,8848,163 is from a flash that fails, which the emulator does not
// simulate.
TEST(Stim300Utility, SavesEndWhenFlashIsWornOut) {
  Stim300Unit unit;
  unit.send_line("UTILITYMODE");
  for (int left = 9999; left >= 0; --left) ASSERT_EQ(unit.ask("save"), "#save,0," + std::to_string(left));
  EXPECT_EQ(unit.send_line("$save,33"), "#save,6,0,158\r");
}

TEST(Stim300Utility, WhatIsNotSavedIsGoneAfterAReset) {
  Stim300Unit unit;
  unit.send_line("UTILITYMODE");
  EXPECT_EQ(unit.ask("st,460800,1,e,1,1,0"), "#st,0,460800,1,E,1,1,0");
  EXPECT_EQ(unit.ask("save"), "#save,0,9999");
  EXPECT_EQ(unit.ask("sd,0"), "#sd,0,0");
  EXPECT_EQ(unit.ask("sbto,0.5,g,x").substr(0, 15), "#sbto,0,0.50000");
  EXPECT_EQ(unit.ask("xn"), "#xn,0");
  const auto datagrams = unit.run(100);
  EXPECT_EQ(first(datagrams.back()), 0x90U);
  EXPECT_NEAR(unit.decode(datagrams).measurements.back().sample.rate.x(), 0.5 * units::degree, 1e-6);
  unit.send_line("R");
  EXPECT_EQ(unit.device->uart(), (UartSettings{460800, Parity::even, 1}));
  unit.run(2000);
  EXPECT_EQ(first(unit.run(10).back()), 0xA7U);
}

// Tables 5-3 to 5-8, and figure 10-10 for the answer.
TEST(Stim300Utility, BiasTrimOffsetsEndAtTheirLimits) {
  for (const auto& [range, limit] :
       {std::pair{"5", "0.100000"}, {"10", "0.100000"}, {"30", "0.300000"}, {"80", "0.800000"}}) {
    Stim300Unit unit(std::string("start_up=false,accelerometer_range_g=") + range);
    unit.send_line("UTILITYMODE");
    const std::string l = limit;
    const std::string ends = "1.00000,1.00000,1.00000," + l + ',' + l + ',' + l + ",0.0200000,0.0200000,0.0200000";
    EXPECT_EQ(unit.ask("sbto,3"), "#sbto,8," + ends);
    EXPECT_EQ(unit.ask("sdbto,0,0,0,0,0,0,0,0,1e9"), "#sdbto,8," + ends);
    EXPECT_EQ(unit.ask("sdbto,-2,-2,-2,-2,-2,-2,-2,-2,-0.01").substr(0, 20), "#sdbto,8,-1.00000,-1");
    EXPECT_EQ(unit.ask("sdbto,1.5,0,0,0,0,0,0,0,0").substr(0, 17), "#sdbto,0,0.50000,");
  }
}

// Bits 0 to 3 of byte 7 of the configuration datagram (Table 5-16), from $sg.
TEST(Stim300Utility, TheConfigurationNamesTheGCompensation) {
  const auto code = [](const char* parameters, const char* axes) {
    Stim300Unit unit;
    unit.send_line("UTILITYMODE");
    for (; *axes != 0; ++axes) unit.ask(std::string("sg,") + *axes + ',' + parameters);
    unit.ask("xn");
    unit.send_line("C");
    return std::to_integer<unsigned>(unit.run(2).at(0).at(7)) & 15U;
  };
  EXPECT_EQ(code("0,0,0,0,3", "xyz"), 0U);
  EXPECT_EQ(code("1,0,0,0,0.01", "xyz"), 1U) << "scale from the accelerometers";
  EXPECT_EQ(code("1,1,2,1,0.01", "xyz"), 15U);
  EXPECT_EQ(code("1,0,2,1,0.01", "xyz"), 10U);
  EXPECT_EQ(code("2,1,2,1,0.01", "xyz"), 12U);
  EXPECT_EQ(code("2,1,2,1,0.02", "xyz"), 15U) << "not the standard filter";
  EXPECT_EQ(code("1,0,0,0,0.01", "xy"), 15U) << "not on all axes";
}

}  // namespace
}  // namespace imud
