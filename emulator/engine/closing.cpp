#include "emulator/engine/closing.hpp"

#include <poll.h>

#include <algorithm>
#include <exception>

namespace imud {

ChosenPorts chosen_ports(const Engine& engine) {
  ChosenPorts all;
  const auto add = [&all](std::string key, std::string port) {
    if (!port.empty()) all.emplace_back(std::move(key), std::move(port));
  };
  add("truth.port", engine.intake().chosen_port());
  for (const auto& channel : engine.channels()) {
    const std::string imu = "imu." + channel->name;
    const auto lines = std::as_const(*channel).lines.all();
    add(imu + ".port", lines[0].port->chosen_port());
    if (lines.size() == 2) add(imu + ".second_port", lines[1].port->chosen_port());
    for (const DeviceLine& copy : channel->lines.copies().lines()) add(imu + ".also", copy.port->chosen_port());
    if (channel->sync) {
      add(imu + ".sync.trigger_port", channel->sync->chosen_trigger_port());
      add(imu + ".sync.pps_port", channel->sync->chosen_pps_port());
    }
  }
  return all;
}

void empty_files(std::span<const std::unique_ptr<Channel>> channels) noexcept {
  for (const auto& channel : channels) {
    for (const DeviceLine& line : channel->lines.all()) line.port->flush();
    for (const DeviceLine& copy : channel->lines.copies().lines()) copy.port->flush();
  }
}

bool drain(Engine& engine, std::chrono::milliseconds readers) noexcept {
  constexpr std::chrono::milliseconds lines(500);
  const auto channels = engine.channels();
  const auto has_pace = [&] {
    for (const auto& channel : channels)
      for (const DeviceLine& line : channel->lines.all())
        if (line.port->next_flush()) return true;
    return false;
  };
  for (const auto& channel : channels) channel->flush(true);
  bool read = false;
  for (int ms = 0; !read && ms < (has_pace() ? std::max(lines, readers) : readers).count(); ++ms) {
    if (ms > 0) ::poll(nullptr, 0, 1);
    read = true;
    for (const auto& channel : channels) {
      for (const DeviceLine& line : channel->lines.all()) read = line.port->is_drained() && read;  // which flushes
      read = channel->lines.copies().is_drained() && read;
    }
  }
  for (const auto& channel : channels) {
    channel->lines.discard_pending();
    channel->publish();
  }
  return read;
}

void commit(std::span<const std::unique_ptr<Channel>> channels) {
  std::exception_ptr failure;
  for (const auto& channel : channels) try {
      channel->lines.commit();
    } catch (const std::exception&) {
      if (!failure) failure = std::current_exception();
    }
  if (failure) std::rethrow_exception(failure);
}

std::vector<Expected> expected(std::span<const std::unique_ptr<Channel>> channels) {
  std::vector<Expected> all;
  for (const auto& channel : channels)
    if (channel->faults)
      for (Expected& one : channel->faults->expectations().results()) all.push_back(std::move(one));
  return all;
}

}  // namespace imud
