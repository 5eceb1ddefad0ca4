// One endpoint to the host: the device's transfers go in, the host's are filled.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "firmware/ports/usb_controller.h"
#include "simulator/faults/lane_faults.h"
#include "simulator/usb/usb_completions.h"
#include "simulator/usb/usb_transfer_faults.h"

namespace scatter::simulator {

/// Bulk: a stream of packets; a transfer of the host ends when it is full, or with the device's transfer: by
/// a short packet, or by one of no bytes when the last one was full. A packet that does not fit into what is
/// left of the host's transfer babbles. Interrupt: every write is a report of at most one packet.
///
/// Calls that may move bytes give true when the fault plan breaks the cable there.
/// Cost: one copy into the pipe; out of it whole buffers move where they can. Threads: one.
class InPipe {
 public:
  /// Bytes that wait for the host before the device feels back-pressure: as much as VirtualLink takes.
  static constexpr std::size_t kBulkCapacity = 256 * 1024;
  static constexpr std::size_t kReportsWaiting = 4;

  /// What the fault plan does to a bulk pipe; lives longer than the pipe.
  struct Faults {
    LaneFaults& lane;
    UsbTransferFaults& transfers;
  };

  /// `faults` null: nothing is harmed.
  InPipe(const firmware::UsbEndpoint& endpoint, Faults* faults, UsbCompletions& completions);

  [[nodiscard]] const firmware::UsbEndpoint& endpoint() const noexcept { return endpoint_; }
  [[nodiscard]] bool halted() const noexcept { return halted_; }
  /// Bytes that the host has not taken.
  [[nodiscard]] std::size_t waiting() const noexcept { return queued_; }
  [[nodiscard]] std::size_t under_way() const noexcept { return pending_.size(); }
  /// Bulk bytes wait, and no transfer is there to take them.
  [[nodiscard]] bool host_is_slow() const noexcept {
    return bulk() && queued_ > 0 && pending_.empty() && !halted_;
  }

  // The device's side.
  struct Written {
    std::size_t taken = 0;
    bool broken = false;
  };
  [[nodiscard]] Written write(std::span<const std::byte> bytes, std::uint64_t now_us);
  [[nodiscard]] bool end_transfer(std::uint64_t now_us);
  /// The end of a halt forgets what waits, as the start of a new setting does.
  void set_halt(bool halted);
  void forget();

  // The host's side. `transfer.data` is empty; its memory is used for bytes to come.
  [[nodiscard]] bool submit(UsbTransfer transfer, std::uint64_t now_us);
  /// What has come for it so far goes with it. False: not here.
  [[nodiscard]] bool cancel(std::uint64_t id, bool& broken, std::uint64_t now_us);
  /// Every transfer of the host ends so.
  void end_all(UsbOutcome outcome);

  /// Time has moved: frames held back go on, a stall may be over.
  [[nodiscard]] bool tick(std::uint64_t now_us);

 private:
  /// A transfer of the device. Packets are cut from `base` on.
  struct Segment {
    std::vector<std::byte> bytes;
    std::size_t size = 0;  ///< Of `bytes`, also after they have moved to the host.
    std::size_t base = 0;
    std::size_t taken = 0;
    bool ended = false;
  };
  struct Pending {
    std::uint64_t id = 0;
    std::size_t length = 0;
    std::vector<std::byte> data;
  };
  enum class Moved : std::uint8_t { kOn, kNothing, kBroken };

  [[nodiscard]] bool bulk() const noexcept { return endpoint_.type == firmware::UsbEndpoint::Type::kBulk; }
  [[nodiscard]] std::size_t capacity() const noexcept;
  [[nodiscard]] Segment& open_segment();
  void count_new(Segment& segment);
  void append(std::span<const std::byte> bytes, std::uint64_t now_us);
  void end_segment();
  [[nodiscard]] bool serve(std::uint64_t now_us, bool every_packet = false);
  [[nodiscard]] Moved move_some(std::uint64_t now_us, bool every_packet);
  /// Bytes in packets that are complete: full, or ended.
  [[nodiscard]] std::size_t sendable(const Segment& segment) const noexcept;
  /// What is left of the host's transfer ends inside a packet.
  [[nodiscard]] bool overflows(const Segment& segment, std::size_t room) const noexcept;
  [[nodiscard]] bool ends_short(const Segment& segment) const noexcept;
  [[nodiscard]] bool completes(const Segment& segment, const Pending& to, std::size_t count) const noexcept;
  [[nodiscard]] Moved move_faulty(Segment& segment, Pending& to, std::size_t count);
  void take(Segment& segment, Pending& to, std::size_t count);
  void forget_taken(Segment& segment);
  /// `count` bytes have moved: the host's transfer is complete, or the device's is over, or both.
  void settle(const Segment& segment, const Pending& to, std::size_t count);
  /// The host's first transfer babbles, and these bytes are gone.
  void lose(Segment& segment, std::size_t count);
  void complete(UsbOutcome outcome);
  void pop_segment();
  void keep_spare(std::vector<std::byte>&& buffer);
  [[nodiscard]] std::vector<std::byte> fresh_buffer();

  firmware::UsbEndpoint endpoint_;
  Faults* faults_;
  UsbCompletions& completions_;
  bool halted_ = false;
  std::size_t queued_ = 0;  ///< Bytes in `segments_` that were not taken.
  std::deque<Segment> segments_;
  std::deque<Pending> pending_;
  std::vector<std::vector<std::byte>> spare_;  ///< Memory of finished segments.
};

}  // namespace scatter::simulator
