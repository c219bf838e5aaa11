// `imud run --record` and `imud replay` of the record, by the programs; tshark opens what imud writes.
#include <algorithm>
#include <thread>

#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class RecordRunTest : public LiveTest {
 protected:
  // Two imus with errors, bytes and CAN, to files.
  std::string two_imus(const std::string& clock, const std::string& truth) const {
    return write("config.toml", fmt::format(R"(seed = 3
clock = "{}"
realtime.priority = 0
realtime.lock_memory = false
[truth]
{}
[[imu]]
name = "imu1"
rate_hz = 500
protocol = "native"
model = "stim300"
port = "file:{}"
[[imu]]
name = "imu2"
rate_hz = 100
protocol = "native-can"
port = "canfile:{}"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
)",
                                            clock, truth, path("out1"), path("out2")));
  }
  std::string record() const { return path("run.pcapng"); }
  // Returns the lines that tshark prints for a file.
  std::vector<std::string> packets(const std::string& file) const {
    const std::string command =
        "tshark -n -r '" + file + "' -T fields -e frame.interface_name 2> '" + path("tshark.err") + "'";
    FILE* pipe = ::popen(command.c_str(), "r");
    std::string text;
    std::array<char, 65536> buffer;
    for (std::size_t size = 0; (size = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
      text.append(buffer.data(), size);
    ::pclose(pipe);
    return lines_of(text);
  }
  // Without the times of arrival, which the text of a CAN log has not.
  std::string decoded(const std::string& protocol, const std::string& port) const {
    const ProgramResult result = run_program("imu-decode", {protocol, port});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    return result.output;
  }
};

TEST_F(RecordRunTest, ARecordOfACaptureIsWholeAndRepeatsTheBytes) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "5"}).exit_code,
            0);
  const std::string c = two_imus("fast", "format = \"csv\"");
  const auto first = run_program("imud", {"replay", c, path("truth.csv"), "--record", record(), "--summary",
                                          path("summary.json"), "--require", "record.lost=0"});
  ASSERT_EQ(first.exit_code, 0) << first.errors;
  const auto json = summary();
  EXPECT_EQ(json["record"]["lost"], 0);
  constexpr auto others = std::filesystem::perms::others_exec;
  EXPECT_EQ(std::filesystem::status(record()).permissions() & others, std::filesystem::perms::none);
  const std::vector<std::string> all = packets(record());
  EXPECT_EQ(read_file(path("tshark.err")).find("rror"), std::string::npos) << read_file(path("tshark.err"));
  EXPECT_EQ(all.size(), json["record"]["packets"].get<std::size_t>() + 2)
      << "with the event of the file's begin, and the configuration";
  EXPECT_EQ(std::count(all.begin(), all.end(), "imu1"), 2501);
  EXPECT_GT(std::count(all.begin(), all.end(), "truth"), 0);

  const std::string out1 = read_file(path("out1")), out2 = read_file(path("out2"));
  EXPECT_EQ(decoded("native", "record:" + record() + "?interface=imu1"), decoded("native", "file:" + path("out1")));
  EXPECT_EQ(decoded("native-can", "record:" + record() + "?interface=imu2"),
            decoded("native-can", "canfile:" + path("out2")));
  for (const char* file : {"out1", "out2"}) write(file, "");
  // The truth alone gives the same in this clock.
  for (const std::string& capture : {record(), "record:" + record()}) {
    const auto again = run_program("imud", {"replay", c, capture, "--fast"});
    EXPECT_EQ(again.exit_code, 0) << again.errors;
    EXPECT_TRUE(read_file(path("out1")) == out1) << capture;
    EXPECT_TRUE(read_file(path("out2")) == out2) << capture;
  }
}

// The last truths leave the fit when the capture has ended.
TEST_F(RecordRunTest, ARunOfDerivedTruthIsRepeatedToItsEnd) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "2"}).exit_code,
            0);
  const std::string c = two_imus("fast", "format = \"csv\"\nrate = \"derived\"\nspecific_force = \"derived\"");
  const auto first = run_program("imud", {"replay", c, path("truth.csv"), "--record", record()});
  ASSERT_EQ(first.exit_code, 0) << first.errors;
  const std::string out1 = read_file(path("out1"));
  EXPECT_GT(out1.size(), 50'000U);
  const auto again = run_program("imud", {"replay", c, record(), "--fast"});
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_TRUE(read_file(path("out1")) == out1);
}

TEST_F(RecordRunTest, ALiveRunIsRepeatedAndReadableAfterAKill) {
  const std::string c =
      two_imus("realtime", "port = \"" + simulator_.port() + "\"\ndelay_ms = 0\nextrapolate_ms = 20");
  Program imud("imud");
  start(imud, c, {"--record", record()});
  ASSERT_TRUE(imud.wait_for_errors(" ready"));
  std::uint32_t k = 0;
  const auto play = [&](int truths) {
    for (int i = 0; i < truths; ++i, ++k) {
      simulator_.send(Simulator::encode(Simulator::truth(10 * k, k, false)));
      std::this_thread::sleep_for(10ms);
    }
  };
  play(50);
  std::this_thread::sleep_for(100ms);
  k += 10;
  play(50);
  ASSERT_EQ(imud.stop(SIGTERM), 0) << imud.errors();
  const std::string out1 = read_file(path("out1")), out2 = read_file(path("out2"));
  EXPECT_GT(summary()["imus"][0]["held"], 10);
  EXPECT_EQ(packets(record()).size(), summary()["record"]["packets"].get<std::size_t>() + 2);
  const auto again = run_program("imud", {"replay", c, record(), "--fast"});
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_GT(out1.size(), 50'000U);
  EXPECT_TRUE(read_file(path("out1")) == out1);
  EXPECT_TRUE(read_file(path("out2")) == out2);

  Program killed("imud");
  start(killed, c, {"--record", record()});
  ASSERT_TRUE(killed.wait_for_errors(" ready"));
  play(50);
  EXPECT_TRUE(eventually([&] {
    const std::vector<std::string> now = packets(record());
    return std::count(now.begin(), now.end(), "truth") > 30 && read_file(path("out1")).size() > 10'000;
  }));
  killed.stop(SIGKILL);
  const std::vector<std::string> left = packets(record());
  EXPECT_GT(std::count(left.begin(), left.end(), "truth"), 30);
  const std::string left1 = read_file(path("out1"));
  const auto repeated = run_program("imud", {"replay", c, record(), "--fast"});
  EXPECT_EQ(repeated.exit_code, 3) << repeated.errors;
  EXPECT_NE(repeated.errors.find("the record has no end: its run was killed, or later files are missing"),
            std::string::npos)
      << repeated.errors;
  const std::string whole1 = read_file(path("out1"));
  const std::size_t both = std::min(whole1.size(), left1.size());
  EXPECT_GT(both, 10'000U);
  EXPECT_TRUE(whole1.substr(0, both) == left1.substr(0, both));
}

// `cat FILE-*.pcapng` makes one record of all files; it is not whole if one is missing or in another place.
TEST_F(RecordRunTest, AMissingFileIsNamed) {
  ASSERT_EQ(
      run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "40"}).exit_code, 0);
  const std::string c = two_imus("fast", "format = \"csv\"");
  const auto recorded =
      run_program("imud", {"replay", c, path("truth.csv"), "--record", record(), "--record-max-mb", "1"});
  ASSERT_EQ(recorded.exit_code, 0) << recorded.errors;
  const std::string out1 = read_file(path("out1"));
  std::vector<std::string> files;
  for (int i = 1; std::filesystem::exists(path(fmt::format("run-{:05}.pcapng", i))); ++i)
    files.push_back(read_file(path(fmt::format("run-{:05}.pcapng", i))));
  ASSERT_GE(files.size(), 3U);
  std::string all, but_second = files[0], but_last;
  for (std::size_t i = 0; i < files.size(); ++i) {
    all += files[i];
    if (i > 1) but_second += files[i];
    if (i + 1 < files.size()) but_last += files[i];
  }
  const auto repeat = [&](const std::string& bytes) {
    return run_program("imud", {"replay", c, write("joined.pcapng", bytes), "--fast"});
  };
  const ProgramResult whole = repeat(all);
  EXPECT_EQ(whole.exit_code, 0) << whole.errors;
  EXPECT_TRUE(read_file(path("out1")) == out1);
  const std::pair<std::string, std::string> wrong[] = {
      {but_second, "file 2 of the record is missing or out of order: file 3 comes in its place"},
      {but_last, "the record has no end: its run was killed, or later files are missing"},
      {files[0] + all, "a second run begins in the record"},
      {all + all, "a second run begins in the record"}};
  for (const auto& [bytes, words] : wrong) {
    const ProgramResult part = repeat(bytes);
    EXPECT_EQ(part.exit_code, 3) << words;
    EXPECT_NE(part.errors.find(words), std::string::npos) << part.errors;
  }
}

TEST_F(RecordRunTest, FilesRotateAndAFullDiskIsCounted) {
  ASSERT_EQ(
      run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "60"}).exit_code, 0);
  const std::string c = two_imus("fast", "format = \"csv\"");
  const std::vector<std::string> replay = {"replay",  c, path("truth.csv"), "--summary", path("summary.json"),
                                           "--record"};
  const auto with = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments = replay;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("imud", arguments);
  };
  const auto rotated = with({record(), "--record-max-mb", "1", "--record-files", "3"});
  ASSERT_EQ(rotated.exit_code, 0) << rotated.errors;
  const auto files = summary()["record"]["files"].get<int>();
  EXPECT_GT(files, 5);
  for (int i = 1; i <= files; ++i) {
    const std::string file = path(fmt::format("run-{:05}.pcapng", i));
    ASSERT_EQ(std::filesystem::exists(file), i > files - 3) << i;
    if (i <= files - 3) continue;
    EXPECT_LT(std::filesystem::file_size(file), 1'400'000U);
    EXPECT_GT(packets(file).size(), 5U);
  }
  const std::string last = path(fmt::format("run-{:05}.pcapng", files - 1));
  const auto refused = run_program("imud", {"replay", c, last});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.errors.find("from its beginning only"), std::string::npos) << refused.errors;

  // A piece that is read is not written over. A shorter record leaves no piece of the longer one behind.
  const std::string content = read_file(last);
  const auto onto_itself =
      run_program("imud", {"replay", c, "record:" + last, "--record", record(), "--record-max-mb", "1"});
  EXPECT_EQ(onto_itself.exit_code, 2);
  EXPECT_NE(onto_itself.errors.find(last + ": is the file of the truth; give another file"), std::string::npos)
      << onto_itself.errors;
  EXPECT_TRUE(read_file(last) == content);
  const std::string namesake = write("run-final.pcapng", "not a piece");
  EXPECT_EQ(with({record(), "--record-max-mb", "1000"}).exit_code, 0);
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder_))
    if (entry.path().filename().string().starts_with("run-")) left.push_back(entry.path().filename().string());
  std::ranges::sort(left);
  EXPECT_EQ(left, (std::vector<std::string>{"run-00001.pcapng", "run-final.pcapng"}));

  const std::string whole = read_file(path("out1"));
  const auto full = with({"/dev/full"});
  EXPECT_EQ(full.exit_code, 3);
  EXPECT_NE(full.errors.find("the record: No space left on device"), std::string::npos) << full.errors;
  EXPECT_GT(summary()["record"]["lost"], 30'000);
  EXPECT_TRUE(read_file(path("out1")) == whole) << "the run goes on";
}

}  // namespace
}  // namespace imud
