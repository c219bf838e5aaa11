#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/free_port.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/processor_time.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/tools/sample_stream.hpp"
#include "tests/transports/capture_builder.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

std::string file_with(const ScratchFolder& folder, const std::string& content) {
  capture::write_file(folder / "input", content);
  return "file:" + (folder / "input");
}

void send_to(const std::string& spec, std::string_view protocol, std::span<const Sample> samples) {
  const auto port = open_port(spec, Role::device);
  Line line(protocol_named(protocol));
  for (const Sample& sample : samples) port->send(line.encode(sample));
}

std::string free_port() { return fmt::format("udp:127.0.0.1:{}", free_udp_port()); }

TEST(ImuDecode, DecodesAFile) {
  const ScratchFolder folder;
  const auto samples = steady_samples(12001, 200);
  const auto result = run_program("imu-decode", {"native", file_with(folder, bytes_of("native", samples))});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.output, csv_of(samples));
  EXPECT_EQ(result.errors,
            "samples    12001 in 60.000 s\n"
            "rate       200.000 Hz (device clock)\n"
            "gaps       0 (0 samples missing)\n"
            "checksum   0 failures, 0 malformed, 0 incomplete, 0 bytes skipped\n");
}

TEST(ImuDecode, SaysWhyTheRateIsUnknown) {
  const ScratchFolder folder;
  const auto report_of = [&](const std::string& protocol, int samples) {
    return run_program("imu-decode", {protocol, file_with(folder, bytes_of(protocol, steady_samples(samples, 2000)))})
        .errors;
  };
  const std::string one = report_of("native", 1), without_time = report_of("stim300", 4000);
  EXPECT_TRUE(contains(one, "rate       unknown: too few samples with a time\n")) << one;
  EXPECT_TRUE(contains(without_time, "rate       unknown: neither the samples nor the input carry a time\n"))
      << without_time;
}

TEST(ImuDecode, ReportsGapsAndChecksumFailures) {
  const ScratchFolder folder;
  auto frames = frames_of("native", steady_samples(1000, 100));
  frames[100][50] = static_cast<char>(frames[100][50] ^ 1);
  frames[200].clear();
  frames[201].clear();
  std::string bytes = "noise";
  for (const std::string& frame : frames) bytes += frame;
  const auto result =
      run_program("imu-decode", {"native", file_with(folder, bytes), "--json", folder / "report.json", "--quiet"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.output, "");
  EXPECT_TRUE(contains(result.errors, "gaps       2 (3 samples missing)\n")) << result.errors;
  EXPECT_TRUE(contains(result.errors, "checksum   1 failure, 0 malformed, 0 incomplete, 129 bytes skipped\n"));

  const auto report = nlohmann::json::parse(read_file(folder / "report.json"));
  EXPECT_EQ(report["samples"], 997);
  EXPECT_EQ(report["gaps"], 2);
  EXPECT_EQ(report["missing"], 3);
  EXPECT_EQ(report["errors"]["checksum"], 1);
  EXPECT_EQ(report["errors"]["skipped_bytes"], 129);
  EXPECT_DOUBLE_EQ(report["duration_s"], 9.99);
  EXPECT_TRUE(report["rate_hz"]["arrival"].is_null());
  EXPECT_TRUE(report["jitter_us"].is_null());
  EXPECT_EQ(report["ended_by"], "end of input");
  EXPECT_EQ(report["protocol"], "native");
}

TEST(ImuDecode, LimitsThatAreRequiredDecideTheExitCode) {
  const ScratchFolder folder;
  auto frames = frames_of("native", steady_samples(1000, 100));
  frames[100][50] = static_cast<char>(frames[100][50] ^ 1);
  std::string bytes;
  for (const std::string& frame : frames) bytes += frame;
  const std::string file = file_with(folder, bytes);
  const auto with = [&](const std::string& limits) {
    return run_program("imu-decode",
                       {"native", file, "--quiet", "--json", folder / "report.json", "--require", limits});
  };
  EXPECT_EQ(with("samples=999,gaps<=1,missing<0.2%,checksum=1,malformed=0,rate_hz>99.8,rate_hz<100.2").exit_code, 0);
  const auto kept = nlohmann::json::parse(read_file(folder / "report.json"))["required"];
  ASSERT_EQ(kept.size(), 7U);
  for (const auto& limit : kept) EXPECT_EQ(limit["holds"], true) << limit;

  const auto broken = with("samples>=999,gaps=0");
  EXPECT_EQ(broken.exit_code, 3);
  EXPECT_TRUE(contains(broken.errors, "required   samples>=999: holds, 999\n")) << broken.errors;
  EXPECT_TRUE(contains(broken.errors, "required   gaps=0: VIOLATED, 1\n")) << broken.errors;
  const auto limits = nlohmann::json::parse(read_file(folder / "report.json"))["required"];
  EXPECT_EQ(limits.at(1), nlohmann::json::parse(R"({"limit": "gaps=0", "seen": 1.0, "holds": false})"));

  const auto unknown = with("jitter_p99_us<1000");  // files have no jitter
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_TRUE(contains(unknown.errors, "jitter_p99_us<1000: VIOLATED, unknown")) << unknown.errors;
}

TEST(ImuDecode, EmptyFieldsStayEmptyAndAreNotEvaluated) {
  const std::string header(measurement_csv_header);
  const std::string rows = ",,1,2,3,,,,,,,,,,,\n,,4,5,6,,,,,,,,,,,\n";
  const auto result = run_program("imu-decode", {"csv", "file:-"}, header + rows);
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.output, header + rows);
  EXPECT_TRUE(contains(result.errors, "samples    2")) << result.errors;
  EXPECT_TRUE(contains(result.errors, "gaps       unknown")) << result.errors;
  EXPECT_TRUE(contains(result.errors, "checksum   none in this protocol, 0 malformed")) << result.errors;
}

// A capture that was cut short: the last frame is incomplete, or the last line has no line feed.
TEST(ImuDecode, AnIncompleteEndOfTheInputIsCounted) {
  const ScratchFolder folder;
  const std::string bytes = bytes_of("native", steady_samples(10, 100));
  const auto cut = run_program("imu-decode", {"native", file_with(folder, bytes.substr(0, bytes.size() - 50))});
  EXPECT_EQ(cut.exit_code, 0);
  EXPECT_TRUE(contains(cut.errors, "samples    9 in ")) << cut.errors;
  EXPECT_TRUE(contains(cut.errors, " 0 malformed, 0 incomplete, 74 bytes skipped\n")) << cut.errors;

  const std::string csv = csv_of(steady_samples(2, 100));
  const auto without_end = run_program("imu-decode", {"csv", "file:-"}, csv.substr(0, csv.size() - 1));
  EXPECT_EQ(without_end.exit_code, 0);
  EXPECT_EQ(without_end.output, csv_of(steady_samples(1, 100))) << "its last number may lack digits";
  EXPECT_TRUE(contains(without_end.errors, " 1 malformed")) << without_end.errors;
}

TEST(ImuDecode, EndsAfterCount) {
  const ScratchFolder folder;
  const auto samples = steady_samples(100, 100);
  const auto result = run_program(
      "imu-decode", {"native", file_with(folder, bytes_of("native", samples)), "--count", "7", "--json", "-"});
  EXPECT_EQ(result.exit_code, 0);
  const std::string csv = csv_of(std::span(samples).first(7));
  ASSERT_TRUE(result.output.starts_with(csv));
  EXPECT_EQ(nlohmann::json::parse(result.output.substr(csv.size()))["ended_by"], "count");
}

// The datagrams arrive while it cannot read; SIGINT comes before it can.
TEST(ImuDecode, WhatHasArrivedBeforeASignalIsDecoded) {
  const std::string spec = free_port();
  const auto samples = steady_samples(500, 100);
  Program decode("imu-decode");
  decode.start({"native", spec, "--require", "samples=500,gaps=0"});
  ASSERT_TRUE(decode.wait_for_output("status\n"));
  decode.kill(SIGSTOP);
  send_to(spec, "native", samples);
  decode.kill(SIGINT);
  decode.kill(SIGCONT);
  EXPECT_EQ(decode.wait(), 0) << decode.errors();
  EXPECT_EQ(decode.output(), csv_of(samples));
}

TEST(ImuDecode, TheReportDoesNotReplaceTheInput) {
  const ScratchFolder folder;
  const std::string port = file_with(folder, bytes_of("native", steady_samples(50, 100)));
  const std::string path = port.substr(port.find(':') + 1);
  EXPECT_EQ(run_program("imu-decode", {"native", port, "--json", path}).exit_code, 2);
  EXPECT_EQ(read_file(path).size(), 50U * 124U);
}

TEST(ImuDecode, AFileDescriptorIsWrittenToWhenThePortIsOpen) {
  const ScratchFolder folder;
  const auto decode = [](const std::string& port) {
    return run_program("/bin/sh", {"-c", IMUD_BIN_DIR "/imu-decode native " + port + " --for 0.1 --ready-fd 3 3>&1"});
  };
  EXPECT_TRUE(decode(free_port()).output.starts_with("ready\ntime_ns,"));
  EXPECT_EQ(decode("file:" + folder / "none").output, "");
  EXPECT_EQ(run_program("imu-decode", {"native", free_port(), "--ready-fd", "1000"}).exit_code, 2);
}

TEST(ImuDecode, ARowIsWrittenAtOnceAndASignalEndsIt) {
  const ScratchFolder folder;
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string spec = free_port();
    const auto samples = steady_samples(50, 100);
    Program decode("imu-decode");
    decode.start({"native", spec, "--json", folder / "report.json"});
    ASSERT_TRUE(decode.wait_for_output("status\n"));  // it receives
    send_to(spec, "native", samples);
    EXPECT_TRUE(decode.wait_for_output("\n490000000,49,"));
    EXPECT_TRUE(decode.is_running());
    EXPECT_EQ(decode.stop(signal), 0);
    EXPECT_EQ(decode.output(), csv_of(samples));
    EXPECT_TRUE(contains(decode.errors(), "(arrival against a fitted line)")) << decode.errors();
    const auto report = nlohmann::json::parse(read_file(folder / "report.json"));
    EXPECT_EQ(report["ended_by"], "signal");
    EXPECT_GT(report["rate_hz"]["arrival"], 0);
    EXPECT_GE(report["jitter_us"]["max"], report["jitter_us"]["p50"]);
  }
}

TEST(ImuDecode, EndsAfterItsTime) {
  const auto result = run_program("imu-decode", {"native", free_port(), "--for", "0.2"});
  EXPECT_EQ(result.exit_code, 1);  // nothing was received
  EXPECT_TRUE(contains(result.errors, "no sample was decoded")) << result.errors;
  EXPECT_EQ(result.output, measurement_csv_header);
}

TEST(ImuDecode, WaitsWithoutSpinning) {
  const ScratchFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  Program decode("imu-decode");
  decode.start({"native", "file:" + (folder / "fifo"), "--quiet"});
  const auto processor_time = [&] { return processor_time_s(fmt::format("/proc/{}/stat", decode.pid())); };
  // Once it has started, which takes a sanitized program on a busy machine a while.
  EXPECT_TRUE(eventually([&] {
    const double before = processor_time();
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    return processor_time() - before < 0.025;  // in steps of 10 ms
  }));

  const auto samples = steady_samples(10, 100);
  std::ofstream(folder / "fifo", std::ios::binary) << bytes_of("native", samples);
  EXPECT_EQ(decode.wait(), 0);
  EXPECT_TRUE(contains(decode.errors(), "samples    10")) << decode.errors();
}

TEST(ImuDecode, ClosedOutputEndsItWell) {
  const ScratchFolder folder;
  Program decode("imu-decode");
  decode.start({"native", file_with(folder, bytes_of("native", steady_samples(100'000, 1000))), "--json",
                folder / "report.json"});
  EXPECT_TRUE(decode.wait_for_output("\n0,0,"));
  decode.close_output();
  EXPECT_EQ(decode.wait(), 0);
  EXPECT_TRUE(contains(decode.errors(), "samples    ")) << decode.errors();
}

TEST(ImuDecode, PtyEndsWithItsDevice) {
  const ScratchFolder folder;
  const auto samples = steady_samples(20, 100);
  auto device = open_port("pty:" + (folder / "imu"), Role::device);
  Program decode("imu-decode");
  decode.start({"native", "pty:" + (folder / "imu")});
  ASSERT_TRUE(decode.wait_for_output("status\n"));
  Line line(protocol_named("native"));
  for (const Sample& sample : samples) device->send(line.encode(sample));
  EXPECT_TRUE(decode.wait_for_output("\n190000000,19,"));
  device.reset();
  EXPECT_EQ(decode.wait(), 0);
  EXPECT_EQ(decode.output(), csv_of(samples));
}

// A capture has arrival times of its own: one datagram in fifty is 2 ms late.
TEST(ImuDecode, CaptureHasJitter) {
  const ScratchFolder folder;
  const capture::Format format;
  std::string bytes = capture::file_header(format, 1);
  const auto frames = frames_of("native", steady_samples(1000, 100));
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const std::int64_t ns =
        1'700'000'000'000'000'000 + static_cast<std::int64_t>(k) * 10'000'000 + (k % 50 == 25 ? 2'000'000 : 0);
    bytes +=
        capture::file_record(format, {ns, capture::ethernet(0x0800, capture::ipv4(capture::udp(frames[k], 7777)))});
  }
  capture::write_file(folder / "imu.pcap", bytes);
  const auto result = run_program("imu-decode", {"native", "pcap:" + (folder / "imu.pcap") + "?port=7777", "--quiet",
                                                 "--json", folder / "report.json"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_TRUE(contains(result.errors, "rate       100.000 Hz (device clock), 100.000 Hz (arrival)\n"))
      << result.errors;
  const auto report = nlohmann::json::parse(read_file(folder / "report.json"));
  EXPECT_NEAR(report["jitter_us"]["p50"], 40, 4);
  EXPECT_NEAR(report["jitter_us"]["max"], 1960, 10);
}

TEST(ImuDecode, WrongCommandLineIsReported) {
  const ScratchFolder folder;
  const std::string file = file_with(folder, "");
  const struct {
    std::vector<std::string> arguments;
    std::string_view message;
  } cases[] = {
      {{}, "PROTOCOL"},
      {{"native"}, "PORT"},
      {{"nativ", file}, "there is no protocol 'nativ'; did you mean 'native'? --help lists all\n"},
      {{"vn-200", file}, "vn-200 is a product of the protocol vectornav; give vectornav file:"},
      {{"native", "nonsense"}, "no scheme"},
      {{"native", "floppy:a"}, "there is no transport 'floppy'"},
      {{"native", "can:can0"}, "native needs a port for bytes; can: carries CAN frames"},
      {{"native-can", file}, "native-can needs a CAN port; file: carries bytes"},
      {{"native", "file:/does/not/exist"}, "cannot read it"},
      {{"native", file, "--json", "/does/not/exist"}, "cannot write it"},
      {{"native", file, "--set", "fd=true"}, "fd"},
      {{"native", file, "--set", "fd"}, "right would be --set KEY=VALUE"},
      {{"native-can", "can:can0", "--set", "can_id=maybe"}, "can_id"},
      {{"native", file, "--frame-file", "um7"}, "--frame-file is for protocol frame: native has no description"},
      {{"native", file, "--for", "nan"}, "--for"},
      {{"native", file, "--count", "0"}, "--count"},
      {{"native", file, "--require", "gap=0"}, "there is no figure gap; there are samples, gaps, missing, checksum"},
      {{"native", file, "--require", "gaps"}, "right would be FIGURE>=NUMBER"},
      {{"native", file, "--colour"}, "--colour"},
  };
  for (const auto& [arguments, message] : cases) {
    const auto result = run_program("imu-decode", arguments);
    EXPECT_EQ(result.exit_code, 2) << message;
    EXPECT_TRUE(contains(result.errors, message)) << result.errors << "\nlacks: " << message;
    EXPECT_EQ(result.output, "");
  }
}

TEST(ImuDecode, HelpAndVersion) {
  const auto help = run_program("imu-decode", {"--help"});
  EXPECT_EQ(help.exit_code, 0);
  for (const Protocol* protocol : protocols()) EXPECT_TRUE(contains(help.output, protocol->name));
  for (const Transport* transport : transports()) EXPECT_TRUE(contains(help.output, transport->syntax));
  const auto version = run_program("imu-decode", {"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_TRUE(version.output.starts_with("imu-decode ")) << version.output;
}

}  // namespace
}  // namespace imud
