// One endpoint to the device: the host's transfers wait until the device has room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "firmware/ports/usb_controller.h"
#include "simulator/faults/lane_faults.h"
#include "simulator/usb/usb_completions.h"

namespace scatter::simulator {

/// A transfer is done when the device's queue has its last packet; while there is no room the device says NAK
/// and the transfer waits. Bulk: a stream of bytes. Interrupt: packets, one at a time.
/// Calls that may move bytes give true when the fault plan breaks the cable there. Threads: one.
class OutPipe {
 public:
  static constexpr std::size_t kBulkCapacity = 64 * 1024;
  static constexpr std::size_t kReportsWaiting = 4;

  /// `faults` null: nothing is harmed; else it lives longer than the pipe.
  OutPipe(const firmware::UsbEndpoint& endpoint, LaneFaults* faults, UsbCompletions& completions);

  [[nodiscard]] const firmware::UsbEndpoint& endpoint() const noexcept { return endpoint_; }
  [[nodiscard]] bool halted() const noexcept { return halted_; }
  [[nodiscard]] std::size_t under_way() const noexcept { return pending_.size(); }

  // The device's side.
  struct Taken {
    std::size_t size = 0;
    bool broken = false;
  };
  [[nodiscard]] Taken read(std::span<std::byte> out, std::uint64_t now_us);
  /// The end of a halt forgets what waits, as the start of a new setting does.
  void set_halt(bool halted);
  void forget();

  // The host's side.
  [[nodiscard]] bool submit(UsbTransfer transfer, std::uint64_t now_us);
  /// What the device took of it stays with the device. False: not here.
  [[nodiscard]] bool cancel(std::uint64_t id);
  void end_all(UsbOutcome outcome);

  [[nodiscard]] bool tick(std::uint64_t now_us);

 private:
  struct Pending {
    std::uint64_t id = 0;
    std::vector<std::byte> data;
    std::size_t taken = 0;
  };
  struct Piece {
    std::vector<std::byte> bytes;
    std::size_t taken = 0;
  };

  [[nodiscard]] bool bulk() const noexcept { return endpoint_.type == firmware::UsbEndpoint::Type::kBulk; }
  /// Bytes of a transfer that fit now, whole packets.
  [[nodiscard]] std::size_t fitting(std::size_t wanted) const noexcept;
  [[nodiscard]] bool serve(std::uint64_t now_us);
  void accept(std::span<const std::byte> bytes, std::uint64_t now_us);
  void queue(std::vector<std::byte> bytes);
  void complete(UsbOutcome outcome);

  firmware::UsbEndpoint endpoint_;
  LaneFaults* faults_;
  UsbCompletions& completions_;
  bool halted_ = false;
  std::size_t queued_ = 0;  ///< Bytes in `pieces_` that the device has not read.
  std::deque<Piece> pieces_;
  std::deque<Pending> pending_;
};

}  // namespace scatter::simulator
