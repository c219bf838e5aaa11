// Any serial sensor whose frames a file describes (protocols/frames/README.md). The device sends the messages that
// are due with each sample, with the file's layout, and answers requests of a host.
//
// [imu.device]
// frame_file = "my.toml"
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include "core/units.hpp"
#include "protocols/frames/frame_device.hpp"
#include "protocols/frames/frame_message_seal.hpp"

namespace imud {
namespace {

// The message of a configuration without a file.
constexpr double rate_lsb = 0x1p-24, force_lsb = 0x1p-20, angle_lsb = 0x1p-30, velocity_lsb = 0x1p-24,
                 temperature_lsb = 0x1p-8;
constexpr double i32_end = 0x1p31, i16_end = 0x1p15;
constexpr const char* example_layout[] = {
    "\"IMUF\"",
    "time_us:u64",
    "sample_counter:u64",
    "rate_x_rad_per_s:i32*2^-24",
    "rate_y_rad_per_s:i32*2^-24",
    "rate_z_rad_per_s:i32*2^-24",
    "specific_force_x_m_per_s2:i32*2^-20",
    "specific_force_y_m_per_s2:i32*2^-20",
    "specific_force_z_m_per_s2:i32*2^-20",
    "delta_angle_x_rad:i32*2^-30",
    "delta_angle_y_rad:i32*2^-30",
    "delta_angle_z_rad:i32*2^-30",
    "delta_velocity_x_m_per_s:i32*2^-24",
    "delta_velocity_y_m_per_s:i32*2^-24",
    "delta_velocity_z_m_per_s:i32*2^-24",
    "temperature_c:i16*2^-8",
    "status:u32",
};

FrameDescription example() {
  FrameDescription description;
  description.file = "example";
  description.name = "example";
  FrameDescription::Message& message = description.messages.emplace_back();
  message.name = "imu";
  for (const char* element : example_layout) message.layout.push_back({element, 0});
  return description;
}

FrameDescription description_of(const Settings& settings) {
  if (settings.frames() != nullptr) return *settings.frames();
  if (!settings.text("frame_file").empty())
    throw std::invalid_argument("frame_file: the file was not read; this program cannot use it");
  return example();
}

// Returns the default model of errors. A shipped description has its own model only as a protocol, not as the file of
// this protocol.
std::string_view model_of(const Settings& settings) {
  const auto& description = settings.frames();
  return description == nullptr || description->model.empty() || !is_path_of_frames(description->file)
             ? "white"
             : std::string_view(description->model);
}

UartSettings uart_of(const FrameDescription& description, const Settings& settings) {
  UartSettings uart = description.uart;
  if (const std::int64_t baud = settings.integer("baud"); baud != 0) uart.baud = static_cast<unsigned>(baud);
  return uart;
}

// Returns the values of the description's settings that the configuration gives.
std::vector<FrameChosen> stored_values(const FrameSettings& described, const Settings& settings) {
  std::vector<FrameChosen> all;
  for (const std::string& text : settings.list("settings")) try {
      const std::size_t equals = text.find('=');
      if (equals == std::string::npos) throw std::invalid_argument("give NAME=VALUE");
      const std::size_t setting = described.at(text.substr(0, equals));
      all.push_back({setting, described.value_at(setting, text.substr(equals + 1))});
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("settings: " + text + ": " + error.what());
    }
  return all;
}

// Returns the part of the unit that listens to a host. The key `baud` counts as a value that a host has saved.
FrameHost host_of(const FrameDescription& description, const Settings& settings) {
  FrameHost host(std::make_shared<const FrameRequests>(description));
  for (const FrameChosen chosen : stored_values(host.requests().settings(), settings)) host.store(chosen);
  const std::int64_t baud = settings.integer("baud");
  if (const auto setting = host.requests().baud_setting(); setting && baud != 0) {
    const auto value = host.requests().settings().find_value(*setting, std::to_string(baud));
    if (!value)
      throw std::invalid_argument("baud: " + std::to_string(baud) + " is no value of the setting " +
                                  description.baud_setting + " of " + description.file +
                                  "; imud check prints its values");
    host.store({*setting, *value});
  }
  return host;
}

// Refuses a message with a rate above the rate of the samples. Where a setting has the rate inf as well, a host may
// ask for more than there is.
void check_rates(const Settings& settings, double rate_hz) {
  const FrameDescription description = description_of(settings);
  for (const FrameDescription::Message& message : description.messages) {
    const double highest = highest_rate_hz(description, message);
    if (highest <= rate_hz * (1 + 1e-6) || std::isinf(highest)) continue;
    const bool is_fixed = message.rate_setting.empty();
    char text[240];
    std::snprintf(text, sizeof text, "rate_hz %s %g, but with rate_hz = %g of the imu there are no more samples%s",
                  is_fixed ? "is" : "is a setting that a host may set to", highest, rate_hz,
                  is_fixed ? "" : "; with the value inf, each sample, the setting may have higher rates");
    throw std::invalid_argument("frame_file: " + description.file + ": line " + std::to_string(message.line) +
                                ": message \"" + message.name + "\": " + text);
  }
}

std::string rate_text(const FrameMessage& message) {
  if (message.period.count() == 0 && message.phases.size() == message.divider) return "with every sample";
  char text[80];
  if (message.period.count() != 0)
    std::snprintf(text, sizeof text, "at %g Hz", 1 / seconds(message.period));
  else
    std::snprintf(text, sizeof text, "with %zu of %llu samples", message.phases.size(),
                  static_cast<unsigned long long>(message.divider));
  return text;
}

std::string when(const FrameMessage& message, const FrameDescription::Message& described) {
  if (!described.is_streamed) return "when a request polls it";
  std::string text = described.rate_setting.empty() ? rate_text(message) : "at " + described.rate_setting + " Hz";
  const char* word = ", while ";
  for (const FrameHostDescription::Choice& choice : described.when) {
    text += word + choice.setting;
    for (const std::string& value : choice.values) text += (&value == choice.values.data() ? " = " : " or ") + value;
    word = " and ";
  }
  return text;
}

// Returns a text about the test frames of a message. All were compared when the file was read.
std::string agreement(const FrameDescription::Message& message) {
  const std::size_t frames = message.tests.size();
  return frames == 0   ? "no test_frame has been compared with it"
         : frames == 1 ? "its test frame agrees"
                       : fmt::format("its {} test frames agree", frames);
}

std::vector<std::string> layout_of(const Settings& settings) {
  const FrameDescription description = description_of(settings);
  std::vector<std::string> lines;
  if (description.escape != FrameEscape::none)
    lines.push_back(fmt::format("{}: the frames, whose bytes follow, are sent with the escapes of {}",
                                description.name, escape_name(description.escape)));
  std::size_t index = 0;
  for (const FrameMessage& message : frame_messages(description)) {
    const bool varies =
        std::ranges::any_of(message.layout->rows(), [](const auto& row) { return row.size == 0 || !row.offset; });
    const FrameDescription::Message& described = description.messages[index++];
    lines.push_back(fmt::format("{}, message \"{}\": {}{} bytes, {}; {}", description.name, message.name,
                                varies ? "at most " : "", message.layout->longest(), when(message, described),
                                agreement(described)));
    const std::vector<MessageLayout::Row>& rows = message.layout->rows();
    std::size_t type = 4, lsb = 3, unit = 4;
    for (const MessageLayout::Row& row : rows) {
      type = std::max(type, row.type.size());
      lsb = std::max(lsb, row.lsb.size());
      unit = std::max(unit, row.unit.size());
    }
    const auto padded = [](std::string text, std::size_t width) {
      text.resize(std::max(width, text.size()), ' ');
      return text;
    };
    const auto add = [&](const std::string& offset, const MessageLayout::Row& row) {
      lines.push_back(padded(offset, 6) + "  " + padded(row.type, type) + "  " + padded(row.lsb, lsb) + "  " +
                      padded(row.unit, unit) + "  " + row.name + row.remark);
    };
    add("offset", {{}, 0, "type", "LSB", "unit", "name"});
    for (const MessageLayout::Row& row : rows) add(row.offset ? fmt::format("{:6}", *row.offset) : "", row);
  }
  for (std::string& line : frame_request_rows(description)) lines.push_back(std::move(line));
  return lines;
}

constexpr Setting settings[] = {
    frames_setting("frame_file",
                   "file that describes the frames, or the name of a shipped description (imud list frame); without "
                   "it, one message is an example"),
    list_setting("settings",
                 "values of the description's settings that a host has saved in the unit before, as {NAME = VALUE}"),
    integer_setting("baud", "bit rate of the line, in place of that of the file; 0: as the file has it", 0, 0,
                    20'000'000),
};

constexpr DeviceCounter counters[] = {
    {"saturated_fields", "fields saturated",
     "a value is beyond the range of its field, and was sent as the nearest in it; see protocols/frames/README.md"},
    {"unknown_bytes", "bytes of the host that no request matched",
     "the host has sent what the description has no [[request]] for, or one whose check is wrong; imud check prints "
     "those that it has, and --record FILE keeps the bytes that came"},
    {"lost_answers", "answers for which there was no room"}};

}  // namespace

extern constexpr Protocol frame_protocol = {
    .name = "frame",
    .summary = "Any serial sensor whose frames a file describes",
    .document = "the user's description; its language: protocols/frames/README.md",
    .settings = settings,
    .resolution = {.time_s = 1e-6,
                   .rate = rate_lsb,
                   .specific_force = force_lsb,
                   .delta_angle = angle_lsb,
                   .delta_velocity = velocity_lsb,
                   .temperature_c = temperature_lsb},
    .range = {.rate = (i32_end - 1) * rate_lsb,
              .specific_force = (i32_end - 1) * force_lsb,
              .delta_angle = (i32_end - 1) * angle_lsb,
              .delta_velocity = (i32_end - 1) * velocity_lsb,
              .temperature_c = (i16_end - 1) * temperature_lsb},
    .sends_some_samples = true,
    .make_seal =
        [](const Settings& chosen) {
          const FrameDescription description = description_of(chosen);
          return seal_of(frame_messages(description), description.escape);
        },
    .counters = counters,
    .preset = model_of,
    .layout = layout_of,
    .check = check_rates,
    .make = [](const Settings& chosen) -> std::unique_ptr<Device> {
      const FrameDescription description = description_of(chosen);
      return std::make_unique<FrameDevice>(frame_messages(description), description, host_of(description, chosen),
                                           uart_of(description, chosen));
    },
    .make_decoder = [](const Settings& chosen) -> std::unique_ptr<Decoder> {
      const FrameDescription description = description_of(chosen);
      const FrameSettings described(description);
      std::vector<FrameValue> values = described.delivered();
      for (const auto [setting, value] : stored_values(described, chosen)) values[setting] = value;
      return std::make_unique<FrameStreamDecoder>(frame_messages(description), description.escape, values);
    },
};

}  // namespace imud
