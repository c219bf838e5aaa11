#include "protocols/dronecan/services.hpp"

#include <algorithm>

#include "protocols/dronecan/settings.hpp"
#include "protocols/wire/frame_writer.hpp"

namespace imud::dronecan {
namespace {

using Request = FieldReader<order::little>;

using Bytes = std::span<const std::byte>;

constexpr unsigned ok_bit = 0x80;  // a bool that is followed by padding

// The tags of param.Value and param.NumericValue.
enum Tag : unsigned { empty, integer, real, boolean, text };

struct NodeInfoWire {
  NodeStatusWire status;
  std::uint8_t software_major, software_minor;
  std::uint8_t optional_fields;  // 0: neither of the next two
  little_uint32_buf_t commit;
  little_uint64_buf_t image_crc;
  std::uint8_t hardware_major, hardware_minor;
  UniqueId unique_id;
  std::uint8_t certificate_size;  // 0
};
static_assert(sizeof(NodeInfoWire) == 41);

struct InterfaceWire {
  little_uint48_buf_t frames_sent, frames_received, errors;
};
struct TransportStatsWire {
  little_uint48_buf_t transfers_sent, transfers_received, errors;
  InterfaceWire interface;
};
static_assert(sizeof(TransportStatsWire) == 36);

Served serve_node_info(Bytes, DeviceTime now, Node& node, Payload& response) noexcept {
  const Identity& identity = node.identity;
  response.put(NodeInfoWire{.status = node.status(now),
                            .software_major = identity.software.major,
                            .software_minor = identity.software.minor,
                            .optional_fields = 0,
                            .commit = little_uint32_buf_t(0),
                            .image_crc = little_uint64_buf_t(0),
                            .hardware_major = identity.hardware.major,
                            .hardware_minor = identity.hardware.minor,
                            .unique_id = identity.unique_id,
                            .certificate_size = 0});
  response.put_text(identity.name);
  return Served::answered;
}

Served serve_transport_stats(Bytes, DeviceTime, Node& node, Payload& response) noexcept {
  using Count = little_uint48_buf_t;
  const TransportStatistics& s = node.statistics;
  response.put(TransportStatsWire{Count(s.transfers_sent),
                                  Count(s.transfers_received),
                                  Count(s.transfer_errors),
                                  {Count(s.frames_sent), Count(s.frames_received), Count(s.frame_errors)}});
  return Served::answered;
}

// Writes the response about a data type. `found`: nullptr if the node has no such type; `name`: the type's name.
void put_data_type_info(const DataType* found, std::string_view name, Payload& response) noexcept {
  constexpr unsigned known = 1, subscribed = 2, publishing = 4, serving = 8;
  response.put(little_uint64_buf_t(found != nullptr ? found->signature : 0));
  response.put(little_uint16_buf_t(found != nullptr ? found->id : std::uint16_t{0}));
  response.put_byte(found != nullptr && !found->is_service ? 1 : 0);
  const bool is_received = found == &global_time_sync || found == &allocation;
  response.put_byte(found == nullptr    ? 0
                    : found->is_service ? known | serving
                    : is_received       ? known | subscribed
                                        : known | publishing);
  response.put_text(found != nullptr ? found->name : name);
}

// The messages beside the measurements (`streams`).
constexpr std::array other_messages = {&node_status, &global_time_sync, &allocation};

// Returns the data type of this name or, if `name` is empty, of this id and kind; nullptr if there is none.
const DataType* find_type(std::string_view name, unsigned id, bool is_service) noexcept;

Served serve_data_type_info(Bytes bytes, DeviceTime, Node&, Payload& response) noexcept {
  Request request(bytes);
  const auto id = request.take<std::uint16_t>();
  const bool is_service = request.take<std::uint8_t>() == 0;
  if (!request.is_whole()) return Served::malformed;
  const std::span<const std::byte> rest = bytes.subspan(3);
  const std::string_view name(reinterpret_cast<const char*>(rest.data()), rest.size());
  put_data_type_info(find_type(name, id, is_service), name.substr(0, 80), response);
  return Served::answered;
}

void put_value(bool is_flag, std::int64_t value, Payload& response) noexcept {
  response.put_byte(is_flag ? boolean : integer);
  if (is_flag)
    response.put_byte(static_cast<unsigned>(value));
  else
    response.put(little_int64_buf_t(value));
}

// A request begins with 13 bits of index and 3 bits of tag. The parameter is set if the value has the parameter's
// type and is valid. The response has the parameter's present value.
Served serve_get_set(Bytes bytes, DeviceTime, Node& node, Payload& response) noexcept {
  Memory& memory = node.memory;
  Request request(bytes);
  const auto low = request.take<std::uint8_t>(), high = request.take<std::uint8_t>();
  const unsigned index = low | static_cast<unsigned>(high >> 3) << 8, tag = high & 7U;
  std::int64_t value = 0;
  std::size_t used = 2;
  if (tag == integer) {
    value = request.take<std::int64_t>();
    used += sizeof(std::int64_t);
  } else if (tag == real) {
    request.take<float>();
    used += sizeof(float);
  } else if (tag == boolean) {
    value = request.take<std::uint8_t>() != 0;
    used += 1;
  } else if (tag == text) {
    used += 1 + std::size_t{request.take<std::uint8_t>()};
  }
  if (!request.is_whole() || tag > text || used > bytes.size()) return Served::malformed;
  const std::span<const std::byte> rest = bytes.subspan(used);
  const std::string_view name(reinterpret_cast<const char*>(rest.data()), rest.size());
  const std::size_t key = name.empty() ? index : find_parameter(name).value_or(key_count);
  if (key >= key_count) {
    for (int i = 0; i < 4; ++i) response.put_byte(empty);  // value, default, maximum, minimum; no name
    return Served::answered;
  }
  const Parameter& parameter = parameters[key];
  if (tag == (parameter.is_flag ? boolean : integer) && memory.accepts(key, value)) memory.active[key] = value;
  put_value(parameter.is_flag, memory.active[key], response);
  put_value(parameter.is_flag, memory.factory[key], response);
  for (const std::int64_t limit : {memory.highest(key), std::int64_t{0}}) {
    if (parameter.is_flag)
      response.put_byte(empty);
    else
      put_value(false, limit, response);
  }
  response.put_text(parameter.name);
  return Served::answered;
}

Served serve_opcode(Bytes bytes, DeviceTime, Node& node, Payload& response) noexcept {
  Memory& memory = node.memory;
  constexpr unsigned save = 0, erase = 1;
  if (bytes.size() < 7) return Served::malformed;
  const auto opcode = std::to_integer<unsigned>(bytes[0]);
  if (opcode == save) memory.stored = memory.active;
  if (opcode == erase) memory.stored = memory.active = memory.factory;
  response.put(little_int48_buf_t(0));
  response.put_byte(opcode <= erase ? ok_bit : 0);
  return Served::answered;
}

Served serve_restart(Bytes bytes, DeviceTime, Node&, Payload& response) noexcept {
  constexpr std::uint64_t magic = 0xACCE551B1E;
  if (bytes.size() < sizeof(little_uint40_buf_t)) return Served::malformed;
  const bool ok = read_wire<little_uint40_buf_t>(bytes).value() == magic;
  response.put_byte(ok ? ok_bit : 0);
  return ok ? Served::restart : Served::answered;
}

using namespace std::string_view_literals;

// A service. If the node only knows the service, `serve` is nullptr, and the response is always `refusal`.
struct Service {
  DataType type;
  Served (*serve)(Bytes request, DeviceTime now, Node& node, Payload& response) noexcept;
  std::string_view refusal = "";
};
constexpr std::string_view not_implemented = "\x26\0"sv;  // the error of file services
constexpr Service services[] = {
    {{1, true, 0xEE468A8121C46A9E, "uavcan.protocol.GetNodeInfo"}, serve_node_info},
    {{2, true, 0x1B283338A7BED2D8, "uavcan.protocol.GetDataTypeInfo"}, serve_data_type_info},
    {{4, true, 0xBE6F76A7EC312B04, "uavcan.protocol.GetTransportStats"}, serve_transport_stats},
    {{5, true, 0x569E05394A3017F0, "uavcan.protocol.RestartNode"}, serve_restart},
    // The error's code, 1; the flag of an error of the shell.
    {{6, true, 0x59276B5921C9246E, "uavcan.protocol.AccessCommandShell"}, nullptr, "\1\0\0\0\2no shell"sv},
    {{10, true, 0x3B131AC5EB69D2CD, "uavcan.protocol.param.ExecuteOpcode"}, serve_opcode},
    {{11, true, 0xA7B622F939D1A4D5, "uavcan.protocol.param.GetSet"}, serve_get_set},
    {{15, true, 0x196AE06426A3B5D8, "uavcan.protocol.enumeration.Begin"}, nullptr, "\3"},  // unsupported
    // Invalid mode.
    {{40, true, 0xB7D725DF72724126, "uavcan.protocol.file.BeginFirmwareUpdate"}, nullptr, "\1not supported"},
    // Size 0, the error, no such entry.
    {{45, true, 0x5004891EE8A27531, "uavcan.protocol.file.GetInfo"}, nullptr, "\0\0\0\0\0\x26\0\0"sv},
    {{46, true, 0x8C46E8AB568BDA79, "uavcan.protocol.file.GetDirectoryEntryInfo"}, nullptr, "\x26\0\0"sv},
    {{47, true, 0x78648C99170B47AA, "uavcan.protocol.file.Delete"}, nullptr, not_implemented},
    {{48, true, 0x8DCDCA939F33F678, "uavcan.protocol.file.Read"}, nullptr, not_implemented},
    {{49, true, 0x515AA1DC77E58429, "uavcan.protocol.file.Write"}, nullptr, not_implemented},
    {{63, true, 0xDB11EDC510502658, "uavcan.tunnel.Call"}, nullptr},
};

const DataType* find_type(std::string_view name, unsigned id, bool is_service) noexcept {
  const auto is_it = [&](const DataType& type) {
    return name.empty() ? type.id == id && type.is_service == is_service : type.name == name;
  };
  for (const Service& service : services)
    if (is_it(service.type)) return &service.type;
  for (const DataType* message : other_messages)
    if (is_it(*message)) return message;
  for (const Stream& stream : streams)
    if (is_it(*stream.type)) return stream.type;
  return nullptr;
}

}  // namespace

const DataType* find_service(unsigned id) noexcept { return find_type("", id, true); }
const DataType* find_message(unsigned id) noexcept { return find_type("", id, false); }

std::span<std::byte> reseal(std::span<std::byte> data, const CanHeader& can) noexcept {
  const Identifier identifier = Identifier::parse(can.id);
  const DataType* type = identifier.is_anonymous() ? nullptr
                         : identifier.is_service   ? find_service(identifier.type)
                                                   : find_message(identifier.type);
  return type == nullptr ? std::span<std::byte>() : reseal_transfer(data, *type);
}

std::size_t transfer_frames(std::span<const Frame> frames) noexcept {
  for (std::size_t i = 0; i < frames.size() && !frames[i].bytes.empty(); ++i)
    if (frames[i].can == frames[0].can && Tail::parse(frames[i].bytes.back()).is_last) return i + 1;
  return 1;
}

Served serve(const DataType& service, std::span<const std::byte> request, DeviceTime now, Node& node,
             Payload& response) noexcept {
  const auto& known = *std::ranges::find(services, service.id, [](const Service& one) { return one.type.id; });
  if (known.serve != nullptr) return known.serve(request, now, node, response);
  response.put_text(known.refusal);
  return Served::answered;
}

}  // namespace imud::dronecan
