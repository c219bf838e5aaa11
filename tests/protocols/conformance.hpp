// The configurations in which the tests of all protocols run a protocol, and the inputs from which the fuzz test of
// its device starts. conformance.cpp has those of the protocols of one file, PRODUCT/conformance.cpp those of a
// product.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/protocol.hpp"

namespace imud {

// A configuration that the conformance test runs.
struct ConformanceSettings {
  // "key=value key=value ..."; each sample must immediately yield a frame. Other settings have their initial values.
  std::string_view settings = "";
  // Adapts a copy of the entry to these settings, if they change its fields, resolution, range or the like. nullptr:
  // they change nothing.
  void (*adapt)(Protocol& entry) = nullptr;
};

// Inputs of the host from which the fuzz test starts. A body is an input without its framing; on CAN, bodies and
// answers are frames in candump's notation ("123#0102 18EAFF00#00EE00").
struct HostInputs {
  std::string (*frame)(std::string_view body) = nullptr;  // adds the framing to a body
  std::span<const std::string_view> bodies = {};          // at least one of every kind
  // These bodies, sent one after another, must bring the device from any state to a state in which its answer to the
  // body `last` contains `answer`. Before them is a pause in which an unfinished input times out.
  std::span<const std::string_view> revive = {};
  std::string_view last = "", answer = "";
};

struct ConformanceInputs {
  std::span<const ConformanceSettings> settings = {};  // empty: the test runs the initial settings only
  HostInputs host = {};                                // has bodies if, and only if, the device overrides receive()
};

// A constant of this type declares the inputs of the protocol of that name.
class Conformance {
 public:
  Conformance(std::string_view protocol, const ConformanceInputs& inputs) { all().emplace(protocol, inputs); }

  static std::map<std::string_view, ConformanceInputs>& all() {
    static std::map<std::string_view, ConformanceInputs> declared;
    return declared;
  }
  static const ConformanceInputs& of(const Protocol& protocol) { return all()[protocol.name]; }
};

// Returns true if the sources of an entry override Device::receive().
inline bool overrides_receive(const Protocol& protocol) {
  namespace fs = std::filesystem;
  std::string stem(protocol.name);
  std::ranges::replace(stem, '-', '_');
  const fs::path folder = fs::path(IMUD_SOURCE_DIR) / "protocols";
  std::vector<fs::path> sources = {folder / "devices" / (stem + ".cpp")};
  if (!fs::exists(sources[0])) sources = {fs::directory_iterator(folder / stem), {}};
  std::ostringstream text;
  for (const fs::path& source : sources) text << std::ifstream(source).rdbuf();
  if (text.str().empty()) throw std::runtime_error("no source of " + stem);
  return text.str().find("void receive(") != std::string::npos;
}

}  // namespace imud
