// Terminal: the whole screen of a terminal, by ncurses.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace imud {

// ncurses is loaded when the first Terminal is made, so that other commands of imud do not load ncurses. Only one
// Terminal may exist at a time. Used by one thread.
class Terminal {
 public:
  // Keys beside the bytes that are typed.
  enum Key : int { none = -1, erase = 1000, enter, escape, other };

  // Takes the terminal of standard input and output, whose type TERM names. Throws std::runtime_error: ncurses
  // is missing, or does not know the type.
  Terminal();
  // Restores the terminal.
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  // Shows the lines from the first row on, and `bottom`, emphasised, in the last row. Text that does not fit is
  // omitted.
  void show(const std::vector<std::string>& lines, const std::string& bottom);
  // Returns the next byte or Key; Key::none if there is no input.
  int read_key();
  // Adapts the screen to the terminal's present size.
  void resize();

 private:
  class Screen;
  std::unique_ptr<Screen> screen_;
};

}  // namespace imud
