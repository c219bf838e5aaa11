#include "emulator/engine/encoding_thread.hpp"

#include <algorithm>

namespace imud {

EncodingThread::EncodingThread(std::size_t channels, const std::atomic<bool>& stop, std::deque<NormalStock>& numbers)
    : stop_(stop), numbers_(numbers), motions_(channels) {
  for (Batch& batch : ring_.batches()) {  // only what is written takes pages
    batch.items.reserve(batch_size + channels);
    batch.samples.reserve(batch_size + channels);
  }
  thread_ = std::thread([this] { run(); });
}

EncodingThread::~EncodingThread() {
  finish();
  ring_.next_free().count = 0;
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
    filling_->count = filling_->sample_count = 0;
  }
  for (Channel* channel : prepared) {
    if (filling_->count == filling_->items.size()) filling_->items.emplace_back();
    Item& item = filling_->items[filling_->count++];
    item.channel = channel;
    item.is_last = channel == prepared.back();
    item.outgoing = channel->prepared;
    item.whole = Item::none;
    const Sample& sample = *channel->prepared.sample;
    if (!sample.has_surroundings && !sample.solution) {
      copy(sample, item.motion);
      continue;
    }
    item.whole = filling_->sample_count++;
    if (item.whole == filling_->samples.size()) filling_->samples.emplace_back();
    copy(sample, filling_->samples[item.whole]);
  }
  if (filling_->count >= batch_size) publish();
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
    for (auto stock = numbers_.begin(); stock != numbers_.end() && !ring_.has_filled(); ++stock) stock->fill();
    Batch& batch = ring_.next_filled();
    if (batch.count == 0) return;
    for (std::span<Item> left(batch.items.data(), batch.count); !left.empty();) {
      const auto last = std::ranges::find_if(left, &Item::is_last);
      const auto size = static_cast<std::size_t>(last - left.begin()) + 1;
      send(left.first(size), batch.samples);
      left = left.subspan(size);
    }
    ring_.give_back();
  }
}

// Sends the samples of an instant as Pace::transmit() does.
void EncodingThread::send(std::span<Item> instant, std::span<Sample> samples) noexcept {
  for (Item& item : instant) item.channel->lines.wait_for_room(stop_);
  for (Sample* motion = motions_.data(); Item & item : instant) {
    Sample& sample = item.whole == Item::none ? *motion++ : samples[item.whole];
    if (item.whole == Item::none) copy(item.motion, sample);
    item.outgoing.sample = &sample;
    item.channel->encode(item.outgoing);
  }
  for (Item& item : instant) item.channel->lines.wait_for_room(stop_);
  for (Item& item : instant) item.channel->transmit();
  for (Item& item : instant) item.channel->count_sample();
}

}  // namespace imud
