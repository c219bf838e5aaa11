#include "transports/port.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <system_error>

#include "transports/file/compressed_file.hpp"

namespace imud {
namespace {

// Returns whether `path` ends in one of `suffixes`, which are separated by blanks.
bool ends_in_one_of(std::string_view path, std::string_view suffixes) {
  while (!suffixes.empty()) {
    const std::string_view suffix = suffixes.substr(0, suffixes.find(' '));
    if (path.ends_with(suffix)) return true;
    suffixes.remove_prefix(std::min(suffix.size() + 1, suffixes.size()));
  }
  return false;
}

// Returns whether `path` is a regular file that `transport` cannot read.
bool is_another_file(const Transport& transport, const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;
  try {
    transport.open({std::string(transport.name), path, {}}, Role::listener);
    return false;
  } catch (const PortError&) {
    return true;
  }
}

}  // namespace

const Transport* transport_of(std::string_view port) noexcept {
  return find_transport(port.substr(0, port.find(':')));
}

void check_port(const Transport& transport, const PortSpec& spec, const PortSettings& settings) {
  spec.allow_only(transport.options, settings.role == Role::device);
  transport.check(spec, settings);
  if (settings.role == Role::listener || transport.serves_device) return;
  const auto others =
      port_examples([&](const Transport& t) { return t.serves_device && t.carries_can == transport.carries_can; });
  throw spec.error(fmt::format("can only be read; right for output would be {}", fmt::join(others, " or ")));
}

std::unique_ptr<Port> open_port(std::string_view text, const PortSettings& settings) {
  const PortSpec spec = PortSpec::parse(text);
  if (const Transport* transport = find_transport(spec.scheme)) {
    check_port(*transport, spec, settings);
    return transport->open(spec, settings);
  }
  std::string known;
  for (const Transport* transport : transports()) known += fmt::format(" {}:", transport->name);
  throw PortError(fmt::format("'{}': there is no transport '{}'; right would be one of{}", text, spec.scheme, known));
}

const Transport* record_transport_of(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return nullptr;
  for (const Transport* transport : transports())
    if (transport->is_record != nullptr && transport->is_record(path)) return transport;
  return nullptr;
}

std::string capture_port(std::string_view capture) {
  const std::size_t colon = capture.find(':');
  if (const Transport* named = transport_of(capture); colon != std::string_view::npos && named && named->ends)
    return std::string(capture);
  const std::string file(capture.substr(0, capture.find('?')));
  if (const Transport* record = record_transport_of(file)) return fmt::format("{}:{}", record->name, capture);
  const std::string_view path = CompressedFile::without_suffix(capture.substr(0, capture.find('?')));
  const Transport* any = nullptr;
  for (const Transport* transport : transports()) {
    if (ends_in_one_of(path, transport->suffixes)) return fmt::format("{}:{}", transport->name, capture);
    if (transport->suffixes.find('*') != std::string_view::npos) any = transport;
  }
  if (any == nullptr || is_another_file(*any, file)) any = transport_of(standard_input_port(false, false));
  return any == nullptr ? std::string(capture) : fmt::format("{}:{}", any->name, capture);
}

std::string standard_input_port(bool keeps_datagrams, bool carries_can) {
  for (const Transport* transport : transports())
    if (transport->reads_standard_input && transport->keeps_datagrams == keeps_datagrams &&
        transport->carries_can == carries_can)
      return fmt::format("{}:-", transport->name);
  return "-";
}

}  // namespace imud
