// imud run with ports that fail or stall.
#include <fcntl.h>
#include <termios.h>

#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

// Reads `size` bytes from a tty; returns fewer if the other end closes it or falls silent.
std::string read_bytes(int descriptor, std::size_t size) {
  std::string bytes;
  std::array<char, 4096> buffer;
  while (bytes.size() < size) {
    pollfd ready{descriptor, POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(Program::default_timeout.count())) <= 0) break;
    const ssize_t got = ::read(descriptor, buffer.data(), buffer.size());
    if (got <= 0) break;
    bytes.append(buffer.data(), static_cast<std::size_t>(got));
  }
  return bytes;
}

FileDescriptor open_raw(const std::string& path) {
  FileDescriptor tty(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios settings{};
  ::tcgetattr(tty.get(), &settings);
  ::cfmakeraw(&settings);
  ::tcsetattr(tty.get(), TCSANOW, &settings);
  return tty;
}

TEST_F(LiveTest, AReaderThatComesLateStopsAndReturnsSeesWholeFrames) {
  const std::string c = config("realtime", simulator_.port(), "native", 1000, "native", "pty:" + path("imu"));
  Program imud("imud");
  start(imud, c, {"--quality", path("quality.jsonl")});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  Program truth("imu-truth");
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "50", "--for", "240"});
  // The figures of each second.
  const auto quality = [&] { return lines_of(read_file(path("quality.jsonl"))); };
  const auto figure = [](const std::string& line, const char* key) {
    const auto second = nlohmann::json::parse(line, nullptr, false);  // the last line may be incomplete
    return second.is_discarded() ? 0 : second["imus"][0][key].get<std::int64_t>();
  };
  ASSERT_TRUE(eventually([&] {  // without a reader
    const auto lines = quality();
    return !lines.empty() && figure(lines.back(), "samples") > 200;
  }));

  std::string bytes;
  std::uint64_t frames = 0;
  {
    const FileDescriptor reader = open_raw(path("imu"));
    bytes = read_bytes(reader.get(), 10'000);
    const std::size_t seconds = quality().size();
    ASSERT_TRUE(eventually([&] {  // the reader is busy: 124 kB/s do not fit
      const auto lines = quality();
      return lines.size() > seconds + 1 && figure(lines.back(), "dropped") > 0;
    }));
    bytes += read_bytes(reader.get(), 30'000);  // all that a pty holds, and what follows
  }
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  write("bytes", bytes);
  const ProgramResult decoded = run_program("imu-decode", {"native", "file:" + path("bytes")});
  EXPECT_EQ(decoded.exit_code, 0);
  EXPECT_NE(decoded.errors.find("checksum   0 failures, 0 malformed"), std::string::npos) << decoded.errors;
  const auto all = rows(decoded.output);
  frames = all.size();
  ASSERT_GT(frames, 0U);
  // There is no old data from before the reader opened the pty; frames were lost while it was busy; every frame was
  // sent or dropped.
  EXPECT_GT(std::stoul(all[0][1]), 100U);
  const auto s = summary();
  EXPECT_EQ(s["imus"][0]["frames"].get<std::uint64_t>() + s["imus"][0]["dropped"].get<std::uint64_t>(),
            s["imus"][0]["samples"].get<std::uint64_t>());
  std::uint64_t missing = 0;
  for (std::size_t i = 1; i < all.size(); ++i) {
    const auto step = std::stoul(all[i][1]) - std::stoul(all[i - 1][1]);
    ASSERT_GE(step, 1U);
    missing += step - 1;
  }
  EXPECT_GT(missing, 0U);
}

// Input from a host is read in every clock: more than a pty holds passes.
TEST_F(LiveTest, HostInputIsReadWhileACaptureIsReplayed) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "120"}).exit_code, 0);
  const std::string c = config("realtime", simulator_.port(), "csv", 1000, "native", "pty:" + path("imu"));
  Program imud("imud");
  imud.start({"replay", c, path("truth.csv")});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  const FileDescriptor host = open_raw(path("imu"));
  const std::string words(1000, 'x');
  std::array<char, 4096> ignored;
  std::size_t sent = 0;
  while (imud.is_running() && sent < 80'000) {
    if (const ssize_t size = ::write(host.get(), words.data(), words.size()); size > 0)
      sent += static_cast<std::size_t>(size);
    while (::read(host.get(), ignored.data(), ignored.size()) > 0) {
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_GE(sent, 80'000U);
}

// A serial device made of a pty behind a link, so that it can be unplugged and come back.
class SerialDevice {
 public:
  explicit SerialDevice(std::string link) : link_(std::move(link)) {
    master_ = FileDescriptor(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (::grantpt(master_.get()) != 0 || ::unlockpt(master_.get()) != 0) throw std::runtime_error("no pty");
    std::array<char, 64> name{};
    ::ptsname_r(master_.get(), name.data(), name.size());
    std::filesystem::create_symlink(name.data(), link_);
  }
  ~SerialDevice() { std::filesystem::remove(link_); }
  int get() const { return master_.get(); }

 private:
  std::string link_;
  FileDescriptor master_;
};

TEST_F(LiveTest, ASerialDeviceThatIsUnpluggedAndReturns) {
  auto device = std::make_unique<SerialDevice>(path("tty"));
  const std::string c =
      config("realtime", simulator_.port(), "native", 200, "native", "serial:" + path("tty") + "?baud=921600");
  Program imud("imud");
  start(imud, c);
  Program truth("imu-truth");
  ASSERT_TRUE(eventually([&] {  // until it reads
    simulator_.send(Simulator::encode(Simulator::truth(0, 0, false)));
    pollfd ready{device->get(), POLLIN, 0};
    return ::poll(&ready, 1, 50) == 1;
  }));
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "50", "--for", "240"});
  EXPECT_GE(read_bytes(device->get(), 10 * 124).size(), 10 * 124U);
  device.reset();
  ASSERT_TRUE(imud.wait_for_errors("is lost"));
  device = std::make_unique<SerialDevice>(path("tty"));
  ASSERT_TRUE(imud.wait_for_errors("takes frames"));
  const std::string bytes = read_bytes(device->get(), 100 * 124);
  EXPECT_GE(bytes.size(), 100 * 124U);
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  write("bytes", bytes.substr(0, bytes.size() / 124 * 124));
  const ProgramResult decoded = run_program("imu-decode", {"native", "file:" + path("bytes")});
  EXPECT_NE(decoded.errors.find("checksum   0 failures, 0 malformed"), std::string::npos) << decoded.errors;
  EXPECT_NE(decoded.errors.find("0 bytes skipped"), std::string::npos)
      << decoded.errors;  // the data begin with a whole frame
  const auto s = summary();
  EXPECT_GT(s["imus"][0]["dropped"], 0);
  EXPECT_EQ(s["imus"][0]["frames"].get<std::uint64_t>() + s["imus"][0]["dropped"].get<std::uint64_t>(),
            s["imus"][0]["samples"].get<std::uint64_t>());
}

}  // namespace
}  // namespace imud
