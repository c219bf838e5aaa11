#include "emulator/control/subscriptions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <numeric>
#include <tuple>
#include <type_traits>
#include <utility>

#include "core/navigation/aid_names.hpp"
#include "emulator/control/change.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

constexpr std::array<std::string_view, 4> kinds = {"samples", "truth", "counters", "events"};

using Buffer = fmt::memory_buffer;

void append(Buffer& out, std::string_view text) { out.append(text.data(), text.data() + text.size()); }

// JSON has no numbers that are not finite. Texts are words without quotation marks.
template <class Value>
void append_value(Buffer& out, const Value& value) {
  if constexpr (std::is_same_v<Value, std::string_view>) {
    fmt::format_to(std::back_inserter(out), "\"{}\"", value);
  } else if constexpr (requires { value.begin(); }) {
    out.push_back('[');
    std::string_view before;
    for (const auto& part : value) {
      append(out, std::exchange(before, ","));
      append_value(out, part);
    }
    out.push_back(']');
  } else if (std::is_floating_point_v<Value> && !std::isfinite(static_cast<double>(value))) {
    append(out, "null");
  } else {
    fmt::format_to(std::back_inserter(out), "{}", value);
  }
}

bool has_truth_time(const FeedSample& s) { return s.truth_time.has_value(); }
bool has_field(const FeedSample& s) { return s.magnetic_field != decltype(s.magnetic_field){}; }
bool has_pressure(const FeedSample& s) { return s.pressure > 0; }
bool has_inclination(const FeedSample& s) { return s.inclination.has_value(); }
bool has_place(const FeedSample& s) { return s.has_place; }
bool has_solution(const FeedSample& s) { return s.solution.has_value(); }

constexpr std::array<std::string_view, 4> solution_states = {"aligning", "coasting", "aided", "levelled"};
static_assert(solution_states.size() == static_cast<std::size_t>(Solution::State::levelled) + 1);

// Appends ,"name":[...] with the value of each sample, or null for a sample without this value (`has`); appends
// nothing if no sample has the value.
template <class ValueOf>
void append_list(
    Buffer& out, std::string_view name, const std::vector<const FeedSample*>& samples, ValueOf value_of,
    bool (*has)(const FeedSample&) = [](const FeedSample&) { return true; }) {
  if (std::ranges::none_of(samples, [&](const FeedSample* s) { return has(*s); })) return;
  fmt::format_to(std::back_inserter(out), ",\"{}\":", name);
  char before = '[';
  for (const FeedSample* s : samples) {
    out.push_back(std::exchange(before, ','));
    if (has(*s))
      append_value(out, std::invoke(value_of, *s));
    else
      append(out, "null");
  }
  out.push_back(']');
}

// Appends the navigation solution of a unit that computes a solution, with errors and standard deviations.
void append_solution(Buffer& out, const std::vector<const FeedSample*>& samples) {
  const auto state = [](const FeedSample& s) { return solution_states[static_cast<std::size_t>(s.solution->state)]; };
  const auto names = [](std::uint16_t bits) {
    std::vector<std::string_view> all;
    for (std::size_t i = 0; i < aid::names.size(); ++i)
      if ((bits >> i & 1U) != 0) all.push_back(aid::names[i]);
    return all;
  };
  append_list(out, "solution", samples, state, has_solution);
  append_list(
      out, "aids_used", samples, [&](const FeedSample& s) { return names(s.solution->used); }, has_solution);
  append_list(
      out, "aids_rejected", samples, [&](const FeedSample& s) { return names(s.solution->rejected); }, has_solution);
  const auto append_part = [&](std::size_t part, std::string_view error, std::string_view sigma) {
    append_list(
        out, error, samples, [part](const FeedSample& s) { return s.solution->errors[part]; }, has_solution);
    append_list(
        out, sigma, samples, [part](const FeedSample& s) { return s.solution->sigmas[part]; }, has_solution);
  };
  append_part(0, "attitude_error", "attitude_sigma");
  append_part(1, "velocity_error", "velocity_sigma");
  append_part(2, "position_error", "position_sigma");
}

// Appends the values beyond rate and specific force, and the counts of samples without their truth.
void append_rest(Buffer& out, const std::vector<const FeedSample*>& samples) {
  const auto truth_time_s = [](const FeedSample& s) { return static_cast<double>(s.truth_time->ns) / 1e9; };
  const auto position = [](const FeedSample& s) { return std::array{s.latitude, s.longitude, s.height}; };
  append_list(out, "truth_time_s", samples, truth_time_s, has_truth_time);
  append_list(out, "attitude", samples, &FeedSample::attitude);
  append_list(out, "magnetic_field", samples, &FeedSample::magnetic_field, has_field);
  append_list(out, "pressure", samples, &FeedSample::pressure, has_pressure);
  append_list(
      out, "inclination", samples, [](const FeedSample& s) { return *s.inclination; }, has_inclination);
  append_list(out, "position", samples, position, has_place);
  append_solution(out, samples);
  append_list(out, "sent", samples, &FeedSample::is_sent);
  append_list(out, "extrapolated", samples, &FeedSample::extrapolated);
  append_list(out, "held", samples, &FeedSample::held);
  append_list(out, "silent", samples, &FeedSample::silent);
}

}  // namespace

Subscriptions::What Subscriptions::what_of(const std::string& word) {
  return static_cast<What>(std::ranges::find(kinds, word) - kinds.begin());
}

bool Subscriptions::concerns(const Subscription& subscription, const std::shared_ptr<Subscriber>& client,
                             std::optional<What> what, std::uint16_t imu) {
  const bool is_of_imu = imu == Command::all_imus || subscription.imu == imu || subscription.what == What::counters ||
                         subscription.what == What::events;
  return subscription.client.lock() == client && (!what || subscription.what == *what) && is_of_imu;
}

Json Subscriptions::subscribe(const Json& request_params, const std::shared_ptr<Subscriber>& client) {
  RpcParams params(request_params);
  const std::string word = params.choice("what", kinds);
  const What what = what_of(word);
  const std::uint16_t imu = params.imu(config_);
  constexpr double most_decimated = 1e9;
  std::uint32_t every = 1;
  double rate_hz = 0;
  const bool has_rate = params.has("rate_hz");
  if (has_rate) rate_hz = params.number("rate_hz", "samples a second", 1e-3, 1e6);
  if (params.has("decimate")) {
    if (has_rate) throw wrong_params("give decimate or rate_hz");
    every = params.whole_number("decimate", "of so many samples one", 1, most_decimated);
  }
  params.finish();
  if (client == nullptr)
    throw RpcError(RpcError::refused, "this connection takes no notifications; use the socket or a WebSocket");
  const bool is_of_imus = what == What::samples || what == What::truth;
  const std::size_t wanted = is_of_imus && imu == Command::all_imus ? config_.imus.size() : 1;
  const auto replaced = static_cast<std::size_t>(
      std::ranges::count_if(all_, [&](const Subscription& s) { return concerns(s, client, what, imu); }));
  if (all_.size() - replaced + wanted > most) throw RpcError(RpcError::busy, "there are too many subscriptions");
  unsubscribe({{"what", word}, {"imu", imu < config_.imus.size() ? config_.imus[imu].name : "*"}}, client);
  Json subscribed = Json::array();
  const auto add = [&](std::uint16_t of_imu, std::uint32_t decimate) {
    all_.push_back({client, what, of_imu, decimate});
    Json one = {{"what", word}};
    if (is_of_imus) {
      one["imu"] = config_.imus[of_imu].name;
      one["decimate"] = decimate;
    }
    subscribed.push_back(std::move(one));
  };
  if (what == What::counters) {
    last_ = monitor_.now();
    counted_ = host_now();
  }
  if (!is_of_imus) {
    add(0, 1);
  } else {
    for (std::uint16_t i = 0; i < config_.imus.size(); ++i) {
      if (imu != Command::all_imus && imu != i) continue;
      const double of_rate = std::round(config_.imus[i].rate_hz / rate_hz);
      add(i, has_rate ? static_cast<std::uint32_t>(std::clamp(of_rate, 1.0, most_decimated)) : every);
    }
  }
  watch();
  return {{"subscribed", std::move(subscribed)}};
}

Json Subscriptions::unsubscribe(const Json& request_params, const std::shared_ptr<Subscriber>& client) {
  RpcParams params(request_params);
  std::optional<What> what;
  if (params.has("what")) what = what_of(params.choice("what", kinds));
  const std::uint16_t imu = params.imu(config_);
  params.finish();
  const std::size_t removed =
      std::erase_if(all_, [&](const Subscription& s) { return concerns(s, client, what, imu); });
  watch();
  return {{"removed", removed}};
}

// The feed has every sample that a subscription wants: the samples at multiples of the greatest common divisor of
// all intervals.
void Subscriptions::watch() {
  for (std::uint16_t imu = 0; imu < config_.imus.size(); ++imu) {
    std::uint32_t every = 0;
    for (const Subscription& s : all_)
      if (s.imu == imu && (s.what == What::samples || s.what == What::truth)) every = std::gcd(every, s.every);
    control_.feed.watch(imu, every);
  }
}

void Subscriptions::send_event(const Json& event) {
  std::shared_ptr<const std::string> text;
  for (const Subscription& s : all_) {
    const auto client = s.client.lock();
    if (client == nullptr || s.what != What::events) continue;
    if (!text) text = std::make_shared<const std::string>(rpc_notification("event", json_line(event)));
    client->notify(text, Notification::event);
  }
}

bool Subscriptions::is_watched() {
  if (std::erase_if(all_, [](const Subscription& s) { return s.client.expired(); }) > 0) watch();
  return std::ranges::any_of(all_, [](const Subscription& s) { return s.what != What::events; });
}

std::string Subscriptions::text_of(What what, std::uint16_t imu, std::uint32_t every,
                                   const std::vector<FeedSample>& samples) const {
  std::vector<const FeedSample*> chosen;
  for (const FeedSample& sample : samples)
    if (sample.k % every == 0) chosen.push_back(&sample);
  if (chosen.empty()) return {};
  Buffer out;
  append(out, "{\"imu\":");
  append(out, json_line(config_.imus[imu].name));
  append_list(out, "k", chosen, &FeedSample::k);
  append_list(out, "time_s", chosen, [](const FeedSample& s) { return static_cast<double>(s.time_ns) / 1e9; });
  if (what == What::samples) {
    append_list(out, "rate", chosen, &FeedSample::rate);
    append_list(out, "specific_force", chosen, &FeedSample::specific_force);
  }
  append_list(out, "true_rate", chosen, &FeedSample::true_rate);
  append_list(out, "true_specific_force", chosen, &FeedSample::true_specific_force);
  if (what == What::samples) {
    append_list(out, "temperature_c", chosen, &FeedSample::temperature_c);
    append_rest(out, chosen);
  }
  append_list(out, "status", chosen, &FeedSample::status);
  out.push_back('}');
  return rpc_notification(kinds[static_cast<std::size_t>(what)], {out.data(), out.size()});
}

void Subscriptions::distribute(HostTime now) {
  samples_.resize(config_.imus.size());
  for (auto& samples : samples_) samples.clear();
  for (FeedSample sample; control_.feed.pop(sample);) samples_[sample.imu].push_back(sample);
  std::shared_ptr<const std::string> counters;
  const bool is_counted = std::ranges::any_of(all_, [](const auto& s) { return s.what == What::counters; });
  if (is_counted && now - counted_ >= std::chrono::seconds(1)) {
    Summary figures = monitor_.now();
    counters = std::make_shared<const std::string>(
        rpc_notification("counters", json(figures.since(last_), JsonLayout::line)));
    last_ = std::move(figures);
    counted_ = now;
  }
  // Clients with the same subscription get the same text.
  std::map<std::tuple<What, std::uint16_t, std::uint32_t>, std::shared_ptr<const std::string>> texts;
  for (const Subscription& s : all_) {
    const auto client = s.client.lock();
    if (client == nullptr || s.what == What::events) continue;
    if (s.what == What::counters) {
      if (counters) client->notify(counters, Notification::points);
      continue;
    }
    auto& text = texts[{s.what, s.imu, s.every}];
    if (!text) text = std::make_shared<const std::string>(text_of(s.what, s.imu, s.every, samples_[s.imu]));
    if (!text->empty()) client->notify(text, Notification::points);
  }
}

}  // namespace imud
