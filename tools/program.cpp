#include "tools/program.hpp"

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>

#include "transports/file/output_path.hpp"

namespace imud {

std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : wrong_command_line;
  }
}

int run_tool(std::string_view name, int (*execute)(int argc, char** argv, bool& running), int argc, char** argv) {
  open_closed_streams();
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond the limit of file sizes then fails, as on a full disk
  bool running = false;
  int exit_code = 0;
  try {
    exit_code = execute(argc, argv, running);
  } catch (const std::exception& error) {
    std::fputs(fmt::format("{}: {}\n", name, error.what()).c_str(), stderr);  // fmt::print would throw
    exit_code = running ? failed : wrong_command_line;
  }
  const int error = flush_standard_output();
  if (error == 0) return exit_code;
  std::fputs(fmt::format("{}: standard output: {}\n", name, std::strerror(error)).c_str(), stderr);
  return exit_code == 0 ? failed : exit_code;
}

}  // namespace imud
