#include "emulator/watch/terminal.hpp"

// ncurses is used by functions, not macros, because other files may be compiled together with this file.
#define NCURSES_NOMACROS
#include <curses.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "transports/loaded_library.hpp"

namespace imud {
namespace {

// The functions of ncurses that are used.
struct Curses {
  decltype(&::newterm) new_terminal;
  decltype(&::endwin) end;
  decltype(&::delscreen) delete_screen;
  decltype(&::newwin) new_window;
  decltype(&::delwin) delete_window;
  decltype(&::cbreak) without_lines;
  decltype(&::noecho) without_echo;
  decltype(&::keypad) keypad;
  decltype(&::nodelay) nodelay;
  decltype(&::curs_set) set_cursor;
  decltype(&::set_escdelay) set_escape_delay;
  decltype(&::wgetch) get_key;
  decltype(&::wmove) move;
  decltype(&::waddnstr) add;
  decltype(&::wclrtoeol) clear_to_end;
  decltype(&::wattr_on) attribute_on;
  decltype(&::wattr_off) attribute_off;
  decltype(&::wrefresh) refresh;
  decltype(&::clearok) clear_all;
  decltype(&::getmaxy) rows;
  decltype(&::resizeterm) resize;

  static const Curses& get() {
    static const Curses library = load();
    return library;
  }

 private:
  static Curses load() {
    const LoadedLibrary library({"libncursesw.so.6"}, "libncursesw6");
    Curses c{};
    library.find("newterm", c.new_terminal);
    library.find("endwin", c.end);
    library.find("delscreen", c.delete_screen);
    library.find("newwin", c.new_window);
    library.find("delwin", c.delete_window);
    library.find("cbreak", c.without_lines);
    library.find("noecho", c.without_echo);
    library.find("keypad", c.keypad);
    library.find("nodelay", c.nodelay);
    library.find("curs_set", c.set_cursor);
    library.find("set_escdelay", c.set_escape_delay);
    library.find("wgetch", c.get_key);
    library.find("wmove", c.move);
    library.find("waddnstr", c.add);
    library.find("wclrtoeol", c.clear_to_end);
    library.find("wattr_on", c.attribute_on);
    library.find("wattr_off", c.attribute_off);
    library.find("wrefresh", c.refresh);
    library.find("clearok", c.clear_all);
    library.find("getmaxy", c.rows);
    library.find("resizeterm", c.resize);
    return c;
  }
};

}  // namespace

class Terminal::Screen {
 public:
  Screen() : curses_(Curses::get()) {
    std::setlocale(LC_CTYPE, "");  // ncurses counts columns by this locale
    const char* const type = std::getenv("TERM");
    screen_ = curses_.new_terminal(nullptr, stdout, stdin);
    if (screen_ == nullptr)
      throw std::runtime_error(
          fmt::format("ncurses does not know the type of this terminal, TERM=\"{}\"", type == nullptr ? "" : type));
    curses_.without_lines();
    curses_.without_echo();
    curses_.set_cursor(0);
    constexpr int escape_ms = 25;  // after which an escape does not begin a key's sequence
    curses_.set_escape_delay(escape_ms);
    window_ = curses_.new_window(0, 0, 0, 0);
    curses_.keypad(window_, true);
    curses_.nodelay(window_, true);
  }
  ~Screen() {
    curses_.delete_window(window_);
    curses_.set_cursor(1);
    curses_.end();
    curses_.delete_screen(screen_);
  }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // A row that is too long for the window continues in the next row, which is overwritten afterwards.
  void show(const std::vector<std::string>& lines, const std::string& bottom) {
    const int rows = curses_.rows(window_);
    for (int row = 0; row < rows; ++row) {
      const bool is_last = row + 1 == rows;
      const auto index = static_cast<std::size_t>(row);
      curses_.move(window_, row, 0);
      curses_.clear_to_end(window_);
      if (is_last) curses_.attribute_on(window_, A_REVERSE, nullptr);
      const char* const text = is_last ? bottom.c_str() : index < lines.size() ? lines[index].c_str() : "";
      curses_.add(window_, text, -1);
      if (is_last) curses_.attribute_off(window_, A_REVERSE, nullptr);
    }
    curses_.refresh(window_);
  }
  int read_key() {
    const int key = curses_.get_key(window_);
    switch (key) {
      case ERR:
        return Terminal::none;
      case KEY_BACKSPACE:
      case '\b':
      case '\x7f':
        return Terminal::erase;
      case KEY_ENTER:
      case '\r':
      case '\n':
        return Terminal::enter;
      case '\x1b':
        return Terminal::escape;
      default:
        return key < KEY_MIN ? key : Terminal::other;
    }
  }
  void resize() {
    winsize size{};
    if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_row == 0 || size.ws_col == 0) return;
    curses_.resize(size.ws_row, size.ws_col);
    curses_.clear_all(window_, true);
  }

 private:
  const Curses& curses_;
  SCREEN* screen_ = nullptr;
  WINDOW* window_ = nullptr;
};

Terminal::Terminal() : screen_(std::make_unique<Screen>()) {}
Terminal::~Terminal() = default;
void Terminal::show(const std::vector<std::string>& lines, const std::string& bottom) {
  screen_->show(lines, bottom);
}
int Terminal::read_key() { return screen_->read_key(); }
void Terminal::resize() { screen_->resize(); }

}  // namespace imud
