#include "transports/file/file_replacement.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/transports/numbered_frames.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/file/output_path.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

class FileReplacementTest : public ::testing::Test {
 protected:
  FileReplacementTest() { settings_.replaces_file = true; }
  static std::string content(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::unique_ptr<Port> open(const std::string& path) const { return open_port("file:" + path, settings_); }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "out", incomplete_ = folder_ / "out.incomplete";
  PortSettings settings_ = Role::device;
  NumberedFrames frames_;
};

TEST_F(FileReplacementTest, TheOldFileStaysUntilTheNewOneIsWhole) {
  std::ofstream(path_) << "old";
  fs::permissions(path_, fs::perms(0640));
  {
    const auto port = open(path_);
    port->send(frames_.next(10));
    port->flush();
    EXPECT_EQ(content(path_), "old");
    EXPECT_GT(content(incomplete_).size(), 10 * NumberedFrames::head);
    port->send(frames_.next(1));
    port->commit();
    EXPECT_FALSE(fs::exists(incomplete_));
  }
  const std::string whole = content(path_);
  NumberedReader reader;
  reader.feed(std::as_bytes(std::span(whole)));
  EXPECT_EQ(reader.numbers.size(), 11U);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(fs::status(path_).permissions(), fs::perms(0640));
}

TEST_F(FileReplacementTest, ARunThatFailsChangesNothing) {
  open(path_)->send(frames_.next(1));
  EXPECT_FALSE(fs::exists(path_));
  std::ofstream(path_) << "old";
  open(path_)->send(frames_.next(1));
  EXPECT_EQ(content(path_), "old");
  EXPECT_FALSE(fs::exists(incomplete_));
}

TEST_F(FileReplacementTest, WhatAKilledProcessLeftBehindIsReplaced) {
  std::ofstream(incomplete_) << std::string(100'000, 'x');
  const auto port = open(path_);
  EXPECT_EQ(content(incomplete_), "");
  port->commit();
  EXPECT_EQ(content(path_), "");
  EXPECT_FALSE(fs::exists(incomplete_));
}

TEST_F(FileReplacementTest, TwoProcessesCannotWriteTheSameFile) {
  const auto port = open(path_);
  port->send(frames_.next(1));
  port->flush();
  EXPECT_TRUE(mentions(error_of("file:" + path_, settings_), "another process writes it, as " + incomplete_));
  EXPECT_FALSE(content(incomplete_).empty());
  fs::remove(incomplete_);
  std::ofstream(incomplete_) << "foreign";
  EXPECT_THROW(port->commit(), std::runtime_error);
  EXPECT_FALSE(fs::exists(path_));
  EXPECT_EQ(content(incomplete_), "foreign");
}

TEST_F(FileReplacementTest, OnlyAFileOfItsOwnIsRemoved) {
  fs::create_symlink(folder_ / "elsewhere", incomplete_);
  std::ofstream(folder_ / "elsewhere") << "kept";
  EXPECT_TRUE(mentions(error_of("file:" + path_, settings_), incomplete_));
  EXPECT_EQ(content(folder_ / "elsewhere"), "kept");
  fs::remove(incomplete_);
  fs::create_directory(incomplete_);
  EXPECT_TRUE(mentions(error_of("file:" + path_, settings_), incomplete_));
  EXPECT_TRUE(fs::is_directory(incomplete_));
}

TEST_F(FileReplacementTest, ALinkStaysAndItsTargetIsReplaced) {
  fs::create_directory(folder_ / "data");
  fs::create_symlink("data/file", path_);
  for (const char* old : {"", "old"}) {  // the target does not exist at first
    if (*old != '\0') std::ofstream(folder_ / "data/file") << old;
    const auto port = open(path_);
    port->send(frames_.next(1));
    port->flush();
    EXPECT_TRUE(fs::exists(folder_ / "data/file.incomplete"));
    port->commit();
    EXPECT_TRUE(fs::is_symlink(path_));
    EXPECT_GT(content(folder_ / "data/file").size(), NumberedFrames::head);
  }
}

TEST_F(FileReplacementTest, WhatHasNoOldContentIsWrittenInPlace) {
  EXPECT_EQ(FileReplacement::target("/dev/null"), std::nullopt);
  EXPECT_EQ(FileReplacement::target(folder_ / "."), std::nullopt);
  ASSERT_EQ(::mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  EXPECT_EQ(FileReplacement::target(folder_ / "fifo"), std::nullopt);
  const FileDescriptor file(::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  EXPECT_EQ(FileReplacement::target("/dev/fd/" + std::to_string(file.get())), std::nullopt);
  EXPECT_EQ(FileReplacement::target("/proc/self/fd/" + std::to_string(file.get())), std::nullopt);
  EXPECT_EQ(FileReplacement::target(path_), path_);
  fs::create_symlink(folder_ / "loop", folder_ / "loop");
  EXPECT_EQ(FileReplacement::target(folder_ / "loop"), std::nullopt);
}

TEST_F(FileReplacementTest, NamesTheCauseIfItCannotBeWritten) {
  EXPECT_TRUE(mentions(error_of("file:" + folder_ / "none/out", settings_), "No such file"));
  EXPECT_TRUE(mentions(error_of("file:" + folder_ / ".", settings_), "directory"));
}

// The owner of a test's link is the user who runs the test; only root can change it, and root's links are trusted.
TEST(OutputPath, ALinkOfAnotherUserIsForeignWhereOthersCanWrite) {
  const ScratchFolder folder;
  constexpr uid_t somebody = 54'321;
  const std::string shared = folder / "shared", link = shared + "/link";
  fs::create_directory(shared);
  fs::create_symlink(folder / "file", link);
  const bool is_root = ::geteuid() == 0;
  if (is_root) {
    EXPECT_EQ(foreign_link(link, somebody), "") << "root's";
    ASSERT_EQ(::lchown(link.c_str(), somebody, somebody), 0);
  }
  const uid_t owner = is_root ? somebody : ::geteuid(), other = somebody + 1;
  for (const unsigned mode : {0755U, 0775U, 0757U, 01777U}) {
    fs::permissions(shared, fs::perms(mode));
    EXPECT_EQ(foreign_link(link, owner), "") << mode;
    EXPECT_EQ(foreign_link(link, other), mode == 0755 ? "" : link) << mode;
  }
  EXPECT_EQ(foreign_link(shared + "/none", other), "");
  // On the way, and as the target of a link.
  fs::create_directory(folder / "file");
  EXPECT_EQ(foreign_link(link + "/out", other), link);
  fs::create_symlink(link, folder / "mine");
  EXPECT_EQ(foreign_link(folder / "mine", other), link);
  if (is_root) {
    EXPECT_TRUE(mentions(error_of("file:" + link + "/out"), link + " is a symbolic link that another user"));
  }
}

}  // namespace
}  // namespace imud
