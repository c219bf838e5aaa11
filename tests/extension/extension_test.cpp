// A transport is one file, so is a truth format, so is a device whose messages are a table, and a device that talks
// is one folder: those in tests/extension, of which nothing else in the project knows, work in the daemon. The tests
// of all devices run over them, too.
#include <functional>

#include "emulator/config/line_load.hpp"
#include "emulator/config/load_config.hpp"
#include "protocols/native_truth.hpp"
#include "protocols/truth_format.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

class Extension : public RunTest {
 protected:
  // Starts imud with truth by the throw-away transport, and opens the simulator's end of it. imud has opened its
  // ports when the paths of the truth port and of the pty exist.
  void start(const std::string& protocol, const std::string& imu_port) {
    const std::string c = config("lockstep", "throwaway:" + path("truth"), "native", 100, protocol, imu_port);
    imud_.start({"run", c, "--summary", path("summary.json")});
    ASSERT_TRUE(eventually([&] {
      return !imud_.is_running() || (std::filesystem::exists(path("truth")) && std::filesystem::exists(path("imu")));
    }));
    simulator_ = open_port("throwaway:" + path("truth"), Role::device);
  }

  // Sends a truth for every 10 ms of simulation, each after the answer to the one before, and calls `after_each`.
  // Returns the number of samples up to the last truth.
  std::uint64_t simulate(
      int truths, const std::function<void()>& after_each = [] {}) {
    std::array<std::byte, native_truth_size> datagram;
    NativeAcknowledgement answer;
    for (int k = 0; k < truths; ++k) {
      Truth truth;
      truth.time = TruthTime{10'000'000 * std::int64_t{k}};
      truth.omega_BN_B = {0.5, -0.25, 0.125};
      truth.sequence = static_cast<std::uint32_t>(k);
      truth.acknowledge = true;
      truth.new_run = k == 0;
      encode_native_truth(truth, datagram);
      simulator_->send({{Frame{datagram}}});
      EXPECT_TRUE(wait_for(*simulator_));
      const auto received = simulator_->receive();
      if (!received || !decode_native_acknowledgement(received->frame.bytes, answer)) {
        ADD_FAILURE() << "no answer to truth " << k;
        return 0;
      }
      EXPECT_EQ(answer.sequence, truth.sequence);
      after_each();
    }
    return answer.samples;
  }

  static bool wait_for(const Port& port) {
    pollfd ready{port.descriptor(), POLLIN, 0};
    return ::poll(&ready, 1, static_cast<int>(Program::default_timeout.count())) == 1;
  }

  void stop() {
    imud_.kill(SIGTERM);
    EXPECT_EQ(imud_.wait(), 0) << imud_.errors();
  }

  Program imud_{IMUD_BIN_DIR "/tests/imud-extended"};
  std::unique_ptr<Port> simulator_;
};

TEST_F(Extension, TheTablesHaveThemBesideTheOthers) {
  ASSERT_NE(find_transport("throwaway"), nullptr);
  ASSERT_NE(find_protocol("throwaway-imu"), nullptr);
  ASSERT_NE(find_protocol("throwaway-can"), nullptr);
  ASSERT_NE(find_truth_format("throwaway-poses"), nullptr);
  EXPECT_NE(find_truth_format("jsbsim"), nullptr);
  EXPECT_NE(find_transport("udp"), nullptr);
  EXPECT_NE(find_protocol("native"), nullptr);
  const ProgramResult listed = run_program(IMUD_BIN_DIR "/tests/imud-extended", {"list"});
  EXPECT_NE(listed.output.find("throwaway:PATH"), std::string::npos) << listed.output;
  EXPECT_NE(listed.output.find("throwaway-imu"), std::string::npos) << listed.output;
  EXPECT_NE(listed.output.find("throwaway-node"), std::string::npos) << listed.output;
  EXPECT_EQ(run_program("imud", {"list"}).output.find("throwaway"), std::string::npos) << "the real one";
}

TEST_F(Extension, ATransportBringsTruthAndServesADevice) {
  const auto flight_computer = open_port("throwaway:" + path("imu"), Role::listener);
  start("native", "throwaway:" + path("imu"));
  Recording recording;
  const auto decoder = find_protocol("native")->make_decoder(Settings());
  const std::uint64_t samples = simulate(20, [&] {  // a Unix socket keeps no more than ten datagrams
    ASSERT_TRUE(wait_for(*flight_computer));
    decoder->feed(flight_computer->receive().value().frame, recording);
  });
  EXPECT_EQ(samples, 20U);
  ASSERT_EQ(recording.measurements.size(), 20U);
  for (const Measurement& measurement : recording.measurements)
    EXPECT_EQ(measurement.sample.rate, Vector3(0.5, -0.25, 0.125));
  EXPECT_EQ(flight_computer->receive(), std::nullopt);
  stop();
  EXPECT_EQ(summary()["imus"][0]["frames"], 20);
}

TEST_F(Extension, ATruthFormatBringsATable) {
  const std::string table =
      write("poses.txt", "0;1;0;0;0;0;0;0;1.5;-2.25;-9.75\n0.1;1;0;0;0;0;0;0;1.5;-2.25;-9.75\n");
  const std::string c = config("fast", "file:" + table, "throwaway-poses", 100, "csv", "file:" + path("imu.csv"));
  const ProgramResult done = run_program(IMUD_BIN_DIR "/tests/imud-extended", {"replay", c, table, "--fast"});
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  const auto sent = rows(read_file(path("imu.csv")));
  ASSERT_EQ(sent.size(), 11U);
  for (const auto& row : sent) {
    // Between two truths the force is a slope of the velocity's curve.
    EXPECT_NEAR(std::stod(row[5]), 1.5, 1e-12);
    EXPECT_NEAR(std::stod(row[6]), -2.25, 1e-12);
    EXPECT_NEAR(std::stod(row[7]), -9.75, 1e-12);
  }
}

TEST_F(Extension, ADeviceSendsAndAnswersOnItsLine) {
  const std::string port = "pty:" + path("imu");
  const ImuConfig imu =
      load_config(config("lockstep", "throwaway:" + path("truth"), "native", 100, "throwaway-imu", port)).imus[0];
  EXPECT_EQ(imu.port_settings.uart, (UartSettings{57'600, Parity::even, 1}));
  EXPECT_DOUBLE_EQ(line_load(imu).percent, 100.0 * 24 * 11 * 100 / 57'600);

  start("throwaway-imu", port);
  const FileDescriptor client = open_terminal(path("imu"));
  ASSERT_EQ(::write(client.get(), "?", 1), 1);
  EXPECT_EQ(simulate(20), 20U);
  Recording recording;
  const auto decoder = find_protocol("throwaway-imu")->make_decoder(Settings());
  std::size_t bytes = 0;
  while (bytes < 20 * 24 + 4) {
    const auto some = read_some(client.get(), 65536, static_cast<int>(Program::default_timeout.count()));
    ASSERT_FALSE(some.empty()) << bytes;
    bytes += some.size();
    decoder->feed({some}, recording);
  }
  decoder->finish(recording);
  ASSERT_EQ(recording.measurements.size(), 20U);
  for (const Measurement& measurement : recording.measurements)
    EXPECT_EQ(measurement.sample.rate, Vector3(0.5, -0.25, 0.125));
  EXPECT_EQ(decoder->errors().skipped_bytes, 4U) << "the answer";
  stop();
}

// A node on CAN that listens: it claims its address, answers requests, and refuses those that it cannot fulfil.
TEST_F(Extension, ANodeIsOneFileOverTheStack) {
  const Protocol& protocol = *find_protocol("throwaway-node");
  const auto device = protocol.make(Settings(protocol.settings));
  const auto frames = std::make_unique<FrameBuffer>();
  const auto sent = [&] {
    std::string text;
    for (const Frame& frame : frames->frames()) text += can_text(frame) + ' ';
    frames->clear();
    return text;
  };
  const auto answer = [&](std::string_view text) {
    each_frame(text, [&](const Frame& frame) { device->receive(frame, {}, *frames); });
    return sent();
  };
  device->poll({}, *frames);
  EXPECT_EQ(sent(), "18EEFF20#0100000000000080 ");
  device->sample({}, *frames);
  EXPECT_EQ(sent(), "0CF02A20#007D007D007D0000 ");
  EXPECT_EQ(answer("18EA2005#2AF000"), "0CF02A20#007D007D007D0000 ");
  EXPECT_EQ(answer("18EA2005#C5FD00"), "18E8FF20#01FFFFFF05C5FD00 ");
  EXPECT_EQ(answer("18EA2005#DAFE00"), "1CEC0520#10100003FFDAFE00 ");
  EXPECT_EQ(answer("1CEC2005#110303FFFFDAFE00"), "1CEB0520#03652AFFFFFFFFFF ");
  EXPECT_EQ(answer("18EEFF20#0000000000000000"), "18EEFF80#0100000000000080 ") << "a lower NAME";
  EXPECT_EQ(device->counts()[0], 1U);
}

TEST_F(Extension, ATableSendsItsMessages) {
  start("throwaway-can", "canfile:" + path("imu"));
  EXPECT_EQ(simulate(20), 20U);
  stop();
  const std::vector<std::string> lines = lines_of(read_file(path("imu")));
  ASSERT_EQ(lines.size(), 40U);
  EXPECT_TRUE(lines[0].ends_with(" 300#01F4FF06007D00")) << lines[0];
  EXPECT_TRUE(lines[38].ends_with(" 300#01F4FF06007D13")) << lines[38];
  EXPECT_NE(lines[39].find(" 301#"), std::string::npos) << lines[39];
}

// The filter of this program's ctest chooses them by name.
TEST_F(Extension, TheTestsOfAllDevicesRunOverThem) {
  const auto& all = *testing::UnitTest::GetInstance();
  const auto tests_of = [&](std::string_view device) {
    int tests = 0;
    for (int suite = 0; suite < all.total_test_suite_count(); ++suite)
      for (int i = 0; i < all.GetTestSuite(suite)->total_test_count(); ++i)
        tests += std::string_view(all.GetTestSuite(suite)->GetTestInfo(i)->name()).ends_with(device) ? 1 : 0;
    return tests;
  };
  EXPECT_GE(tests_of("/throwaway_imu"), 9);
  EXPECT_GE(tests_of("/throwaway_node"), 9) << "it has a host, too";
  EXPECT_GE(tests_of("/throwaway_can"), 6);
}

}  // namespace
}  // namespace imud
