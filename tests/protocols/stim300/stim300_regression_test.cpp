// The STIM300's frames when only samples advance its time: hashes of what it sent, and at which sample, before its
// timeouts used device time (44251d1). Polling its deadlines, and the time within a step at which the host's bytes
// arrive, change nothing.
#include <gtest/gtest.h>

#include <boost/crc.hpp>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

struct Command {
  int before;  // this sample
  const char* text;
};

// Start-up, every special datagram, Utility and Service Mode, resets, and a request that waits.
constexpr Command short_session[] = {
    {150, "N"},        {700, "I"},      {1500, "N"},           {1520, "C"},           {1600, "E"},
    {1650, "T"},       {1651, "I"},     {1700, "UTILITYM"},    {1701, "ODE"},         {1750, "$ie,"},
    {1760, "$sgu,3,"}, {1800, "$xn,"},  {1900, "E"},           {1950, "SERVICEMODE"}, {1990, "a"},
    {2000, "u a,1"},   {2001, "d t,1"}, {2010, "x N"},         {2200, "R"},           {2250, "UTILITYMODE"},
    {2500, "$xn,"},    {3200, "E"},     {3700, "SERVICEMODE"}, {3750, "x I"},
};
// A saved configuration, hold times, and a line left unfinished for a minute.
constexpr Command long_session[] = {
    {1500, "SERVICEMODE"}, {1510, "h t,1"},       {1520, "h b,1"}, {1530, "m 3"},
    {1540, "s"},           {1550, "Y"},           {1600, "x n"},   {1700, "i"},
    {8000, "E"},           {8200, "SERVICEMODE"}, {8300, "x i"},   {15000, "SERVICEMODE"},
    {15001, "m"},          {135000, " 2"},        {136000, "x N"}, {136500, "E"},
};

std::string line(const char* text) {
  std::string sent = text;
  if (sent == "UTILITYM" || sent == "m") return sent;
  if (!sent.starts_with('$')) return sent + "\r";
  boost::crc_optimal<8, 0x07, 0xFF, 0, false, false> crc;
  crc.process_bytes(sent.data(), sent.size());
  return sent + std::to_string(crc.checksum()) + "\r";
}

// FNV-1a, 64 bits.
class Hash {
 public:
  void add(std::uint64_t number) { mix(number, 8); }
  void add(std::uint64_t what, std::span<const Frame> frames) {
    for (const Frame& frame : frames) {
      add(what);
      for (const std::byte byte : frame.bytes) mix(std::to_integer<std::uint64_t>(byte), 1);
    }
  }
  std::uint64_t value() const { return value_; }

 private:
  void mix(std::uint64_t number, int bytes) {
    for (; bytes > 0; --bytes, number >>= 8) value_ = (value_ ^ (number & 0xFFU)) * 0x100000001B3U;
  }
  std::uint64_t value_ = 0xCBF29CE484222325U;
};

enum class Drive { by_samples, by_deadlines_too };

// The hash of what a unit with these settings sent in that many samples, and of its pulses. `latest`: the longest
// time after a sample at which the host's bytes arrive, 0.5 ms at most.
std::uint64_t recorded(const std::string& texts, std::span<const Command> session, int samples,
                       [[maybe_unused]] Drive drive, [[maybe_unused]] Nanoseconds latest) {
  const Protocol& protocol = protocol_named("stim300");
  Settings settings(protocol.settings);
  for (std::string_view rest = texts; !rest.empty();) {
    const std::string_view one = rest.substr(0, rest.find(' '));
    rest.remove_prefix(std::min(rest.size(), one.size() + 1));
    settings.set_text(one.substr(0, one.find('=')), one.substr(one.find('=') + 1));
  }
  const std::unique_ptr<Device> device = protocol.make(settings);
  const bool triggered = settings.integer("sample_rate") == 0;
  const auto frames = std::make_unique<FrameBuffer>();
  std::mt19937_64 random(5);
  const auto number = [&](double range) { return range * (static_cast<double>(random() % 2'000'001) / 1e6 - 1); };
  // The order in which arguments are evaluated is unspecified.
  const auto vector = [&](double range) {
    const double z = number(range), y = number(range), x = number(range);
    return Vector3(x, y, z);
  };
  Hash hash;
  Sample sample;
  for (int k = 0; k < samples; ++k) {
    const DeviceTime last = sample.time;
    sample.counter = static_cast<std::uint64_t>(k);
    sample.time = DeviceTime{} + k * 500us;
    sample.rate = vector(1);
    sample.specific_force = vector(25);
    sample.delta_angle = vector(5e-4);
    sample.delta_velocity = vector(1e-2);
    sample.temperature_c = k % 1000 < 900 ? 20 + number(1) : 90;
    sample.status = random() % 100 == 0 ? 1U << random() % 9 : 0;
    std::size_t sent = 0;
    for (const Command& command : session)
      if (command.before == k) {
        const std::string text = line(command.text);
        frames->clear();
        device->receive({std::as_bytes(std::span(text))}, last + latest, *frames);
        hash.add(static_cast<std::uint64_t>(k), frames->frames());
      }
    if (k > 0 && k % 700 == 350) device->pps(last + 123us);
    if (const auto edge = random() % 2000; k > 0 && triggered && edge < 500)
      device->trigger(last + std::chrono::microseconds(1 + edge));
    frames->clear();
    if (drive == Drive::by_deadlines_too)
      for (auto due = device->deadline(); due && *due <= sample.time; due = device->deadline())
        device->poll(*due, *frames);
    device->sample(sample, *frames);
    hash.add(static_cast<std::uint64_t>(k), frames->frames());
    for (const Frame& frame : frames->frames()) sent += frame.bytes.size();
    hash.add(sent);
    if (const auto pulse = device->pulse()) {
      hash.add(static_cast<std::uint64_t>((pulse->begin - sample.time).count()));
      hash.add(static_cast<std::uint64_t>((pulse->end - sample.time).count()));
    }
  }
  return hash.value();
}

// Combinations of bit rate, termination and start-up, each with its hash.
std::uint64_t recorded_all(int sample_rate, bool start_up, Drive drive, Nanoseconds latest) {
  Hash all;
  for (const char* bit_rate : {"374400", "460800", "921600", "1843200"})
    for (const char* rest : {"cr_lf=false", "cr_lf=true pps=true",
                             "temperature=false gyro_unit=integrated accelerometer_unit=increment"})
      all.add(recorded("sample_rate=" + std::to_string(sample_rate) + " bit_rate=" + bit_rate +
                           " start_up=" + (start_up ? "true " : "false ") + rest,
                       short_session, 4000, drive, latest));
  return all.value();
}

struct KnownHash {
  int sample_rate;
  bool start_up;
  std::uint64_t hash;
};
constexpr KnownHash known_hashes[] = {
    {0, false, 0xAB9AE409DF8808EA},   {0, true, 0x3F3033CC0DD94BBD},     {125, false, 0x7F9BD45C07B2851E},
    {125, true, 0x6A1C52F26B703A71},  {250, false, 0x4A63E320D0AFA833},  {250, true, 0x5A8D7EA7951AC097},
    {500, false, 0xF970E582AE8DBE28}, {500, true, 0x2C5CE81ED9AFCB9C},   {1000, false, 0x01443F48ECCCDE45},
    {1000, true, 0xBAC7247BB953C346}, {2000, false, 0xE918DD1BB96DB38E}, {2000, true, 0x7002828ABE099970},
};
constexpr KnownHash known_long[] = {
    {0, true, 0x7817286120593779},
    {250, false, 0x52BD633F8298975C},
    {1000, true, 0x1647096B0479237E},
};

using How = std::tuple<Drive, int>;
class Stim300Regression : public testing::TestWithParam<How> {
 protected:
  Drive drive() const { return std::get<0>(GetParam()); }
  Nanoseconds latest() const { return std::get<1>(GetParam()) * 1us; }
};
INSTANTIATE_TEST_SUITE_P(Drives, Stim300Regression,
                         testing::Values(How(Drive::by_samples, 0), How(Drive::by_deadlines_too, 250),
                                         How(Drive::by_deadlines_too, 500)));

TEST_P(Stim300Regression, EveryFrameLeavesAtItsSample) {
  for (const KnownHash& one : known_hashes)
    EXPECT_EQ(recorded_all(one.sample_rate, one.start_up, drive(), latest()), one.hash)
        << one.sample_rate << (one.start_up ? " true" : " false");
}

TEST_P(Stim300Regression, HoldTimesEndAtTheirSample) {
  for (const KnownHash& one : known_long)
    EXPECT_EQ(recorded("pps=true sample_rate=" + std::to_string(one.sample_rate) +
                           " start_up=" + (one.start_up ? "true" : "false"),
                       long_session, 137'000, drive(), latest()),
              one.hash)
        << one.sample_rate << (one.start_up ? " true" : " false");
}

}  // namespace
}  // namespace imud
