// CAN frames in a log: what one port writes another reads, and so do the programs of can-utils.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "tests/support/allocations.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Sends frame `number`, `number` ms after `begin`: its identifier and its data are made from the number.
void send(Port& port, std::uint32_t number, CanHeader header = {}, DeviceTime begin = {}) {
  FrameBuffer buffer;
  const auto room = buffer.room(number % 9);
  for (std::size_t i = 0; i < room.size(); ++i) room[i] = static_cast<std::byte>(number + i);
  header.id = number % 0x800;
  buffer.push(room.size(), header);
  port.set_time(begin + std::chrono::milliseconds(number));
  port.send(buffer.frames());
}

// Reads frames 0, 1, 2, ... to the end; returns their number.
std::uint32_t count_of(Port& port, const CanHeader& header = {}) {
  std::uint32_t number = 0;
  while (!port.at_end()) {
    const auto received = port.receive();
    if (!received) continue;
    CanHeader expected = header;
    expected.id = number % 0x800;
    EXPECT_EQ(received->frame.can, expected) << number;
    EXPECT_EQ(received->time, HostTime{} + std::chrono::milliseconds(number)) << number;
    EXPECT_EQ(received->frame.bytes.size(), number % 9) << number;
    for (std::size_t i = 0; i < received->frame.bytes.size(); ++i)
      EXPECT_EQ(received->frame.bytes[i], static_cast<std::byte>(number + i)) << number;
    ++number;
  }
  return number;
}

TEST(CanFile, FramesAreReadAsTheyWereWritten) {
  constexpr std::uint32_t all = 5000;
  const ScratchFolder folder;
  for (const std::string name : {"x.log", "x.asc", "y?format=asc", "z.asc?format=candump"}) {
    const std::string spec = "canfile:" + folder / name;
    {
      const auto port = open_port(spec, Role::device);
      for (std::uint32_t i = 0; i < all; ++i) send(*port, i, {.extended = i == 7});
      port->flush();
      EXPECT_EQ(port->counters().sent, all);
      EXPECT_EQ(port->counters().dropped, 0U);
    }
    const std::string text = text_of(folder / name.substr(0, name.find('?')));
    EXPECT_EQ(text.starts_with("("), name == "x.log" || name.ends_with("candump")) << text.substr(0, 100);
    EXPECT_EQ(text.starts_with("date "), name == "x.asc" || name.ends_with("=asc"));
  }
  for (const char* name : {"x.log", "x.asc"}) {
    {
      const auto port = open_port("canfile:" + folder / name, Role::device);
      for (std::uint32_t i = 0; i < all; ++i) send(*port, i);
    }
    const auto port = open_port("canfile:" + folder / name, Role::listener);
    EXPECT_LT(port->descriptor(), 0) << "there is nothing to wait for";
    EXPECT_EQ(port->progress(), 0.0);
    EXPECT_EQ(count_of(*port), all);
    EXPECT_EQ(port->progress(), 1.0);
    EXPECT_EQ(port->end_warning(), "");
  }
}

TEST(CanFile, ACompressedLogIsReadToo) {
  const ScratchFolder folder;
  const auto write = [&] {
    const auto port = open_port("canfile:" + folder / "x.log", Role::device);
    for (std::uint32_t i = 0; i < 20'000; ++i) send(*port, i);
  };
  for (const std::string program : {"gzip", "zstd -q --rm"}) {
    write();
    ASSERT_EQ(std::system(fmt::format("{} {}", program, folder / "x.log").c_str()), 0);
    const auto port = open_port("canfile:" + folder / (program == "gzip" ? "x.log.gz" : "x.log.zst"), Role::listener);
    EXPECT_EQ(count_of(*port), 20'000U);
    EXPECT_EQ(port->end_warning(), "");
  }
}

TEST(CanFile, AFrameThatNoBusCarriesIsDropped) {
  const ScratchFolder folder;
  const auto port = open_port("canfile:" + folder / "x.asc", Role::device);
  const std::vector<std::byte> nine(9);
  const Frame frames[] = {{nine, {}}, {std::span(nine).first(8), {}}, {nine, {.remote = true}}};
  port->send(frames);
  port->flush();
  EXPECT_EQ(port->counters().sent, 1U);
  EXPECT_EQ(port->counters().dropped, 2U);
  EXPECT_EQ(text_of(folder / "x.asc"),
            "date Thu Jan  1 00:00:00 1970\nbase hex  timestamps absolute\nno internal events logged\n"
            "   0.000000 1  0               Rx   d 8 00 00 00 00 00 00 00 00\n");
}

// log2asc is a program of can-utils. It prints the date, and counts the times from the first frame, which must not be
// in the first second.
TEST(CanFile, AnAscLogIsThatOfLog2asc) {
  const ScratchFolder folder;
  for (const char* name : {"x.log", "x.asc"}) {
    const auto port = open_port("canfile:" + folder / name + "?interface=can2", Role::device);
    for (std::uint32_t i = 0; i < 3000; ++i) {
      CanHeader header{.extended = i % 3 == 0, .fd = i % 5 == 0, .bit_rate_switch = i % 10 == 0};
      header.remote = !header.fd && i % 7 == 0;
      send(*port, i, header, DeviceTime{name == std::string("x.log") ? 1'000'000'000'000 : 0});
    }
  }
  ASSERT_EQ(
      std::system(fmt::format("log2asc -I {} -O {} can0 can1 can2", folder / "x.log", folder / "theirs").c_str()), 0);
  std::istringstream ours(text_of(folder / "x.asc")), theirs(text_of(folder / "theirs"));
  std::string our_line, their_line;
  std::getline(ours, our_line);
  std::getline(theirs, their_line);
  std::size_t lines = 0;
  while (std::getline(ours, our_line) && std::getline(theirs, their_line)) {
    EXPECT_EQ(our_line, their_line);
    ++lines;
  }
  EXPECT_EQ(lines, 3002U);
  EXPECT_FALSE(std::getline(theirs, their_line));
}

TEST(CanFile, ALineMayComeInPieces) {
  const ScratchFolder folder;
  const std::string path = folder / "fifo";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  const auto port = open_port("canfile:" + path, Role::listener);
  EXPECT_GE(port->descriptor(), 0);
  FileDescriptor writer(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
  const auto write = [&](std::string_view text) {
    EXPECT_EQ(::write(writer.get(), text.data(), text.size()), text.size());
  };
  EXPECT_FALSE(port->receive());
  write("(1.0) can0 1");
  EXPECT_FALSE(port->receive());
  write("23#11\n(2.0) can0 124#\n(3.0)");
  EXPECT_EQ(port->receive()->frame.can.id, 0x123U);
  EXPECT_EQ(port->receive()->frame.can.id, 0x124U);
  EXPECT_FALSE(port->receive());
  EXPECT_FALSE(port->at_end());
  write(" can0 125#");
  writer.reset();
  EXPECT_EQ(port->receive()->frame.can.id, 0x125U) << "the last line has no line feed";
  EXPECT_FALSE(port->receive());
  EXPECT_TRUE(port->at_end());
}

TEST(CanFile, DamageIsReportedAtTheEnd) {
  const ScratchFolder folder;
  const auto warning = [&](const std::string& text, std::uint64_t frames, const std::string& options = "") {
    std::ofstream(folder / "x") << text;
    const auto port = open_port("canfile:" + folder / "x" + options, Role::listener);
    while (!port->at_end()) port->receive();
    EXPECT_EQ(port->counters().received, frames);
    return std::string(port->end_warning());
  };
  EXPECT_EQ(warning("(1.0) can0 123#11\n(2.0) can0 12\n\n(3.0) can0 1\n(4.0) can0 124#", 2),
            "2 of 5 lines are no frames, first line 2; right would be the text of candump -L, or Vector ASC");
  EXPECT_EQ(warning("  can0  123   [1]  11\n", 0),
            "none of its 1 lines is a frame; right would be the text of candump -L, or Vector ASC");
  EXPECT_EQ(warning("(1.0) can0 123#11\n(2.0) can0 124#\n", 0, "?interface=can1"),
            "none of its 2 lines is a frame of can1; give an interface of the log, or another file: right would "
            "be the text of candump -L, or Vector ASC");
  EXPECT_EQ(warning("(1.0) can0 123#11\n(2.0) can1 124#\n", 1, "?interface=can1"), "");
  EXPECT_NE(warning(std::string(300'000, 'x') + "\n(1.0) can0 123#\n", 1), "none") << "a line of any length";
  EXPECT_NE(warning("", 0), "");
}

TEST(CanFile, OptionsAreChecked) {
  const ScratchFolder folder;
  const std::string spec = "canfile:" + folder / "x";
  EXPECT_TRUE(mentions(error_of(spec + "?interface=a234567890123456"), "right would be a name of an interface"));
  EXPECT_TRUE(mentions(error_of(spec + "?interface=a b"), "right would be a name of an interface"));
  EXPECT_TRUE(mentions(error_of(spec + "?format=pcap"), "format"));
  EXPECT_TRUE(mentions(error_of("canfile:" + folder / "none", Role::listener), "cannot read it"));
  EXPECT_TRUE(mentions(error_of("canfile:" + folder / "no/where"), "cannot write it"));
}

TEST(CanFile, NothingIsAllocatedOnceItIsOpen) {
  const ScratchFolder folder;
  const auto writer = open_port("canfile:" + folder / "x", Role::device);
  const std::uint64_t before = allocations();
  for (std::uint32_t i = 0; i < 1000; ++i) send(*writer, i);
  writer->flush();
  EXPECT_EQ(allocations(), before);
  const auto reader = open_port("canfile:" + folder / "x", Role::listener);
  const std::uint64_t opened = allocations();
  while (!reader->at_end()) reader->receive();
  EXPECT_EQ(allocations(), opened);
  EXPECT_EQ(reader->counters().received, 1000U);
}

}  // namespace
}  // namespace imud
