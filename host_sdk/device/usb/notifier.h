// Tells subscribers what came and went, from a thread of its own that holds no lock. Internal to this folder.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/device/usb/context.h"

namespace scatter::device::usb {

/// A subscription. It outlives whoever made it.
struct Subscription {
  std::function<void(const Change&)> changed;
  std::vector<BusEntry> known;  ///< Told as present; the notifier's thread only.

  /// Calls `changed` unless the subscription has ended.
  void tell(const Change& change);
  /// No call is under way or comes after this, unless it is made inside one.
  void end();
  [[nodiscard]] bool ended() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable idle_;
  bool ended_ = false;
  std::thread::id inside_;  ///< Of the call under way.
};

/// Hints are only reasons to look: what is told is the difference between two looks at the bus, so that hints
/// that are lost, doubled or early change nothing, and nothing can pile up.
class Notifier : public std::enable_shared_from_this<Notifier> {
 public:
  /// Something may have come or gone. Any thread; never waits.
  void hint();
  /// Makes the thread when it is the first. Errors  kResourceExhausted.
  [[nodiscard]] Status add(std::shared_ptr<Subscription> entry);
  /// Ends the thread; waits for it at most 150 ms, not at all from inside a call.
  void stop();

 private:
  void work();
  void look();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::shared_ptr<Subscription>> entries_;
  bool started_ = false;
  bool stopping_ = false;
  bool finished_ = false;
  std::thread::id thread_;
  std::uint64_t hints_ = 0;
  /// Came, but may not be opened yet by this user: udev has not got to it. Told when it may, or after a
  /// second.
  struct Waiting {
    BusEntry entry;
    std::chrono::steady_clock::time_point since;
  };
  std::vector<Waiting> waiting_;
};

}  // namespace scatter::device::usb
