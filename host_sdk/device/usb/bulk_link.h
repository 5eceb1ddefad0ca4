// The two bulk pipes of one open instrument: transfers under way in the kernel, lent in order. Internal to
// this folder.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/device/transport.h"
#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/device/usb/event_loop.h"
#include "host_sdk/device/usb/transfer_slot.h"
#include "host_sdk/error/error.h"

struct libusb_device_handle;
struct libusb_transfer;  // NOLINT(readability-identifier-naming): theirs

namespace scatter::device::usb {

/// Promises:
/// - bytes are lent in the order of the wire; a transfer's buffer is the kernel's where the system gives
/// such,
///   and goes back to it at the next receive();
/// - memory is bounded by the transfers: while nobody receives they fill up, and the device waits (NAK);
/// - a halted endpoint is drained and started again, failed transfers are counted, and the link goes on;
/// - close() cancels, waits until the kernel has given every transfer back, and only then lets go of
///   the interface, which tells the device (alternate setting 0); a device that does not answer is left to a
///   thread of its own after 150 ms.
///
/// Threads  one; abandon() from any. The event thread only moves transfers between lists.
class BulkLink : public std::enable_shared_from_this<BulkLink> {
 public:
  using Clock = std::chrono::steady_clock;

  /// Opens, claims, selects the open setting and submits. Errors  as Context::open; kDeadlineExceeded,
  /// kAborted; kDisconnected: it was unplugged meanwhile.
  [[nodiscard]] static Result<std::shared_ptr<BulkLink>> open(std::shared_ptr<EventLoop> loop,
                                                              const BusEntry& entry, int transfers,
                                                              Clock::time_point deadline,
                                                              const std::stop_token& stop);
  ~BulkLink();
  BulkLink(const BulkLink&) = delete;
  BulkLink& operator=(const BulkLink&) = delete;

  [[nodiscard]] Result<std::span<const std::byte>> receive(Clock::time_point deadline,
                                                           const std::stop_token& stop);
  [[nodiscard]] Status write(std::span<const std::byte> bytes, Clock::time_point deadline,
                             const std::stop_token& stop);
  void close() noexcept;
  /// Every call from now on gives kDisconnected.
  void abandon() noexcept;

  [[nodiscard]] std::vector<Notice> notices() const { return notices_; }
  [[nodiscard]] CarrierStatistics statistics() const noexcept { return statistics_; }

 private:
  struct Slot : TransferSlot {
    BulkLink* owner = nullptr;
    std::uint32_t generation = 0;  ///< Of the pipe when it was submitted.
  };

  BulkLink(std::shared_ptr<EventLoop> loop, BusEntry entry, int transfers);
  [[nodiscard]] Status attach();
  [[nodiscard]] Status start();
  [[nodiscard]] bool make_slot(Slot& slot, std::uint8_t endpoint, bool kernel_memory);
  static void on_complete(libusb_transfer* transfer);

  /// The oldest completed slot that was not looked at; null: none. Takes all that there are at once, so that
  /// the two threads meet once a batch.
  [[nodiscard]] Slot* next_completed();
  /// Until there is one, a stop request may have to be looked for, or the device is gone. Errors  as
  /// receive().
  [[nodiscard]] Status wait_for_completed(Clock::time_point deadline);
  /// Hands a slot of the IN pipe to the kernel; keeps it idle where that cannot be.
  void submit_in(Slot& slot);
  [[nodiscard]] int submit(Slot& slot);
  void judge(const Slot& slot);
  /// Ends a halt of the IN pipe. False: the device does not answer.
  void restart_in();
  [[nodiscard]] bool clear_halt(std::uint8_t endpoint);
  /// Waits until nothing is under way; false when `limit` passed.
  [[nodiscard]] bool drain(Clock::time_point limit);
  void cancel_all() noexcept;
  [[nodiscard]] int send_piece(std::span<const std::byte> piece, Clock::time_point deadline,
                               const std::stop_token& stop, std::size_t& sent);
  /// Until nothing is being sent. False: something still is at the deadline, a stop request, or the device's
  /// end.
  [[nodiscard]] bool wait_for_out(Clock::time_point deadline, const std::stop_token& stop);
  void lose(const std::string& why);
  [[nodiscard]] bool gone(std::string* why = nullptr) const;
  [[nodiscard]] std::unexpected<Error> disconnected() const;
  [[nodiscard]] std::unexpected<Error> no_memory() const;
  void shut_down() noexcept;

  const std::shared_ptr<EventLoop> loop_;
  const BusEntry entry_;
  libusb_device_handle* handle_ = nullptr;
  bool claimed_ = false;
  std::atomic<bool> closed_ = false;

  // Of the thread that uses the link.
  std::vector<Slot> in_;  ///< One more than asked for: one is lent while the others are under way.
  Slot out_;
  std::vector<Slot*> idle_;
  std::vector<Slot*> taken_;  ///< Completed, oldest first; of these `next_taken_` were looked at.
  std::size_t next_taken_ = 0;
  Slot* lent_ = nullptr;
  bool halted_ = false;
  std::uint32_t generation_ = 0;
  int failures_in_row_ = 0;
  std::vector<Notice> notices_;
  CarrierStatistics statistics_;

  /// Held while a call asks the device something that it may be slow to answer.
  std::mutex control_mutex_;

  // Shared with the event thread.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Slot*> completed_;  ///< Oldest first.
  int under_way_ = 0;             ///< Both pipes.
  bool out_busy_ = false;
  bool gone_ = false;
  bool settled_ = false;  ///< Gone, and nothing will come that was on its way.
  std::string gone_why_;
};

}  // namespace scatter::device::usb
