// Subscriptions: who watches which samples, truth, counters and events, and the texts that they get.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emulator/control/json_rpc.hpp"
#include "emulator/engine/run_control.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/report/monitor.hpp"

namespace imud {

// Points are samples, truth and counters: later points replace lost ones. Events come once.
enum class Notification : std::uint8_t { points, event };

// A connection that gets notifications.
class Subscriber {
 public:
  virtual ~Subscriber() = default;
  // Queues the text, one line without its line feed, to be sent. Discards and counts it if the client reads too
  // slowly. All subscribers to the same points share the text.
  virtual void notify(const std::shared_ptr<const std::string>& text, Notification kind) = 0;
};

// Reads the feed of the sampling thread and distributes it. A subscription ends with its Subscriber. One thread.
class Subscriptions {
 public:
  static constexpr std::size_t most = 1000;  // subscriptions together

  // All arguments must outlive this.
  Subscriptions(const Config& config, RunControl& control, const Monitor& monitor)
      : config_(config), control_(control), monitor_(monitor) {}

  // Execute `subscribe` and `unsubscribe` and return their results. Throw RpcError.
  Json subscribe(const Json& params, const std::shared_ptr<Subscriber>& client);
  Json unsubscribe(const Json& params, const std::shared_ptr<Subscriber>& client);

  // Sends an event to the subscribers to events.
  void send_event(const Json& event);
  // Sends the samples of the feed, and once a second the figures of the time since they were sent last.
  void distribute(HostTime now);
  // Removes the subscriptions whose clients have gone. Returns true if somebody subscribes to samples, truth or
  // counters, so that distribute() must be called often.
  bool is_watched();

 private:
  enum class What : std::uint8_t { samples, truth, counters, events };
  struct Subscription {
    std::weak_ptr<Subscriber> client;
    What what = What::samples;
    std::uint16_t imu = 0;    // of samples and truth
    std::uint32_t every = 1;  // of samples and truth: one of so many samples is sent
  };
  static What what_of(const std::string& word);
  // Returns whether it is a subscription of this client to `what` (none: to anything) of this imu, or of all.
  static bool concerns(const Subscription& subscription, const std::shared_ptr<Subscriber>& client,
                       std::optional<What> what, std::uint16_t imu);
  void watch();
  std::string text_of(What what, std::uint16_t imu, std::uint32_t every,
                      const std::vector<FeedSample>& samples) const;

  const Config& config_;
  RunControl& control_;
  const Monitor& monitor_;
  std::vector<Subscription> all_;
  std::vector<std::vector<FeedSample>> samples_;  // by imu, of distribute()
  HostTime counted_;                              // when the figures were sent last
  Summary last_;                                  // of the counters
};

}  // namespace imud
