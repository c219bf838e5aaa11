#include "emulator/frames/described_protocols.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "emulator/frames/frame_file.hpp"

namespace imud {
namespace {

struct Described {
  std::shared_ptr<const FrameDescription> description;
  std::vector<Setting> settings;
  Protocol protocol;
};

// A copy of the protocol `frame`, with a description in place of the key that names a description.
void describe(const ShippedFrames& shipped, Described& described) {
  described.description = read_frames(std::string(shipped.name));
  described.protocol = *find_protocol("frame");
  for (Setting setting : described.protocol.settings) {
    if (setting.names_frames) continue;
    setting.frames = &described.description;
    described.settings.push_back(setting);
  }
  described.protocol.name = shipped.name;
  described.protocol.summary = described.description->name;
  described.protocol.document = described.description->document;
  described.protocol.settings = described.settings;
  described.protocol.preset = nullptr;
  if (!described.description->model.empty())
    described.protocol.preset = [](const Settings& settings) { return std::string_view(settings.frames()->model); };
}

const Protocol* described_protocol(const ShippedFrames& shipped) {
  static std::map<std::string_view, Described> known;
  const auto [place, is_new] = known.try_emplace(shipped.name);
  if (is_new) describe(shipped, place->second);
  return &place->second.protocol;
}

// Returns the text of a key that stands in a line of its own; empty if there is none.
std::string_view line_value(std::string_view text, std::string_view key) {
  const std::string begin = fmt::format("\n{} = \"", key);
  const std::size_t at = text.find(begin);
  if (at == text.npos) return {};
  text.remove_prefix(at + begin.size());
  return text.substr(0, text.find('"'));
}

}  // namespace

const Protocol* resolve_protocol(std::string_view name) {
  if (const Protocol* entry = find_protocol(name)) return entry;
  const auto shipped = std::ranges::find(shipped_frames(), name, &ShippedFrames::name);
  return shipped != shipped_frames().end() ? described_protocol(*shipped) : nullptr;
}

bool is_described(const Protocol& protocol) {
  return std::ranges::any_of(protocol.settings, [](const Setting& setting) { return setting.frames != nullptr; });
}

std::vector<const Protocol*> described_protocols() {
  std::vector<const Protocol*> all;
  for (const ShippedFrames& shipped : shipped_frames()) all.push_back(described_protocol(shipped));
  return all;
}

std::vector<DescribedTitle> described_titles() {
  std::vector<DescribedTitle> all;
  for (const ShippedFrames& shipped : shipped_frames())
    all.push_back({shipped.name, line_value(shipped.text, "name"), line_value(shipped.text, "document")});
  return all;
}

std::vector<std::string> protocol_names() {
  std::vector<std::string> all;
  for (const Protocol* protocol : protocols()) all.emplace_back(protocol->name);
  for (const ShippedFrames& shipped : shipped_frames()) all.emplace_back(shipped.name);
  return all;
}

std::string frame_file_refusal(const Protocol& protocol) {
  return fmt::format("protocol \"{}\" has its description; omit the key, or give protocol = \"frame\"",
                     protocol.name);
}

}  // namespace imud
