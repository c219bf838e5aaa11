// Which MIP commands are executed, and which are refused (mip_sdk e5a847d, commands_3dm.h).
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "protocols/mip/mip.hpp"
#include "tests/protocols/mip/mip_unit.hpp"

namespace imud::mip_test {
namespace {

Bytes repeated(Bytes head, std::size_t times, const Bytes& one) {
  for (std::size_t k = 0; k < times; ++k)
    for (const std::uint8_t byte : one) head.push_back(byte);
  return head;
}

// A field of 12 bytes needs 14 of the packet's 255: 18 of them are 252.
TEST(MipCommands, AFormatFitsOnePacket) {
  Unit unit;
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, repeated({1, 0x80, 18}, 18, {0x05, 0, 10}))), 0);
  EXPECT_EQ(unit.run(1).at(0).size(), 4U + 18 * 14 + 2);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, repeated({1, 0x80, 19}, 19, {0x05, 0, 10}))), 3);
  EXPECT_EQ(unit.code(command(0x0C, 0x08, repeated({1, 19}, 19, {0x05, 0, 10}))), 3);
  EXPECT_EQ(unit.code(command(0x0C, 0x0D, repeated({0x80, 0, 19}, 19, {0x05}))), 3) << "nor does a poll";
  EXPECT_EQ(field(unit.send(command(0x0C, 0x0F, {2, 0x80})).at(0), 0x8F)[1], 18);
  const auto with = [](std::size_t count, const char* name) {
    return Unit({{"sensor_fields", std::vector<std::string>(count, name)}});
  };
  EXPECT_NO_THROW(with(18, "rate"));
  EXPECT_THROW(with(19, "rate"), std::invalid_argument);
  EXPECT_NO_THROW(with(32, "event_source"));
  EXPECT_THROW(with(33, "event_source"), std::invalid_argument);
}

// Poll data: "any unrecognized descriptors are ignored"; "If no format is provided and there is no stored format, the
// device will respond with a NACK"; "Suppress the usual ACK/NACK reply".
TEST(MipCommands, Polls) {
  Unit unit;
  const Bytes ack = {4, 0xF1, 0x0D, 0}, data = {14, 0x05, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(unit.send(command(0x0C, 0x0D, {0x80, 0, 3, 0x77, 0x05, 0x78})),
            (std::vector<Bytes>{packet(0x0C, ack), packet(0x80, data)}));
  EXPECT_EQ(unit.send(command(0x0C, 0x0D, {0x80, 0, 1, 0x77})), (std::vector<Bytes>{packet(0x0C, ack)}))
      << "is all there is";
  EXPECT_EQ(unit.send(command(0x0C, 0x0D, {0x82, 0, 0})).at(1)[2], 0x82) << "as it is streamed";
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x82, 0})), 0);
  EXPECT_EQ(unit.send(command(0x0C, 0x0D, {0x82, 0, 0})), (std::vector<Bytes>{packet(0x0C, {4, 0xF1, 0x0D, 4})}));
  EXPECT_TRUE(unit.send(command(0x0C, 0x0D, {0x82, 1, 0})).empty());
  EXPECT_EQ(unit.code(command(0x0C, 0x0D, {0x80, 0, 2, 0x05})), 3) << "one is missing";

  const auto both = unit.send(packet(0x0C, {6, 0x0D, 0x80, 0, 1, 0x05, 7, 0x01, 0, 1, 0x04, 0, 0}));
  ASSERT_EQ(both.size(), 3U);
  EXPECT_EQ(both[0], packet(0x0C, {4, 0xF1, 0x0D, 0, 4, 0xF1, 0x01, 0}));
  EXPECT_EQ(both[1], packet(0x80, data));
  EXPECT_EQ(field(both[2], 0x04).size(), 12U);
  const auto silent = unit.send(packet(0x0C, {3, 0x11, 9, 6, 0x0D, 0x80, 1, 1, 0x05, 2, 0x06}));
  ASSERT_EQ(silent.size(), 2U);
  EXPECT_EQ(silent[0], packet(0x0C, {4, 0xF1, 0x11, 3, 4, 0xF1, 0x06, 0, 4, 0x83, 0x03, 0xE8}))
      << "the others' answers";
}

// The longest answers need 107 of a packet's 255 bytes: they fit behind 37 of a ping's 4 bytes.
TEST(MipCommands, AnAnswerThatMightNotFitBeginsANewPacket) {
  Unit unit;
  const Bytes ack = {4, 0xF1, 0x01, 0};
  EXPECT_EQ(unit.send(packet(0x01, repeated({}, 39, {2, 0x01}))),
            (std::vector<Bytes>{packet(0x01, repeated({}, 38, ack)), packet(0x01, ack)}));
}

TEST(MipCommands, EachFieldIsAsLongAsItsEntry) {
  std::size_t fields = 0;
  for (const mip::Model& model : mip::models) {
    Unit unit({{"model", std::string(model.keyword)}});
    for (const mip::DataField& one : mip::data_fields()) {
      if (!model.is(one.models)) continue;
      const std::uint8_t set = one.set == mip::gnss ? model.receivers[0] : one.set;
      const auto sent = unit.send(command(0x0C, 0x0D, {set, 0, 1, one.descriptor}));
      ASSERT_EQ(sent.size(), 2U) << one.name;
      EXPECT_EQ(field(sent[1], one.descriptor).size(), one.size) << one.name;
      ++fields;
    }
  }
  EXPECT_GT(fields, mip::data_fields().size());
}

// "For all functions except 0x01 (use new settings), the new baud rate value is ignored", and of the others alike.
TEST(MipCommands, AValueBesideReadSaveLoadDefaultIsIgnored) {
  struct Case {
    const char* model;
    std::uint8_t set, descriptor;
    Bytes key, value;
  };
  for (const Case& c : {Case{"3dm-gx5-25", 0x0C, 0x40, {}, {0, 0x0E, 0x10, 0}},
                        {"3dm-gx5-25", 0x01, 0x09, {1}, {0, 0x0E, 0x10, 0}},
                        {"3dm-gx5-25", 0x0C, 0x11, {0x80}, {0}},
                        {"3dm-gx5-25", 0x0C, 0x0F, {0x80}, {1, 0x05, 0, 1}},
                        {"3dm-gx5-25", 0x0C, 0x38, {}, Bytes(12, 0x3F)},
                        {"3dm-gx5-25", 0x0C, 0x3E, {}, {0}},
                        {"3dm-gx5-25", 0x0D, 0x11, {}, Bytes(12, 0x3F)},
                        {"3dm-cv7-ahrs", 0x0C, 0x32, {}, Bytes(16, 0x3F)},
                        {"3dm-cv7-ahrs", 0x0C, 0x2B, {1}, {1}},
                        {"3dm-cv7-ahrs", 0x0D, 0x50, {0, 5}, {0}}}) {
    SCOPED_TRACE(testing::Message() << unsigned{c.set} << ' ' << unsigned{c.descriptor});
    Unit unit({{"model", std::string(c.model)}});
    const auto with = [&](std::uint8_t function, bool has_value) {
      Bytes all = repeated({function}, 1, c.key);
      return command(c.set, c.descriptor, has_value ? repeated(all, 1, c.value) : all);
    };
    const auto before = unit.send(with(2, false));
    for (const std::uint8_t function : Bytes{3, 4, 5})
      EXPECT_EQ(unit.code(with(function, true)), 0) << unsigned{function};
    EXPECT_EQ(unit.send(with(2, true)), before);
  }
}

// Commands that change nothing must have their size, too.
TEST(MipCommands, AnAcknowledgedCommandHasItsSize) {
  int tried = 0;
  for (const char* model : {"3dm-gx5-25", "3dm-gx5-45", "3dm-cv7-ahrs", "3dm-cv7-ins", "3dm-gq7"}) {
    const mip::Model& has =
        *std::find_if(mip::models.begin(), mip::models.end(), [&](const auto& m) { return m.keyword == model; });
    for (const mip::Acknowledged& one : mip::acknowledged_commands()) {
      if (!has.is(one.models)) continue;
      SCOPED_TRACE(testing::Message() << model << ' ' << unsigned{one.set} << ' ' << unsigned{one.command});
      Unit unit({{"model", std::string(model)}});
      EXPECT_EQ(unit.code(command(one.set, one.command, Bytes(one.size))), 0);
      EXPECT_EQ(unit.code(command(one.set, one.command, Bytes(one.size + 1U))), 3);
      if (one.size > 0) {
        EXPECT_EQ(unit.code(command(one.set, one.command, Bytes(one.size - 1U))), 3);
      }
      ++tried;
    }
  }
  EXPECT_EQ(tried, 30);
}

// commands_base.h, comm speed: port 0 stands for all ports, 1 is the main port; there is no other.
TEST(MipCommands, SpeedsBelongToThePortsThatThereAre) {
  Unit unit;
  for (const std::uint8_t port : Bytes{2, 3, 0x11, 0xFF})
    for (const Bytes& data : {Bytes{2, port}, {1, port, 0, 0x0E, 0x10, 0}, {3, port}, {4, port}, {5, port}})
      EXPECT_EQ(unit.code(command(0x01, 0x09, data)), 3) << unsigned{port};
  EXPECT_EQ(unit.device->uart().baud, 115200U);
  for (const std::uint8_t port : Bytes{0, 1})
    EXPECT_EQ(field(unit.send(command(0x01, 0x09, {2, port})).at(0), 0x89), (Bytes{1, 0, 1, 0xC2, 0}))
        << unsigned{port};
  EXPECT_EQ(unit.code(command(0x01, 0x09, {1, 1, 0, 0x0E, 0x10, 0})), 0);
  EXPECT_EQ(unit.device->uart().baud, 921600U);
}

TEST(MipCommands, ValuesThatAreNoneAreRefused) {
  Unit unit({{"model", std::string("3dm-gx5-45")}});
  const Bytes nan = {0x7F, 0xC0, 0, 0}, infinite = {0xFF, 0x80, 0, 0}, one = {0x3F, 0x80, 0, 0};
  EXPECT_EQ(unit.code(command(0x0C, 0x3E, {1, 77})), 3) << "on or off";
  EXPECT_EQ(unit.code(command(0x0C, 0x3E, {1, 0})), 0);
  for (const Bytes& bad : {nan, infinite}) {
    EXPECT_EQ(unit.code(command(0x0C, 0x3A, repeated(repeated({1}, 2, one), 1, bad))), 3) << "hard iron";
    EXPECT_EQ(unit.code(command(0x0C, 0x3B, repeated(repeated({1}, 8, one), 1, bad))), 3) << "soft iron";
    EXPECT_EQ(unit.code(command(0x0D, 0x13, repeated(repeated({1}, 2, one), 1, bad))), 3) << "antenna";
    EXPECT_EQ(unit.code(command(0x0C, 0x37, repeated(repeated({1}, 2, one), 1, bad))), 3) << "bias";
    EXPECT_EQ(unit.code(command(0x0D, 0x11, repeated(repeated({1}, 2, one), 1, bad))), 3) << "mounting";
  }
  EXPECT_EQ(unit.code(command(0x0C, 0x3A, repeated({1}, 3, one))), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x3B, repeated({1}, 9, one))), 0);
  Unit cv7({{"model", std::string("3dm-cv7-ins")}});
  for (const Bytes& bad : {nan, infinite}) {
    EXPECT_EQ(cv7.code(command(0x0C, 0x33, repeated(repeated({1}, 8, one), 1, bad))), 3);
    EXPECT_EQ(cv7.code(command(0x0C, 0x32, repeated(repeated({1}, 3, one), 1, bad))), 3);
  }
}

TEST(MipCommands, AllStreamsAreSwitchedAtOnce) {
  Unit unit;
  ASSERT_GT(unit.run(1000).size(), 100U);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0, 0})), 0) << "all off";
  EXPECT_TRUE(unit.run(1000).empty());
  for (const std::uint8_t set : Bytes{0x80, 0x82})
    EXPECT_EQ(field(unit.send(command(0x0C, 0x11, {2, set})).at(0), 0x85), (Bytes{set, 0}));
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0, 1})), 0) << "all on";
  EXPECT_GT(unit.run(1000).size(), 100U);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0x82, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {3, 0})), 0) << "all saved";
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {4, 0})), 0) << "all loaded";
  for (const auto& [set, enabled] : {std::pair<std::uint8_t, std::uint8_t>{0x80, 1}, {0x82, 0}})
    EXPECT_EQ(field(unit.send(command(0x0C, 0x11, {2, set})).at(0), 0x85), (Bytes{set, enabled}));
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {5, 0})), 0) << "as delivered";
  EXPECT_EQ(field(unit.send(command(0x0C, 0x11, {2, 0x82})).at(0), 0x85), (Bytes{0x82, 1}));
}

// 0C:54 of the 7 series: function, set, descriptor, enable, manual, frequency as a float.
TEST(MipCommands, LowPassFiltersOfThe7Series) {
  Unit unit(
      {{"sensor_rate_hz", std::int64_t{100}}, {"sensor_fields", std::vector<std::string>{"rate", "acceleration"}}});
  const auto cut_offs = [&] {
    const SensorFilters filters = unit.device->filters().value();
    EXPECT_EQ(filters.gyro.order, 1);
    return std::array{filters.gyro.cut_off_hz[2], filters.accelerometer.cut_off_hz[0]};
  };
  const auto set = [](Bytes data) { return command(0x0C, 0x54, std::move(data)); };
  EXPECT_EQ(cut_offs(), (std::array{50.0, 50.0})) << "as delivered, half of the rate";
  EXPECT_EQ(field(unit.send(set({2, 0x80, 0x05})).at(0), 0xD4), (Bytes{0x80, 0x05, 1, 0, 0x42, 0x48, 0, 0}));
  // 20 Hz, manual, then saved.
  EXPECT_EQ(unit.code(set({1, 0x80, 0x05, 1, 1, 0x41, 0xA0, 0, 0})), 0);
  EXPECT_EQ(cut_offs(), (std::array{20.0, 50.0}));
  EXPECT_EQ(field(unit.send(set({2, 0x80, 0x05})).at(0), 0xD4), (Bytes{0x80, 0x05, 1, 1, 0x41, 0xA0, 0, 0}));
  EXPECT_EQ(unit.code(set({3, 0x80, 0x05})), 0);
  // The automatic one follows the message format: rate and acceleration at 250 Hz. The manual one does not.
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x80, 2, 0x05, 0, 4, 0x04, 0, 4})), 0);
  EXPECT_EQ(cut_offs(), (std::array{20.0, 125.0}));
  // At 1 kHz half of the rate is half of the sensor's own: nothing is left to filter. Nor is there a rate without a
  // stream.
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x80, 1, 0x04, 0, 1})), 0);
  EXPECT_EQ(cut_offs(), (std::array{20.0, 0.0}));
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x80, 1, 0x07, 0, 10})), 0);
  EXPECT_EQ(cut_offs(), (std::array{20.0, 0.0}));
  EXPECT_EQ(unit.code(set({1, 0, 0, 0, 0, 0, 0, 0, 0})), 0) << "all of them off";
  EXPECT_EQ(cut_offs(), (std::array{0.0, 0.0}));
  EXPECT_EQ(unit.code(set({4, 0x80, 0})), 0) << "all as they were saved";
  EXPECT_EQ(cut_offs(), (std::array{20.0, 0.0}));
  EXPECT_EQ(unit.code(set({5, 0x80, 0x05})), 0) << "as delivered; the rate is not streamed";
  EXPECT_EQ(cut_offs(), (std::array{0.0, 0.0}));
  // A quantity without a filter, another set, every quantity of none, a function that is none, a flag that is none,
  // no frequency, too short, too long.
  for (const Bytes& wrong : {Bytes{2, 0x80, 0x07}, Bytes{2, 0x82, 0x05}, Bytes{2, 0x80, 0}, Bytes{9, 0x80, 0x05},
                             Bytes{1, 0x80, 0x05, 2, 0, 0, 0, 0, 0}, Bytes{1, 0x80, 0x05, 1, 1, 0, 0, 0, 0},
                             Bytes{1, 0x80, 0x05, 1, 1, 0x7F, 0xC0, 0, 0}, Bytes{1, 0x80, 0x05, 1, 1, 0x41, 0xA0},
                             Bytes{1, 0x80, 0x05, 1, 1, 0x41, 0xA0, 0, 0, 0}, Bytes{2, 0, 0x05}, Bytes{2}})
    EXPECT_EQ(unit.code(set(wrong)), 3) << wrong.size();
  EXPECT_EQ(unit.code(command(0x0C, 0x50, {2, 0x05})), 1) << "is of the 5 series";
}

// 0C:50 of a GX5: function, descriptor, enable, manual, frequency, reserved.
TEST(MipCommands, LowPassFiltersOfAGx5) {
  Unit unit({{"model", std::string("3dm-gx5-25")}, {"sensor_rate_hz", std::int64_t{100}}});
  const auto set = [](Bytes data) { return command(0x0C, 0x50, std::move(data)); };
  EXPECT_EQ(field(unit.send(set({2, 0x06})).at(0), 0x8B), (Bytes{0x06, 1, 0, 0, 50, 0}));
  EXPECT_EQ(unit.code(set({1, 0x05, 1, 1, 0, 20, 0})), 0);
  EXPECT_EQ(field(unit.send(set({2, 0x05})).at(0), 0x8B), (Bytes{0x05, 1, 1, 0, 20, 0}));
  EXPECT_EQ(unit.device->filters().value().gyro.cut_off_hz[0], 20);
  EXPECT_EQ(unit.device->filters().value().magnetometer.cut_off_hz[0], 50);
  EXPECT_EQ(unit.code(set({1, 0, 1, 1, 0, 33, 0})), 0);
  EXPECT_EQ(unit.device->filters().value().magnetometer.cut_off_hz[0], 33);
  EXPECT_EQ(unit.code(set({1, 0x05, 1, 1, 0, 20})), 3);
  EXPECT_EQ(unit.code(command(0x0C, 0x54, {2, 0x80, 0x05})), 1) << "is of the 7 series";
}

}  // namespace
}  // namespace imud::mip_test
