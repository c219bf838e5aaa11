// ioctl_tty(2). This is a file of its own because the kernel's struct termios2 clashes with <termios.h>.
#include "transports/uart/termios2.hpp"

#include <asm/termbits.h>
#include <sys/ioctl.h>

namespace imud {

bool set_line_speed(int fd, unsigned baud) noexcept {
  termios2 line{};
  if (::ioctl(fd, TCGETS2, &line) != 0) return false;
  constexpr unsigned any_constant = CBAUD | CBAUD << IBSHIFT;
  constexpr unsigned no_constant = BOTHER | BOTHER << IBSHIFT;
  line.c_cflag = (line.c_cflag & ~any_constant) | no_constant;
  line.c_ispeed = baud;
  line.c_ospeed = baud;
  return ::ioctl(fd, TCSETS2, &line) == 0;
}

std::optional<unsigned> line_speed(int fd) noexcept {
  termios2 line{};
  if (::ioctl(fd, TCGETS2, &line) != 0) return std::nullopt;
  return line.c_ospeed;
}

bool has_speed_constant(int fd) noexcept {
  termios2 line{};
  return ::ioctl(fd, TCGETS2, &line) == 0 && (line.c_cflag & CBAUD) != BOTHER;
}

}  // namespace imud
