// The ports of `also` carry the bytes of the imu's port, and take nothing from it.
#include <fcntl.h>
#include <unistd.h>

#include "tests/emulator/run/live_test.hpp"
#include "tests/support/raw_terminal.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

const std::string flight = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap";
// Ten seconds at 1000 Hz, half of the rate of the samples, less the datagrams of the start-up of 0.1 s.
constexpr int frames_of_the_flight = 9902;

class CopiesTest : public LiveTest {
 protected:
  // A STIM300 whose port is the file "first", and further keys.
  std::string stim300(const std::string& clock, const std::string& keys) const {
    return write("stim300.toml",
                 fmt::format("clock = \"{}\"\n[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n"
                             "[[imu]]\nprotocol = \"stim300\"\nport = \"file:{}\"\n{}\n",
                             clock, path("first"), keys));
  }
  ProgramResult replay(const std::string& config) const {
    return run_program("imud", {"replay", config, flight, "--summary", path("summary.json")});
  }
};

TEST_F(CopiesTest, TheBytesOfThePortWithAndWithoutFaultsOfTheWire) {
  for (const char* fault : {"",
                            "[[fault]]\ntarget = \"wire\"\nkind = \"bit_errors\"\nvalue = 1e-4\nat_s = 2\n"
                            "for_s = 2\n"}) {
    const ProgramResult run = replay(
        stim300("fast", fmt::format("also = [\"file:{}\", \"file:{}\"]\n{}", path("second"), path("third"), fault)));
    ASSERT_EQ(run.exit_code, 0) << run.errors;
    const std::string bytes = read_file(path("first"));
    ASSERT_GT(bytes.size(), 100'000U);
    EXPECT_TRUE(read_file(path("second")) == bytes) << fault;
    EXPECT_TRUE(read_file(path("third")) == bytes) << fault;
    EXPECT_EQ(summary()["imus"][0]["copies_dropped"], 0);
    EXPECT_EQ(summary()["imus"][0]["frames"], frames_of_the_flight) << "copies are not counted";
  }
}

// A pipe that nobody reads takes 64 KiB.
TEST_F(CopiesTest, AReaderThatStopsCostsThePortNothing) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  const FileDescriptor reader(::open(path("pipe").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  ASSERT_GE(reader.get(), 0);
  const ProgramResult run = replay(stim300("realtime", "also = [\"file:" + path("pipe") + "\"]"));
  EXPECT_EQ(run.exit_code, 0) << run.errors;
  const auto imu = summary()["imus"][0];
  EXPECT_GT(imu["copies_dropped"], 100);
  EXPECT_EQ(imu["dropped"], 0);
  // A machine that is held up skips samples; each second one has a frame.
  EXPECT_NEAR(imu["frames"].get<int>(), frames_of_the_flight - imu["skipped"].get<int>() / 2, 1);
}

// In fast the pipe's reader is waited for.
TEST_F(CopiesTest, APipeLosesNothingInFast) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  Program cat("/bin/cat");
  cat.start({path("pipe")});
  const ProgramResult run = replay(stim300("fast", "also = [\"file:" + path("pipe") + "\"]"));
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  EXPECT_EQ(cat.wait(), 0);
  EXPECT_TRUE(cat.output() == read_file(path("first")));
}

TEST_F(CopiesTest, AFullDiskUnderACopyMakesTheRunIncomplete) {
  const ProgramResult run = replay(stim300("fast", "also = [\"file:/dev/full\"]"));
  EXPECT_EQ(run.exit_code, 3) << run.errors;
  EXPECT_GT(summary()["imus"][0]["copies_dropped"], 0);
}

// What a host sends to the port is answered at the port and its copy; what comes from a copy is discarded.
TEST_F(CopiesTest, AnswersAreCopiedAndCommandsOfACopyAreNot) {
  Program imud("imud");
  std::uint32_t sequence = 0;
  start(imud, write("config.toml", fmt::format("clock = \"lockstep\"\n[truth]\nport = \"{}\"\n[[imu]]\n"
                                               "protocol = \"vectornav\"\ndevice.async_type = 0\n"
                                               "port = \"pty:{}\"\nalso = [\"pty:{}\"]\n",
                                               simulator_.port(), path("imu"), path("copy"))));
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("copy")); }));
  const FileDescriptor host = open_raw_terminal(path("imu")), other = open_raw_terminal(path("copy"));
  const auto steps = [&](std::string& at_host, std::string& at_copy) {
    for (int i = 0; i < 50; ++i, ++sequence) {
      ASSERT_TRUE(simulator_.exchange(Simulator::truth(10 * sequence, sequence, true)).has_value());
      read_all(host, at_host);
      read_all(other, at_copy);
    }
  };
  std::string at_host, at_copy;
  steps(at_host, at_copy);
  constexpr std::string_view command = "$VNRRG,01*72\r\n";
  ASSERT_EQ(::write(other.get(), command.data(), command.size()), static_cast<ssize_t>(command.size()));
  steps(at_host, at_copy);
  EXPECT_EQ(count(at_host, "$VNRRG,01"), 0U);
  ASSERT_EQ(::write(host.get(), command.data(), command.size()), static_cast<ssize_t>(command.size()));
  steps(at_host, at_copy);
  EXPECT_EQ(count(at_host, "$VNRRG,01"), 1U);
  EXPECT_EQ(count(at_copy, "$VNRRG,01"), 1U);
  EXPECT_EQ(imud.stop(), 0);
}

// A byte reaches only one of two programs that read a pty. A child that has inherited it is no other program.
TEST_F(CopiesTest, TwoReadersOfOnePtyAreNamed) {
  Program imud("imud");
  start(imud, write("config.toml", fmt::format("[truth]\nport = \"{}\"\n[[imu]]\nprotocol = \"stim300\"\n"
                                               "port = \"pty:{}\"\n[[imu]]\nprotocol = \"stim300\"\n"
                                               "port = \"pty:{}\"\n",
                                               simulator_.port(), path("one"), path("two"))));
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("two")); }));
  Program alone("/bin/sh"), first("/bin/cat"), second("/bin/cat");
  alone.start({"-c", "{ cat; true; } < " + path("one") + " > /dev/null"});
  first.start({path("two")});
  second.start({path("two")});
  ASSERT_TRUE(imud.wait_for_errors(fmt::format("imu2: 2 programs have pty:{} open, cat (", path("two"))));
  EXPECT_TRUE(contains(imud.errors(), fmt::format("cat ({})", first.pid())));
  EXPECT_TRUE(contains(imud.errors(), fmt::format("cat ({})", second.pid())));
  imud.stop();
  EXPECT_EQ(count(imud.errors(), "programs have pty:"), 1U) << imud.errors();
}

TEST_F(CopiesTest, WrongPortsAreRefused) {
  const auto faults = [&](const std::string& also) {
    const ProgramResult check = run_program("imud", {"check", stim300("fast", "also = " + also)});
    EXPECT_EQ(check.exit_code, 2) << also;
    return check.errors;
  };
  EXPECT_TRUE(contains(faults("\"file:x\""), "imu.0.also: give a list of ports, for example [\"file:imu1.bin\"]"));
  EXPECT_TRUE(contains(faults("[\"can:vcan0\"]"), "imu.0.also: can:vcan0: stim300 is for byte links"));
  EXPECT_TRUE(contains(faults("[\"file:" + path("first") + "\"]"), "imu.0.also: the same as imu.0; give another"));
  EXPECT_TRUE(contains(faults("[\"fiel:x\"]"), "did you mean \"file\"?"));
}

}  // namespace
}  // namespace imud
