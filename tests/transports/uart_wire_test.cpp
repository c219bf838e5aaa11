// A UART receives from another one that runs at another speed: known answers, worked out by hand from the waveforms.
#include "transports/uart/uart_wire.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace imud {
namespace {

using Bytes = std::vector<std::byte>;

Bytes bytes(std::initializer_list<unsigned> values) {
  Bytes all;
  for (const unsigned value : values) all.push_back(static_cast<std::byte>(value));
  return all;
}

Bytes random_bytes(std::size_t count, std::mt19937& random) {
  Bytes all(count);
  for (std::byte& byte : all) byte = static_cast<std::byte>(random() & 0xFFU);
  return all;
}

// Returns all that is received of `sent`, fed in pieces of up to `piece` characters, before an idle line.
Bytes received(const UartSettings& sender, unsigned receiver_baud, const Bytes& sent, std::size_t piece = 1'000'000) {
  UartWire wire;
  wire.set(sender, receiver_baud);
  Bytes all;
  for (std::size_t at = 0; at < sent.size(); at += piece) {
    const auto part = std::span(sent).subspan(at, std::min(piece, sent.size() - at));
    Bytes some(UartWire::max_received * part.size());
    some.resize(wire.carry(part, some));
    all.insert(all.end(), some.begin(), some.end());
  }
  if (const auto last = wire.idle()) all.push_back(*last);
  EXPECT_EQ(wire.idle(), std::nullopt);
  return all;
}

TEST(UartWire, SpeedsThatAreNearlyEqualAreUnderstood) {
  std::mt19937 random(1);
  for (const Parity parity : {Parity::none, Parity::even, Parity::odd})
    for (const unsigned stop_bits : {1U, 2U})
      for (const unsigned baud : {115'200U, 112'900U, 117'500U, 110'600U, 119'800U}) {  // 0, +-2 %, +-4 %
        const UartSettings line{115'200, parity, stop_bits};
        const Bytes sent = random_bytes(1000, random);
        EXPECT_TRUE(speeds_match(115'200, baud, line)) << baud;
        EXPECT_EQ(received(line, baud, sent), sent) << baud;
      }
  // The stop bit's middle is 9.5 bits after the edge, so that 10 / 9.5 is the limit: 5.26 %; with parity 11
  // / 10.5, 4.76 %.
  EXPECT_TRUE(speeds_match(100'000, 105'200, {}));
  EXPECT_FALSE(speeds_match(100'000, 105'300, {}));
  EXPECT_FALSE(speeds_match(105'300, 100'000, {}));
  EXPECT_FALSE(speeds_match(100'000, 105'000, {.parity = Parity::even}));
  EXPECT_FALSE(speeds_match(50, 4'000'000, {}));
}

TEST(UartWire, AReceiverAtTwiceTheSpeed) {
  // U is 0x55: start 0, data 1 0 1 0 1 0 1 0, stop 1. In bits of the receiver, each of which is half a bit of the
  // sender: 0 0 1 1 0 0 1 1 0 0 1 1 0 0 1 1 0 0 1 1, then idle 1. Bit 0 starts a character, 1 to 8 are its data, 0 1
  // 1 0 0 1 1 0, least significant first: 0x66; bit 9, a stop bit by rights, is 0. The next edge down is that of bit
  // 12; data 13 to 20: 0 1 1 0 0 1 1 1: 0xE6.
  EXPECT_EQ(received({9600}, 19'200, bytes({0x55})), bytes({0x66, 0xE6}));
  // 0xFF is low for the start bit alone, two bits of the receiver: a start bit and a first data bit 0.
  EXPECT_EQ(received({9600}, 19'200, bytes({0xFF})), bytes({0xFE}));
}

TEST(UartWire, AReceiverThatIsSlower) {
  // 0x00 is low for nine bits. Three times as slow, samples fall at 1.5, 4.5, 7.5 bits of the sender: start and two
  // data bits; from 10.5 on the line is idle: 1.
  EXPECT_EQ(received({28'800}, 9600, bytes({0x00})), bytes({0xFC}));
  // At half the speed at 1, 3, 5, 7 and 9, where the stop bit has just begun.
  EXPECT_EQ(received({19'200}, 9600, bytes({0x00})), bytes({0xF8}));
  // A start bit that has ended at the sampling time of its middle is not detected, and 0xFF has no other edge.
  EXPECT_EQ(received({28'800}, 9600, bytes({0xFF, 0xFF, 0xFF})), bytes({}));
}

TEST(UartWire, ALineThatStaysLowIsOneZero) {
  // 108 bits of the receiver, which receives a break as one character, and waits for the line to rise.
  EXPECT_EQ(received({9600}, 115'200, bytes({0x00})), bytes({0x00}));
}

TEST(UartWire, ACharacterUnderWayGoesOnInTheNextPiece) {
  std::mt19937 random(2);
  using Speeds = std::pair<unsigned, unsigned>;
  for (const auto& [sender, receiver] : {Speeds{115'200, 9600}, {9600, 115'200}, {115'200, 57'600}, {1000, 1300}}) {
    const Bytes sent = random_bytes(3000, random);
    const Bytes whole = received({sender}, receiver, sent);
    EXPECT_NE(whole, sent);
    for (const std::size_t piece : {1U, 7U, 14U}) EXPECT_EQ(received({sender}, receiver, sent, piece), whole);
  }
}

TEST(UartWire, NeverMoreThanFits) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> exponent(std::log(50.0), std::log(4e6));
  for (int i = 0; i < 2000; ++i) {
    const auto any_speed = [&] {
      return i % 10 == 0 ? (random() % 2 == 0 ? 50U : 4'000'000U) : static_cast<unsigned>(std::exp(exponent(random)));
    };
    const UartSettings line{any_speed(), static_cast<Parity>(random() % 3), 1 + static_cast<unsigned>(random() % 2)};
    const unsigned receiver = any_speed();
    const Bytes sent = random_bytes(random() % 200, random);
    const Bytes seen = received(line, receiver, sent);
    if (speeds_match(line.baud, receiver, line)) {
      EXPECT_EQ(seen, sent);
    }
    // From a falling edge to the middle of the stop bit it is 9.5 bits at least; one may be under way at the end.
    const double bits = static_cast<double>(sent.size() * line.bits_per_character()) * receiver / line.baud;
    EXPECT_LE(static_cast<double>(seen.size()), bits / 9.5 + 1);
    EXPECT_LE(seen.size(), UartWire::max_received * sent.size());
  }
}

TEST(UartWire, WhatHasNoRoomIsLost) {
  UartWire wire;
  wire.set({9600}, 19'200);
  std::array<std::byte, 3> room{std::byte{1}, std::byte{2}, std::byte{3}};
  EXPECT_EQ(wire.carry(bytes({0x55, 0x55, 0x55}), std::span(room).first(2)), 2U);
  EXPECT_EQ(room[2], std::byte{3});
}

}  // namespace
}  // namespace imud
