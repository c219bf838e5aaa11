// The log: its levels, the form of its lines, and the progress of a replay.
#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <regex>

#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class LogTest : public RunTest {
 protected:
  // Returns the arguments of a replay of 30,000 truths, of which one is damaged.
  std::vector<std::string> replay(const std::vector<std::string>& more, const std::string& clock = "fast") const {
    const std::string capture = path("truth.csv");
    EXPECT_EQ(run_program("imu-truth", {"spiral", "--csv", capture, "--rate", "1000", "--for", "30"}).exit_code, 0);
    std::ofstream(capture, std::ios::app) << "damaged\n";
    std::vector<std::string> arguments = {
        "replay", config(clock, "file:" + capture, "csv", 100, "native", "file:" + path("out")), capture};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  // Returns the log of such a replay.
  std::vector<std::string> log(const std::vector<std::string>& more) const {
    return lines_of(run_program("imud", replay(more)).errors);
  }
  static bool any_contains(const std::vector<std::string>& lines, std::string_view text) {
    return std::ranges::any_of(lines, [&](const std::string& line) { return contains(line, text); });
  }
};

TEST_F(LogTest, EachLineHasItsDateAndLevel) {
  const std::vector<std::string> lines = log({});
  ASSERT_GE(lines.size(), 3U);
  for (const std::string& line : lines)
    EXPECT_TRUE(std::regex_match(
        line, std::regex(R"(20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d (info|warning|error) \S.*)")))
        << line;
  EXPECT_TRUE(any_contains(lines, " info ready"));
  EXPECT_TRUE(any_contains(lines, " error incomplete: "));
}

TEST_F(LogTest, QuietAndVerbose) {
  for (const char* quiet : {"-q", "--quiet"}) {
    const std::vector<std::string> lines = log({quiet});
    ASSERT_GE(lines.size(), 2U);
    for (const std::string& line : lines)
      EXPECT_TRUE(contains(line, " warning ") || contains(line, " error ")) << line;
  }
  const std::vector<std::string> lines = log({"-v"});
  EXPECT_TRUE(any_contains(lines, " debug truth: csv from file:"));
  EXPECT_TRUE(any_contains(lines, " debug imu1: native at 100 Hz to file:"));
  EXPECT_TRUE(any_contains(lines, " info ready"));
  EXPECT_FALSE(any_contains(log({}), " debug "));
  EXPECT_EQ(run_program("imud", {"run", "-q", "-v", path("config.toml")}).exit_code, 2);
}

// As a terminal after Ctrl-S, or a pager that nobody scrolls.
TEST_F(LogTest, AReaderThatTakesNothingDoesNotHoldTheRunUp) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK), 0);
  const FileDescriptor reader(ends[0]), writer(ends[1]);
  const std::string filling(4096, 'x');
  while (::write(writer.get(), filling.data(), filling.size()) > 0) continue;
  const std::string file = config("realtime", "udp:127.0.0.1:0", "native", 100, "native", "file:" + path("out"));
  Program imud("/bin/sh");
  imud.start({"-c", fmt::format("exec {}/imud run {} --set control.socket=none --log-every 0.1 --for 3 --summary {} "
                                "2> /proc/{}/fd/{}",
                                IMUD_BIN_DIR, file, path("summary.json"), ::getpid(), writer.get())});
  ASSERT_TRUE(eventually([&] { return !read_file(path("summary.json")).empty(); })) << "the run does not begin";
  std::string text, piece(4096, ' ');
  const auto is_reported = [&] {
    for (ssize_t size = 0; (size = ::read(reader.get(), piece.data(), piece.size())) > 0;)
      text.append(piece, 0, static_cast<std::size_t>(size));
    return contains(text, " lines of the log were lost: its reader has taken none");
  };
  EXPECT_TRUE(eventually(is_reported)) << text.substr(text.find_last_of('x') + 1);
  EXPECT_EQ(imud.wait(), 0);
}

// tests/service/service_test.py has the entries with fields.
TEST_F(LogTest, TheJournalGetsPriorities) {
  log({});
  // With a /run of its own: a journal of this machine would get the lines.
  std::vector<std::string> without_journal = {"--mount", "sh", "-c"};
  if (::geteuid() != 0) without_journal.insert(without_journal.begin(), "--map-root-user");
  const std::string imud = IMUD_BIN_DIR "/imud replay " + path("config.toml") + " " + path("truth.csv");
  for (const bool is_journal : {true, false}) {
    const std::string stream = is_journal ? "$(stat -L -c %d:%i /proc/self/fd/2)" : "1:2";
    std::vector<std::string> words = without_journal;
    words.push_back("mount -t tmpfs tmpfs /run && JOURNAL_STREAM=" + stream + " exec " + imud);
    const ProgramResult result = run_program("/usr/bin/unshare", words);
    EXPECT_EQ(result.exit_code, 3);
    const std::vector<std::string> lines = lines_of(result.errors);
    EXPECT_EQ(any_contains(lines, "<6>ready"), is_journal) << result.errors;
    EXPECT_EQ(any_contains(lines, "<4>truth refused"), is_journal) << result.errors;
    EXPECT_EQ(any_contains(lines, "<3>incomplete: "), is_journal) << result.errors;
    ASSERT_GE(lines.size(), 3U);
    for (const std::string& line : lines)
      EXPECT_EQ(std::regex_match(line, std::regex("<[346]>[^0-9].*")), is_journal) << line;
  }
}

TEST_F(LogTest, ALongReplayReportsItsProgress) {
  Program imud("imud");
  imud.start(replay({"--log-every", "0.2"}, "realtime"));
  struct Report {
    double percent, left_s;
  };
  std::vector<Report> reports;
  const bool are_some = eventually([&] {
    reports.clear();
    for (const std::string& line : lines_of(imud.errors())) {
      std::smatch found;
      if (std::regex_search(line, found, std::regex(R"( (\d+) % of the capture, (\d+) s left; truth )")))
        reports.push_back({std::stod(found[1]), std::stod(found[2])});
    }
    return reports.size() > 3 && reports.back().percent > 4;
  });
  imud.stop();
  ASSERT_TRUE(are_some) << imud.errors();
  for (std::size_t i = 1; i < reports.size(); ++i) EXPECT_GE(reports[i].percent, reports[i - 1].percent);
  EXPECT_GT(reports.front().left_s, 1);
  EXPECT_LT(reports.front().percent, 60);
}

}  // namespace
}  // namespace imud
