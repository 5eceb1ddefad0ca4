// Work that the kernel may hold up (a device that does not answer), done without waiting for it for ever.
// Internal to this folder.
#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <thread>

namespace scatter::device::usb {

enum class CallEnd { kDone, kLate, kStopped };

/// Does `work` on a thread of its own and waits for its end, for the deadline, or for a stop request (within
/// 20 ms). Work that is late goes on alone: it must own what it uses. It is destroyed before kDone is told.
[[nodiscard]] CallEnd call_bounded(std::function<void()> work, std::chrono::steady_clock::time_point deadline,
                                   const std::stop_token& stop = {});

/// A thread that leaves signals to the others: they are the program's.
[[nodiscard]] std::jthread quiet_thread(std::function<void(const std::stop_token&)> body);

}  // namespace scatter::device::usb
