// `imud ctl`: a client of the control protocol for people and scripts.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace imud {

struct CtlOptions {
  std::string socket;                   // a path; empty: the socket of `name`
  std::string name;                     // of the instance; empty: the only running instance
  std::string to;                       // ADDRESS:PORT of the instance's TCP port; empty: a socket
  std::string token_file;               // for `to`
  std::string method;                   // empty: the instances that run are listed
  std::vector<std::string> parameters;  // KEY=VALUE, the value as JSON, or a text
  bool json = false;                    // print the answer as JSON
};

// Adds the command `ctl` with its options to the command line.
const CLI::App* add_ctl_command(CLI::App& app, CtlOptions& options);

// Sends one request and prints the answer; after `subscribe`, each notification as a line of JSON, until the run ends
// or SIGINT. Returns 0; 1 if no imud answers or it refuses; 2 if the request is wrong. Throws OpenError if the token
// cannot be read.
int ctl(const CtlOptions& options);

}  // namespace imud
