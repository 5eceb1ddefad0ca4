#include "host_sdk/device/usb/notifier.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <system_error>
#include <utility>

#include "host_sdk/device/usb/bounded_call.h"
#include "host_sdk/device/usb/selection.h"

namespace scatter::device::usb {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Without hints (no udev) it still looks this often, while somebody watches.
constexpr auto kLookAnyway = 500ms;
/// The tables follow a hint with a delay: looked at again and again this long.
constexpr auto kSettling = 1000ms;
constexpr auto kBetweenLooks = 20ms;
constexpr auto kPermissionWithin = 1000ms;
constexpr auto kStopWithin = 150ms;

Change change_of(Change::Kind kind, const BusEntry& entry) {
  return {.kind = kind, .uri = uri_for(entry), .serial = entry.serial, .dfu_mode = entry.dfu_mode};
}

std::vector<BusEntry> instruments() {
  std::vector<BusEntry> out = scan_bus();
  std::erase_if(out, [](const BusEntry& entry) { return !entry.ours; });
  return out;
}

}  // namespace

void Subscription::tell(const Change& change) {
  {
    const std::lock_guard lock(mutex_);
    if (ended_) {
      return;
    }
    inside_ = std::this_thread::get_id();
  }
  changed(change);
  const std::lock_guard lock(mutex_);
  inside_ = {};
  idle_.notify_all();
}

void Subscription::end() {
  std::unique_lock lock(mutex_);
  ended_ = true;
  if (inside_ != std::this_thread::get_id()) {
    idle_.wait(lock, [this] { return inside_ == std::thread::id(); });
  }
}

bool Subscription::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

void Notifier::hint() {
  const std::lock_guard lock(mutex_);
  ++hints_;
  changed_.notify_all();
}

Status Notifier::add(std::shared_ptr<Subscription> entry) {
  const std::lock_guard lock(mutex_);
  entries_.push_back(std::move(entry));
  ++hints_;
  changed_.notify_all();
  if (!std::exchange(started_, true)) {
    try {
      std::jthread thread =
          quiet_thread([self = shared_from_this()](const std::stop_token&) { self->work(); });
      thread_ = thread.get_id();
      thread.detach();  // It owns what it uses; stop() waits for its end.
    } catch (const std::system_error& error) {
      started_ = false;
      return fail(ErrorCode::kResourceExhausted, std::string("no thread to watch USB: ").append(error.what()),
                  "close other programs");
    }
  }
  return {};
}

void Notifier::stop() {
  std::unique_lock lock(mutex_);
  stopping_ = true;
  changed_.notify_all();
  if (started_ && thread_ != std::this_thread::get_id()) {
    changed_.wait_for(lock, kStopWithin, [this] { return finished_; });
  }
}

void Notifier::work() {
  std::unique_lock lock(mutex_);
  std::uint64_t seen = 0;
  auto settled_at = Clock::now();
  while (!stopping_) {
    if (hints_ != seen) {
      seen = hints_;
      settled_at = Clock::now() + kSettling;
    }
    lock.unlock();
    look();
    lock.lock();
    const auto pause = Clock::now() < settled_at || !waiting_.empty() ? kBetweenLooks : kLookAnyway;
    changed_.wait_for(lock, pause, [&] { return stopping_ || hints_ != seen; });
  }
  finished_ = true;
  changed_.notify_all();
}

void Notifier::look() {
  std::vector<std::shared_ptr<Subscription>> entries;
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(entries_, [](const auto& entry) { return entry->ended(); });
    entries = entries_;
  }
  const std::vector<BusEntry> there = instruments();
  const auto now = Clock::now();
  std::vector<Waiting> waiting;
  std::vector<BusEntry> ready;
  for (const BusEntry& entry : there) {
    const auto before =
        std::ranges::find_if(waiting_, [&](const Waiting& one) { return same_stay(one.entry, entry); });
    const auto since = before == waiting_.end() ? now : before->since;
    if (::access(entry.node().c_str(), R_OK | W_OK) == 0 || now >= since + kPermissionWithin) {
      ready.push_back(entry);
    } else {
      waiting.push_back({.entry = entry, .since = since});
    }
  }
  waiting_ = std::move(waiting);
  for (const auto& entry : entries) {
    const std::vector<BusEntry> left = missing_in(there, entry->known);
    const std::vector<BusEntry> came = missing_in(entry->known, ready);
    std::erase_if(entry->known, [&](const BusEntry& one) { return !missing_in(there, {one}).empty(); });
    entry->known.insert(entry->known.end(), came.begin(), came.end());
    for (const BusEntry& one : left) {
      entry->tell(change_of(Change::Kind::kLeft, one));
    }
    for (const BusEntry& one : came) {
      entry->tell(change_of(Change::Kind::kArrived, one));
    }
  }
}

Watch::Watch(std::shared_ptr<Subscription> subscription) noexcept : subscription_(std::move(subscription)) {}
Watch::Watch(Watch&&) noexcept = default;
Watch& Watch::operator=(Watch&& other) noexcept {
  if (this != &other) {
    if (subscription_ != nullptr) {
      subscription_->end();
    }
    subscription_ = std::move(other.subscription_);
  }
  return *this;
}
Watch::~Watch() {
  if (subscription_ != nullptr) {
    subscription_->end();
  }
}

}  // namespace scatter::device::usb
