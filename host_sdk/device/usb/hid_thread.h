// The one thread of the program that calls hidapi, and the HID interfaces that it holds open.
// Internal to this folder: programs use RescueChannel.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "protocol/rescue_report.h"

struct hid_device_;  // NOLINT(readability-identifier-naming): hidapi's

namespace scatter::device::usb {

using SteadyTime = std::chrono::steady_clock::time_point;

/// How a wait ended.
enum class Waited { kDone, kDeadline, kStopped, kGone };

/// An answer, and what had come before it.
struct HeardAnswer {
  protocol::RescueAnswer answer;
  std::uint64_t statuses = 0;  ///< HidPort::statuses then: SPEC 12.3 sends the status asked for behind it.
};

/// A HID interface in use. Fields belong to the thread's lock, `handle` to the thread itself.
struct HidPort {
  hid_device_* handle = nullptr;
  bool opened = false;     ///< The attempt is over; `handle` may still be null.
  bool abandoned = false;  ///< Nobody waits for it any more.
  bool gone = false;       ///< Unplugged.
  int listeners = 0;       ///< Calls that wait for input reports.
  std::optional<protocol::RescueStatus> newest;
  std::uint64_t statuses = 0;       ///< Status reports received.
  std::deque<HeardAnswer> answers;  ///< The last ones, oldest first.
};

/// hidapi is not thread-safe, so every call to it is made here. The thread sleeps while nobody waits for
/// reports. It lives until the last channel is gone and the program ends.
///
/// A call that the system holds up (5 s at worst, for a device that answers nothing) delays other
/// channels; no caller waits for it longer than its own deadline.
class HidThread {
 public:
  /// The program's; made with the first call.
  [[nodiscard]] static std::shared_ptr<HidThread> shared();
  HidThread();
  ~HidThread();
  HidThread(const HidThread&) = delete;
  HidThread& operator=(const HidThread&) = delete;

  /// Path of a HID interface as hidapi names it, "" when hidapi sees none there.
  /// `port`: "1-1.4"; `nodes`: hidraw nodes of it.
  [[nodiscard]] Waited find(const std::string& port, const std::vector<std::string>& nodes, std::string& path,
                            SteadyTime deadline, const std::stop_token& stop);
  /// Null in `out` with kDone: hidapi could not open it.
  [[nodiscard]] Waited open(const std::string& path, std::shared_ptr<HidPort>& out, SteadyTime deadline,
                            const std::stop_token& stop);
  /// Waits until it is closed, 200 ms at most.
  void close(const std::shared_ptr<HidPort>& port) noexcept;

  /// Reads what lay there, then sends. `taken` false with kDone: the instrument is deaf.
  [[nodiscard]] Waited send(const std::shared_ptr<HidPort>& port, const protocol::Report& report, bool& taken,
                            SteadyTime deadline, const std::stop_token& stop);
  /// The feature report, over the control pipe. Empty with kDone: refused.
  [[nodiscard]] Waited feature(const std::shared_ptr<HidPort>& port, std::optional<protocol::Report>& report,
                               SteadyTime deadline, const std::stop_token& stop);
  /// Reads input reports until `arrived` holds; it is called under the lock.
  [[nodiscard]] Waited listen(const std::shared_ptr<HidPort>& port,
                              const std::function<bool(const HidPort&)>& arrived, SteadyTime deadline,
                              const std::stop_token& stop);

 private:
  void post(std::function<void()> task);
  /// Runs `task` on the thread and waits for it.
  [[nodiscard]] Waited run_and_wait(std::function<void()> task, SteadyTime deadline,
                                    const std::stop_token& stop);
  void serve();
  /// On the thread, without the lock. Waits for the first report at most `wait`.
  void read_reports(HidPort& port, std::chrono::milliseconds wait);
  /// After a call that failed; sets `gone`. hidapi's libusb backend is told on a thread of its own, a little
  /// after its calls fail.
  void learn_whether_gone(HidPort& port);
  void keep(HidPort& port, const protocol::Report& report);

  std::mutex mutex_;
  std::condition_variable work_;      ///< For the thread.
  std::condition_variable_any news_;  ///< For the callers.
  std::deque<std::function<void()>> tasks_;
  std::vector<std::shared_ptr<HidPort>> listening_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace scatter::device::usb
