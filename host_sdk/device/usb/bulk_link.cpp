#include "host_sdk/device/usb/bulk_link.h"

#include <libusb.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "host_sdk/device/usb/bounded_call.h"
#include "host_sdk/device/usb/open_error.h"
#include "host_sdk/device/usb/selection.h"
#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

using namespace std::chrono_literals;
using protocol::usb::kBulkIn;
using protocol::usb::kBulkOut;
using protocol::usb::kStreamInterface;
using protocol::usb::kStreamOpenSetting;
using protocol::usb::kTransferBytes;

constexpr std::size_t kFewestTransfers = 2;
constexpr auto kStopSlice = 10ms;
/// The kernel gives cancelled transfers back at once; a device has no say in it.
constexpr auto kReapWithin = 150ms;
constexpr auto kCloseWithin = 150ms;
constexpr auto kAnswerWithin = 200ms;
/// Failed transfers without a good one between them after which the device counts as gone: a cable that is
/// being pulled out gives such ones until the hub tells. Twice what may be under way.
constexpr int kMostFailures = 128;
constexpr int kMostRepeats = 3;

constexpr const char* kRaiseUsbMemory = "echo 128 | sudo tee /sys/module/usbcore/parameters/usbfs_memory_mb";

}  // namespace

BulkLink::BulkLink(std::shared_ptr<EventLoop> loop, BusEntry entry, int transfers)
    : loop_(std::move(loop)),
      entry_(std::move(entry)),
      in_(static_cast<std::size_t>(std::clamp(transfers, 16, 64)) + 1) {
  taken_.reserve(in_.size());
  completed_.reserve(in_.size());
}

BulkLink::~BulkLink() {
  shut_down();
}

Result<std::shared_ptr<BulkLink>> BulkLink::open(std::shared_ptr<EventLoop> loop, const BusEntry& entry,
                                                 int transfers, Clock::time_point deadline,
                                                 const std::stop_token& stop) {
  struct Attempt {
    std::shared_ptr<BulkLink> link;
    Status status;
  };
  const auto attempt = std::make_shared<Attempt>();
  attempt->link = std::shared_ptr<BulkLink>(new BulkLink(std::move(loop), entry, transfers));
  // The kernel asks the device; one that does not answer holds the call for many seconds. Whoever drops the
  // attempt last closes what it opened.
  switch (call_bounded([attempt] { attempt->status = attempt->link->attach(); }, deadline, stop)) {
    case CallEnd::kStopped:
      return fail(ErrorCode::kAborted, label(entry) + ": opening was stopped", "start again when ready");
    case CallEnd::kLate:
      return fail(ErrorCode::kDeadlineExceeded, label(entry) + " does not answer",
                  "unplug it and plug it in again");
    case CallEnd::kDone:
      break;
  }
  if (!attempt->status) {
    attempt->link->close();
    return std::unexpected(attempt->status.error());
  }
  return attempt->link;
}

Status BulkLink::attach() {
  libusb_device** all = nullptr;
  const ssize_t count = ::libusb_get_device_list(loop_->context(), &all);
  int failed = LIBUSB_ERROR_NOT_FOUND;
  for (ssize_t k = 0; k < count; ++k) {
    if (::libusb_get_bus_number(all[k]) == entry_.bus &&
        ::libusb_get_device_address(all[k]) == entry_.address) {
      failed = ::libusb_open(all[k], &handle_);
    }
  }
  if (count >= 0) {
    ::libusb_free_device_list(all, 1);
  }
  if (failed == 0 && !entry_.stream_driver.empty() && entry_.stream_driver != "usbfs") {
    (void)::libusb_set_auto_detach_kernel_driver(handle_, 1);
  }
  if (failed == 0) {
    failed = ::libusb_claim_interface(handle_, kStreamInterface);
    claimed_ = failed == 0;
    if (failed == LIBUSB_ERROR_NOT_FOUND) {
      return fail(ErrorCode::kFailedPrecondition,
                  label(entry_) + ": interface " + std::to_string(kStreamInterface) +
                      " of its descriptors is not there",
                  "unplug it and plug it in again");
    }
  }
  if (failed == 0) {
    failed = ::libusb_set_interface_alt_setting(handle_, kStreamInterface, kStreamOpenSetting);
  }
  return failed == 0 ? start() : Status(std::unexpected(open_error(failed, entry_)));
}

bool BulkLink::make_slot(Slot& slot, std::uint8_t endpoint, bool kernel_memory) {
  slot.owner = this;
  return slot.make(handle_, endpoint, kernel_memory, on_complete, &slot);
}

Status BulkLink::start() {
  if (!make_slot(out_, kBulkOut, false)) {
    return no_memory();
  }
  std::size_t submitted = 0;
  int failed = 0;
  for (Slot& slot : in_) {
    if (!make_slot(slot, kBulkIn, true)) {
      return no_memory();
    }
    failed = failed == 0 ? submit(slot) : failed;
    if (failed == 0) {
      ++submitted;
    } else {
      idle_.push_back(&slot);
    }
  }
  if (failed != 0 && (failed != LIBUSB_ERROR_NO_MEM || submitted < kFewestTransfers)) {
    return failed == LIBUSB_ERROR_NO_MEM ? Status(no_memory())
                                         : Status(std::unexpected(open_error(failed, entry_)));
  }
  if (failed != 0) {
    notices_.push_back({"the system's memory for USB allows " + std::to_string(submitted) + " of " +
                            std::to_string(in_.size()) +
                            " transfers under way: frames may wait in the instrument",
                        kRaiseUsbMemory});
  }
  if (entry_.speed_mbps != 0 && entry_.speed_mbps < 480) {
    notices_.push_back({label(entry_) + " is on a " + std::to_string(entry_.speed_mbps) +
                            " Mb/s bus: frames come slower than the sensor takes them",
                        "use another port or cable, without an old hub between"});
  }
  return {};
}

int BulkLink::submit(Slot& slot) {
  slot.generation = generation_;
  {
    const std::lock_guard lock(mutex_);
    ++under_way_;
  }
  const int failed = ::libusb_submit_transfer(slot.transfer());
  if (failed != 0) {
    const std::lock_guard lock(mutex_);
    --under_way_;
  }
  return failed;
}

void BulkLink::submit_in(Slot& slot) {
  if (halted_ || gone()) {
    idle_.push_back(&slot);
    return;
  }
  const int failed = submit(slot);
  if (failed == 0) {
    return;
  }
  idle_.push_back(&slot);
  if (failed == LIBUSB_ERROR_NO_DEVICE) {
    lose("was unplugged");
  } else if (failed != LIBUSB_ERROR_NO_MEM || idle_.size() == in_.size()) {
    lose(std::string("takes no transfers: ").append(::libusb_strerror(static_cast<libusb_error>(failed))));
  }
}

void BulkLink::on_complete(libusb_transfer* transfer) {
  auto* const slot = static_cast<Slot*>(transfer->user_data);
  BulkLink& link = *slot->owner;
  std::unique_lock lock(link.mutex_);
  --link.under_way_;
  if (slot == &link.out_) {
    link.out_busy_ = false;
  } else {
    link.completed_.push_back(slot);
  }
  // Whoever waits for the last one may destroy the link right after, so that is told with the lock held. Else
  // who wakes need not wait for the lock: the link stays while others are under way, and libusb_close() waits
  // for the event thread besides.
  if (link.under_way_ != 0) {
    lock.unlock();
  }
  link.changed_.notify_all();
}

Result<std::span<const std::byte>> BulkLink::receive(Clock::time_point deadline,
                                                     const std::stop_token& stop) {
  if (lent_ != nullptr && !closed_) {
    submit_in(*std::exchange(lent_, nullptr));
  }
  for (;;) {
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "usb: stopped", "start again when ready");
    }
    if (closed_) {
      return disconnected();
    }
    if (halted_ && !gone()) {
      restart_in();
    }
    Slot* const slot = next_completed();
    if (slot == nullptr) {
      if (const Status waited = wait_for_completed(deadline); !waited) {
        return std::unexpected(waited.error());
      }
      continue;
    }
    judge(*slot);
    if (slot->transfer()->actual_length > 0) {
      lent_ = slot;
      return std::span<const std::byte>(slot->memory(),
                                        static_cast<std::size_t>(slot->transfer()->actual_length));
    }
    submit_in(*slot);
  }
}

BulkLink::Slot* BulkLink::next_completed() {
  if (next_taken_ == taken_.size()) {
    taken_.clear();
    next_taken_ = 0;
    const std::lock_guard lock(mutex_);
    std::swap(taken_, completed_);
  }
  return next_taken_ == taken_.size() ? nullptr : taken_[next_taken_++];
}

Status BulkLink::wait_for_completed(Clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  const auto some = [this] { return !completed_.empty(); };
  const auto now = Clock::now();
  if (gone_) {
    // A refused transfer tells of the end before the kernel has given back what came earlier.
    if (!settled_) {
      changed_.wait_until(lock, now + kReapWithin, [&] { return some() || under_way_ == 0; });
    }
    if (some()) {
      return {};
    }
    settled_ = true;
    lock.unlock();
    return disconnected();
  }
  if (!some() && now >= deadline) {
    return fail(ErrorCode::kDeadlineExceeded, label(entry_) + ": nothing came in time",
                "check that the device has power and the cable is good, then try again");
  }
  changed_.wait_until(lock, std::min(deadline, now + kStopSlice), [&] { return some() || gone_; });
  return {};
}

void BulkLink::judge(const Slot& slot) {
  switch (slot.transfer()->status) {
    case LIBUSB_TRANSFER_COMPLETED:
      failures_in_row_ = 0;
      return;
    case LIBUSB_TRANSFER_STALL:
      if (slot.generation != generation_ || halted_) {
        return;  // Of the halt that is known already.
      }
      halted_ = true;
      ++statistics_.stalls;
      break;
    case LIBUSB_TRANSFER_OVERFLOW:
      ++statistics_.overflows;
      break;
    case LIBUSB_TRANSFER_ERROR:
      ++statistics_.errors;
      break;
    case LIBUSB_TRANSFER_NO_DEVICE:
      lose("was unplugged");
      return;
    case LIBUSB_TRANSFER_CANCELLED:
    case LIBUSB_TRANSFER_TIMED_OUT:
      return;
  }
  if (++failures_in_row_ >= kMostFailures) {
    lose("gives nothing but errors");
  }
}

void BulkLink::restart_in() {
  cancel_all();
  if (!drain(Clock::now() + kReapWithin) || !clear_halt(kBulkIn)) {
    lose("stays halted");
    return;
  }
  halted_ = false;
  ++generation_;
  for (Slot* slot : std::exchange(idle_, {})) {
    submit_in(*slot);
  }
}

bool BulkLink::clear_halt(std::uint8_t endpoint) {
  const auto answer = std::make_shared<std::atomic<int>>(LIBUSB_ERROR_TIMEOUT);
  const CallEnd end = call_bounded(
      [self = shared_from_this(), answer, endpoint] {
        const std::lock_guard lock(self->control_mutex_);
        if (self->handle_ != nullptr) {
          *answer = ::libusb_clear_halt(self->handle_, endpoint);
        }
      },
      Clock::now() + kAnswerWithin);
  return end == CallEnd::kDone && *answer == 0;
}

bool BulkLink::drain(Clock::time_point limit) {
  std::unique_lock lock(mutex_);
  return changed_.wait_until(lock, limit, [this] { return under_way_ == 0; });
}

void BulkLink::cancel_all() noexcept {
  for (Slot& slot : in_) {
    if (slot.transfer() != nullptr) {
      (void)::libusb_cancel_transfer(slot.transfer());  // One that is not under way is left alone.
    }
  }
}

int BulkLink::send_piece(std::span<const std::byte> piece, Clock::time_point deadline,
                         const std::stop_token& stop, std::size_t& sent) {
  if (!wait_for_out(deadline, stop)) {
    return LIBUSB_TRANSFER_TIMED_OUT;
  }
  std::memcpy(out_.memory(), piece.data(), piece.size());
  out_.transfer()->length = static_cast<int>(piece.size());
  {
    const std::lock_guard lock(mutex_);
    out_busy_ = true;
  }
  if (const int failed = submit(out_); failed != 0) {
    const std::lock_guard lock(mutex_);
    out_busy_ = false;
    return failed == LIBUSB_ERROR_NO_DEVICE ? LIBUSB_TRANSFER_NO_DEVICE : LIBUSB_TRANSFER_ERROR;
  }
  if (!wait_for_out(deadline, stop)) {
    (void)::libusb_cancel_transfer(out_.transfer());
    // A bus over a network asks its far end first; until it has answered the transfer is under way.
    if (!wait_for_out(Clock::now() + kReapWithin, {})) {
      return gone() ? LIBUSB_TRANSFER_NO_DEVICE : LIBUSB_TRANSFER_TIMED_OUT;
    }
  }
  sent = static_cast<std::size_t>(std::max(out_.transfer()->actual_length, 0));
  return out_.transfer()->status;
}

bool BulkLink::wait_for_out(Clock::time_point deadline, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (out_busy_ && !gone_ && !stop.stop_requested() && Clock::now() < deadline) {
    changed_.wait_until(lock, std::min(deadline, Clock::now() + kStopSlice));
  }
  return !out_busy_;
}

Status BulkLink::write(std::span<const std::byte> bytes, Clock::time_point deadline,
                       const std::stop_token& stop) {
  std::span<const std::byte> rest = bytes;
  for (int repeats = 0; !rest.empty();) {
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "usb: stopped", "start again when ready");
    }
    if (closed_ || gone()) {
      return disconnected();
    }
    if (Clock::now() >= deadline) {
      return fail(ErrorCode::kDeadlineExceeded, label(entry_) + ": it does not take what is sent to it",
                  "unplug it and plug it in again");
    }
    std::size_t sent = 0;
    const int end = send_piece(rest.first(std::min(rest.size(), kTransferBytes)), deadline, stop, sent);
    rest = rest.subspan(std::min(sent, rest.size()));
    if (end == LIBUSB_TRANSFER_NO_DEVICE) {
      lose("was unplugged");
    } else if (end == LIBUSB_TRANSFER_STALL || end == LIBUSB_TRANSFER_ERROR ||
               end == LIBUSB_TRANSFER_OVERFLOW) {
      const bool stalled = end == LIBUSB_TRANSFER_STALL;
      ++(stalled ? statistics_.stalls : statistics_.errors);
      // Whole again: the receiver finds the frame behind the torn one, and executes a request once.
      rest = bytes;
      if (++repeats > kMostRepeats || (stalled && !clear_halt(kBulkOut))) {
        lose("refuses what is sent to it");
      }
    }
  }
  return {};
}

void BulkLink::lose(const std::string& why) {
  const std::lock_guard lock(mutex_);
  if (!std::exchange(gone_, true)) {
    gone_why_ = why;
  }
  changed_.notify_all();
}

void BulkLink::abandon() noexcept {
  {
    const std::lock_guard lock(mutex_);
    settled_ = true;
  }
  lose("was let go: the program's USB context is gone");
}

bool BulkLink::gone(std::string* why) const {
  const std::lock_guard lock(mutex_);
  if (why != nullptr) {
    *why = gone_why_;
  }
  return gone_;
}

std::unexpected<Error> BulkLink::disconnected() const {
  std::string why;
  if (!gone(&why)) {
    why = "is closed";
  }
  return fail(ErrorCode::kDisconnected, label(entry_) + " " + why, "plug it in again and open it again");
}

std::unexpected<Error> BulkLink::no_memory() const {
  return fail(ErrorCode::kResourceExhausted,
              label(entry_) + ": the system's memory for USB does not allow " +
                  std::to_string(kFewestTransfers) + " transfers of " + std::to_string(kTransferBytes) +
                  " bytes",
              kRaiseUsbMemory);
}

void BulkLink::close() noexcept {
  if (closed_.exchange(true) || handle_ == nullptr) {
    return;
  }
  (void)call_bounded([self = shared_from_this()] { self->shut_down(); }, Clock::now() + kCloseWithin);
}

void BulkLink::shut_down() noexcept {
  if (handle_ == nullptr) {
    return;
  }
  // Cancel, wait for the kernel to give everything back, and only then let go: a handle that is closed before
  // takes the transfers' memory with it.
  cancel_all();
  if (out_.transfer() != nullptr) {
    (void)::libusb_cancel_transfer(out_.transfer());
  }
  {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return under_way_ == 0; });
  }
  {
    const std::lock_guard wait_for_control(control_mutex_);
  }
  if (claimed_) {
    // The kernel selects setting 0 again by itself. Asking libusb for it would be wrong for a device that has
    // left: up to 1.0.26 libusb_set_interface_alt_setting() then unlocks a mutex that it never locked, and
    // libusb_close() ends the program over it.
    (void)::libusb_release_interface(handle_, kStreamInterface);
  }
  for (Slot& slot : in_) {
    slot.free();
  }
  out_.free();
  ::libusb_close(std::exchange(handle_, nullptr));
}

}  // namespace scatter::device::usb
