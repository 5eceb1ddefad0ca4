#include "host_sdk/device/usb/bounded_call.h"

#include <pthread.h>

#include <algorithm>
#include <condition_variable>
#include <csignal>
#include <memory>
#include <mutex>
#include <system_error>
#include <utility>

namespace scatter::device::usb {
namespace {

constexpr auto kSlice = std::chrono::milliseconds(10);

struct Gate {
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
};

}  // namespace

std::jthread quiet_thread(std::function<void(const std::stop_token&)> body) {
  // A new thread inherits the mask of the one that makes it.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);
  std::jthread out;
  try {
    out = std::jthread(std::move(body));
  } catch (...) {
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
    throw;
  }
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  return out;
}

CallEnd call_bounded(std::function<void()> work, std::chrono::steady_clock::time_point deadline,
                     const std::stop_token& stop) {
  const auto gate = std::make_shared<Gate>();
  const auto shared = std::make_shared<std::function<void()>>(std::move(work));
  std::jthread thread;
  try {
    thread = quiet_thread([gate, work = shared](const std::stop_token&) {
      (*work)();
      *work = nullptr;
      const std::lock_guard lock(gate->mutex);
      gate->done = true;
      gate->changed.notify_all();
    });
  } catch (const std::system_error&) {  // No more threads: the kernel's own limits bound the work.
    (*shared)();
    return CallEnd::kDone;
  }
  std::unique_lock lock(gate->mutex);
  while (!gate->done) {
    const auto now = std::chrono::steady_clock::now();
    if (now >= deadline || stop.stop_requested()) {
      lock.unlock();
      thread.detach();
      return stop.stop_requested() ? CallEnd::kStopped : CallEnd::kLate;
    }
    gate->changed.wait_until(lock, std::min(deadline, now + kSlice));
  }
  return CallEnd::kDone;
}

}  // namespace scatter::device::usb
