// The ports of an Engine before its first step and after its last one.
#pragma once

#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "emulator/engine/engine.hpp"

namespace imud {

// Configuration keys of ports that the system has chosen, with the ports.
using ChosenPorts = std::vector<std::pair<std::string, std::string>>;
ChosenPorts chosen_ports(const Engine& engine);

// Empties the files that the ports write in place, by Port::flush(). Called when all that a run opens is open.
void empty_files(std::span<const std::unique_ptr<Channel>> channels) noexcept;

// Waits up to `readers` until the readers have read everything, or up to 500 ms until paced lines have sent
// everything; the rest counts as dropped. Returns false if a reader is known not to have read everything.
bool drain(Engine& engine, std::chrono::milliseconds readers) noexcept;

// Calls Channel::commit() of all channels, even if one fails, and then throws the first exception. Called after
// drain() if the run has not failed.
void commit(std::span<const std::unique_ptr<Channel>> channels);

// Returns the outcomes of the expectations.
std::vector<Expected> expected(std::span<const std::unique_ptr<Channel>> channels);

}  // namespace imud
