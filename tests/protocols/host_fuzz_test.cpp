// What hosts may send to the devices that listen: commands of theirs, changed at random, half of them with a checksum
// that is right all the same. Nothing crashes, hangs or allocates, and a good command is answered afterwards. As many
// inputs as IMUD_FUZZ_INPUTS says, for each device; from fixed seeds.
#include <gtest/gtest.h>

#include <boost/crc.hpp>
#include <cstdlib>
#include <string>

#include "tests/protocols/recording.hpp"
#include "tests/protocols/table_names.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

std::string mip(const std::string& body) {  // set and fields
  if (body.empty()) return body;
  std::string packet = "ue" + body.substr(0, 1) + static_cast<char>(body.size() - 1) + body.substr(1);
  unsigned a = 0, b = 0;
  for (const char c : packet) b += a += static_cast<unsigned char>(c);
  return packet + static_cast<char>(a) + static_cast<char>(b);
}
std::string vectornav(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  char text[8];
  std::snprintf(text, sizeof text, "*%02X\r\n", sum);
  return "$" + body + text;
}
std::string stim300(const std::string& body) {
  if (!body.starts_with('$')) return body + "\r";
  boost::crc_optimal<8, 0x07, 0xFF, 0, false, false> crc;
  crc.process_bytes(body.data(), body.size());
  return body + std::to_string(crc.checksum()) + "\r";
}

struct Host {
  const char* protocol;
  std::string (*frame)(const std::string& body);
  std::vector<std::string> bodies;
  std::string revive, last, answer;  // brings the device back to what answers `last` by something with `answer` in it
  std::string model = {};            // of several; the initial one
};

// And of the other models of one, the same.
std::vector<Host> with_models(std::vector<Host> hosts, std::string_view protocol,
                              std::initializer_list<const char*> models) {
  const auto of = [&](const Host& host) { return host.protocol == protocol; };
  const Host host = *std::find_if(hosts.begin(), hosts.end(), of);
  for (const char* model : models) {
    hosts.push_back(host);
    hosts.back().model = model;
  }
  return hosts;
}

std::string bytes(std::initializer_list<int> all) {
  std::string text;
  for (const int byte : all) text += static_cast<char>(byte);
  return text;
}

const std::vector<Host>& hosts() {
  static const std::vector<Host> all = with_models(
      with_models(
          {{"stim300",
            stim300,
            {"N",
             "I",
             "C",
             "T",
             "E",
             "R",
             "SERVICEMODE",
             "UTILITYMODE",
             "$sm,4,",
             "$sgu,b,",
             "$sau,1,",
             "$sd,t,",
             "$ie,",
             "$st,921600,2,n,1,0,0,",
             "$saf,z,4,",
             "$sconf,v,5,",
             "$ibto,",
             "$sbto,3.4e-03,g,y,",
             "$save,",
             "$sfs,1,",
             "$xn,",
             "$sdbto,1e308,-1,0,0.1,0.1,0.1,1,1,1,",
             "$srf,4294967295,",
             "$irng,",
             "$ix,",
             "$ig,x,",
             "$sg,y,1,1,2,0,0.5,",
             "$st,1500,1,o,1,1,0,",
             "SERVICEMODE\ri",
             "SERVICEMODE\rc",
             "a",
             "b 0.001,g,x",
             "b 7,r",
             "d t,1",
             "f 2,a,x",
             "g 8,0.3",
             "g 0,0,1,2,1,1,0",
             "h v,3",
             "i e",
             "i g",
             "m 5",
             "r 0",
             "s",
             "Y",
             "N",
             "t f,500000,2,1",
             "t 3,1,0",
             "u g,8",
             "x n",
             "x I",
             "z s",
             "? g",
             "\b\b\b"},
            stim300("$xn,") + "N\rx N\r",
            stim300("UTILITYMODE"),
            "#UTILITYMODE,234"},
           {"mip",
            mip,
            {bytes({1, 2, 1}),
             bytes({1, 2, 2}),
             bytes({1, 2, 3}),
             bytes({1, 2, 4}),
             bytes({1, 2, 6}),
             bytes({1, 8, 9, 1, 1, 0, 1, 194, 0}),
             bytes({1, 2, 0x7E}),
             bytes({12, 2, 6}),
             bytes({12, 14, 15, 1, 128, 3, 0xD5, 0, 10, 4, 0, 10, 5, 0, 10}),
             bytes({12, 8, 13, 0x80, 0, 3, 0xD5, 4, 5}),
             bytes({12, 5, 0x11, 1, 0x80, 0}),
             bytes({12, 3, 0x30, 3}),
             bytes({12, 7, 0x40, 1, 0, 14, 16, 0}),
             bytes({12, 10, 8, 1, 2, 4, 0, 1, 5, 0, 1}),
             bytes({12, 3, 8, 2}),
             bytes({12, 4, 1, 0, 0}),
             bytes({13, 2, 1}),
             bytes({12, 4, 0x39, 3, 232}),
             bytes({12, 3, 0x38, 2}),
             bytes({12, 15, 0x38, 1, 63, 128, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}),
             bytes({12, 15, 0x37, 1, 0, 0, 0, 0, 0, 0, 0, 0, 63, 128, 0, 0}),
             bytes({12, 25, 0x2E, 1, 1, 2, 130, 5, 1, 1, 63, 232, 0, 0, 0, 0, 0, 0, 191, 232, 0, 0, 0, 0, 0, 0}),
             bytes({12, 11, 0x2F, 1, 2, 1, 2, 130, 0, 0, 1, 208}),
             bytes({12, 5, 0x2B, 1, 1, 1}),
             bytes({12, 4, 0x2B, 3, 0}),
             bytes({12, 19, 0x32, 1, 63, 53, 4, 243, 0, 0, 0, 0, 0, 0, 0, 0, 63, 53, 4, 243}),
             bytes({12, 3, 0x33, 2}),
             bytes({13, 15, 0x11, 1, 0, 0, 0, 0, 0, 0, 0, 0, 63, 201, 15, 218}),
             bytes({13, 4, 0x18, 1, 4}),
             bytes({13, 3, 0x18, 2}),
             bytes({13, 6, 0x50, 1, 0, 5, 1}),
             bytes({13, 5, 0x50, 3, 255, 255}),
             bytes({13, 6, 3, 63, 128, 0, 0}),
             bytes(
                 {19, 30, 1, 1, 3, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 63, 192, 0, 0}),
             bytes({19, 5, 1, 2, 3, 1}),
             bytes({1, 8, 0x72, 1, 1, 0, 0, 9, 104}),
             bytes({1, 8, 0x72, 1, 2, 0, 4, 60, 81}),
             bytes({12, 4, 0x0F, 3, 0}),
             bytes({12, 10, 9, 1, 2, 3, 0, 1, 11, 0, 1})},
            mip(bytes({1, 2, 1})),
            mip(bytes({1, 2, 1})),
            bytes({4, 0xF1, 1, 0})},
           {"vectornav",
            vectornav,
            {"VNRRG,01",
             "VNRRG,27",
             "VNWRG,05,921600",
             "VNWRG,06,14,1",
             "VNWRG,07,200",
             "VNWRG,75,3,16,01,0721",
             "VNWRG,76,1,1,7F,7FFF,03FF,1FFF,3FFF,1FFF,1FFF,3FFF",
             "VNWRG,77,1,2,04,0ED0",
             "VNASY,1",
             "VNASY,0",
             "VNWNV",
             "VNRFS",
             "VNRST",
             "VNTAR",
             "VNBOM,1",
             "VNWRG,35,1,1,1,1",
             "VNWRG,26,+1,0,0,0,1,0,0,0,1",
             "VNRRG,54",
             "VNWRG,0,a tag",
             "VNWRG,75,1,0,01,0029",
             "VNWRG,30,1,2,0,0,3,0,2",
             "VNWRG,84,9,0,0,0,9,0,0,0,9,1,1,1",
             "VNRRG,80",
             "VNRRG,05,2"},
            "\r\n",
            vectornav("VNRRG,04"),
            "2.1.0.0"}},
          "mip", {"3dm-gx5-45", "3dm-cv7-ahrs", "3dm-cv7-ins"}),
      "vectornav", {"vn-300"});
  return all;
}

class HostFuzz : public testing::TestWithParam<Host> {};
INSTANTIATE_TEST_SUITE_P(Devices, HostFuzz, testing::ValuesIn(hosts()), [](const auto& host) {
  std::string name = std::string(host.param.protocol) + host.param.model;
  std::erase(name, '-');
  return name;
});

TEST_P(HostFuzz, AnyBytesDoNoHarm) {
  const Host& host = GetParam();
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 100'000;
  const Protocol& protocol = *find_protocol(host.protocol);
  Settings settings(protocol.settings);
  if (!host.model.empty()) settings.set("model", host.model);
  const std::unique_ptr<Device> device = protocol.make(settings);
  const auto frames = std::make_unique<FrameBuffer>();
  std::mt19937_64 random(11);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  Sample sample;
  sample.navigation.is_known = true;
  sample.navigation.gps_ns = 1'420'000'000'000'000'000;
  sample.navigation.latitude = 0.8;
  sample.navigation.r_E = {4.4e6, 0, 4.6e6};
  std::string answers;
  const auto hear = [&](std::string_view text) {
    frames->clear();
    device->receive({std::as_bytes(std::span(text))}, sample.time, *frames);
    for (const Frame& frame : frames->frames())
      for (const std::byte byte : frame.bytes) answers += static_cast<char>(byte);
  };
  const auto live = [&](int samples) {
    for (int i = 0; i < samples; ++i) {
      ++sample.counter;
      sample.time = sample.time + 1ms;
      frames->clear();
      device->sample(sample, *frames);
    }
  };
  std::string text;
  text.reserve(4096);
  answers.reserve(1 << 20);
  for (long n = 0; n < inputs; ++n) {
    std::string body = host.bodies[below(host.bodies.size())];
    const bool framed_last = below(2) == 0;
    text = framed_last ? body : host.frame(body);
    for (std::size_t k = below(4); k > 0 && !text.empty(); --k) {
      const std::size_t at = below(text.size());
      switch (below(5)) {
        case 0:
          text[at] = static_cast<char>(random());
          break;
        case 1:
          text.erase(at, below(5));
          break;
        case 2:
          text.insert(at, 1 + below(300), static_cast<char>(random()));
          break;
        case 3:
          text += text.substr(at);
          break;
        default:
          text.insert(at, host.bodies[below(host.bodies.size())]);
          break;
      }
    }
    if (framed_last) text = host.frame(text.substr(0, 250));
    if (below(8) == 0) text.resize(below(text.size() + 1));
    const std::uint64_t before = allocations();
    frames->clear();
    device->receive({std::as_bytes(std::span(text))}, sample.time, *frames);
    frames->clear();
    if (below(4) == 0) {
      ++sample.counter;
      sample.time = sample.time + 1ms;
      device->sample(sample, *frames);
    }
    ASSERT_EQ(allocations(), before);
    const unsigned baud = device->uart().baud;
    ASSERT_TRUE(baud >= 1500 && baud <= 5'184'000) << baud;
    if (n % 1000 != 999) continue;
    live(7000);  // what was cut off is forgotten, a hold time has gone by
    answers.clear();
    hear(host.revive);
    hear(host.last);
    ASSERT_NE(answers.find(host.answer), std::string::npos) << n;
    hear(host.revive);
  }
}

}  // namespace
}  // namespace imud
