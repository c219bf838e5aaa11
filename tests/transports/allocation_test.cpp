// Nothing is allocated in send() and receive(), not even by a device that is lost and comes back.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/support/allocations.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/port.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

void use(Port& port) {
  NumberedFrames frames;
  const std::uint64_t before = allocations();
  for (int i = 0; i < 500; ++i) {
    port.send(frames.next(5));
    port.receive();
    port.flush();
  }
  EXPECT_EQ(allocations(), before);
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

  for (const unsigned client_baud : {115'200U, 9600U}) {
    PortSettings settings = Role::device;
    settings.paced = true;
    const auto paced = open_port("pty:" + folder / "paced" + "?baud=115200", settings);
    const FileDescriptor client = open_terminal(folder / "paced");
    ASSERT_TRUE(set_line_speed(client.get(), client_baud));
    use(*paced);
    EXPECT_GT(paced->counters().dropped, 0U);
  }
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
  const std::uint64_t before = allocations();
  for (int i = 0; i < 300 && port->state() == PortState::lost; ++i) {
    port->send({});
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(allocations(), before);
  EXPECT_EQ(port->state(), PortState::ready);
}

}  // namespace
}  // namespace imud
