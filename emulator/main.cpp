#include "emulator/commands/command_line.hpp"

int main(int argc, char** argv) { return imud::command_line(argc, argv); }
