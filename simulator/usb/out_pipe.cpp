#include "simulator/usb/out_pipe.h"

#include <algorithm>
#include <utility>

namespace scatter::simulator {

OutPipe::OutPipe(const firmware::UsbEndpoint& endpoint, LaneFaults* faults, UsbCompletions& completions)
    : endpoint_(endpoint), faults_(faults), completions_(completions) {}

OutPipe::Taken OutPipe::read(std::span<std::byte> out, std::uint64_t now_us) {
  Taken taken;
  while (!pieces_.empty() && taken.size < out.size()) {
    Piece& piece = pieces_.front();
    const std::size_t count = std::min(out.size() - taken.size, piece.bytes.size() - piece.taken);
    std::copy_n(piece.bytes.begin() + static_cast<std::ptrdiff_t>(piece.taken), count,
                out.begin() + static_cast<std::ptrdiff_t>(taken.size));
    piece.taken += count;
    taken.size += count;
    queued_ -= count;
    if (!bulk()) {
      // A packet is taken as one; what does not fit is lost, as in a controller's FIFO.
      queued_ -= piece.bytes.size() - piece.taken;
      pieces_.pop_front();
      break;
    }
    if (piece.taken == piece.bytes.size()) {
      pieces_.pop_front();
    }
  }
  taken.broken = taken.size > 0 && serve(now_us);
  return taken;
}

void OutPipe::set_halt(bool halted) {
  halted_ = halted;
  if (halted) {
    end_all(UsbOutcome::kStalled);
  } else {
    forget();
  }
}

void OutPipe::forget() {
  pieces_.clear();
  queued_ = 0;
  halted_ = false;
  if (faults_ != nullptr) {
    faults_->clear();
  }
}

bool OutPipe::submit(UsbTransfer transfer, std::uint64_t now_us) {
  pending_.push_back({.id = transfer.id, .data = std::move(transfer.data)});
  if (halted_) {
    complete(UsbOutcome::kStalled);
    return false;
  }
  return serve(now_us);
}

bool OutPipe::cancel(std::uint64_t id) {
  const auto found = std::ranges::find(pending_, id, &Pending::id);
  if (found == pending_.end()) {
    return false;
  }
  completions_.add_out(id, UsbOutcome::kCancelled, found->taken);
  pending_.erase(found);
  return true;
}

void OutPipe::end_all(UsbOutcome outcome) {
  while (!pending_.empty()) {
    complete(outcome);
  }
}

bool OutPipe::tick(std::uint64_t now_us) {
  if (faults_ != nullptr && faults_->harms_frames()) {
    std::vector<std::byte> held;
    faults_->release_due(now_us, held);
    queue(std::move(held));
  }
  return serve(now_us);
}

std::size_t OutPipe::fitting(std::size_t wanted) const noexcept {
  const std::size_t packet = endpoint_.packet_bytes;
  if (!bulk()) {
    return pieces_.size() < kReportsWaiting ? std::min(wanted, packet) : 0;
  }
  const std::size_t room = kBulkCapacity - std::min(queued_, kBulkCapacity);
  return wanted <= room ? wanted : room / packet * packet;
}

bool OutPipe::serve(std::uint64_t now_us) {
  while (!pending_.empty() && !halted_) {
    Pending& from = pending_.front();
    const std::size_t left = from.data.size() - from.taken;
    const std::size_t fits = fitting(left);
    const std::size_t count = faults_ != nullptr ? faults_->allowed(fits, now_us) : fits;
    if (count == 0 && left > 0) {
      // At a stall, or without room. A break at this very byte happened when the one before crossed, unless
      // it is the first of all.
      return faults_ != nullptr && fits > 0 && faults_->crossed(0);
    }
    accept(std::span(from.data).subspan(from.taken, count), now_us);
    from.taken += count;
    const bool broken = faults_ != nullptr && faults_->crossed(count);
    if (from.taken == from.data.size()) {
      complete(UsbOutcome::kDone);
    }
    if (broken) {
      return true;
    }
  }
  return false;
}

void OutPipe::accept(std::span<const std::byte> bytes, std::uint64_t now_us) {
  std::vector<std::byte> taken;
  if (faults_ != nullptr) {
    faults_->carry(bytes, now_us, taken);
  } else {
    taken.assign(bytes.begin(), bytes.end());
  }
  queue(std::move(taken));
}

void OutPipe::queue(std::vector<std::byte> bytes) {
  if (!bytes.empty()) {
    queued_ += bytes.size();
    pieces_.push_back({.bytes = std::move(bytes)});
  }
}

void OutPipe::complete(UsbOutcome outcome) {
  completions_.add_out(pending_.front().id, outcome, pending_.front().taken);
  pending_.pop_front();
}

}  // namespace scatter::simulator
