// The DroneCAN unit on a bus: its node id is allocated by the test, whose frames are those of pydronecan (at
// 08cda37), and another node has the same one. Runs in tools/with-vcan.
#include <boost/crc.hpp>
#include <map>

#include "tests/can/can_unit.hpp"
#include "tests/protocols/can_text.hpp"

namespace imud {
namespace {

using namespace std::string_view_literals;

using Bytes = std::vector<std::uint8_t>;

// The transfers of one identifier, assembled from its frames by the specification alone: the tail byte is first,
// last, toggle, and 5 bits of transfer id; the CRC covers the data type's signature, too.
class Transfers {
 public:
  explicit Transfers(std::uint64_t signature) : signature_(signature) {}
  // Returns the payload when a transfer is complete. Expects everything to be in order.
  std::optional<Bytes> feed(const canfd_frame& frame) {
    EXPECT_GE(frame.len, 1);
    const unsigned tail = frame.data[frame.len - 1];
    const bool is_first = tail & 0x80, is_last = tail & 0x40;
    EXPECT_EQ(is_first, frames_ == 0);
    EXPECT_EQ(tail >> 5 & 1, frames_ % 2) << "toggle";
    if (is_first && transfer_id) {
      EXPECT_EQ(tail & 31, (*transfer_id + 1) % 32) << "a transfer is missing";
    }
    if (!is_first) {
      EXPECT_EQ(tail & 31, transfer_id.value_or(32));
    }
    EXPECT_TRUE(is_last || frame.len == 8);
    transfer_id = tail & 31;
    bytes_.insert(bytes_.end(), frame.data, frame.data + frame.len - 1);
    ++frames_;
    if (!is_last) return std::nullopt;
    Bytes whole = std::exchange(bytes_, {});
    if (std::exchange(frames_, 0) == 1) return whole;
    boost::crc_ccitt_false_t crc;
    for (int i = 0; i < 8; ++i) crc.process_byte(static_cast<std::uint8_t>(signature_ >> 8 * i));
    crc.process_bytes(whole.data() + 2, whole.size() - 2);
    EXPECT_EQ(crc.checksum(), whole[0] | whole[1] << 8);
    whole.erase(whole.begin(), whole.begin() + 2);
    return whole;
  }

  std::optional<unsigned> transfer_id;  // of the last one

 private:
  std::uint64_t signature_;
  Bytes bytes_;
  unsigned frames_ = 0;  // of the present one
};

class CanDroneCanTest : public CanUnitTest {
 protected:
  void send(std::string_view frames) {
    each_frame(frames, [&](const Frame& one) {
      canfd_frame frame{};
      frame.can_id = one.can.id | CAN_EFF_FLAG;
      frame.len = static_cast<std::uint8_t>(one.bytes.size());
      std::memcpy(frame.data, one.bytes.data(), one.bytes.size());
      node_.send(frame, false);
    });
  }
  // Lets time pass until the unit requests a node id. Returns the data of the request, empty if there is none in 2 s.
  std::string next_request() {
    for (int i = 0; i < 100; ++i) {
      while (const auto got = node_.receive(2)) {
        EXPECT_EQ(got->frame.can_id, CAN_EFF_FLAG | 0x188A2100) << "nothing else is sent";
        return {reinterpret_cast<const char*>(got->frame.data), got->frame.len - 1U};
      }
      EXPECT_TRUE(pass_20_ms()) << imud_.errors();
    }
    return "";
  }

  const Node node_{"vcan0"};
};

TEST_F(CanDroneCanTest, GetsItsNodeIdAndSendsRawImu) {
  start(imud_, write_config("lockstep", unit("dronecan",
                                             "device.node_id = 0\ndevice.start_up_ms = 0\n"
                                             "device.unique_id = \"000102030405060708090a0b0c0d0e0f\"\n"
                                             "device.raw_imu_hz = 200\ndevice.timestamp = \"device\"\n"
                                             "device.name = \"org.example.imu\"")));
  EXPECT_EQ(next_request(), "\x01\0\1\2\3\4\5"sv);
  send("1400017F#00000102030405C0");
  EXPECT_EQ(next_request(), "\0\6\7\x8\x9\xA\xB"sv);
  send("1400017F#585D000001020381 1400017F#0405060708090A21 1400017F#0B41");
  EXPECT_EQ(next_request(), "\0\xC\xD\xE\xF"sv);
  send("1400017F#4D6BC80001020382 1400017F#0405060708090A22 1400017F#0B0C0D0E0F42");

  constexpr canid_t node_100 = CAN_EFF_FLAG | 100;
  constexpr canid_t status = node_100 | 24 << 24 | 341 << 8, raw_imu = node_100 | 16 << 24 | 1003 << 8;
  constexpr canid_t node_info = CAN_EFF_FLAG | 0x1E010AE4;  // the response from 100 to 10
  std::map<canid_t, Transfers> transfers = {{status, Transfers(0x0F0868D0C1A7C6F1)},
                                            {raw_imu, Transfers(0x8280632C40E574B5)},
                                            {node_info, Transfers(0xEE468A8121C46A9E)}};
  std::map<canid_t, std::vector<Bytes>> got;
  constexpr int steps = 60;  // 1.2 s
  for (int i = 0; i < steps; ++i) {
    ASSERT_TRUE(pass_20_ms()) << imud_.errors();
    if (i == steps / 2) send("1E01E48A#C0");  // GetNodeInfo, from 10 to 100
    while (const auto frame = node_.receive(i + 1 < steps ? 0 : 200)) {
      const auto of = transfers.find(frame->frame.can_id);
      ASSERT_NE(of, transfers.end()) << fmt::format("{:08X}", frame->frame.can_id);
      if (auto payload = of->second.feed(frame->frame)) got[of->first].push_back(*payload);
    }
  }
  ASSERT_GE(got[status].size(), 2U);
  EXPECT_EQ(got[status].back()[4], 0) << "operational, in good health";
  ASSERT_EQ(got[node_info].size(), 1U);
  const Bytes& info = got[node_info][0];
  ASSERT_EQ(info.size(), 41U + 15U);
  for (std::uint8_t i = 0; i < 16; ++i) EXPECT_EQ(info[24U + i], i) << "unique id";
  EXPECT_EQ(std::string(info.begin() + 41, info.end()), "org.example.imu");

  ASSERT_GE(got[raw_imu].size(), 235U);
  std::optional<std::uint64_t> last;
  for (const Bytes& payload : got[raw_imu]) {
    ASSERT_EQ(payload.size(), 47U);
    std::uint64_t time = 0;
    for (int i = 6; i >= 0; --i) time = time << 8 | payload[static_cast<std::size_t>(i)];
    if (last) {
      EXPECT_EQ(time - *last, 5000U) << "us";
    }
    last = time;
    float interval = 0;
    std::memcpy(&interval, &payload[7], sizeof interval);
    EXPECT_EQ(interval, &payload == got[raw_imu].data() ? interval : 0.005F) << "s";
  }

  // Another node with the allocated id.
  send("18015564#07000000480000C0");
  EXPECT_TRUE(imud_.wait_for_errors("another node has the same node id")) << imud_.errors();
  const auto unit = end()[0];
  EXPECT_EQ(unit["node_id_conflicts"], 1);
  EXPECT_EQ(unit["transfers_malformed"], 0);
  EXPECT_EQ(unit["transfers_timed_out"], 0);
  EXPECT_EQ(unit["dropped"], 0);
}

TEST_F(CanDroneCanTest, NoticesAnotherNodeWithItsNodeId) {
  start_unit("dronecan", "device.node_id = 42");
  ASSERT_TRUE(node_.receive_id(CAN_EFF_FLAG | 0x1801552A).has_value()) << imud_.errors();
  send("1801552B#07000000480000C0");  // node 43: no conflict
  for (int i = 0; i < 3; ++i) send("1801552A#07000000480000C0");
  EXPECT_TRUE(imud_.wait_for_errors("another node has the same node id")) << imud_.errors();
  // A request that is sent after them is answered after them.
  send("1E01AA8A#C0");
  EXPECT_TRUE(node_.receive_id(CAN_EFF_FLAG | 0x1E010AAA).has_value());
  EXPECT_EQ(end()[0]["node_id_conflicts"], 3);
  const std::string log = imud_.errors();
  const std::size_t first = log.find("another node has the same node id");
  EXPECT_EQ(log.find("another node has the same node id", first + 1), log.npos) << "logged once";
}

}  // namespace
}  // namespace imud
