// Limits as text, and whether figures keep them.
#include "core/requirement.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/support/text.hpp"

namespace imud {
namespace {

TEST(Requirement, NamesFigureRelationAndLimit) {
  using Relation = Requirement::Relation;
  const auto all = parse_requirements("imu1.samples>=1000, dropped = 0,truth.refused <=1.5%,a==2,b>-3,c<1e3");
  ASSERT_EQ(all.size(), 6U);
  EXPECT_EQ(all[0].text, "imu1.samples>=1000");
  EXPECT_EQ(all[0].figure, "imu1.samples");
  EXPECT_EQ(all[0].limit, 1000);
  EXPECT_FALSE(all[0].percent);
  EXPECT_EQ(all[1].figure, "dropped");
  EXPECT_EQ(all[1].limit, 0);
  EXPECT_EQ(all[2].figure, "truth.refused");
  EXPECT_EQ(all[2].limit, 1.5);
  EXPECT_TRUE(all[2].percent);
  const Relation relations[] = {Relation::at_least, Relation::equal, Relation::at_most,
                                Relation::equal,    Relation::more,  Relation::less};
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ(all[i].relation, relations[i]) << all[i].text;
  EXPECT_EQ(all[4].limit, -3);
  EXPECT_EQ(all[5].limit, 1000);
}

TEST(Requirement, HoldsUpToItsLimit) {
  const auto holds = [](std::string_view text, double value, double whole = 0) {
    return parse_requirements(text).at(0).holds(value, whole);
  };
  EXPECT_TRUE(holds("n>=3", 3));
  EXPECT_FALSE(holds("n>=3", 2));
  EXPECT_TRUE(holds("n<=3", 3));
  EXPECT_FALSE(holds("n<=3", 4));
  EXPECT_TRUE(holds("n=3", 3));
  EXPECT_FALSE(holds("n=3", 4));
  EXPECT_TRUE(holds("n>3", 4));
  EXPECT_FALSE(holds("n>3", 3));
  EXPECT_TRUE(holds("n<3", 2));
  EXPECT_FALSE(holds("n<3", 3));
  EXPECT_TRUE(holds("n<=1%", 3, 300));
  EXPECT_FALSE(holds("n<=1%", 4, 300));
  EXPECT_TRUE(holds("n<=1%", 0, 0));
  EXPECT_FALSE(holds("n>=1%", 7, 0)) << "of nothing, all is 0 %";
}

TEST(Requirement, WhatIsNoLimitIsRefusedWithWhatWouldBeRight) {
  for (const char* text : {"", "samples", ">=3", "n>=", "n>=x", "n>=3x", "n=%", "n>=3,", ",n>=3", "n>=inf", "n>=nan",
                           "n=>3", "n>=1000 Hz", "n>=1e999"}) {
    try {
      parse_requirements(text);
      ADD_FAILURE() << text << " was accepted";
    } catch (const RequirementError& fault) {
      EXPECT_TRUE(contains(fault.what(), "right would be FIGURE>=NUMBER")) << fault.what();
    }
  }
}

}  // namespace
}  // namespace imud
