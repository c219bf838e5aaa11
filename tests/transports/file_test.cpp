#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <fstream>
#include <iterator>

#include "tests/transports/numbered_frames.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

std::string content_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void feed_file(NumberedReader& reader, const std::string& path) {
  const std::string content = content_of(path);
  reader.feed(std::as_bytes(std::span(content)));
}

std::uint64_t decided(const Port& port) { return port.counters().sent + port.counters().dropped; }

TEST(File, OldContentGoesAndFramesComeInOrder) {
  const ScratchFolder folder;
  const std::string path = folder / "out";
  std::ofstream(path) << std::string(5'000'000, 'x');
  NumberedFrames frames;
  {
    const auto port = open_port("file:" + path, Role::device);
    EXPECT_EQ(content_of(path).size(), 5'000'000U) << "until the run begins";
    port->flush();
    EXPECT_EQ(content_of(path), "");
    for (int i = 0; i < 3000; ++i) port->send(frames.next(4));
    port->flush();
    EXPECT_EQ(port->counters().sent, 12000U);
    EXPECT_EQ(port->counters().dropped, 0U);
    port->send(frames.next(4));  // written by the destructor
  }
  NumberedReader reader;
  feed_file(reader, path);
  EXPECT_EQ(reader.numbers.size(), 12004U);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
}

TEST(File, OnePortWritesAFile) {
  const ScratchFolder folder;
  const std::string text = "file:" + folder / "out";
  {
    const auto port = open_port(text, Role::device);
    EXPECT_TRUE(mentions(error_of(text, Role::device), "is written by another process"));
    EXPECT_EQ(error_of(text, Role::listener), "") << "a reader needs no lock";
  }
  EXPECT_EQ(error_of(text, Role::device), "");
}

TEST(File, FramesAreGatheredUntilFlushed) {
  const ScratchFolder folder;
  const auto port = open_port("file:" + folder / "out", Role::device);
  NumberedFrames frames;
  port->send(frames.next(5));
  EXPECT_EQ(content_of(folder / "out"), "");
  EXPECT_EQ(port->counters().sent, 0U);
  port->flush();
  EXPECT_NE(content_of(folder / "out"), "");
  EXPECT_EQ(port->counters().sent, 5U);
}

TEST(File, ReadsBackWhatWasWrittenAndEnds) {
  const ScratchFolder folder;
  const std::string spec = "file:" + folder / "out";
  NumberedFrames frames;
  {
    const auto port = open_port(spec, Role::device);
    for (int i = 0; i < 1000; ++i) port->send(frames.next(10));
  }
  const auto port = open_port(spec, Role::listener);
  NumberedReader reader;
  while (const auto received = port->receive()) {
    EXPECT_FALSE(port->at_end());
    reader.feed(received->frame.bytes);
  }
  EXPECT_TRUE(port->at_end());
  EXPECT_EQ(port->end_warning(), "");
  EXPECT_EQ(reader.numbers.size(), 10000U);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
}

// A limit on the file's size stops write() in the middle of a frame, as a full disk does.
TEST(File, TheProgressOfAFileIsKnownAndThatOfAPipeIsNot) {
  const ScratchFolder folder;
  const std::string path = folder / "truth";
  std::ofstream(path) << std::string(300'000, 'x');
  const auto port = open_port("file:" + path, Role::listener);
  std::size_t read = 0;
  EXPECT_EQ(port->progress(), 0.0);
  while (const auto received = port->receive()) {
    read += received->frame.bytes.size();
    EXPECT_DOUBLE_EQ(port->progress().value_or(-1), static_cast<double>(read) / 300'000);
  }
  EXPECT_EQ(port->progress(), 1.0);
  EXPECT_EQ(open_port("file:/dev/null", Role::listener)->progress(), std::nullopt);
}

TEST(File, FullDiskTearsNoFrameAndWritingResumes) {
  const ScratchFolder folder;
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  NumberedFrames frames;
  {
    const auto port = open_port("file:" + folder / "out", Role::device);
    const rlimit full{500'001, before.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &full);
    for (int i = 0; i < 2000; ++i) port->send(frames.next(5));
    port->flush();
    EXPECT_EQ(port->state(), PortState::lost);
    EXPECT_EQ(port->counters().lost_count, 1U);
    EXPECT_GT(port->counters().sent, 0U);
    EXPECT_GT(port->counters().dropped, 0U);
    EXPECT_EQ(content_of(folder / "out").size(), 500'001U);

    ::setrlimit(RLIMIT_FSIZE, &before);
    const std::uint64_t dropped = port->counters().dropped;
    for (int i = 0; i < 200; ++i) port->send(frames.next(5));
    port->flush();
    EXPECT_EQ(port->state(), PortState::ready);
    EXPECT_EQ(port->counters().dropped, dropped);
    EXPECT_EQ(decided(*port), frames.made());

    NumberedReader reader;
    feed_file(reader, folder / "out");
    EXPECT_EQ(reader.numbers.size(), port->counters().sent);
    EXPECT_EQ(reader.numbers.back(), frames.made() - 1);
    EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  }
  std::signal(SIGXFSZ, SIG_DFL);
}

// The disk is full within the last frame: it counts as lost when the run ends.
TEST(File, AFrameThatIsTornAtTheEndIsLost) {
  const ScratchFolder folder;
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  NumberedFrames frames;
  const auto port = open_port("file:" + folder / "out", Role::device);
  port->send(frames.next(1));
  port->flush();
  const rlimit full{content_of(folder / "out").size() + 1, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &full);
  port->send(frames.next(1));
  port->flush();
  EXPECT_EQ(port->counters().sent, 1U);
  EXPECT_EQ(port->error(), EFBIG);
  port->discard_pending();
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_EQ(port->counters().dropped, 1U);
  EXPECT_EQ(port->counters().failed, 1U);
}

TEST(File, FullDeviceDropsAndCounts) {
  const auto port = open_port("file:/dev/full", Role::device);
  NumberedFrames frames;
  port->send(frames.next(3));
  port->send(frames.next(3));
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_EQ(port->counters().lost_count, 1U);
  EXPECT_EQ(port->counters().dropped, 6U);
  EXPECT_EQ(port->counters().failed, 6U);
  EXPECT_EQ(port->error(), ENOSPC);
}

class Fifo : public ::testing::Test {
 protected:
  Fifo() : path(folder / "fifo") { EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0); }
  FileDescriptor open_end(int flags) const {
    return FileDescriptor(::open(path.c_str(), flags | O_NONBLOCK | O_CLOEXEC));
  }
  static void drain(int fd, NumberedReader& reader, std::size_t most) {
    std::vector<std::byte> bytes(most);
    const ssize_t size = ::read(fd, bytes.data(), bytes.size());
    if (size > 0) reader.feed(std::span(bytes).first(static_cast<std::size_t>(size)));
  }
  ScratchFolder folder;
  std::string path;
};

TEST_F(Fifo, NeedsItsReaderFirst) { EXPECT_TRUE(mentions(error_of("file:" + path), "reader first")); }

TEST_F(Fifo, FramesLeaveAtOnceAndAReaderThatStopsTearsNone) {
  const FileDescriptor out = open_end(O_RDONLY);
  const auto port = open_port("file:" + path, Role::device);
  NumberedFrames frames;
  NumberedReader reader;
  port->send(frames.next(1));
  drain(out.get(), reader, 100000);
  EXPECT_EQ(reader.numbers.size(), 1U);

  for (int i = 0; i < 500; ++i) port->send(frames.next(5));
  EXPECT_GT(port->counters().dropped, 0U);
  EXPECT_EQ(port->state(), PortState::ready);
  for (int i = 0; i < 500; ++i) {
    drain(out.get(), reader, 1000);
    port->send(frames.next(1));
  }
  for (int i = 0; i < 10; ++i) {
    drain(out.get(), reader, 100000);
    port->flush();
  }
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(reader.numbers.size(), port->counters().sent);
  EXPECT_EQ(decided(*port), frames.made());
}

TEST_F(Fifo, FramesThatMustNotBeDroppedAreGatheredAndKept) {
  const FileDescriptor out = open_end(O_RDONLY);
  PortSettings settings = Role::device;
  settings.delivery = Delivery::complete;
  const auto port = open_port("file:" + path, settings);
  NumberedFrames frames;
  NumberedReader reader;
  port->send(frames.next(1));
  drain(out.get(), reader, 100000);
  EXPECT_EQ(reader.numbers.size(), 0U);
  EXPECT_TRUE(port->has_room());
  EXPECT_TRUE(port->wants_output());
  port->flush();
  EXPECT_FALSE(port->wants_output());
  drain(out.get(), reader, 100000);
  EXPECT_EQ(reader.numbers.size(), 1U);

  // More than the pipe holds: the rest stays in the port, and a reader in small pieces gets all of it.
  for (int i = 0; i < 2; ++i) {
    while (port->has_room()) port->send(frames.next(1));
    port->flush();
  }
  EXPECT_TRUE(port->wants_output());
  EXPECT_FALSE(port->is_drained());
  for (int i = 0; i < 1000 && !port->is_drained(); ++i) drain(out.get(), reader, 1000);
  drain(out.get(), reader, 100000);
  EXPECT_EQ(port->counters().dropped, 0U);
  EXPECT_EQ(reader.numbers.size(), frames.made());
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);

  // If nobody waits for the reader, frames are dropped whole, and so are those that are left at the end.
  for (int i = 0; i < 500; ++i) port->send(frames.next(5));
  EXPECT_FALSE(port->has_room());
  EXPECT_GT(port->counters().dropped, 0U);
  drain(out.get(), reader, 1000);
  port->discard_pending();
  EXPECT_EQ(decided(*port), frames.made());
}

TEST_F(Fifo, ReaderThatLeavesEndsNothing) {
  FileDescriptor out = open_end(O_RDONLY);
  const auto port = open_port("file:" + path, Role::device);
  NumberedFrames frames;
  NumberedReader reader;
  // Until a frame is written in part.
  for (std::size_t i = 0; i < 1000 && decided(*port) == frames.made(); ++i) {
    port->send(frames.next(40 + i % 20));
    if (port->counters().dropped > 0 && decided(*port) == frames.made()) drain(out.get(), reader, 5000);
  }
  ASSERT_EQ(decided(*port), frames.made() - 1);
  EXPECT_TRUE(port->wants_output()) << "the rest of a frame";
  out.reset();
  const std::uint64_t dropped = port->counters().dropped;
  port->send(frames.next(4));
  EXPECT_EQ(port->state(), PortState::no_reader);
  EXPECT_EQ(port->counters().dropped, dropped + 4);

  out = open_end(O_RDONLY);
  drain(out.get(), reader, 100000);
  port->send(frames.next(2));
  EXPECT_FALSE(port->wants_output());
  EXPECT_EQ(port->state(), PortState::ready);
  drain(out.get(), reader, 100000);
  EXPECT_EQ(reader.numbers.back(), frames.made() - 1);
  EXPECT_EQ(reader.numbers.size(), port->counters().sent);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(decided(*port), frames.made());
}

TEST_F(Fifo, ListenerWaitsForTheWriterAndEndsWithIt) {
  const auto port = open_port("file:" + path, Role::listener);
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_FALSE(port->at_end());
  FileDescriptor in = open_end(O_WRONLY);
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_FALSE(port->at_end());
  ASSERT_EQ(::write(in.get(), "abc", 3), 3);
  EXPECT_EQ(port->receive().value().frame.bytes.size(), 3U);
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_FALSE(port->at_end());
  in.reset();
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_TRUE(port->at_end());
}

// Replaces a standard stream by `fd` until it is destroyed.
class Redirected {
 public:
  Redirected(int stream, int fd) : stream_(stream), kept_(::dup(stream)) { ::dup2(fd, stream); }
  ~Redirected() { ::dup2(kept_.get(), stream_); }

 private:
  int stream_;
  FileDescriptor kept_;
};

TEST(File, StandardOutputThatTheShellAppendsToIsNotTruncated) {
  for (const char* spec : {"file:-", "file:/dev/stdout"}) {
    const ScratchFolder folder;
    std::ofstream(folder / "log") << "before";
    const FileDescriptor log(::open((folder / "log").c_str(), O_WRONLY | O_APPEND | O_CLOEXEC));
    const Redirected output(STDOUT_FILENO, log.get());
    NumberedFrames frames;
    open_port(spec, Role::device)->send(frames.next(1));
    const std::string content = content_of(folder / "log");
    EXPECT_EQ(content.substr(0, 6), "before");
    EXPECT_EQ(content.size(), 6U + NumberedFrames::head + 1U);
  }
}

TEST(File, StandardStreamsThatArePipes) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const FileDescriptor out(ends[0]), in(ends[1]);
  NumberedFrames frames;
  {
    const Redirected output(STDOUT_FILENO, in.get());
    const auto port = open_port("file:/dev/stdout", Role::device);
    port->send(frames.next(3));
  }
  EXPECT_EQ(::fcntl(in.get(), F_GETFL) & O_NONBLOCK, 0) << "the stream is the shell's too";
  const Redirected input(STDIN_FILENO, out.get());
  const auto port = open_port("file:-", Role::listener);
  NumberedReader reader;
  reader.feed(port->receive().value().frame.bytes);
  EXPECT_EQ(reader.numbers.size(), 3U);
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_FALSE(port->at_end());
}

TEST(File, NamesTheCauseIfItCannotBeOpened) {
  const ScratchFolder folder;
  EXPECT_TRUE(mentions(error_of("file:" + folder / "none", Role::listener), "No such file"));
  EXPECT_TRUE(mentions(error_of("file:" + folder / "none/out", Role::device), "No such file"));
  EXPECT_TRUE(mentions(error_of("file:" + folder / ".", Role::listener), "directory"));
  EXPECT_TRUE(mentions(error_of("file:" + folder / ".", Role::device), "directory"));
}

}  // namespace
}  // namespace imud
