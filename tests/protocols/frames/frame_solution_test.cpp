// The status words of the shipped descriptions while the unit's own filter aligns, is aided, coasts, and is aided
// again, by the numbers of the documents that the descriptions name.
#include <gtest/gtest.h>

#include <bit>
#include <cstddef>
#include <string>
#include <vector>

#include "core/units.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/protocols/solution_phases.hpp"

namespace imud {
namespace {

Sample over_jena() {
  Sample sample;
  sample.specific_force = {0, 0, -9.8};
  sample.navigation = {.is_known = true,
                       .satellites = 9,
                       .gps_ns = 1'440'000'001'000'000'000,
                       .latitude = 50.9 * units::degree,
                       .longitude = 11.6 * units::degree,
                       .height = 200,
                       .v_L = {3, 4, 0}};
  return sample;
}
constexpr PhaseSigmas drifted = {.tilt_deg = 0.4, .heading_deg = 1.5, .velocity = 0.2, .position = 30};

std::vector<Sample> phases(const Sample& known) {
  return {known, aligning(known, false), aligning(known), aided(known), coasting(known, 30, drifted), aided(known)};
}

std::vector<unsigned> first_frames(std::string_view product, const Sample& sample) {
  Line line(protocol_named("frame"), frame_settings(read_frames(std::string(product))));
  std::vector<unsigned> bytes;
  for (const std::byte byte : bytes_of(line, sample)) bytes.push_back(std::to_integer<unsigned>(byte));
  return bytes;
}
// The byte at that place in each phase; behind `more` bytes.
std::vector<unsigned> byte_at(std::string_view product, std::size_t at) {
  std::vector<unsigned> all;
  for (const Sample& sample : phases(over_jena())) all.push_back(first_frames(product, sample).at(at));
  return all;
}
unsigned big_endian(const std::vector<unsigned>& frame, std::size_t at, std::size_t bytes = 4) {
  unsigned number = 0;
  for (std::size_t i = at; i < at + bytes; ++i) number = number << 8 | frame.at(i);
  return number;
}

// The words of the sentence that begins so, in each phase.
std::vector<std::vector<std::string>> sentences(std::string_view product, const std::string& begin) {
  std::vector<std::vector<std::string>> all;
  for (const Sample& sample : phases(over_jena())) {
    std::string text;
    for (const unsigned byte : first_frames(product, sample)) text += static_cast<char>(byte);
    const std::size_t at = text.find(begin);
    std::vector<std::string> words = {""};
    for (std::size_t i = at; i < text.size() && text[i] != '*'; ++i)
      if (text[i] == ',')
        words.emplace_back();
      else
        words.back() += text[i];
    all.push_back(words);
  }
  return all;
}
std::vector<std::string> word(const std::vector<std::vector<std::string>>& of_phases, std::size_t index) {
  std::vector<std::string> words;
  for (const auto& one : of_phases) words.push_back(index < one.size() ? one[index] : "none");
  return words;
}

using Numbers = std::vector<unsigned>;
using Words = std::vector<std::string>;

TEST(SolutionStatus, OfNmea) {
  const auto gga = sentences("nmea", "$GPGGA"), rmc = sentences("nmea", "$GPRMC"), vtg = sentences("nmea", "$GPVTG");
  EXPECT_EQ(word(gga, 6), (Words{"1", "0", "0", "1", "6", "1"})) << "6: dead reckoning";
  EXPECT_EQ(word(gga, 7), (Words{"09", "00", "09", "09", "00", "09"}));
  EXPECT_EQ(word(rmc, 2), (Words{"A", "V", "V", "A", "A", "A"}));
  EXPECT_EQ(word(rmc, 12), (Words{"A", "N", "N", "A", "E", "A"}));
  EXPECT_EQ(word(vtg, 9), (Words{"A", "N", "N", "A", "E", "A"}));
  const std::string time = gga[0][1];
  EXPECT_EQ(word(gga, 1), (Words{time, "", time, time, time, time})) << "the receiver's while the filter aligns";
  EXPECT_EQ(gga[2][2], "") << "no latitude";
}

TEST(SolutionStatus, OfNmeaAttitude) {
  const auto pashr = sentences("nmea-attitude", "$PASHR");
  EXPECT_EQ(word(pashr, 10), (Words{"1", "0", "0", "1", "1", "1"})) << "1: a position";
  EXPECT_EQ(word(pashr, 7), (Words{"0.101", "180.000", "180.000", "0.200", "0.400", "0.200"})) << "roll";
  EXPECT_EQ(word(pashr, 9), (Words{"0.267", "180.000", "180.000", "0.800", "1.500", "0.800"})) << "heading";
}

TEST(SolutionStatus, OfTss1) { EXPECT_EQ(byte_at("tss1", 13), (Numbers{'H', 'h', 'h', 'F', 'H', 'F'})); }

TEST(SolutionStatus, OfApplanix) {
  EXPECT_EQ(byte_at("applanix-gsof", 15), (Numbers{4, 1, 1, 4, 4, 4})) << "coarse leveling, full navigation";
  EXPECT_EQ(byte_at("applanix-gsof", 16), (Numbers{1, 0, 0, 1, 6, 1})) << "6: dead reckoning";
  std::vector<unsigned> weeks;
  for (const Sample& sample : phases(over_jena()))
    weeks.push_back(big_endian(first_frames("applanix-gsof", sample), 9, 2));
  EXPECT_EQ(weeks, (Numbers{2380, 0, 2380, 2380, 2380, 2380}));
}

TEST(SolutionStatus, OfNcom) {
  EXPECT_EQ(byte_at("ncom", 21), (Numbers{4, 2, 2, 4, 4, 4})) << "ready to initialise, real time";
  EXPECT_EQ(byte_at("ncom", 67), (Numbers{9, 0, 9, 9, 0, 9})) << "satellites";
  for (const std::size_t mode : {68U, 69U, 70U})
    EXPECT_EQ(byte_at("ncom", mode), (Numbers{5, 0, 5, 5, 0, 5})) << "0: the receiver cannot measure";
}

TEST(SolutionStatus, OfInertialLabs) {
  const std::size_t end = first_frames("inertiallabs-ins", over_jena()).size();
  EXPECT_EQ(byte_at("inertiallabs-ins", end - 3), (Numbers{0, 3, 3, 0, 4, 0})) << "no heading yet, autonomous";
  // The accuracies follow the place, of which the last four bytes are the height in cm.
  const std::size_t at = 111;
  EXPECT_EQ(byte_at("inertiallabs-ins", at), (Numbers{10, 255, 255, 100, 200, 100})) << "of the velocity, mm/s";
  EXPECT_EQ(byte_at("inertiallabs-ins", at + 3 + 6 + 2), (Numbers{2, 0, 2, 2, 0, 2})) << "fix";
  EXPECT_EQ(byte_at("inertiallabs-ins", at + 3 + 6 + 2 + 2), (Numbers{9, 0, 9, 9, 0, 9})) << "satellites";
}

TEST(SolutionStatus, OfSensAItion) {
  const std::size_t ins = 39 + 19;
  EXPECT_EQ(byte_at("sensaition-ins", ins + 3), (Numbers{9, 0, 9, 9, 0, 9})) << "satellites";
  EXPECT_EQ(byte_at("sensaition-ins", ins + 35), (Numbers{1, 0, 0, 1, 1, 1})) << "aligned";
  EXPECT_EQ(byte_at("sensaition-ins", ins + 41), (Numbers{3, 0, 3, 3, 0, 3})) << "fix";
  std::vector<unsigned> accuracies;
  for (const Sample& sample : phases(over_jena()))
    accuracies.push_back(big_endian(first_frames("sensaition-ins", sample), ins + 47));
  const unsigned unknown = ~0U;  // beyond the field
  EXPECT_EQ(accuracies, (Numbers{1000, unknown, unknown, 1000, 30'000, 1000})) << "of the latitude, mm";
}

// The bytes from there on.
std::vector<unsigned> part(std::string_view product, const Sample& sample, std::size_t at, std::size_t size) {
  const std::vector<unsigned> frame = first_frames(product, sample);
  if (frame.size() < at + size) return {};
  const auto begin = frame.begin() + static_cast<std::ptrdiff_t>(at);
  return {begin, begin + static_cast<std::ptrdiff_t>(size)};
}

// A receiver with a fix and a place of 0, 0 would contradict each other.
TEST(SolutionStatus, ThePlaceIsTheReceiversWhileTheFilterAligns) {
  struct Place {
    std::string_view product;
    std::size_t at, size;  // of latitude, longitude, and what follows of height and velocity
  };
  const Sample known = over_jena();
  for (const auto& [product, at, size] :
       {Place{"applanix-gsof", 17, 40}, Place{"ncom", 23, 29}, Place{"inertiallabs-ins", 87, 24},
        Place{"sensaition-ins", 39 + 19 + 11, 24}, Place{"stdbin-ins", 45, 16}}) {
    const std::vector<unsigned> of_truth = part(product, known, at, size), none(size, 0);
    EXPECT_EQ(of_truth.size(), size) << product;
    EXPECT_NE(of_truth, none) << product;
    EXPECT_EQ(part(product, aligning(known), at, size), of_truth) << product;
    EXPECT_EQ(part(product, aligning(known, false), at, size), none) << product << ", without a fix";
  }
}

// The frames of a message that is not sent as delivered, in each phase.
std::vector<std::vector<unsigned>> message_in_phases(std::string_view product, std::string_view message,
                                                     const std::vector<Sample>& samples) {
  std::vector<std::vector<unsigned>> all;
  for (const FrameMessage& one : frame_messages(*read_frames(std::string(product)))) {
    if (one.name != message) continue;
    for (const Sample& sample : samples) {
      std::vector<double> carried(one.layout->carries());
      std::vector<std::byte> bytes(one.layout->longest());
      one.layout->encode({sample}, {}, carried, bytes);
      std::vector<unsigned>& numbers = all.emplace_back();
      for (const std::byte byte : bytes) numbers.push_back(std::to_integer<unsigned>(byte));
    }
  }
  return all;
}
unsigned little_endian(const std::vector<unsigned>& frame, std::size_t at, std::size_t bytes) {
  unsigned number = 0;
  for (std::size_t i = at + bytes; i > at; --i) number = number << 8 | frame.at(i - 1);
  return number;
}

TEST(SolutionStatus, OfAdvancedNavigation) {
  std::vector<Sample> samples = phases(over_jena());
  Sample levelled = navigating(over_jena(), Solution::State::levelled, {});
  levelled.navigation = {};
  samples.push_back(levelled);
  const unsigned orientation = 1, navigation = 2, heading = 4, utc = 8, fix_3d = 0x20, receiver = 0x200;
  const unsigned fixed = orientation | navigation | heading | utc | fix_3d | receiver;
  const Numbers wanted = {fixed,           receiver, utc | fix_3d | receiver,         fixed,
                          fixed & ~fix_3d, fixed,    orientation | heading | receiver};
  const std::size_t data = 5;
  Numbers of_20, of_23;
  for (const auto& frame : message_in_phases("anpp", "20", samples))
    of_20.push_back(little_endian(frame, data + 2, 2));
  for (const auto& frame : message_in_phases("anpp", "23", samples))
    of_23.push_back(little_endian(frame, data + 2, 2));
  EXPECT_EQ(of_20, wanted);
  EXPECT_EQ(of_23, wanted);
  const auto first = [&](const char* message, std::size_t at, const Sample& sample) {
    return std::bit_cast<float>(little_endian(message_in_phases("anpp", message, {sample}).at(0), data + at, 4));
  };
  const Sample drifts = coasting(over_jena(), 30, drifted);
  EXPECT_EQ(first("20", 88, drifts), 30) << "m north";
  EXPECT_EQ(first("24", 8, drifts), 30) << "m down";
  EXPECT_EQ(first("25", 0, drifts), 0.2F) << "m/s north";
  EXPECT_NEAR(first("26", 8, drifts), 1.5 * units::degree, 1e-7) << "rad of heading";
  Sample east = drifts;
  east.q_LP = exp(Vector3(0, 0, units::pi / 2));
  east.solution->attitude = {0.001F, 0.002F, 0.03F};
  EXPECT_NEAR(first("26", 0, east), 0.002, 1e-7) << "rad of roll: a rotation about east";
  EXPECT_NEAR(first("26", 4, east), 0.001, 1e-7) << "rad of pitch";
  EXPECT_EQ(first("24", 0, aligning(over_jena())), 2e7F) << "anywhere";
}

TEST(SolutionStatus, OfNovAtel) {
  std::vector<Sample> samples = phases(over_jena());
  samples.push_back(coasting(over_jena(), 60, {.heading_deg = 1.99}));
  samples.push_back(coasting(over_jena(), 90, {.heading_deg = 2.01}));
  const unsigned is_aligning = 1, high_variance = 2, good = 3;
  Numbers words;
  for (const auto& frame : message_in_phases("novatel-raw", "INSPVAS", samples))
    words.push_back(little_endian(frame, 12 + 84, 4));
  EXPECT_EQ(words, (Numbers{good, is_aligning, is_aligning, good, good, good, good, high_variance}));
  Sample levelled = navigating(over_jena(), Solution::State::levelled, {});
  levelled.navigation = {};
  EXPECT_EQ(little_endian(message_in_phases("novatel-raw", "INSPVAS", {levelled}).at(0), 12 + 84, 4), is_aligning);
}

// Raw data of the receiver: the same with and without a filter, wherever the filter is; nothing without a fix.
TEST(SolutionStatus, TheReceiversOwnMessagesFollowItsFix) {
  Sample known = over_jena(), elsewhere = aided(over_jena()), lost = over_jena(), poor = over_jena();
  elsewhere.navigation.latitude += 0.1;
  elsewhere.navigation.v_L.setZero();
  lost.navigation = {};
  poor.navigation.satellites = 4;
  poor.navigation.accuracy_factor = 3;
  struct Message {
    const char *product, *name;
    std::size_t from, to;                                // of what the receiver measures
    std::size_t satellites, accuracy, bytes, per_metre;  // the accuracy along north, or the horizontal one; 0: none
  };
  for (const Message& message : {Message{"mavlink-hil", "HIL_GPS", 18, 46, 45, 30, 2, 100},
                                 Message{"novatel-raw", "BESTGNSSPOS", 28, 100, 92, 68, 4, 0},
                                 Message{"novatel-raw", "BESTGNSSVEL", 28, 72, 0, 0, 0, 0}}) {
    SCOPED_TRACE(message.name);
    std::vector<std::vector<unsigned>> measured;
    const auto frames = message_in_phases(
        message.product, message.name, {known, aligning(known), elsewhere, coasting(known, 30, drifted), lost, poor});
    for (const std::vector<unsigned>& frame : frames)
      measured.emplace_back(frame.begin() + static_cast<std::ptrdiff_t>(message.from),
                            frame.begin() + static_cast<std::ptrdiff_t>(message.to));
    EXPECT_EQ(measured.at(1), measured.at(0)) << "aligning";
    EXPECT_EQ(measured.at(2), measured.at(0)) << "the filter is elsewhere";
    EXPECT_NE(measured.at(3), measured.at(0)) << "without a fix";
    EXPECT_EQ(measured.at(4), measured.at(3)) << "without a fix and a filter";
    if (message.per_metre != 0) {
      EXPECT_EQ(little_endian(frames.at(3), message.accuracy, message.bytes), 65535U) << "not known";
      EXPECT_EQ(little_endian(frames.at(3), message.accuracy + 2, message.bytes), 65535U) << "vertical";
    }
    if (message.satellites == 0) continue;
    EXPECT_EQ(frames[0].at(message.satellites), 9U);
    EXPECT_EQ(frames[3].at(message.satellites), 0U);
    EXPECT_EQ(frames[5].at(message.satellites), 4U);
    const auto metres = [&](const std::vector<unsigned>& frame) {
      const unsigned number = little_endian(frame, message.accuracy, message.bytes);
      return message.per_metre == 0 ? double{std::bit_cast<float>(number)}
                                    : number / static_cast<double>(message.per_metre);
    };
    const double north = message.per_metre == 0 ? 0.85 : 1.2;  // the horizontal accuracy is 0.85 sqrt(2)
    EXPECT_NEAR(metres(frames[0]), north, 0.005);
    EXPECT_NEAR(metres(frames[5]), 3 * north, 0.02);
  }
}

// The receiver's messages have the time of its fix, 150 ms ago, and the flag of new data in the samples of the
// epochs.
TEST(SolutionStatus, TheReceiversOwnMessagesHaveTheTimeOfItsFix) {
  Sample known = over_jena();
  known.time.ns = 7'000'000'000;
  const Sample old = between_fixes(known, std::chrono::milliseconds(150)), at_epoch = between_fixes(known, {}, 0);
  const std::vector<Sample> samples = {known, old, coasting(known, 5)};
  const unsigned now_ms = 1'440'000'001'000U % 604'800'000U;
  for (const char* name : {"BESTGNSSPOS", "BESTGNSSVEL"}) {
    Numbers times;
    for (const auto& frame : message_in_phases("novatel-raw", name, samples))
      times.push_back(little_endian(frame, 16, 4));
    EXPECT_EQ(times, (Numbers{now_ms, now_ms - 150, now_ms})) << name;
  }
  Numbers times_us;
  for (const auto& frame : message_in_phases("mavlink-hil", "HIL_GPS", samples))
    times_us.push_back(little_endian(frame, 10, 4));
  EXPECT_EQ(times_us, (Numbers{7'000'000, 6'850'000, 7'000'000}));

  const std::size_t data = 39, gnss_time = 147, new_data = 153;  // behind the accuracies, the fix, and its place
  Numbers times, is_new;
  for (const Sample& sample : {known, old, at_epoch, coasting(known, 5)}) {
    const std::vector<unsigned> frame = first_frames("inertiallabs-ins", sample);
    EXPECT_EQ(little_endian(frame, data, 4), now_ms) << "of the solution";
    times.push_back(little_endian(frame, gnss_time, 4));
    is_new.push_back(frame.at(new_data));
  }
  EXPECT_EQ(times, (Numbers{now_ms, now_ms - 150, now_ms, now_ms}));
  EXPECT_EQ(is_new, (Numbers{0, 0, 1, 0}));
}

// The accuracies that a unit reports are those of its own errors.
TEST(SolutionStatus, AccuraciesAreTheReceiversOwn) {
  Line line(protocol_named("frame"), frame_settings(read_frames("mavlink-hil")));
  OwnFigures figures;
  figures.position = {3, 4, 7};
  line.device->set_figures(figures);
  std::vector<unsigned> bytes;
  for (const std::byte byte : bytes_of(line, over_jena())) bytes.push_back(std::to_integer<unsigned>(byte));
  const std::size_t gps = bytes.size() - 48;  // HIL_GPS is the last message
  EXPECT_EQ(bytes.at(gps + 7), 0x71U);
  EXPECT_EQ(little_endian(bytes, gps + 30, 2), 500U) << "cm, horizontal";
  EXPECT_EQ(little_endian(bytes, gps + 32, 2), 700U) << "cm, vertical";
}

TEST(SolutionStatus, OfXsens) {
  const auto status_word = [](const Sample& sample) { return big_endian(first_frames("xsens-mtdata2", sample), 49); };
  std::vector<unsigned> words;
  for (const Sample& sample : phases(over_jena())) words.push_back(status_word(sample));
  const unsigned tested = 1, valid = tested | 2, fix = 4, mode_coasting = 1U << 23, mode_gnss = 3U << 23;
  EXPECT_EQ(words, (Numbers{valid, tested, tested | fix, valid | fix | mode_gnss, valid | mode_coasting,
                            valid | fix | mode_gnss}));
  // An attitude alone, beside a place that is the truth's, or without any: it does not coast.
  Sample levelled = navigating(over_jena(), Solution::State::levelled, {});
  EXPECT_EQ(status_word(levelled), valid);
  levelled.navigation = {};
  EXPECT_EQ(status_word(levelled), valid);
  // Clipped axes by XsStatusFlag (xsstatusflag.h): accelerometer 0x100 to 0x400, gyro 0x800 to 0x2000, any 0x80000.
  levelled.status = status::self_test_failed | status::accelerometer_saturated_x | status::gyro_saturated_x << 2;
  EXPECT_EQ(status_word(levelled), 2U | 0x100U | 0x2000U | 0x80000U);
}

}  // namespace
}  // namespace imud
