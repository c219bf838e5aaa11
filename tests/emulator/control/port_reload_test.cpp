// A reload gives a running imu another port: all frames before the named sample go to the old one, all others to the
// new one, and a port that cannot be opened changes nothing.
#include <fcntl.h>

#include "tests/emulator/control/control_client.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/raw_terminal.hpp"
#include "tests/support/text.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

using nlohmann::json;

// A reader of a pty. It stays when its pty goes.
class Reader {
 public:
  explicit Reader(const std::string& link) : tty_(::open(link.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {}
  explicit operator bool() const { return static_cast<bool>(tty_); }
  // Returns all that has come so far.
  const std::string& text() {
    char bytes[4096];
    for (ssize_t n = 0; (n = ::read(tty_.get(), bytes, sizeof bytes)) > 0;)
      text_.append(bytes, static_cast<std::size_t>(n));
    return text_;
  }

 private:
  FileDescriptor tty_;
  std::string text_;
};

constexpr int last_truth = 6;  // 10 ms apart
constexpr int all_samples = 10 * last_truth + 1;

class PortReloadTest : public LiveTest {
 protected:
  // Two imus at 1 kHz with white noise, with these ports in the folder of the test. `more` stands in each.
  std::string text(const std::string& first, const std::string& second = "file:{}/out2",
                   const std::string& more = {}) const {
    std::string all = fmt::format("clock = \"lockstep\"\n[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n",
                                  path("socket"), simulator_.port());
    for (const int i : {1, 2})
      all += fmt::format(
          "[[imu]]\nname = \"imu{}\"\nrate_hz = 1000\nprotocol = \"csv\"\nport = \"{}\"\ngyro.max_rad_per_s = 100\n"
          "gyro.angle_random_walk_deg_per_rt_hr = 0.5\naccelerometer.max_m_per_s2 = 1000\n{}",
          i, fmt::format(fmt::runtime(i == 1 ? first : second), folder_), more);
    return all;
  }
  std::string config(const std::string& content) const { return write("config.toml", content); }
  // Plays truths at 10 ms steps; `at[i]` is called when the truth of 10 i ms has been answered, at[-1] before the
  // first. `each` is called after each of them.
  using Script = std::map<int, std::function<void(ControlClient&)>>;
  void play(
      const std::string& content, const Script& at, const std::vector<std::string>& more = {},
      const std::function<void()>& each = [] {}) {
    Program imud("imud");
    start(imud, config(content), more);
    ControlClient client(path("socket"));
    if (at.contains(-1)) at.at(-1)(client);
    for (int i = 0; i <= last_truth; ++i) {
      EXPECT_TRUE(simulator_.exchange(Simulator::truth(10 * i, static_cast<std::uint32_t>(i), true)));
      each();
      if (const auto action = at.find(i); action != at.end()) action->second(client);
    }
    status_ = client.call("status")["result"];
    client.call("quit");
    EXPECT_EQ(imud.wait(), 0) << imud.errors();
    log_ = imud.errors();
  }
  std::string file(const std::string& name) const { return read_file(path(name)); }
  static std::string message(const json& answer) {
    return answer.contains("error") ? answer["error"]["message"].get<std::string>() : answer.dump();
  }
  json reload(ControlClient& client, const std::string& content) const {
    config(content);
    return client.call("reload");
  }
  // The numbers of the samples in measurement CSV.
  static std::vector<int> samples(const std::string& csv) {
    std::vector<int> all;
    for (const auto& row : rows(csv)) all.push_back(std::stoi(row[1]));
    return all;
  }
  static std::vector<int> from_to(int first, int end) {
    std::vector<int> all;
    for (int k = first; k < end; ++k) all.push_back(k);
    return all;
  }
  json imu(std::size_t i) const { return summary()["imus"][i]; }
  json status_;
  std::string log_;
};

TEST_F(PortReloadTest, FramesGoToTheOtherPortFromTheSampleThatItAnswers) {
  play(text("file:{}/out1"), {});
  const std::string plain = file("out1"), second = file("out2");
  ASSERT_EQ(samples(plain), from_to(0, all_samples));
  const json before = imu(0);
  play(text("file:{}/out1"), {{2, [&](ControlClient& client) {
                                 const json answer = reload(client, text("file:{}/other"));
                                 ASSERT_TRUE(answer.contains("result")) << answer;
                                 EXPECT_EQ(answer["result"]["applied"][0]["sample"], 21);
                                 ASSERT_EQ(answer["result"]["changed"].size(), 1U) << answer;
                                 EXPECT_EQ(answer["result"]["changed"][0]["key"], "imu.imu1.port");
                                 // The old port is closed, with all that it has got.
                                 EXPECT_EQ(samples(file("out1")), from_to(0, 21));
                               }}});
  EXPECT_EQ(samples(file("out1")), from_to(0, 21));
  EXPECT_EQ(file("out1") + file("other"), plain);
  EXPECT_EQ(file("out2"), second);
  for (const char* figure : {"samples", "frames", "dropped", "failed"})
    EXPECT_EQ(imu(0)[figure], before[figure]) << figure;
  EXPECT_TRUE(contains(status_["imus"][0]["port"].get<std::string>(), "/other"));
  EXPECT_TRUE(contains(log_, fmt::format("imu1: port file:{0}/out1 -> file:{0}/other from sample 21", folder_)))
      << log_;
  EXPECT_FALSE(contains(log_, "imu2: port")) << log_;
}

TEST_F(PortReloadTest, APortThatCannotBeOpenedChangesNothing) {
  play(text("file:{}/out1"), {});
  const std::string plain = file("out1"), second = file("out2");
  const auto is_refused = [&](const std::string& first_port, const std::string& second_port) {
    const std::string wrong = text(first_port, second_port);
    std::string why;
    play(text("file:{}/out1"), {{2, [&](ControlClient& client) {
                                   why = message(reload(client, wrong));
                                   EXPECT_FALSE(std::filesystem::is_symlink(path("link")));
                                   const std::string now = client.call("status")["result"]["imus"][0]["port"];
                                   EXPECT_TRUE(now.ends_with("/out1")) << now;
                                   config(text("file:{}/out1"));
                                   EXPECT_TRUE(client.call("reload")["result"]["changed"].empty());
                                 }}});
    EXPECT_EQ(file("out1"), plain);
    EXPECT_EQ(file("out2"), second);
    EXPECT_TRUE(contains(why, "reload refused, nothing has changed")) << why;
    // A start names the same cause.
    const auto start = run_program("imud", {"run", config(wrong)});
    EXPECT_EQ(start.exit_code, 2);
    EXPECT_TRUE(contains(start.errors, why.substr(why.rfind(": ", why.rfind(": ") - 1) + 2))) << start.errors << why;
    return why;
  };
  write("taken", "a file");
  std::string why = is_refused("pty:{}/link", "serial:{}/none?baud=4000000");
  EXPECT_TRUE(contains(why, "imu.imu2.port: serial:")) << why;
  why = is_refused("pty:{}/link", "pty:{}/taken");
  EXPECT_TRUE(contains(why, "imu.imu2.port: pty:")) << why;
  EXPECT_EQ(file("taken"), "a file");
  why = is_refused("pty:{}/link", "file:{}/config.toml");
  EXPECT_TRUE(contains(why, "is the file of the configuration")) << why;
}

// A file that would be emptied is not opened if another port cannot be.
TEST_F(PortReloadTest, ARefusedReloadEmptiesNoFile) {
  write("old", "kept");
  play(text("file:{}/out1"), {{2, [&](ControlClient& client) {
                                 const std::string why =
                                     message(reload(client, text("file:{}/old", "serial:{}/none?baud=4000000")));
                                 EXPECT_TRUE(contains(why, "imu.imu2.port")) << why;
                               }}});
  EXPECT_EQ(file("old"), "kept");
}

TEST_F(PortReloadTest, AnAddressThatIsOpenIsRefused) {
  const auto refusal = [&](const std::string& first, const std::string& second,
                           const std::vector<std::string>& more = {}) {
    std::string why;
    play(text("pty:{}/link?baud=4000000"),
         {{2, [&](ControlClient& client) { why = message(reload(client, text(first, second))); }}}, more);
    EXPECT_EQ(samples(file("out2")), from_to(0, all_samples));
    return why;
  };
  std::string why = refusal("file:{}/out2", "file:{}/out3");  // before imu2 has left it
  EXPECT_TRUE(contains(why, "out2 is open already, as imu.imu2.port")) << why;
  why = refusal("file:{}/out2", "pty:{}/link?baud=4000000");  // exchanged
  EXPECT_TRUE(contains(why, "as imu.imu2.port") && contains(why, "as imu.imu1.port")) << why;
  why = refusal("pty:{}/link?baud=3000000", "file:{}/out2");  // other options
  EXPECT_TRUE(contains(why, "link?baud=3000000 is open already, as imu.imu1.port")) << why;
  why = refusal("file:{}/out2", "file:{}/out2");
  EXPECT_TRUE(contains(why, "the same as imu.0")) << why;
  why = refusal("file:{}/run.pcapng", "file:{}/out2", {"--record", path("run.pcapng")});
  EXPECT_TRUE(contains(why, "run.pcapng: is the file of imu.0.port; give another")) << why;
}

// The reader of the old pty has all frames before the sample, then the link goes. The reader of the pty that does not
// change has the same connection for the whole run.
TEST_F(PortReloadTest, APtyLeavesWhenItsReaderHasReadAll) {
  std::optional<Reader> leaving, staying;
  const auto read = [&] {
    leaving->text();
    staying->text();
  };
  play(text("pty:{}/one", "pty:{}/two"),
       {{-1,
         [&](ControlClient&) {
           leaving.emplace(path("one"));
           staying.emplace(path("two"));
           ASSERT_TRUE(*leaving && *staying);
         }},
        {2,
         [&](ControlClient& client) {
           ASSERT_TRUE(
               reload(client, text("file:{}/later", "pty:{}/two", "gyro.bias_rad_per_s = 0.1\n")).contains("result"));
           EXPECT_TRUE(eventually([&] { return !std::filesystem::is_symlink(path("one")); }));
           EXPECT_TRUE(std::filesystem::is_symlink(path("two")));
         }}},
       {}, read);
  EXPECT_TRUE(eventually([&] { return samples(staying->text()).size() == all_samples; }));
  EXPECT_EQ(samples(staying->text()), from_to(0, all_samples));
  EXPECT_EQ(samples(leaving->text()), from_to(0, 21));
  EXPECT_EQ(samples(file("later")), from_to(21, all_samples));
  EXPECT_EQ(imu(0)["frames"], all_samples + 1);  // with the header
  EXPECT_EQ(imu(0)["dropped"], 0);
}

// Nobody has read the last frames: the reader can, until the link goes two seconds later, and meanwhile the address
// cannot be opened again.
TEST_F(PortReloadTest, APtyWaitsForItsReader) {
  std::optional<Reader> reader;
  bool reads = false;
  play(text("pty:{}/one"),
       {{-1, [&](ControlClient&) { reader.emplace(path("one")); }},
        {0,
         [&](ControlClient& client) {
           ASSERT_TRUE(reload(client, text("file:{}/later")).contains("result"));
           const std::string why = message(reload(client, text("pty:{}/one")));
           EXPECT_TRUE(contains(why, "still being closed")) << why;
           const std::string spelt_otherwise = message(reload(client, text("pty:{}/./one")));
           EXPECT_TRUE(contains(spelt_otherwise, "still being closed")) << spelt_otherwise;
           EXPECT_TRUE(std::filesystem::is_symlink(path("one")));
           EXPECT_EQ(samples(reader->text()), from_to(0, 1));
           EXPECT_TRUE(eventually([&] { return !std::filesystem::is_symlink(path("one")); }));
           EXPECT_TRUE(reload(client, text("pty:{}/one")).contains("result"));
           reader.emplace(path("one"));
           reads = true;
         }}},
       {}, [&] {
         if (reads) reader->text();
       });
  EXPECT_TRUE(eventually([&] { return samples(reader->text()).size() == all_samples - 1; }));
  EXPECT_EQ(samples(reader->text()), from_to(1, all_samples));
  EXPECT_EQ(file("later"), "");
}

TEST_F(PortReloadTest, ARecordRepeatsTheBytes) {
  const std::string noise = "gyro.bias_instability_deg_per_hr = 100\n";
  play(text("file:{}/out1", "file:{}/out2", noise),
       {{1, [&](ControlClient& client) { reload(client, text("file:{}/other", "file:{}/out2", noise)); }},
        {3,
         [&](ControlClient& client) {
           reload(client, text("pty:{}/nobody", "file:{}/out2", noise + "gyro.bias_rad_per_s = 0.1\n"));
         }},
        {4,
         [&](ControlClient& client) {
           reload(client, text("file:{}/last", "file:{}/other2", noise + "gyro.bias_rad_per_s = 0.1\n"));
         }}},
       {"--record", path("run.pcapng")});
  const std::string first = file("out1") + file("other"), last = file("last"), second = file("out2") + file("other2");
  EXPECT_EQ(samples(first), from_to(0, 31));
  EXPECT_EQ(samples(last), from_to(41, all_samples));
  EXPECT_EQ(samples(second), from_to(0, all_samples));
  const auto again = run_program(
      "imud", {"replay", config(text("file:{}/out1", "file:{}/out2", noise)), path("run.pcapng"), "--fast"});
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_FALSE(contains(again.errors, "imu1: port")) << again.errors;
  const std::string all = file("out1");
  EXPECT_EQ(samples(all), from_to(0, all_samples));
  EXPECT_TRUE(all.starts_with(first) && all.ends_with(last));
  EXPECT_EQ(file("out2"), second);
}

// With faults of the wire: while the cable is out, the new pty has no link.
TEST_F(PortReloadTest, CountersAndFaultsGoOn) {
  const auto with_faults = [&](const std::string& port) {
    std::string all = text(port);
    return all.insert(all.find("[truth]"), "faults = true\n");
  };
  play(with_faults("file:{}/out1"),
       {{1,
         [&](ControlClient& client) {
           const json answer =
               client.call("fault.begin", {{"imu", "imu1"}, {"target", "wire"}, {"kind", "disconnect"}});
           EXPECT_TRUE(answer.contains("result")) << answer;
         }},
        {2,
         [&](ControlClient& client) {
           EXPECT_TRUE(reload(client, with_faults("pty:{}/unplugged")).contains("result"));
           EXPECT_FALSE(std::filesystem::is_symlink(path("unplugged")));
         }},
        {3, [&](ControlClient& client) { EXPECT_TRUE(client.call("fault.clear").contains("result")); }},
        {4, [&](ControlClient& client) {
           EXPECT_TRUE(std::filesystem::is_symlink(path("unplugged")));
           EXPECT_TRUE(reload(client, with_faults("file:{}/other")).contains("result"));
           EXPECT_FALSE(std::filesystem::is_symlink(path("unplugged")));
         }}});
  EXPECT_EQ(samples(file("out1")), from_to(0, 11));
  EXPECT_EQ(samples(file("other")), from_to(41, all_samples));
  EXPECT_EQ(imu(0)["frames"], all_samples + 1 - 30);
  EXPECT_EQ(imu(0)["dropped"], 30);
}

// Frames in the queue of a slow line leave by its old port. The sum of all counters is the number of frames.
TEST_F(PortReloadTest, ASlowLineSendsWhatItHolds) {
  const auto slow = [&](const std::string& port, const std::string& pace) {
    return fmt::format(
        "clock = \"realtime\"\nrealtime.priority = 0\nrealtime.lock_memory = false\n[control]\nsocket = \"{}\"\n"
        "[truth]\nport = \"{}\"\ndelay_ms = 0\n[[imu]]\nname = \"imu1\"\nrate_hz = 20\nprotocol = \"csv\"\n"
        "before_first = \"rest\"\nport = \"{}\"\n{}gyro.angle_random_walk_deg_per_rt_hr = 0.5\n"
        "accelerometer.velocity_random_walk_m_per_s_per_rt_hr = 0.5\ngyro.max_rad_per_s = "
        "100\naccelerometer.max_m_per_s2 = 1000\n",
        path("socket"), simulator_.port(), port, pace);
  };
  Program imud("imud");
  start(imud, config(slow("pty:" + path("one") + "?baud=53000", "pace = \"line\"\n")));
  ControlClient client(path("socket"));
  Reader reader(path("one"));
  ASSERT_TRUE(reader);
  ASSERT_TRUE(eventually([&] { return count(reader.text(), "\n") > 5; }));
  const std::string why = message(reload(client, slow("pty:" + path("one") + "?baud=53000", "")));
  EXPECT_TRUE(contains(why, "pace: can change only together with the port")) << why;
  const json answer = reload(client, slow("file:" + path("out"), ""));
  ASSERT_TRUE(answer.contains("result")) << answer;
  const int first = answer["result"]["applied"][0]["sample"];
  EXPECT_TRUE(eventually([&] {
    reader.text();
    return !std::filesystem::is_symlink(path("one"));
  }));
  ASSERT_TRUE(eventually([&] { return client.call("status")["result"]["imus"][0]["samples"] > first + 5; }));
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
  const std::string text = reader.text();
  EXPECT_TRUE(text.ends_with("\n"));
  const std::vector<int> old = samples(text);
  EXPECT_EQ(old.back(), first - 1);
  EXPECT_EQ(samples(file("out")).front(), first);
  const json figures = imu(0);
  EXPECT_EQ(figures["frames"].get<int>() + figures["dropped"].get<int>(), figures["samples"].get<int>() + 1);
}

// Each of two UARTs has its host. One host sets the speed of the first port, and the next port has the same speed.
TEST_F(PortReloadTest, UartsFollowTheDevice) {
  const auto unit = [&](const std::string& first, const std::string& second) {
    return fmt::format(
        "clock = \"realtime\"\nrealtime.priority = 0\nrealtime.lock_memory = false\n[control]\nsocket = \"{}\"\n"
        "[truth]\nport = \"{}\"\n[[imu]]\nname = \"imu1\"\nprotocol = \"vectornav\"\ndevice.model = \"vn-200\"\n"
        "before_first = \"rest\"\nport = \"pty:{}\"\n{}",
        path("socket"), simulator_.port(), path(first),
        second.empty() ? second : fmt::format("second_port = \"pty:{}\"\n", path(second)));
  };
  const auto receives = [](const FileDescriptor& client, const std::string& text) {
    std::string all;
    return eventually([&] {
      read_all(client, all);
      return contains(all, text);
    });
  };
  const auto send = [](const FileDescriptor& client, std::string_view text) {
    EXPECT_EQ(::write(client.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  };
  Program imud("imud");
  start(imud, config(unit("one", "two")));
  ControlClient client(path("socket"));
  const FileDescriptor first = open_raw_terminal(path("one")), second = open_raw_terminal(path("two"));
  ASSERT_TRUE(receives(first, "$VNYMR,")) << imud.errors();
  send(first, "$VNWRG,05,921600*XX\r\n");
  ASSERT_TRUE(receives(first, "$VNWRG,05,921600*"));
  ASSERT_TRUE(set_line_speed(first.get(), 921'600));
  ASSERT_TRUE(receives(first, "$VNYMR,"));

  std::string why = message(reload(client, unit("one", "")));
  EXPECT_TRUE(contains(why, "a second UART can be neither connected nor disconnected")) << why;
  ASSERT_TRUE(reload(client, unit("one", "four")).contains("result"));
  EXPECT_TRUE(
      imud.wait_for_errors("imu1: second port pty:" + path("two") + " -> pty:" + path("four") + " from sample"));
  const FileDescriptor fourth = open_raw_terminal(path("four"));
  ASSERT_TRUE(fourth);
  send(fourth, "$VNRRG,01*72\r\n");
  EXPECT_TRUE(receives(fourth, "$VNRRG,01,VN-200"));
  EXPECT_TRUE(receives(first, "$VNYMR,"));

  ASSERT_TRUE(reload(client, unit("three", "four")).contains("result"));
  const FileDescriptor third = open_raw_terminal(path("three"));
  ASSERT_TRUE(third);
  EXPECT_TRUE(imud.wait_for_errors(path("three") + ": the line has 921600 baud and the client 115200"))
      << imud.errors();
  ASSERT_TRUE(set_line_speed(third.get(), 921'600));
  EXPECT_TRUE(receives(third, "$VNYMR,"));
  send(third, "$VNRRG,05*76\r\n");
  EXPECT_TRUE(receives(third, "$VNRRG,05,921600*"));
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
}

}  // namespace
}  // namespace imud
