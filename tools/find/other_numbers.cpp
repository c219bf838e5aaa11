// Lists possible meanings of the bytes that are no known field, such as a temperature, for people who can decide.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "tools/find/field_search.hpp"

namespace imud {
namespace {

constexpr std::size_t number_pairs = 512;
constexpr double smooth_step = 0.6;  // change from frame to frame, relative to all changes
constexpr double times_moved = 4;    // of a number that the turn moves
constexpr double most_spread = 1e4;  // of a float, relative to its mean
constexpr std::size_t most_notes = 24;
constexpr std::size_t fewest_of_message = 8;

struct Reading {
  NumberPlace place;
  NumberStatistics rest, turned;
  bool is_moved() const {
    return turned.step < smooth_step * turned.sigma && turned.sigma > times_moved * rest.sigma;
  }
  bool is_slow() const {
    const auto drifts = [](const NumberStatistics& one) {
      return one.sigma > 0 && one.step < smooth_step * one.sigma;
    };
    return !is_moved() && (drifts(rest) || drifts(turned));
  }
};

std::optional<Reading> read(const HandledFrames& frames, const NumberPlace& place) {
  Reading reading{place, frames.statistics(place, Handled::rest, number_pairs),
                  frames.statistics(place, Handled::turned, number_pairs)};
  if (!reading.rest.is_finite || !reading.turned.is_finite) return std::nullopt;
  return reading;
}

bool is_number(const Reading& reading) {
  if (!reading.place.type.is_float()) return reading.is_moved() || reading.is_slow();
  // Bytes that are no float may have any exponent.
  const double mean = std::max(std::abs(reading.rest.mean), std::abs(reading.turned.mean));
  const double sigma = std::max(reading.rest.sigma, reading.turned.sigma);
  return sigma > 0 && mean > 1e-6 && mean < 1e9 && sigma < most_spread * mean;
}

std::string reading_text(const Reading& reading, const HandledFrames& frames) {
  std::vector<double> all = frames.values(reading.place, Handled::rest, 2048);
  for (const double value : frames.values(reading.place, Handled::turned, 2048)) all.push_back(value);
  const auto [low, high] = std::ranges::minmax(all);
  std::string text =
      fmt::format("bytes {}-{}: {} from {:.5g} to {:.5g}: ", reading.place.at,
                  reading.place.at + reading.place.type.bytes - 1, reading.place.type.text(), low, high);
  if (reading.is_moved()) return text + "the turn moves it: an angle, part of an attitude, or a field";
  constexpr double coldest = -40, hottest = 90;
  if (reading.place.type.is_float() && low > coldest && high < hottest && high - low < 20)
    return text + "hardly changes: may be temperature_c; warm the sensor by hand, and it rises";
  return text + "changes slowly, turned or not: a temperature? Warm the sensor by hand, and it changes";
}

// A byte with few values.
std::string bits_text(const NumberPlace& byte, const HandledFrames& frames) {
  std::set<unsigned> values, at_rest;
  for (const double value : frames.values(byte, Handled::rest, 4096))
    at_rest.insert(static_cast<unsigned>(static_cast<int>(value)) & 0xFFU);
  values = at_rest;
  for (const double value : frames.values(byte, Handled::turned, 4096))
    values.insert(static_cast<unsigned>(static_cast<int>(value)) & 0xFFU);
  constexpr std::size_t most_values = 8;
  if (values.size() < 2 || values.size() > most_values) return "";
  std::string text = fmt::format("byte {}: values", byte.at), bits;
  unsigned changed = 0;
  for (const unsigned value : values) {
    text += fmt::format(" {:02X}", value);
    changed |= value ^ *values.begin();
  }
  for (unsigned bit = 0; bit < 8; ++bit)
    if ((changed >> bit & 1U) != 0) bits += fmt::format("{}{}", bits.empty() ? "" : ", ", bit);
  text += fmt::format(": bits {} change{}", bits, at_rest.size() == values.size() ? "" : ", some only while turned");
  if (*values.rbegin() - *values.begin() < values.size()) text += "; or a slow number, such as a temperature";
  return text;
}

}  // namespace

void note_other_numbers(FoundMessage& message, std::size_t index, const HandledFrames& frames,
                        std::vector<bool> is_free) {
  using enum FrameNumber::Format;
  for (const Handled capture : {Handled::rest, Handled::turned})
    if (frames.frame_count(index, capture) < fewest_of_message) {
      message.notes.push_back(
          fmt::format("too few whole frames {} to find fields", capture == Handled::rest ? "at rest" : "turned"));
      return;
    }
  const std::size_t first = message.notes.size();
  const auto is_open = [&](std::size_t at, std::size_t bytes) {
    if (at + bytes > message.length) return false;
    for (std::size_t i = at; i < at + bytes; ++i)
      if (!is_free[i]) return false;
    return true;
  };
  const auto take = [&](const NumberPlace& place, const std::string& text) {
    if (text.empty() || message.notes.size() >= first + most_notes) return;
    message.notes.push_back(text);
    std::fill_n(is_free.begin() + static_cast<std::ptrdiff_t>(place.at), place.type.bytes, false);
  };
  const FrameNumber types[] = {{float64, 8, false},        {float64, 8, true},         {float32, 4, false},
                               {float32, 4, true},         {signed_integer, 4, false}, {signed_integer, 4, true},
                               {signed_integer, 2, false}, {signed_integer, 2, true}};
  for (const FrameNumber& type : types)
    for (std::size_t at = 0; at < message.length; ++at) {
      const std::size_t high = type.is_big ? at : at + type.bytes - 1, low = type.is_big ? at + type.bytes - 1 : at;
      // A number whose low byte never changes is a shorter one.
      if (!is_open(at, type.bytes) || message.constant[low] ||
          (message.constant[high] && type.bytes == 4 && !type.is_float()))
        continue;
      const auto reading = read(frames, {index, at, type});
      if (reading && is_number(*reading)) take(reading->place, reading_text(*reading, frames));
    }
  for (std::size_t at = 0; at < message.length; ++at) {
    const NumberPlace byte{index, at, {signed_integer, 1, false}};
    if (is_open(at, 1) && !message.constant[at]) take(byte, bits_text(byte, frames));
  }
  for (std::size_t begin = 0; begin < message.length; ++begin) {
    std::size_t end = begin;
    while (end < message.length && is_free[end] && !message.constant[end]) ++end;
    if (end == begin) continue;
    message.notes.push_back(
        fmt::format("byte{} {}: changes, but not as a number of the motion does", end - begin == 1 ? "" : "s",
                    end - begin == 1 ? std::to_string(begin) : fmt::format("{}-{}", begin, end - 1)));
    begin = end;
  }
}

}  // namespace imud
