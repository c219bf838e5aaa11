// Any sensor on CAN that has a DBC file. The configuration assigns numbers to the signals of the file. A message is
// sent if at least one of its signals has a number: each GenMsgCycleTime, or with every sample if the file states no
// cycle time. All other signals keep GenSigStartValue. Messages that are due with one sample are sent in the order of
// their priority. A multiplexed message sends in turn its pages that have a signal with a number. With several
// multiplexors (extended multiplexing), each multiplexor sends its pages in turn.
//
// [imu.device]
// dbc_file = "vehicle.dbc"
// signals = ["YawRate=abs(rate_z_deg_per_s)", "YawSign=sign(rate_z_deg_per_s)", "Imu2.Ay=-specific_force_y_g",
//            "Imu2.Heading=yaw_deg%360", "Imu2.Valid=1", "Imu2.Counter=alive_counter"]
// checksums = ["Imu2.Crc=e2e_p01:0x123:both"]
#include <algorithm>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <string>

#include "protocols/signals/dbc_file.hpp"
#include "protocols/signals/signal_product.hpp"

namespace imud {
namespace {

// The messages of a configuration without a file.
constexpr std::string_view example_dbc = R"(
BO_ 512 ImuRate: 8 imu
 SG_ RateX : 0|16@1- (0.02,0) [0|0] "deg/s" host
 SG_ RateY : 16|16@1- (0.02,0) [0|0] "deg/s" host
 SG_ RateZ : 32|16@1- (0.02,0) [0|0] "deg/s" host
 SG_ Temperature : 48|8@1+ (1,-50) [0|0] "degC" host
 SG_ Counter : 56|8@1+ (1,0) [0|0] "" host

BO_ 513 ImuForce: 8 imu
 SG_ ForceX : 7|16@0- (0.0005,0) [0|0] "g" host
 SG_ ForceY : 23|16@0- (0.0005,0) [0|0] "g" host
 SG_ ForceZ : 39|16@0- (0.0005,0) [0|0] "g" host
 SG_ Status : 48|8@1+ (1,0) [0|0] "" host
 SG_ Counter : 56|8@1+ (1,0) [0|0] "" host
)";
constexpr double example_rate_lsb = 0.02 * units::degree, example_force_lsb = 0.0005 * units::standard_gravity;
const std::vector<std::string> example_signals = {
    "RateX=rate_x_deg_per_s",         "RateY=rate_y_deg_per_s",
    "RateZ=rate_z_deg_per_s",         "ForceX=specific_force_x_g",
    "ForceY=specific_force_y_g",      "ForceZ=specific_force_z_g",
    "Temperature=temperature_c",      "Status=status",
    "ImuRate.Counter=sample_counter", "ImuForce.Counter=sample_counter"};

[[noreturn]] void refuse(const char* key, const std::string& fault) {
  throw std::invalid_argument(std::string(key) + ": " + fault);
}

// A message of the file, with its signals as configured.
struct Mapped {
  const DbcMessage* message = nullptr;
  std::vector<std::string> sources = {};  // of the message's signals, in the order of these
  MessageChecksum checksum = {};
  bool is_used = false;
};

std::string first_names(const std::vector<Mapped>& all) {
  std::string names;
  std::size_t count = 0;
  for (const Mapped& one : all)
    for (const DbcSignal& signal : one.message->signals) {
      if (++count > 40) return names + ", and others";
      names.append(names.empty() ? "" : ", ").append(one.message->name).append(".").append(signal.name);
    }
  return names.empty() ? "none" : names;
}

// Finds the signal in `text`, "[MESSAGE.]SIGNAL=VALUE", and sets its source. Returns its message, and VALUE.
std::pair<Mapped*, std::string> assign(std::vector<Mapped>& all, const char* key, const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos)
    refuse(key, "\"" + text + "\": give SIGNAL=" + (key == std::string_view("signals") ? "QUANTITY" : "KIND"));
  const std::string value = text.substr(equals + 1), name = text.substr(0, equals);
  std::pair<Mapped*, std::string*> found = {};
  for (Mapped& one : all)
    for (std::size_t i = 0; i < one.sources.size(); ++i) {
      const DbcSignal& signal = one.message->signals[i];
      const auto names = [&](const std::string& one_name) {
        return one_name == signal.name || (!signal.short_name.empty() && one_name == signal.short_name);
      };
      const auto is_after = [&](const std::string& message) {
        return !message.empty() && name.starts_with(message + ".") && names(name.substr(message.size() + 1));
      };
      if (!names(name) && !is_after(one.message->name) && !is_after(one.message->short_name)) continue;
      if (found.first != nullptr)
        refuse(key, "\"" + name + "\" is a signal of " + found.first->message->name + " and of " + one.message->name +
                        "; give MESSAGE.SIGNAL");
      found = {&one, &one.sources[i]};
    }
  if (found.first == nullptr) refuse(key, "unknown signal \"" + name + "\"; the signals are " + first_names(all));
  if (!found.second->empty()) refuse(key, "\"" + name + "\" is listed twice");
  *found.second = key == std::string_view("signals") ? value : std::string(checksum_source);
  found.first->is_used = true;
  return {found.first, value};
}

// Returns the message in the form in which a device sends it.
SignalMessage compiled(const Mapped& mapped, std::uint32_t id_offset) {
  const DbcMessage& message = *mapped.message;
  const std::string where = "line " + std::to_string(message.line) + ": message " + message.name + ": ";
  const std::uint64_t id = std::uint64_t{message.id} + id_offset;
  if (id > (message.extended ? 0x1FFF'FFFFU : 0x7FFU))
    refuse(id_offset == 0 ? "dbc_file" : "id_offset", where + "the identifier is out of range");
  constexpr std::size_t sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  if (std::ranges::count(sizes, message.size) == 0)
    refuse("dbc_file", where + "no CAN frame has " + std::to_string(message.size) + " data bytes");

  std::vector<CanSignal> signals;
  for (std::size_t i = 0; i < message.signals.size(); ++i) {
    const DbcSignal& signal = message.signals[i];
    signals.push_back({signal.name, signal.start, signal.length, signal.encoding, signal.scale, signal.offset,
                       mapped.sources[i], nullptr, signal.initial, signal.minimum, signal.maximum, signal.pages,
                       signal.multiplexor});
  }
  MessageChecksum checksum = mapped.checksum;
  checksum.begin_with(static_cast<std::uint32_t>(id), message.extended, message.size);
  try {
    return {{.id = static_cast<std::uint32_t>(id),
             .extended = message.extended,
             .fd = message.fd,
             .bit_rate_switch = message.fd},
            message.cycle,
            CanSignalCodec(message.size, signals, checksum)};
  } catch (const std::invalid_argument& fault) {
    refuse("signals", "message " + message.name + ", line " + std::to_string(message.line) + ": " + fault.what());
  }
}

// Refuses a message whose cycle time is shorter than the interval of the samples.
void check_cycle(const DbcMessage& message, double rate_hz) {
  const double cycle_s = seconds(message.cycle);
  if (cycle_s == 0 || cycle_s * rate_hz > 1 - 1e-6) return;
  char numbers[160];
  std::snprintf(
      numbers, sizeof numbers,
      "GenMsgCycleTime is %g ms, but with rate_hz = %g a sample comes every %g ms; give rate_hz = %g or more",
      1e3 * cycle_s, rate_hz, 1e3 / rate_hz, 1 / cycle_s);
  refuse("dbc_file", "line " + std::to_string(message.line) + ": message " + message.name + ": " + numbers);
}

// Returns the messages that the settings select. `rate_hz` is the rate of the samples; infinity if it is not known
// yet.
std::vector<SignalMessage> messages_of(const Settings& settings,
                                       double rate_hz = std::numeric_limits<double>::infinity()) {
  const std::string& path = settings.text("dbc_file");
  const bool is_example = path.empty() && settings.list("signals").empty() && settings.list("checksums").empty();
  if (path.empty() && !is_example) refuse("dbc_file", "give the path of the DBC file that has the signals");
  std::vector<DbcMessage> messages;
  try {
    messages = is_example ? parse_dbc(example_dbc) : read_dbc_file(path);
  } catch (const std::invalid_argument& fault) {
    refuse("dbc_file", fault.what());
  }
  std::vector<Mapped> all;
  for (const DbcMessage& message : messages) {
    all.push_back({.message = &message});
    all.back().sources.resize(message.signals.size());
  }
  for (const std::string& text : is_example ? example_signals : settings.list("signals"))
    assign(all, "signals", text);
  for (const std::string& text : settings.list("checksums")) {
    const auto [message, kind] = assign(all, "checksums", text);
    const auto checksum = parse_checksum(kind);
    if (!checksum) refuse("checksums", "\"" + text + "\": the kind must be " + std::string(checksum_syntax));
    message->checksum = *checksum;
  }
  std::erase_if(all, [](const Mapped& one) { return !one.is_used; });
  if (all.empty()) refuse("signals", "give at least one SIGNAL=QUANTITY");
  // Messages are in the order in which their identifiers win the arbitration.
  std::ranges::stable_sort(all, {}, [](const Mapped& one) {
    return one.message->extended ? std::uint64_t{one.message->id} << 1 | 1 : std::uint64_t{one.message->id} << 19;
  });
  std::vector<SignalMessage> compiled_messages;
  for (const Mapped& one : all) {
    check_cycle(*one.message, rate_hz);
    compiled_messages.push_back(compiled(one, static_cast<std::uint32_t>(settings.integer("id_offset"))));
  }
  return compiled_messages;
}

constexpr Setting settings[] = {
    text_setting("dbc_file", "path of the DBC file; without it, signals and checksums, two messages are an example",
                 ""),
    list_setting(
        "signals",
        "numbers of the signals: [MESSAGE.]SIGNAL=QUANTITY, such as YawRate=rate_z_deg_per_s, or abs(QUANTITY), "
        "sign(QUANTITY), QUANTITY%MODULUS, a number; the quantities are in protocols/README.md"),
    list_setting("checksums",
                 "checksums of messages: [MESSAGE.]SIGNAL=KIND, such as Crc=j1850 or Imu.Crc=e2e_p01:0x123:both; "
                 "the kinds are in protocols/README.md"),
    integer_setting("id_offset", "is added to every identifier of the file, so that several units can be on one bus",
                    0, 0, 0x1FFF'FFFF),
};

constexpr DeviceCounter counters[] = {
    {"saturated_signals", "signals saturated",
     "the number of a signal is beyond the range of its field or its limits, and was sent as the nearest in it; see "
     "abs(), sign() and % in protocols/README.md"}};

}  // namespace

extern constexpr Protocol dbc_protocol = {
    .name = "dbc",
    .summary = "Any sensor on CAN with a DBC file, whose signals the configuration assigns",
    .link = Link::can,
    .document = "a DBC file; checksums: AUTOSAR E2E, see protocols/wire/message_checksum.hpp",
    .settings = settings,
    .fields = Measurement::counter | Measurement::rate | Measurement::specific_force | Measurement::temperature |
              Measurement::status,
    .resolution = {.rate = example_rate_lsb, .specific_force = example_force_lsb, .temperature_c = 1},
    .range = {.rate = 32767 * example_rate_lsb, .specific_force = 32767 * example_force_lsb, .temperature_c = 50},
    .counter_bits = 8,
    .status_bits = 0xFF,
    .make_seal = [](const Settings& chosen) { return seal_of(messages_of(chosen)); },
    .counters = counters,
    .can_messages = [](const Settings& chosen,
                       double rate_hz) { return can_messages_of(messages_of(chosen), rate_hz); },
    .can_filters = no_can_filters,
    .check = [](const Settings& chosen, double rate_hz) { static_cast<void>(messages_of(chosen, rate_hz)); },
    .make = [](const Settings& chosen) -> std::unique_ptr<Device> {
      return std::make_unique<SignalDevice>(messages_of(chosen));
    },
    .make_decoder = [](const Settings& chosen) -> std::unique_ptr<Decoder> {
      return std::make_unique<SignalDecoder>(messages_of(chosen));
    },
};

}  // namespace imud
