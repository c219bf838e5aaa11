#include "emulator/faults/wire_faults.hpp"

#include <fmt/format.h>

#include <array>

namespace imud {
namespace {

constexpr std::string_view wire[] = {"wire"};

constexpr FaultParameter probability_of(std::string_view meaning) {
  return {.key = "value", .meaning = meaning, .min = 0, .max = 1};
}
constexpr FaultParameter of_frames = {
    .key = "value", .meaning = "probability with which a frame is affected", .initial = 1, .min = 0, .max = 1};

constexpr FaultParameter of_bits[] = {probability_of("probability that a data bit is wrong"),
                                      {.key = "burst_bits",
                                       .meaning = "mean length of a run of wrong bits; 0: each bit is independent",
                                       .initial = 0,
                                       .min = 0,
                                       .max = 1e6}};
constexpr FaultParameter of_lost_bytes[] = {probability_of("probability that a byte is lost")};
constexpr FaultParameter of_inserted_bytes[] = {probability_of("probability that a random byte precedes a byte")};
constexpr FaultParameter of_cut[] = {
    {.key = "bytes",
     .meaning = "bytes of a frame that leave; 0: as `fraction` has it",
     .initial = 0,
     .min = 0,
     .max = 16384},
    {.key = "fraction", .meaning = "part of a frame that leaves", .initial = 0.5, .min = 0, .max = 1},
    of_frames};
constexpr FaultParameter of_checksum[] = {of_frames};
constexpr FaultParameter of_garbage[] = {
    {.key = "bytes_per_s", .meaning = "rate of random bytes", .min = 0, .max = 1e6}};
constexpr FaultParameter of_baud[] = {
    {.key = "value", .meaning = "length of the sensor's bits, in bits of the line", .min = 0.05, .max = 20}};
constexpr FaultParameter of_bandwidth[] = {
    {.key = "value", .meaning = "part of the line's rate that is left", .initial = 0.5, .min = 1e-6, .max = 1},
    {.key = "baud", .meaning = "bit/s of a line whose port has none", .initial = 115200, .min = 50, .max = 1e9}};
constexpr FaultParameter of_frame_rate[] = {
    {.key = "frames_per_s", .meaning = "rate of the frames", .min = 0, .max = 1e5}};
constexpr FaultParameter of_load[] = {
    {.key = "percent", .meaning = "load of the bus with the sensor's own frames", .min = 0, .max = 100},
    {.key = "bitrate",
     .meaning = "bit/s of a bus whose port has none",
     .initial = 500'000,
     .min = 5'000,
     .max = 1'000'000}};

constexpr std::string_view host_bytes_lost = "commands that the host has sent meanwhile are lost";

constexpr FaultKind kind(WireFault code, std::string_view name, std::string_view summary,
                         std::span<const FaultParameter> parameters, bool is_ramped, std::string_view stays = {}) {
  return {.code = code,
          .name = name,
          .summary = summary,
          .seam = FaultSeam::wire,
          .targets = wire,
          .parameters = parameters,
          .is_ramped = is_ramped,
          .stays = stays,
          .acts_on_frames = true};
}

constexpr std::array kinds = {
    kind(WireFault::bit_errors, "bit_errors", "bits of the characters are wrong, alone or in runs", of_bits, true),
    kind(WireFault::byte_loss, "byte_loss", "bytes are lost", of_lost_bytes, true),
    kind(WireFault::byte_insertion, "byte_insertion", "random bytes are inserted", of_inserted_bytes, true),
    kind(WireFault::cut, "cut", "frames end early", of_cut, true),
    kind(WireFault::checksum_wrong, "checksum_wrong",
         "the content of frames is right, the checksum is that of another content", of_checksum, true),
    kind(WireFault::content_wrong, "content_wrong",
         "a bit of the content of frames is wrong, the checksum is right for it", of_checksum, true),
    kind(WireFault::garbage, "garbage", "random bytes between the frames", of_garbage, true),
    kind(WireFault::line_break, "break",
         "the line is at space: the receiver gets one 0x00 with a framing error, then nothing", {}, false),
    kind(WireFault::silence, "silence", "nothing leaves, and nothing that the host sends arrives", {}, false,
         host_bytes_lost),
    kind(WireFault::baud_wrong, "baud_wrong",
         "the sensor's UART runs at another speed: both sides sample the other's bits at the wrong times", of_baud,
         false, host_bytes_lost),
    kind(WireFault::disconnect, "disconnect",
         "the cable is out: a pty is hung up and its link is gone, on other lines nothing passes", {}, false,
         "the client of a pty has to open it anew; commands that the host has sent meanwhile are lost"),
    kind(WireFault::half_bandwidth, "half_bandwidth",
         "the line carries less, and the frames of a sample that finds it busy are dropped whole", of_bandwidth,
         false),
    kind(WireFault::bus_off, "bus_off", "the controller has left the bus until the end, when it restarts", {}, false,
         "counted as a bus-off and a restart; commands that the host has sent meanwhile are lost"),
    kind(WireFault::error_frames, "error_frames", "error frames are on the bus", of_frame_rate, true),
    kind(WireFault::same_id, "same_id",
         "another node sends a frame with the same identifier and random data after a frame of the sensor",
         of_checksum, true),
    kind(WireFault::babbling, "babbling", "a node sends frames with the highest priority", of_frame_rate, true),
    kind(WireFault::bus_load, "bus_load", "other nodes send frames with the lowest priority up to a level of load",
         of_load, true),
};
static_assert(has_every_code(kinds, static_cast<std::size_t>(WireFault::count)),
              "the rows stand in the order of the enumeration, one for each value");
static_assert(has_own_names(kinds), "a target has two kinds of one name");

bool suits(WireFault fault, Link link) {
  switch (fault) {
    case WireFault::checksum_wrong:
    case WireFault::content_wrong:
    case WireFault::silence:
    case WireFault::disconnect:
      return true;
    case WireFault::bus_off:
    case WireFault::error_frames:
    case WireFault::same_id:
    case WireFault::babbling:
    case WireFault::bus_load:
      return link == Link::can;
    case WireFault::bit_errors:
    case WireFault::byte_loss:
    case WireFault::byte_insertion:
    case WireFault::cut:
    case WireFault::garbage:
    case WireFault::line_break:
    case WireFault::baud_wrong:
    case WireFault::half_bandwidth:
      return link != Link::can;
    case WireFault::count:
      break;
  }
  return false;
}

}  // namespace

std::span<const FaultKind> wire_fault_kinds() noexcept { return kinds; }

std::string wire_fault_objection(const FaultKind& kind, const Protocol& protocol, const Settings& settings) {
  const WireFault fault = wire_fault(kind);
  const bool is_can = protocol.link == Link::can;
  if (!suits(fault, protocol.link)) {
    std::string right;
    for (const FaultKind& other : kinds)
      if (suits(wire_fault(other), protocol.link))
        right += fmt::format("{}{}", right.empty() ? "" : ", ", other.name);
    return fmt::format("{} is on {}; right would be {}", protocol.name, is_can ? "a CAN bus" : "a line of bytes",
                       right);
  }
  if ((fault == WireFault::checksum_wrong || fault == WireFault::content_wrong) &&
      make_seal(protocol, settings) == nullptr)
    return fmt::format("the frames of {} have no checksum{}", protocol.name,
                       is_can ? "" : "; bit_errors changes their content");
  return {};
}

}  // namespace imud
