#include "host_sdk/device/usb/hid_thread.h"

#include <hidapi/hidapi.h>
#include <pthread.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <utility>

#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

using std::chrono::milliseconds;

/// How long a read may hold up a new task.
constexpr milliseconds kSlice{4};
constexpr milliseconds kLongestClose{200};
/// An instrument that takes nothing has gone when the system says so within this time, else it is deaf.
constexpr milliseconds kLeavesWithin{200};
/// An answer is looked for as soon as it comes; more than these wait only for callers that gave up.
constexpr std::size_t kMostAnswers = 32;
/// Reports read in one go: more than either backend keeps, so that an interface that floods cannot hold the
/// thread.
constexpr int kMostReports = 128;

/// hidapi's libusb backend names an interface PORT:CONFIGURATION.INTERFACE.
bool is_rescue_interface(const hid_device_info& found, const std::string& port,
                         const std::vector<std::string>& nodes) {
  const std::string path = found.path == nullptr ? "" : found.path;
  return found.interface_number == protocol::usb::kRescueInterface &&
         (path.starts_with(port + ":") || std::ranges::find(nodes, path) != nodes.end());
}

}  // namespace

std::shared_ptr<HidThread> HidThread::shared() {
  static const auto kOne = std::make_shared<HidThread>();
  return kOne;
}

HidThread::HidThread() {
  // Signals belong to the program's own threads.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  thread_ = std::thread([this] { serve(); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

HidThread::~HidThread() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  work_.notify_all();
  thread_.join();
}

void HidThread::serve() {
  hid_init();
  std::unique_lock lock(mutex_);
  while (true) {
    work_.wait(lock, [&] { return ending_ || !tasks_.empty() || !listening_.empty(); });
    if (!tasks_.empty()) {
      const auto task = std::move(tasks_.front());
      tasks_.pop_front();
      lock.unlock();
      task();
      lock.lock();
      continue;
    }
    if (ending_) {
      break;
    }
    const auto ports = listening_;
    lock.unlock();
    const auto wait = std::max(kSlice / static_cast<int>(ports.size()), milliseconds(1));
    for (const auto& port : ports) {
      read_reports(*port, wait);
    }
    lock.lock();
  }
  lock.unlock();
  hid_exit();
}

void HidThread::post(std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  work_.notify_one();
}

Waited HidThread::run_and_wait(std::function<void()> task, SteadyTime deadline, const std::stop_token& stop) {
  const auto done = std::make_shared<bool>(false);  // Under the lock.
  post([this, done, task = std::move(task)] {
    task();
    {
      const std::lock_guard lock(mutex_);
      *done = true;
    }
    news_.notify_all();
  });
  std::unique_lock lock(mutex_);
  if (news_.wait_until(lock, stop, deadline, [&] { return *done; })) {
    return Waited::kDone;
  }
  return stop.stop_requested() ? Waited::kStopped : Waited::kDeadline;
}

Waited HidThread::find(const std::string& port, const std::vector<std::string>& nodes, std::string& path,
                       SteadyTime deadline, const std::stop_token& stop) {
  const auto found = std::make_shared<std::string>();
  const Waited waited = run_and_wait(
      [found, port, nodes] {
        hid_device_info* const all = hid_enumerate(protocol::usb::kVendorId, protocol::usb::kProductId);
        for (const hid_device_info* each = all; each != nullptr; each = each->next) {
          if (is_rescue_interface(*each, port, nodes)) {
            *found = each->path;
            break;
          }
        }
        hid_free_enumeration(all);
      },
      deadline, stop);
  if (waited == Waited::kDone) {
    path = *found;
  }
  return waited;
}

Waited HidThread::open(const std::string& path, std::shared_ptr<HidPort>& out, SteadyTime deadline,
                       const std::stop_token& stop) {
  const auto port = std::make_shared<HidPort>();
  const Waited waited = run_and_wait(
      [this, port, path] {
        hid_device* const handle = hid_open_path(path.c_str());
        std::unique_lock lock(mutex_);
        port->opened = true;
        if (!port->abandoned) {
          port->handle = handle;
          return;
        }
        lock.unlock();
        if (handle != nullptr) {
          hid_close(handle);
        }
      },
      deadline, stop);
  if (waited == Waited::kDone) {
    out = port->handle == nullptr ? nullptr : port;
    return waited;
  }
  bool close_now = false;
  {
    const std::lock_guard lock(mutex_);
    port->abandoned = true;
    close_now = port->opened && port->handle != nullptr;
  }
  if (close_now) {
    close(port);
  }
  return waited;
}

void HidThread::close(const std::shared_ptr<HidPort>& port) noexcept {
  (void)run_and_wait(
      [port] {
        if (port->handle != nullptr) {
          hid_close(std::exchange(port->handle, nullptr));
        }
      },
      std::chrono::steady_clock::now() + kLongestClose, {});
}

Waited HidThread::send(const std::shared_ptr<HidPort>& port, const protocol::Report& report, bool& taken,
                       SteadyTime deadline, const std::stop_token& stop) {
  const auto outcome = std::make_shared<bool>(false);
  const Waited waited = run_and_wait(
      [this, port, report, outcome] {
        // The system keeps a limited number of reports for each reader and then drops the newest: the
        // answer must find room.
        read_reports(*port, milliseconds(0));
        if (port->gone) {
          return;
        }
        std::array<unsigned char, protocol::kReportBytes + 1> bytes{};  // First: report id 0, there are none.
        std::memcpy(bytes.data() + 1, report.data(), report.size());
        *outcome = hid_write(port->handle, bytes.data(), bytes.size()) > 0;
        if (!*outcome) {
          learn_whether_gone(*port);
        }
      },
      deadline, stop);
  if (waited != Waited::kDone) {
    return waited;
  }
  const std::lock_guard lock(mutex_);
  taken = *outcome;
  return port->gone ? Waited::kGone : Waited::kDone;
}

Waited HidThread::feature(const std::shared_ptr<HidPort>& port, std::optional<protocol::Report>& report,
                          SteadyTime deadline, const std::stop_token& stop) {
  const auto got = std::make_shared<std::optional<protocol::Report>>();
  const Waited waited = run_and_wait(
      [this, port, got] {
        std::array<unsigned char, protocol::kReportBytes + 1> bytes{};
        const int count = hid_get_feature_report(port->handle, bytes.data(), bytes.size());
        if (count > 1) {
          protocol::Report& out = got->emplace();
          std::memcpy(out.data(), bytes.data() + 1,
                      std::min(out.size(), static_cast<std::size_t>(count) - 1));
        } else {
          learn_whether_gone(*port);
        }
      },
      deadline, stop);
  if (waited != Waited::kDone) {
    return waited;
  }
  report = *got;
  const std::lock_guard lock(mutex_);
  return port->gone ? Waited::kGone : Waited::kDone;
}

Waited HidThread::listen(const std::shared_ptr<HidPort>& port,
                         const std::function<bool(const HidPort&)>& arrived, SteadyTime deadline,
                         const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  if (port->listeners++ == 0) {
    listening_.push_back(port);
    work_.notify_one();
  }
  const bool met = news_.wait_until(lock, stop, deadline, [&] { return port->gone || arrived(*port); });
  if (--port->listeners == 0) {
    std::erase(listening_, port);
  }
  if (met) {
    return arrived(*port) ? Waited::kDone : Waited::kGone;
  }
  return stop.stop_requested() ? Waited::kStopped : Waited::kDeadline;
}

void HidThread::read_reports(HidPort& port, milliseconds wait) {
  if (port.handle == nullptr) {
    return;  // Closed by a task since.
  }
  protocol::Report report{};
  for (int i = 0; i < kMostReports; ++i) {
    report = {};
    const int count = hid_read_timeout(port.handle, reinterpret_cast<unsigned char*>(report.data()),
                                       report.size(), i == 0 ? static_cast<int>(wait.count()) : 0);
    if (count == 0) {
      return;
    }
    if (count < 0) {
      {
        const std::lock_guard lock(mutex_);
        port.gone = true;
        std::erase_if(listening_, [&](const auto& each) { return each.get() == &port; });
      }
      news_.notify_all();
      return;
    }
    keep(port, report);
  }
}

void HidThread::learn_whether_gone(HidPort& port) {
  // `gone` is written by this thread alone.
  const SteadyTime end = std::chrono::steady_clock::now() + kLeavesWithin;
  while (!port.gone && std::chrono::steady_clock::now() < end) {
    read_reports(port, kSlice);
  }
}

void HidThread::keep(HidPort& port, const protocol::Report& report) {
  const auto status = protocol::decode_rescue_status(report);
  const auto answer = protocol::decode_rescue_answer(report);
  {
    const std::lock_guard lock(mutex_);
    if (status) {
      port.newest = *status;
      ++port.statuses;
    }
    if (answer) {
      port.answers.push_back({.answer = *answer, .statuses = port.statuses});
      if (port.answers.size() > kMostAnswers) {
        port.answers.pop_front();
      }
    }
  }
  if (status || answer) {
    news_.notify_all();
  }
}

}  // namespace scatter::device::usb
