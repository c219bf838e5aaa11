// The text of CAN logs: lines that can-utils wrote, and any other text.
#include "transports/can/can_log.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "transports/can/can_dlc.hpp"

namespace imud {
namespace {

struct Logged {
  CanHeader header;
  std::vector<std::byte> bytes;
  Nanoseconds time;
};

// Data bytes 0x11, 0x22, ...
std::vector<std::byte> bytes(std::size_t size) {
  std::vector<std::byte> all(size);
  for (std::size_t i = 0; i < size; ++i) all[i] = static_cast<std::byte>(0x11 * (i + 1));
  return all;
}

std::string written(CanLogFormat format, const CanHeader& header, std::size_t size, Nanoseconds time,
                    const std::string& interface = "can0") {
  const auto data = bytes(size);
  std::array<char, max_can_log_line> line;
  return {line.data(), write_can_log(format, {data, header}, time, interface, line)};
}

std::vector<Logged> frames_of(CanLogReader& log, std::string_view text) {
  std::vector<Logged> all;
  while (!text.empty()) {
    const std::size_t size = std::min(text.find('\n') + 1, text.size());
    if (log.read(text.substr(0, size)) == CanLogReader::Line::frame) {
      const Frame frame = log.frame();
      all.push_back({frame.can, {frame.bytes.begin(), frame.bytes.end()}, log.time()});
    }
    text.remove_prefix(size);
  }
  return all;
}

constexpr CanHeader standard = {.id = 0x123}, extended = {.id = 0x18FF1234, .extended = true},
                    remote = {.id = 0x7, .remote = true}, fd = {.id = 0x123, .fd = true, .bit_rate_switch = true};

TEST(CanLog, LinesAreThoseOfCanUtils) {
  constexpr auto candump = CanLogFormat::candump;
  EXPECT_EQ(written(candump, standard, 8, Nanoseconds{1'436'509'052'249'713'999}, "vcan0"),
            "(1436509052.249713) vcan0 123#1122334455667788\n");
  EXPECT_EQ(written(candump, extended, 1, Nanoseconds{10'000'000}), "(0000000000.010000) can0 18FF1234#11\n");
  EXPECT_EQ(written(candump, {.id = 0x7F}, 0, Nanoseconds{-5'000}), "(0000000000.000000) can0 07F#\n");
  EXPECT_EQ(written(candump, remote, 0, Nanoseconds{0}), "(0000000000.000000) can0 007#R\n");
  EXPECT_EQ(written(candump, remote, 5, Nanoseconds{0}), "(0000000000.000000) can0 007#R5\n");
  EXPECT_EQ(written(candump, fd, 12, Nanoseconds{0}), "(0000000000.000000) can0 123##1112233445566778899AABBCC\n");
  EXPECT_EQ(written(candump, {.id = 0x123, .fd = true}, 9, Nanoseconds{0}),
            "(0000000000.000000) can0 123##0112233445566778899000000\n")
      << "filled to a length that an FD frame can have";

  // As log2asc 2020.11 wrote the lines above; its date is that of the first.
  constexpr auto asc = CanLogFormat::asc;
  EXPECT_EQ(can_log_header(asc),
            "date Thu Jan  1 00:00:00 1970\nbase hex  timestamps absolute\nno internal events logged\n");
  EXPECT_EQ(written(asc, standard, 8, Nanoseconds{12'345'678'000}),
            "  12.345678 1  123             Rx   d 8 11 22 33 44 55 66 77 88\n");
  EXPECT_EQ(written(asc, extended, 1, Nanoseconds{10'000'000}, "can1"),
            "   0.010000 2  18FF1234x       Rx   d 1 11\n");
  EXPECT_EQ(written(asc, remote, 5, Nanoseconds{0}), "   0.000000 1  7               Rx   r 5\n");
  EXPECT_EQ(
      written(asc, fd, 12, Nanoseconds{0}),
      "   0.000000 CANFD   1 Rx        123                                   1 0 9 12 11 22 33 44 55 66 77 88 99 AA "
      "BB CC   130000  130     3000 0 0 0 0 0\n");
}

// As log2asc 2020.11 writes the first line; asc2log gives every ErrorFrame the identifier 20000080 and eight zeros.
TEST(CanLog, ErrorFramesAreWritten) {
  constexpr CanHeader error = {.id = 0x88, .error = true};
  EXPECT_EQ(written(CanLogFormat::candump, error, 8, Nanoseconds{0}),
            "(0000000000.000000) can0 20000088#1122334455667788\n");
  EXPECT_EQ(written(CanLogFormat::asc, error, 8, Nanoseconds{0}), "   0.000000 1  ErrorFrame\n");
  CanLogReader log;
  const auto read = frames_of(log, written(CanLogFormat::candump, error, 8, Nanoseconds{0}));
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].header, error);
  EXPECT_EQ(read[0].bytes, bytes(8));
}

TEST(CanLog, AFrameThatNoBusCarriesHasNoLine) {
  for (const CanHeader& header : {CanHeader{.id = 0x800}, CanHeader{.id = 1U << 29U, .extended = true},
                                  CanHeader{.fd = true, .error = true}, CanHeader{.fd = true, .remote = true}})
    EXPECT_EQ(written(CanLogFormat::candump, header, 1, Nanoseconds{0}), "");
  EXPECT_EQ(written(CanLogFormat::candump, standard, 9, Nanoseconds{0}), "");
  EXPECT_EQ(written(CanLogFormat::candump, fd, 65, Nanoseconds{0}), "");
}

TEST(CanLog, WhatIsWrittenIsReadAgain) {
  std::size_t frames = 0;
  for (const CanLogFormat format : {CanLogFormat::candump, CanLogFormat::asc})
    for (CanHeader header :
         {standard, extended, remote, fd, CanHeader{.id = 0x1FFFFFFF, .extended = true, .fd = true}})
      for (std::size_t size = 0; size <= (header.fd ? 64 : 8); ++size) {
        const Nanoseconds time{static_cast<std::int64_t>(size) * 1'000'001'000};
        CanLogReader log;
        const auto read = frames_of(log, std::string(can_log_header(format)) + written(format, header, size, time));
        ASSERT_EQ(read.size(), 1U) << size;
        EXPECT_EQ(read[0].header, header);
        auto expected = header.remote ? std::vector<std::byte>(size) : bytes(size);
        if (header.fd) expected.resize(fd_length(size));
        EXPECT_EQ(read[0].bytes, expected);
        EXPECT_EQ(read[0].time, time);
        ++frames;
      }
  EXPECT_EQ(frames, 2U * (3 * 9 + 2 * 65));
  EXPECT_LE(written(CanLogFormat::asc, CanHeader{.id = 0x1FFFFFFF, .extended = true, .fd = true}, 64,
                    Nanoseconds{INT64_MAX}, "abcdefghijk4294")
                .size(),
            max_can_log_line);
}

TEST(CanLog, LinesOfOtherToolsAreRead) {
  CanLogReader log;
  const auto candump = frames_of(log,
                                 "(1436509052.249713) vcan0 044#2A36.6C2BBA R\n"
                                 "  (1.5) vcan0 123##5112233445566778899AABBCC T\r\n"
                                 "(0000000001.500000) can0 20000040#0011223344556677\n"
                                 "(2.25) can0 123#1122334455667788_B\n");
  ASSERT_EQ(candump.size(), 4U);
  EXPECT_EQ(candump[0].header, (CanHeader{.id = 0x44}));
  EXPECT_EQ(candump[0].bytes.size(), 5U);
  EXPECT_EQ(candump[0].time, Nanoseconds{1'436'509'052'249'713'000});
  EXPECT_EQ(candump[1].header, fd);
  EXPECT_EQ(candump[1].time, Nanoseconds{1'500'000'000});
  EXPECT_EQ(candump[2].header, (CanHeader{.id = 0x40, .error = true}));
  EXPECT_EQ(candump[3].bytes.size(), 8U);

  const auto asc =
      frames_of(log,
                "date Wed Jul 8 12:00:00.000 pm 2026\nbase hex  timestamps relative\n"
                "Begin Triggerblock Wed Jul 8 12:00:00.000 pm 2026\n   0.000000 Start of measurement\n"
                "   0.010000 1  123             Rx   d 2 01 FF  Length = 240000 BitCount = 124 ID = 291\n"
                "   0.020000 1  ErrorFrame\n"
                "   0.001    1  Statistic: D 10 R 0 XD 0 XR 0 E 0 O 0 B 1.05%\n"
                "   0.005000 2  18FF1234x       Tx   r\n"
                "   0.004 CANFD   1 Rx 11  Message  1 0 a 16 00 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d 0e 0f "
                "100000  214   223040 80000000 46500250\n"
                "   0.004 CANFD   1 Tx 12x  0 0 2 2 aa bb 100000  214   0 0 0\n"
                "End TriggerBlock\n");
  ASSERT_EQ(asc.size(), 5U);
  EXPECT_EQ(asc[0].header, standard);
  EXPECT_EQ(asc[0].bytes, (std::vector{std::byte{0x01}, std::byte{0xFF}}));
  EXPECT_EQ(asc[0].time, Nanoseconds{10'000'000});
  EXPECT_EQ(asc[1].header, (CanHeader{.id = 0x80, .error = true}));
  EXPECT_EQ(asc[2].header, (CanHeader{.id = 0x18FF1234, .extended = true, .remote = true}));
  EXPECT_EQ(asc[2].time, Nanoseconds{36'000'000}) << "each counts from the line before";
  EXPECT_EQ(asc[3].header, (CanHeader{.id = 0x11, .fd = true, .bit_rate_switch = true}));
  EXPECT_EQ(asc[3].bytes.size(), 16U);
  EXPECT_EQ(asc[4].header, (CanHeader{.id = 0x12, .extended = true})) << "a classic frame in the form of FD";

  const auto decimal = frames_of(log, "base dec  timestamps absolute\n1.0 1 291 Rx d 3 16 255 0\n");
  ASSERT_EQ(decimal.size(), 1U);
  EXPECT_EQ(decimal[0].header, standard);
  EXPECT_EQ(decimal[0].bytes, (std::vector{std::byte{16}, std::byte{255}, std::byte{0}}));
}

TEST(CanLog, OneInterfaceOfSeveralIsRead) {
  const std::string_view text = "(1.0) can0 100#\n(2.0) can1 200#\n3.0 1 300 Rx d 0\n4.0 2 400 Rx d 0\n";
  CanLogReader one("can1");
  const auto read = frames_of(one, text);
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].header.id, 0x200U);
  EXPECT_EQ(read[1].header.id, 0x400U);
  CanLogReader all;
  EXPECT_EQ(frames_of(all, text).size(), 4U);
  EXPECT_EQ(channel_of("can7"), 8U);
  EXPECT_EQ(channel_of("bus"), 1U);
}

TEST(CanLog, ChannelsHaveAnyNumberOfDigits) {
  std::string text;
  for (const char* interface : {"can8", "can9", "can10", "can99"})
    for (const CanHeader& header : {standard, fd})
      text += written(CanLogFormat::asc, header, 4, Nanoseconds{0}, interface);
  for (const char* interface : {"can8", "can9", "can10", "can99"}) {
    CanLogReader one(interface);
    const auto read = frames_of(one, text);
    ASSERT_EQ(read.size(), 2U) << interface;
    EXPECT_EQ(read[0].header, standard);
    EXPECT_EQ(read[1].header, fd);
  }
  CanLogReader all;
  EXPECT_EQ(frames_of(all, text).size(), 8U);
  EXPECT_EQ(all.read("1.0 A 123 Rx d 0"), CanLogReader::Line::other) << "a channel is decimal";
}

TEST(CanLog, DamagedLinesAreCounted) {
  using Line = CanLogReader::Line;
  CanLogReader log;
  for (const char* line : {"(",
                           "()",
                           "(1.0)",
                           "(1.0) can0",
                           "(1.0) can0 123",
                           "(1.0) can0 1234#00",
                           "(1.0) can0 800#00",
                           "(1.0) can0 40000000#00",
                           "(1.0) can0 123#0",
                           "(1.0) can0 123#0G",
                           "(1.0) can0 123#112233445566778899",
                           "(1.0) can0 123#R9",
                           "(1.0) can0 123##",
                           "(1.0) can0 123##1112233445566778899",
                           "(1.x) can0 123#00",
                           "(99999999999.0) can0 123#00",
                           "(-1.0) can0 123#00",
                           "(1.0) can0 12345678##1.",
                           "1.0 1 123 Rx d 2 11",
                           "1.0 1 123 Rx d x",
                           "1.0 1 123 Rx d 1 100",
                           "1.0 CANFD 1 Rx 123 1 0 9 12 11",
                           "1.0 CANFD 1 Rx 123 1 0 9 99",
                           "1.0 CANFD 1 Rx 123 1 0 9 9 1 2 3 4 5 6 7 8 9 0 0 3000",
                           "1.0 CANFD 1 Up 123 1 0 0 0 0 0 3000"})
    EXPECT_EQ(log.read(line), Line::malformed) << line;
  for (const char* line : {"", "\n", "x", "// version 9.0.0", "1.0", "1.0 Start of measurement", "1.0 1 zzz Rx d 0",
                           "  can0  123   [8]  11 22 33 44 55 66 77 88", "1.0 1 800 Rx d 0"})
    EXPECT_EQ(log.read(line), Line::other) << line;
}

TEST(CanLog, NoTextIsHarmful) {
  std::mt19937 random(1);
  const std::string alphabet = "0123456789abcdefABCDEFxRr#(). \tCANFDdTx_\n";
  std::vector<std::string> lines;
  for (const CanHeader& header : {standard, extended, remote, fd})
    for (const CanLogFormat format : {CanLogFormat::candump, CanLogFormat::asc})
      lines.push_back(written(format, header, header.fd ? 64 : 8, Nanoseconds{123'456'789'000}));
  CanLogReader log;
  std::size_t frames = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string line = lines[random() % lines.size()];
    for (unsigned n = random() % 4; n > 0; --n) line[random() % line.size()] = alphabet[random() % alphabet.size()];
    if (random() % 4 == 0) line.resize(random() % line.size());
    if (log.read(line) != CanLogReader::Line::frame) continue;
    ++frames;
    EXPECT_LE(log.frame().bytes.size(), log.frame().can.fd ? 64U : 8U) << line;
    EXPECT_GE(log.time().count(), 0) << line;
  }
  EXPECT_GT(frames, 1000U);
}

}  // namespace
}  // namespace imud
