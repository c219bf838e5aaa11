// ControlApi: answers the requests of the control protocol (README.md in this folder), and notifies subscribers.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/control/change.hpp"
#include "emulator/control/json_rpc.hpp"
#include "emulator/control/reloader.hpp"
#include "emulator/control/subscriptions.hpp"
#include "emulator/engine/run_control.hpp"
#include "emulator/faults/fault_book.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/report/monitor.hpp"

namespace imud {

// Knows nothing of connections: each transport's server passes the texts of its clients. Runs in the io_context's
// thread.
class ControlApi {
 public:
  static constexpr int version = 1;
  static constexpr std::size_t max_request = 64 * 1024;  // bytes; a server refuses longer ones by refuse_long()

  // The run that is controlled. All objects that its members refer to must outlive the api.
  struct Run {
    std::string name;  // of this instance of imud
    const Config& config;
    RunControl& control;
    const Monitor& monitor;
    RunCounters counters;
    std::function<void()> quit;  // ends the run; may be called again
    FaultBook& faults;
    Reloader& reloader;
    bool is_repeated = false;      // the run is repeated from its record; nothing can be changed
    std::string config_file = {};  // absolute; "-": standard input
    struct Clients {
      std::size_t control = 0, web = 0;  // connections
    };
    std::function<Clients()> clients = [] { return Clients(); };
    // Called when a reload begins, and when it has been made or refused, before the answer.
    std::function<void()> reload_begins = [] {}, reload_ends = [] {};
  };
  ControlApi(boost::asio::io_context& io, Run run);

  // A method of the protocol: a change, which `batch` may contain, or another function.
  struct Method {
    using Act = void (*)(ControlApi& api, const Json& params, const RpcReply& reply,
                         const std::shared_ptr<Subscriber>& client);
    using MakeChange = Change (*)(const Json& params, const ChangeContext& context);
    constexpr Method(std::string_view method, std::string_view what, std::string_view json, Act function)
        : name(method), summary(what), example(json), act(function) {}
    constexpr Method(std::string_view method, std::string_view what, std::string_view json, MakeChange function)
        : name(method), summary(what), example(json), change(function) {}
    std::string_view name, summary;
    std::string_view example;  // of its parameters, JSON; empty: it has none
    Act act = nullptr;
    MakeChange change = nullptr;
  };
  // To add a method, add its entry to the table.
  static std::span<const Method> methods() noexcept;

  // Executes the requests of a text. Calls `answer` once, with the text of the answer in one line without its line
  // feed; the text is empty if no answer is wanted. `answer` is called at once, after the sampling thread has made
  // the changes, or from finish(). `client` gets notifications; nullptr: this connection cannot have
  // notifications.
  void call(std::string_view request, std::function<void(std::string)> answer,
            const std::shared_ptr<Subscriber>& client = nullptr);
  // Returns the answer to a request that is longer than max_request.
  static std::string refuse_long();

  // The servers count refused clients and lost notifications here.
  ControlCounters& counters() const noexcept { return run_.control.counters; }

  // Executes the method `reload` for a signal; the answer is written to the log.
  void reload();
  // Reports an event of the sampling thread to the subscribers.
  void report(const RunEvent& event);
  // Reports the begins and ends of faults since the last call.
  void report_faults();
  // Answers all waiting requests with an error. Called when the sampling thread has ended.
  void finish();

  // Called with each event that subscribers get, such as {"event": "mark", ...}, after it took effect.
  std::function<void(const Json& event)> on_event;

 private:
  void execute(const std::string& name, const Json& params, const RpcReply& reply,
               const std::shared_ptr<Subscriber>& client);
  void make(std::vector<Change> changes, const RpcReply& reply);
  void check_regular() const;
  void reload(const RpcReply& reply);
  void make_next_reloads();
  void take_results();
  void complete(std::uint64_t batch);
  void log(const std::string& words);
  void schedule();
  void tick();
  Json status() const;
  Json list() const;
  std::vector<Change> changes_of_batch(const Json& params);
  static const Method* find_method(std::string_view name) noexcept;

  const Run run_;
  const std::chrono::system_clock::time_point started_ = std::chrono::system_clock::now();
  boost::asio::steady_timer timer_;
  bool is_ticking_ = false;
  HostTime distributed_;  // when subscribers were notified last
  Subscriptions subscriptions_;

  // A batch that the sampling thread has not answered completely.
  struct Waiting {
    RpcReply reply;
    std::vector<Change> changes;
    std::vector<Applied> applied;
  };
  std::map<std::uint64_t, Waiting> waiting_;
  std::uint64_t last_batch_ = 0;
  std::deque<RpcReply> next_reloads_;  // of the reloads that begin after the reload that waits for its sample
  bool ended_ = false;
  std::size_t faults_reported_ = 0;
  // The lines of the log in the second that began at log_second_, and omitted lines since then.
  HostTime log_second_;
  int logged_ = 0;
  std::uint64_t unlogged_ = 0;
};

}  // namespace imud
