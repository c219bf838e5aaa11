#include "emulator/control/control_api.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <system_error>
#include <utility>

#include "emulator/control/fault_change.hpp"
#include "emulator/control/running_keys.hpp"
#include "emulator/report/log.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr std::chrono::milliseconds between_notifications(40);

// Words for people: "imu1 from sample 1234, imu2 from sample 617".
std::string samples_text(const Json& applied) {
  std::string out;
  for (const Json& one : applied)
    out += fmt::format("{}{} from sample {}", out.empty() ? "" : ", ", one["imu"].get<std::string>(),
                       one["sample"].get<std::uint64_t>());
  return out;
}

std::string_view word_of_state(PortState state) noexcept {
  switch (state) {
    case PortState::ready:
      return "ready";
    case PortState::no_reader:
      return "no_reader";
    case PortState::wrong_speed:
      return "wrong_speed";
    case PortState::error_warning:
      return "error_warning";
    case PortState::error_passive:
      return "error_passive";
    case PortState::lost:
      return "lost";
  }
  return "";
}

bool concerns(const Change& change, std::uint16_t imu) {
  for (const Command& command : change.commands)
    if (command.imu == Command::all_imus || command.imu == imu) return true;
  return false;
}

}  // namespace

ControlApi::ControlApi(boost::asio::io_context& io, Run run)
    : run_(std::move(run)), timer_(io), subscriptions_(run_.config, run_.control, run_.monitor) {}

void ControlApi::call(std::string_view request, std::function<void(std::string)> answer,
                      const std::shared_ptr<Subscriber>& client) {
  if (request.size() > max_request) return answer(refuse_long());
  answer_rpc(
      request,
      [&](const std::string& method, const Json& params, const RpcReply& reply) {
        execute(method, params, reply, client);
      },
      std::move(answer));
}

std::string ControlApi::refuse_long() {
  return rpc_refusal(
      RpcError(RpcError::invalid_request, fmt::format("Invalid Request: longer than {} bytes", max_request)));
}

std::span<const ControlApi::Method> ControlApi::methods() noexcept {
  using Client = const std::shared_ptr<Subscriber>&;
  static constexpr auto all = std::to_array<Method>({
      {"status", "what runs, and its figures", "",
       [](ControlApi& api, const Json& params, const RpcReply& reply, Client) {
         RpcParams(params).finish();
         reply.result(api.status());
       }},
      {"list", "the methods, the imus, and what can be changed", "",
       [](ControlApi& api, const Json& params, const RpcReply& reply, Client) {
         RpcParams(params).finish();
         reply.result(api.list());
       }},
      {"mark", "a named line into the log and the record", R"({"text": "climb begins"})", mark_change},
      {"power", "the supply of an imu, or of all: off, on, or cycle", R"({"imu": "imu1", "state": "cycle"})",
       power_change},
      {"pause", "the frames of an imu, or of all, are discarded; the sensor goes on", R"({"imu": "imu1"})",
       pause_change},
      {"resume", "the opposite of pause", R"({"imu": "imu1"})", resume_change},
      {"set", "new values of keys of the configuration, at one sample",
       R"({"truth.delay_ms": 20, "imu.imu1.gyro.bias_rad_per_s": [0.01, 0, 0]})", set_change},
      {"fault.begin", "begins a fault: a [[fault]] whose times count from the next sample",
       R"({"imu": "imu1", "target": "gyro.x", "kind": "bias", "value": 0.1, "for_s": 3})", begin_fault_change},
      {"fault.repeat", "begins a configured fault again, once, at the next sample", R"({"name": "fault1"})",
       repeat_fault_change},
      {"fault.end", "ends the faults of a name", R"({"name": "fault1"})", end_fault_change},
      {"fault.clear", "ends all faults of an imu, or of all", R"({"imu": "imu1"})", clear_faults_change},
      {"seed", "random numbers from the next sample on are those of this seed", R"({"seed": 7})", seed_change},
      {"batch", "several changes that take effect at one sample",
       R"({"changes": [{"method": "pause", "params": {"imu": "imu1"}}, {"method": "mark", "params": {"text": "a"}}]})",
       [](ControlApi& api, const Json& params, const RpcReply& reply, Client) {
         api.make(api.changes_of_batch(params), reply);
       }},
      {"reload", "reads the file of the configuration again; what differs changes at one sample, or nothing does", "",
       [](ControlApi& api, const Json& params, const RpcReply& reply, Client) {
         RpcParams(params).finish();
         api.reload(reply);
       }},
      {"subscribe", "notifications of samples, truth, counters or events",
       R"({"what": "samples", "imu": "imu1", "rate_hz": 50})",
       [](ControlApi& api, const Json& params, const RpcReply& reply, Client client) {
         reply.result(api.subscriptions_.subscribe(params, client));
         api.schedule();
       }},
      {"unsubscribe", "the opposite of subscribe; without parameters of everything", R"({"what": "samples"})",
       [](ControlApi& api, const Json& params, const RpcReply& reply, Client client) {
         reply.result(api.subscriptions_.unsubscribe(params, client));
         api.schedule();
       }},
      {"quit", "ends the run, with its summary", "",
       [](ControlApi& api, const Json& params, const RpcReply& reply, Client) {
         RpcParams(params).finish();
         spdlog::info("control: quit");
         reply.result({{"quits", true}});
         api.run_.quit();
       }},
  });
  constexpr auto have_own_names = [] {
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t k = 0; k < i; ++k)
        if (all[i].name == all[k].name) return false;
    return true;
  };
  static_assert(have_own_names(), "two methods have one name");
  return all;
}

const ControlApi::Method* ControlApi::find_method(std::string_view name) noexcept {
  const auto found = std::ranges::find(methods(), name, &Method::name);
  return found == methods().end() ? nullptr : &*found;
}

void ControlApi::execute(const std::string& name, const Json& params, const RpcReply& reply,
                         const std::shared_ptr<Subscriber>& client) {
  const Method* method = find_method(name);
  if (method == nullptr) throw RpcError(RpcError::method_not_found, "Method not found; `list` names the methods");
  if (ended_) throw RpcError(RpcError::run_ended, "the run has ended");
  if (method->change == nullptr) return method->act(*this, params, reply, client);
  std::vector<Change> changes;
  changes.push_back(method->change(params, {run_.config, run_.faults}));
  make(std::move(changes), reply);
}

std::vector<Change> ControlApi::changes_of_batch(const Json& request_params) {
  RpcParams params(request_params);
  const Json& list = params.get("changes", "a list of {\"method\": ..., \"params\": {...}}");
  params.finish();
  if (!list.is_array() || list.empty()) throw wrong_params("changes: give a list of at least one change");
  std::vector<Change> changes;
  for (const Json& item : list) {
    if (!item.is_object()) throw wrong_params("changes: each is an object");
    RpcParams of_item(item);
    const std::string name = of_item.text("method", "the method of a change");
    const Method* method = find_method(name);
    if (method == nullptr || method->change == nullptr)
      throw RpcError(RpcError::method_not_found, fmt::format("Method not found: {} is no change", name));
    const Json none;
    changes.push_back(
        method->change(of_item.has("params") ? item["params"] : none, {run_.config, run_.faults, changes}));
    of_item.finish();
  }
  return changes;
}

// Passes the changes to the sampling thread as one batch.
void ControlApi::make(std::vector<Change> changes, const RpcReply& reply) {
  if (run_.is_repeated) throw RpcError(RpcError::refused, "a run that is repeated from its record cannot be changed");
  std::vector<Command> commands;
  for (const Change& change : changes)
    commands.insert(commands.end(), change.commands.begin(), change.commands.end());
  if (commands.size() > CommandQueue::longest_batch)
    throw wrong_params(fmt::format("more than {} changes at one sample", CommandQueue::longest_batch));
  if (!run_.control.commands.has_room(commands.size()))
    throw RpcError(RpcError::busy, "too many changes wait for their sample; try again later");
  // A request that is refused must add no fault: the numbers of a record's faults have no gap.
  for (Change& change : changes)
    if (change.fault) run_.faults.add(std::move(change.fault->config), std::move(change.fault->text));
  run_.control.commands.push(last_batch_ + 1, commands);
  waiting_.emplace(++last_batch_, Waiting{reply, std::move(changes), {}});
  schedule();
}

// A FIFO, or the pipe of a process substitution, can be read once: a reload might wait for its next writer for ever.
void ControlApi::check_regular() const {
  std::error_code none;
  const auto type = std::filesystem::status(run_.config_file, none).type();
  if (type == std::filesystem::file_type::regular || type == std::filesystem::file_type::not_found) return;
  throw RpcError(RpcError::refused,
                 fmt::format("reload refused, nothing has changed: {} is no regular file; start imud with a file of "
                             "its own",
                             run_.config_file));
}

void ControlApi::reload(const RpcReply& reply) {
  if (run_.reloader.is_waiting()) {
    constexpr std::size_t most = 16;
    if (next_reloads_.size() == most) throw RpcError(RpcError::busy, "reload: others wait already");
    return next_reloads_.push_back(reply);
  }
  run_.reload_begins();
  const auto end = [this] {
    if (!ended_) run_.reload_ends();
  };
  const RpcReply at_end = reply.after(end);
  try {
    if (run_.reloader.can_read()) check_regular();
    if (std::optional<Change> change = run_.reloader.prepare()) return make({std::move(*change)}, at_end);
  } catch (const std::exception& error) {
    run_.reloader.cancel();
    end();
    if (dynamic_cast<const RpcError*>(&error) != nullptr) throw;
    throw RpcError(RpcError::internal_error, error.what());
  }
  log("control: reload: no key differs");
  at_end.result({{"changed", Json::array()}, {"applied", Json::array()}});
}

void ControlApi::make_next_reloads() {
  while (!ended_ && !next_reloads_.empty() && !run_.reloader.is_waiting()) {
    const RpcReply reply = std::move(next_reloads_.front());
    next_reloads_.pop_front();
    try {
      reload(reply);
    } catch (const RpcError& error) {
      reply.error(error);
    }
  }
}

void ControlApi::reload() {
  if (!run_.reloader.can_read()) {
    run_.reload_begins();
    return run_.reload_ends();
  }
  const auto refuse = [](std::string_view why) { spdlog::error("SIGHUP: {}", why); };
  try {
    reload(RpcReply([refuse](const Json& answer) {
      if (answer.contains("error")) refuse(answer["error"]["message"].get<std::string>());
    }));
  } catch (const RpcError& error) {
    refuse(error.what());
  }
}

void ControlApi::take_results() {
  for (Applied result; run_.control.applied.pop(result);) {
    const auto batch = waiting_.find(result.batch);
    if (batch == waiting_.end()) continue;
    batch->second.applied.push_back(result);
    if (result.is_last) complete(result.batch);
  }
}

void ControlApi::complete(std::uint64_t number) {
  const Waiting batch = std::move(waiting_.extract(number).mapped());
  const auto applied_to = [&](auto wants) {
    Json list = Json::array();
    for (const Applied& one : batch.applied) {
      if (!wants(one.imu)) continue;
      list.push_back({{"imu", run_.config.imus[one.imu].name},
                      {"sample", one.sample},
                      {"time_ns", one.has_time ? Json(one.time_ns) : Json()}});
    }
    return list;
  };
  Json result;
  for (const Change& change : batch.changes) {
    for (const Command& command : change.commands) {
      if (command.kind == Command::Kind::log_level) set_log_level(static_cast<LogLevel>(command.number));
      if (command.kind == Command::Kind::reload) run_.reloader.finish();
    }
    if (change.event.contains("changed")) result["changed"] = change.event["changed"];
    Json event = change.event;
    event["applied"] = applied_to([&](std::uint16_t imu) { return concerns(change, imu); });
    log(fmt::format("control: {}; {}", change.words, samples_text(event["applied"])));
    for (const PortChange& port : change.ports) {
      const std::string& imu = run_.config.imus[port.imu].name;
      const LogFields fields(imu);
      for (const Applied& one : batch.applied)
        if (one.imu == port.imu)
          log(fmt::format("{}: {} {} -> {} from sample {}", imu, port.what, port.before, port.after, one.sample));
    }
    subscriptions_.send_event(event);
    if (on_event) on_event(event);
  }
  result["applied"] = applied_to([&](std::uint16_t imu) {
    for (const Change& change : batch.changes)
      if (concerns(change, imu)) return true;
    return false;
  });
  batch.reply.result(std::move(result));
  make_next_reloads();
}

// Limits the lines of the log, because a client may send as many commands as it wants.
void ControlApi::log(const std::string& words) {
  constexpr int most = 20;  // a second
  if (const HostTime now = host_now(); now - log_second_ >= 1s) {
    if (unlogged_ > 0) spdlog::info("control: {} changes more", std::exchange(unlogged_, 0));
    log_second_ = now;
    logged_ = 0;
  }
  if (logged_++ < most)
    spdlog::info("{}", words);
  else
    ++unlogged_;
}

void ControlApi::report(const RunEvent& event) {
  const Json json = {{"event", "run"}, {"imu", "*"}, {"sample", event.sample}, {"time_ns", event.time_ns}};
  subscriptions_.send_event(json);
  if (on_event) on_event(json);
}

void ControlApi::report_faults() {
  const std::vector<std::string> imus = names_of(run_.config.imus);
  for (; faults_reported_ < run_.faults.log().size(); ++faults_reported_) {
    const Json json = fault_event_json(run_.faults, run_.faults.log()[faults_reported_], imus);
    subscriptions_.send_event(json);
    if (on_event) on_event(json);
  }
}

void ControlApi::finish() {
  ended_ = true;
  take_results();
  for (auto& [number, batch] : std::exchange(waiting_, {}))
    batch.reply.error(RpcError(RpcError::run_ended, "the run has ended before the change took effect"));
  for (const RpcReply& reply : std::exchange(next_reloads_, {}))
    reply.error(RpcError(RpcError::run_ended, "the run has ended before the reload"));
  timer_.cancel();
}

// Takes results and samples as long as there may be any.
void ControlApi::schedule() {
  if (is_ticking_ || ended_) return;
  if (waiting_.empty() && !subscriptions_.is_watched()) return;
  is_ticking_ = true;
  timer_.expires_after(waiting_.empty() ? between_notifications : 1ms);
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

void ControlApi::tick() {
  is_ticking_ = false;
  take_results();
  if (const HostTime now = host_now(); now - distributed_ >= between_notifications && subscriptions_.is_watched()) {
    distributed_ = now;
    subscriptions_.distribute(now);
  }
  schedule();
}

Json ControlApi::status() const {
  Json imus = Json::array();
  for (std::size_t i = 0; i < run_.config.imus.size(); ++i) {
    const ImuConfig& imu = run_.config.imus[i];
    const ImuCounters& counters = *run_.counters.imus[i].second;
    imus.push_back({{"name", imu.name},
                    {"protocol", imu.protocol->name},
                    {"port", imu.port},
                    {"rate_hz", imu.rate_hz},
                    {"samples", counters.samples.load(std::memory_order_relaxed)},
                    {"port_state", word_of_state(counters.port_state.load(std::memory_order_relaxed))},
                    {"power", counters.has_power.load(std::memory_order_relaxed) ? "on" : "off"},
                    {"paused", counters.is_paused.load(std::memory_order_relaxed)}});
  }
  const Run::Clients clients = run_.clients();
  return {{"api", version},
          {"version", IMUD_VERSION},
          {"name", run_.name},
          {"pid", ::getpid()},
          {"started",
           fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::floor<std::chrono::seconds>(started_)))},
          {"config", run_.config_file},
          {"clients", {{"control", clients.control}, {"web", clients.web}}},
          {"clock", word_of(clock_words, run_.config.clock)},
          {"seed", run_.config.seed},
          {"config_sha256", run_.config.sha256},
          {"imus", std::move(imus)},
          {"faults", active_faults_json(run_.faults, run_.config)},
          {"lost",
           {{"samples", run_.control.counters.samples_overrun.load()},
            {"events", run_.control.counters.events_overrun.load()}}},
          {"counters", Json::parse(json(run_.monitor.now(), JsonLayout::line))}};
}

Json ControlApi::list() const {
  Json methods = Json::array();
  for (const Method& method : ControlApi::methods()) {
    Json one = {{"name", method.name}, {"summary", method.summary}, {"is_change", method.change != nullptr}};
    if (!method.example.empty()) one["example"] = Json::parse(method.example);
    methods.push_back(std::move(one));
  }
  return {{"api", version},
          {"methods", std::move(methods)},
          {"imus", names_of(run_.config.imus)},
          {"keys", running_keys_json()},
          {"faults", run_.faults.can_grow() ? fault_kinds_json() : Json::array()},
          {"configured_faults", run_.faults.can_grow() ? configured_faults_json(run_.faults) : Json::array()}};
}

}  // namespace imud
