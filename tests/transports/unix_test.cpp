#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <filesystem>
#include <fstream>

#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

class Unix : public ::testing::Test {
 protected:
  std::string at() const { return "unix-listen:" + path; }
  // Makes a socket at `path` of a process that listens, until the descriptor is closed.
  FileDescriptor serve(int type) const {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    FileDescriptor socket(::socket(AF_UNIX, type | SOCK_CLOEXEC, 0));
    EXPECT_EQ(::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    if (type == SOCK_STREAM) {
      EXPECT_EQ(::listen(socket.get(), 0), 0);
    }
    return socket;
  }
  auto files() const {
    return std::distance(std::filesystem::directory_iterator(std::filesystem::path(path).parent_path()), {});
  }

  ScratchFolder folder;
  const std::string path = folder / "socket";
};

TEST_F(Unix, TheSocketIsOfThisUserAlone) {
  const auto mask = ::umask(0);
  {
    const auto port = open_port(at(), Role::listener);
    struct stat status {};
    ASSERT_EQ(::lstat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode, mode_t{S_IFSOCK | 0600});
    EXPECT_EQ(files(), 1) << "nothing is left beside it";
  }
  EXPECT_EQ(files(), 0) << "it is removed at the end";
  ::umask(mask);
}

TEST_F(Unix, ASocketWhoseProcessHasEndedIsReplaced) {
  serve(SOCK_STREAM).reset();
  ASSERT_TRUE(std::filesystem::is_socket(path));
  const auto port = open_port(at(), Role::listener);
  EXPECT_EQ(files(), 1);
  const auto client = open_port("unix:" + path, Role::device);
  client->flush();
  port->flush();
  EXPECT_EQ(client->state(), PortState::ready);
  EXPECT_EQ(port->state(), PortState::ready);
}

TEST_F(Unix, ALiveSocketIsLeftAlone) {
  for (const int type : {SOCK_STREAM, SOCK_DGRAM, SOCK_SEQPACKET}) {
    const FileDescriptor other = serve(type);
    // The queue of one that does not accept is full after a while.
    for (int i = 0; i < 3; ++i) {
      if (type == SOCK_SEQPACKET) ::listen(other.get(), 0);
      EXPECT_TRUE(mentions(error_of(at()), "another process serves it")) << type;
      EXPECT_EQ(files(), 1);
    }
    std::filesystem::remove(path);
  }
  const auto port = open_port(at(), Role::listener);
  EXPECT_TRUE(mentions(error_of(at()), "another process serves it"));
}

TEST_F(Unix, AnotherFileIsLeftAlone) {
  std::ofstream(path) << "text";
  EXPECT_TRUE(mentions(error_of(at()), "is not a socket; it is left alone"));
  EXPECT_EQ(std::filesystem::file_size(path), 4U);
  std::filesystem::remove(path);
  std::filesystem::create_symlink("nowhere", path);
  EXPECT_TRUE(mentions(error_of(at()), "is not a socket; it is left alone"));
  std::filesystem::remove(path);
  std::filesystem::create_directory(path);
  EXPECT_TRUE(mentions(error_of(at()), "is not a socket; it is left alone"));
  EXPECT_EQ(files(), 1);
}

// Whoever has replaced the socket keeps it.
TEST_F(Unix, AReplacedSocketIsNotRemoved) {
  auto port = open_port(at(), Role::listener);
  std::filesystem::remove(path);
  const FileDescriptor other = serve(SOCK_STREAM);
  port.reset();
  EXPECT_TRUE(std::filesystem::is_socket(path));
}

TEST_F(Unix, ErrorsNameWhatWouldBeRight) {
  EXPECT_TRUE(mentions(error_of("unix-listen:" + folder / "none/socket"), "No such file"));
  for (const std::string scheme : {"unix:", "unix-listen:"}) {
    EXPECT_TRUE(mentions(error_of(scheme + std::string(108, 'x')), "right would be at most "));
    EXPECT_TRUE(mentions(error_of(scheme + "-"), "is no path; right would be that of a socket"));
    EXPECT_TRUE(mentions(error_of(scheme + path + "?mode=0666"), "unknown option 'mode'"));
  }
  // Until it listens, the socket has a longer name.
  EXPECT_TRUE(mentions(error_of("unix-listen:" + std::string(98, 'x')), "right would be at most 97 characters"));
  EXPECT_EQ(error_of("unix-listen:" + path + std::string(97 - path.size(), 'x')), "");
  EXPECT_EQ(error_of("unix:" + std::string(107, 'x')), "");
}

}  // namespace
}  // namespace imud
