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
    const std::string imu = "imu." + channel->name();
    add(imu + ".port", channel->port(0).chosen_port());
    if (channel->port_count() == 2) add(imu + ".second_port", channel->port(1).chosen_port());
    for (const DeviceLine& copy : channel->copies().lines()) add(imu + ".also", copy.port->chosen_port());
    if (channel->sync()) {
      add(imu + ".sync.trigger_port", channel->sync()->chosen_trigger_port());
      add(imu + ".sync.pps_port", channel->sync()->chosen_pps_port());
    }
  }
  return all;
}

bool drain(Engine& engine, std::chrono::milliseconds readers) noexcept {
  constexpr std::chrono::milliseconds lines(500);
  const auto channels = engine.channels();
  const auto has_pace = [&] {
    for (const auto& channel : channels)
      for (std::size_t i = 0; i < channel->port_count(); ++i)
        if (channel->port(i).next_flush()) return true;
    return false;
  };
  for (const auto& channel : channels) channel->flush();
  bool read = false;
  for (int ms = 0; !read && ms < (has_pace() ? std::max(lines, readers) : readers).count(); ++ms) {
    if (ms > 0) ::poll(nullptr, 0, 1);
    read = true;
    for (const auto& channel : channels) {
      for (std::size_t i = 0; i < channel->port_count(); ++i)
        read = channel->port(i).is_drained() && read;  // which flushes
      read = channel->copies().is_drained() && read;
    }
  }
  for (const auto& channel : channels) channel->discard_pending();
  return read;
}

void commit(std::span<const std::unique_ptr<Channel>> channels) {
  std::exception_ptr failure;
  for (const auto& channel : channels) try {
      channel->commit();
    } catch (const std::exception&) {
      if (!failure) failure = std::current_exception();
    }
  if (failure) std::rethrow_exception(failure);
}

std::vector<Expected> expected(std::span<const std::unique_ptr<Channel>> channels) {
  std::vector<Expected> all;
  for (const auto& channel : channels)
    for (Expected& one : channel->expected()) all.push_back(std::move(one));
  return all;
}

}  // namespace imud
