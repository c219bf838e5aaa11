#include "emulator/engine/encoding_thread.hpp"

#include <algorithm>

namespace imud {

EncodingThread::EncodingThread(std::size_t channels, const std::atomic<bool>& stop) : stop_(stop) {
  for (Batch& batch : ring_.batches()) batch.reserve(batch_size + channels);
  thread_ = std::thread([this] { run(); });
}

EncodingThread::~EncodingThread() {
  finish();
  ring_.next_free().clear();
  ring_.publish();
  thread_.join();
}

bool EncodingThread::serves(std::span<const std::unique_ptr<Channel>> channels) noexcept {
  return std::ranges::all_of(channels, [](const auto& channel) {
    return !channel->faults && !channel->sync && channel->lines.copies().empty() &&
           std::ranges::none_of(channel->lines.all(), &DeviceLine::listens);
  });
}

void EncodingThread::put(std::span<Channel* const> prepared) noexcept {
  if (filling_ == nullptr) {
    filling_ = &ring_.next_free();
    filling_->clear();
  }
  for (Channel* channel : prepared)
    filling_->push_back({channel, channel->prepared, *channel->prepared.sample, channel == prepared.back()});
  if (filling_->size() >= batch_size) return publish();
  const auto* const ahead = reinterpret_cast<const char*>(filling_->data() + filling_->size() + 1);
  for (std::size_t at = 0; at < sizeof(Item); at += 64) __builtin_prefetch(ahead + at, 1);
}

void EncodingThread::publish() noexcept {
  filling_ = nullptr;
  ring_.publish();
}

void EncodingThread::finish() noexcept {
  if (filling_ != nullptr) publish();
  ring_.wait_until_returned();
}

void EncodingThread::run() noexcept {
  while (true) {
    Batch& batch = ring_.next_filled();
    if (batch.empty()) return;
    for (auto first = batch.begin(); first != batch.end();) {
      const auto end = std::find_if(first, batch.end(), [](const Item& item) { return item.is_last; }) + 1;
      send({first, end});
      first = end;
    }
    ring_.give_back();
  }
}

// Sends the samples of an instant as Pace::transmit() does.
void EncodingThread::send(std::span<Item> instant) noexcept {
  for (Item& item : instant) item.channel->lines.wait_for_room(stop_);
  for (Item& item : instant) {
    item.outgoing.sample = &item.sample;
    item.channel->encode(item.outgoing);
  }
  for (Item& item : instant) item.channel->lines.wait_for_room(stop_);
  for (Item& item : instant) item.channel->transmit();
  for (Item& item : instant) item.channel->count_sample();
}

}  // namespace imud
