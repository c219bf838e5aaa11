// Nothing is allocated in send() and receive(), not even by a device that is lost and comes back.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <new>
#include <thread>

#include "tests/transports/scratch_folder.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/port.hpp"

namespace {
std::atomic<unsigned> allocations = 0;
}

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace imud {
namespace {

using namespace std::chrono_literals;

void use(Port& port) {
  NumberedFrames frames;
  const unsigned before = allocations;
  for (int i = 0; i < 500; ++i) {
    port.send(frames.next(5));
    port.receive();
    port.flush();
  }
  EXPECT_EQ(allocations, before);
}

TEST(Allocation, NoneWhileInUse) {
  const ScratchFolder folder;
  const auto file = open_port("file:" + folder / "file", Role::device);
  use(*file);
  use(*open_port("file:" + folder / "file", Role::listener));
  use(*open_port("udp:127.0.0.1:9", Role::device));

  const auto pty = open_port("pty:" + folder / "pty", Role::device);
  use(*pty);
  {
    const FileDescriptor client = open_terminal(folder / "pty");
    use(*pty);
  }
  use(*pty);
}

TEST(Allocation, NoneByASerialDeviceThatIsLostAndComesBack) {
  const ScratchFolder folder;
  SerialDevice device(folder / "tty");
  const auto port = open_port("serial:" + folder / "tty", Role::device);
  use(*port);
  device.unplug();
  use(*port);
  EXPECT_EQ(port->state(), PortState::lost);
  device.plug_in();
  const unsigned before = allocations;
  for (int i = 0; i < 300 && port->state() == PortState::lost; ++i) {
    port->send({});
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(port->state(), PortState::ready);
}

}  // namespace
}  // namespace imud
