// Runs the bench for an emulated board, in a thread of its own.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "simulator/emulator/backplane_bench.h"
#include "simulator/emulator/qemu_process.h"

namespace scatter::simulator {

/// Integrating light takes its time; the relay of the host's bytes must not wait for it.
/// Threads   all functions from any.
class BenchService {
 public:
  /// Starts: shows the temperatures, then lets the processor run. `board`, `frame` and `process` outlive it;
  /// UART1 and the control line of `process` belong to it from now on.
  BenchService(VirtualBoard& board, BenchPace pace, std::span<std::byte> frame, QemuProcess& process,
               const BenchConduct& conduct);
  /// Ends the thread.
  ~BenchService();
  BenchService(const BenchService&) = delete;
  BenchService& operator=(const BenchService&) = delete;

  /// What the board has said of its starts since the last call.
  [[nodiscard]] std::vector<firmware::backplane::Booted> take_boots();
  /// Becomes readable when there is something to take or the service has failed; for poll(). take_boots()
  /// clears it.
  [[nodiscard]] int news_descriptor() const noexcept { return news_.number(); }
  /// There is something to take, or the service has failed. Costs nothing.
  [[nodiscard]] bool has_news() const noexcept { return has_news_.load(std::memory_order_acquire); }
  /// Why it ended, if it has.
  [[nodiscard]] std::optional<Error> failure() const;
  [[nodiscard]] BackplaneBench::Statistics statistics() const;
  void conduct(const BenchConduct& conduct);
  /// Puts another sample there; done when it returns.
  void put(std::shared_ptr<const Sample> sample);

 private:
  void serve(const std::stop_token& stop);
  [[nodiscard]] Status loop(const std::stop_token& stop);
  void settle();
  [[nodiscard]] Status turn(BackplaneBench::Clock::time_point now);

  void tell();

  std::atomic<bool> has_news_ = false;
  FileDescriptor news_;
  FileDescriptor wake_;
  FileDescriptor& line_;
  QemuProcess& process_;
  BackplaneBench bench_;      ///< The thread's alone: it may compute for long.
  mutable std::mutex mutex_;  ///< Of what follows; held briefly.
  std::vector<firmware::backplane::Booted> boots_;
  std::optional<Error> failure_;
  BackplaneBench::Statistics statistics_;
  BenchConduct conduct_;
  std::shared_ptr<const Sample> sample_;  ///< To be put there.
  std::condition_variable settled_;       ///< sample_ is there, or the service has failed.
  std::jthread thread_;
};

}  // namespace scatter::simulator
