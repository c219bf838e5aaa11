#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <boost/algorithm/hex.hpp>
#include <optional>
#include <span>

#include "emulator/config/fault_reader.hpp"

namespace imud {
namespace {

constexpr std::size_t longest = 256;

// Parses hexadecimal bytes. Returns nullopt if the text is empty or not hexadecimal.
std::optional<HostBytes> bytes_of_hex(std::string text) {
  std::erase(text, ' ');
  if (text.empty()) return std::nullopt;
  try {
    const std::string read = boost::algorithm::unhex(text);
    const auto bytes = std::as_bytes(std::span(read));
    return HostBytes(bytes.begin(), bytes.end());
  } catch (const boost::algorithm::hex_decode_error&) {
    return std::nullopt;
  }
}

}  // namespace

HostBytes read_host_bytes(TableReader& table) {
  HostBytes bytes;
  if (table.has("text") && table.has("hex")) table.fault("hex", "give either text or hex");
  if (table.has("text"))
    for (const char c : table.text("text", "")) bytes.push_back(static_cast<std::byte>(c));
  if (table.has("hex")) {
    const auto read = bytes_of_hex(table.text("hex", "00"));
    if (!read) table.fault("hex", "give bytes as hexadecimal digits, such as \"fa 05\"");
    bytes = read.value_or(HostBytes{});
  }
  if (bytes.size() > longest) table.fault("text", fmt::format("give at most {} bytes", longest));
  return bytes;
}

ExpectConfig read_expect(TableReader& table, std::size_t index, const std::vector<std::string>& imus,
                         std::span<const FaultConfig> faults) {
  ExpectConfig expect;
  expect.name = name_in(table, fmt::format("expect{}", index + 1));
  expect.imu = table.text("imu", imus.size() == 1 ? imus.front() : "");
  if (expect.imu.empty())
    table.fault("imu", fmt::format("missing: whose host; of: {}", fmt::join(imus, ", ")));
  else if (std::find(imus.begin(), imus.end(), expect.imu) == imus.end())
    table.fault("imu", fmt::format("there is no imu \"{}\"; of: {}", expect.imu, fmt::join(imus, ", ")));
  require(table, "what", "\"host_sends\", \"host_is_silent\" or \"host_reopens\"");
  using What = ExpectConfig::What;
  expect.what = table.choice<What>("what",
                                   {{What::host_sends, "host_sends"},
                                    {What::host_is_silent, "host_is_silent"},
                                    {What::host_reopens, "host_reopens"}},
                                   What::host_sends);
  expect.pattern = read_host_bytes(table);
  if (expect.what == ExpectConfig::What::host_reopens && !expect.pattern.empty())
    table.fault("what", "\"host_reopens\" is not about bytes; omit text and hex");
  const auto read_fault = [&](std::string_view key) {
    if (!table.has(key)) return;
    expect.fault_name = table.text(key, "");
    const auto found = std::ranges::find_if(faults, [&](const FaultConfig& fault) {
      return fault.name == expect.fault_name && (fault.kind == nullptr || fault.acts_on(expect.imu));
    });
    if (found == faults.end())
      table.fault(key, fmt::format("no fault \"{}\" acts on {}", expect.fault_name, expect.imu));
  };
  if (int{table.has("after")} + int{table.has("after_end_of")} + int{table.has("at_s")} > 1)
    table.fault("after", "give one of after, after_end_of and at_s");
  expect.after_end = table.has("after_end_of");
  read_fault(expect.after_end ? "after_end_of" : "after");
  constexpr double longest_s = 1e9;
  if (expect.fault_name.empty() || table.has("at_s")) expect.at_s = table.real("at_s", 0, 0, longest_s);
  require(table, "within_s", "the length of the time, in seconds");
  expect.within_s = table.real("within_s", 1, 1e-6, longest_s);
  table.finish();
  return expect;
}

}  // namespace imud
