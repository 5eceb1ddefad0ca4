// SIGUSR1 as the measure button of a simulated instrument.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

namespace scatter::cli {

/// While it lives, `kill -USR1` of this program calls `press`, in a thread of its own. One at a time;
/// afterwards the signal is ignored, so that a late one ends nothing.
class ButtonSignal {
 public:
  explicit ButtonSignal(std::function<void()> press);
  ButtonSignal(const ButtonSignal&) = delete;
  ButtonSignal& operator=(const ButtonSignal&) = delete;
  ~ButtonSignal();

 private:
  int pressed_ = -1;  ///< An eventfd: what the signal's handler may write to.
  std::atomic<bool> over_{false};
  std::thread thread_;
};

}  // namespace scatter::cli
