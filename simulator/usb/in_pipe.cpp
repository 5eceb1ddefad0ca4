#include "simulator/usb/in_pipe.h"

#include <algorithm>
#include <utility>

namespace scatter::simulator {
namespace {

constexpr std::size_t kMostSpare = 32;
// An open transfer of the device forgets the packets that the host has once they are so many bytes.
constexpr std::size_t kForgetBytes = 64 * 1024;

}  // namespace

InPipe::InPipe(const firmware::UsbEndpoint& endpoint, Faults* faults, UsbCompletions& completions)
    : endpoint_(endpoint), faults_(faults), completions_(completions) {}

std::size_t InPipe::capacity() const noexcept {
  return bulk() ? kBulkCapacity : kReportsWaiting * endpoint_.packet_bytes;
}

InPipe::Written InPipe::write(std::span<const std::byte> bytes, std::uint64_t now_us) {
  Written written;
  if (halted_) {
    return written;
  }
  if (!bulk()) {
    const std::size_t report = std::min<std::size_t>(bytes.size(), endpoint_.packet_bytes);
    if (report == 0 || queued_ + report > capacity()) {
      return written;
    }
    append(bytes.first(report), now_us);
    segments_.back().ended = true;
    return {.taken = report, .broken = serve(now_us)};
  }
  while (written.taken < bytes.size() && queued_ < capacity() && !halted_) {
    const std::size_t count = std::min(bytes.size() - written.taken, capacity() - queued_);
    append(bytes.subspan(written.taken, count), now_us);
    written.taken += count;
    if (serve(now_us)) {
      written.broken = true;
      return written;
    }
  }
  return written;
}

InPipe::Segment& InPipe::open_segment() {
  if (segments_.empty() || segments_.back().ended) {
    segments_.push_back({.bytes = fresh_buffer()});
  }
  return segments_.back();
}

void InPipe::count_new(Segment& segment) {
  queued_ += segment.bytes.size() - segment.size;
  segment.size = segment.bytes.size();
}

void InPipe::append(std::span<const std::byte> bytes, std::uint64_t now_us) {
  Segment& segment = open_segment();
  if (faults_ != nullptr && faults_->lane.harms_frames()) {
    faults_->lane.carry(bytes, now_us, segment.bytes);
  } else {
    segment.bytes.insert(segment.bytes.end(), bytes.begin(), bytes.end());
  }
  count_new(segment);
}

void InPipe::end_segment() {
  // Without bytes there is nothing to end: a frame that the link lost, or a call that came twice.
  if (!segments_.empty() && segments_.back().size > 0) {
    segments_.back().ended = true;
  }
}

bool InPipe::end_transfer(std::uint64_t now_us) {
  end_segment();
  return serve(now_us);
}

void InPipe::set_halt(bool halted) {
  halted_ = halted;
  if (halted) {
    end_all(UsbOutcome::kStalled);
  } else {
    forget();
  }
}

void InPipe::forget() {
  segments_.clear();
  queued_ = 0;
  halted_ = false;
  if (faults_ != nullptr) {
    faults_->lane.clear();
  }
}

bool InPipe::submit(UsbTransfer transfer, std::uint64_t now_us) {
  transfer.data.clear();
  pending_.push_back({.id = transfer.id, .length = transfer.length, .data = std::move(transfer.data)});
  if (halted_) {
    complete(UsbOutcome::kStalled);
    return false;
  }
  return serve(now_us);
}

bool InPipe::cancel(std::uint64_t id, bool& broken, std::uint64_t now_us) {
  const auto found = std::ranges::find(pending_, id, &Pending::id);
  if (found == pending_.end()) {
    return false;
  }
  if (found == pending_.begin()) {
    broken = serve(now_us, true);
  }
  const auto again = std::ranges::find(pending_, id, &Pending::id);
  if (again != pending_.end()) {
    completions_.add_in(id, UsbOutcome::kCancelled, std::move(again->data));
    pending_.erase(again);
  }
  return true;
}

void InPipe::end_all(UsbOutcome outcome) {
  while (!pending_.empty()) {
    complete(outcome);
  }
}

bool InPipe::tick(std::uint64_t now_us) {
  if (faults_ == nullptr) {
    return false;
  }
  if (faults_->lane.harms_frames() && !halted_) {
    Segment& segment = open_segment();
    faults_->lane.release_due(now_us, segment.bytes);
    if (segment.bytes.size() > segment.size) {
      count_new(segment);
      end_segment();  // Nothing says when more will come.
    }
  }
  return serve(now_us);
}

bool InPipe::serve(std::uint64_t now_us, bool every_packet) {
  while (!pending_.empty() && !segments_.empty()) {
    const Moved moved = move_some(now_us, every_packet);
    if (moved == Moved::kOn) {
      continue;
    }
    return moved == Moved::kBroken;
  }
  return false;
}

std::size_t InPipe::sendable(const Segment& segment) const noexcept {
  if (segment.ended) {
    return segment.size - segment.taken;
  }
  const std::size_t packets = (segment.size - segment.base) / endpoint_.packet_bytes * endpoint_.packet_bytes;
  const std::size_t done = segment.taken - segment.base;
  return packets > done ? packets - done : 0;
}

bool InPipe::overflows(const Segment& segment, std::size_t room) const noexcept {
  const std::size_t end = segment.taken - segment.base + room;
  return room > 0 && sendable(segment) > room && end % endpoint_.packet_bytes != 0;
}

InPipe::Moved InPipe::move_some(std::uint64_t now_us, bool every_packet) {
  Segment& segment = segments_.front();
  Pending& to = pending_.front();
  const std::size_t room = to.length - to.data.size();
  const std::size_t count = std::min(sendable(segment), room);
  // Packets of a transfer that goes on may as well wait here until they fill the host's.
  const bool gather = !segment.ended && count < room && !every_packet && queued_ < capacity();
  if (gather || (count == 0 && !segment.ended)) {
    return Moved::kNothing;
  }
  if (overflows(segment, room)) {
    const std::size_t packet = endpoint_.packet_bytes;
    const std::size_t end = segment.base + (segment.taken - segment.base + room) / packet * packet + packet;
    lose(segment, std::min(end, segment.size) - segment.taken);
    return Moved::kOn;
  }
  if (faults_ == nullptr) {
    take(segment, to, count);
    settle(segment, to, count);
    return Moved::kOn;
  }
  const std::size_t allowed = faults_->lane.allowed(count, now_us);
  if (allowed < count) {
    take(segment, to, allowed);
    const bool broken = faults_->lane.crossed(allowed);
    // Some went: the next try finds the stall itself, whose time begins with that.
    return broken ? Moved::kBroken : (allowed > 0 ? Moved::kOn : Moved::kNothing);
  }
  return move_faulty(segment, to, count);
}

InPipe::Moved InPipe::move_faulty(Segment& segment, Pending& to, std::size_t count) {
  using Fate = UsbTransferFaults::Fate;
  const UsbTransferFaults::Verdict verdict =
      completes(segment, to, count) ? faults_->transfers.next(count) : UsbTransferFaults::Verdict{};
  std::size_t crossing = count;
  switch (verdict.fate) {
    case Fate::kWhole:
      take(segment, to, count);
      settle(segment, to, count);
      break;
    case Fate::kStall:
      set_halt(true);
      return Moved::kNothing;
    case Fate::kBabble:
      lose(segment, count);
      break;
    case Fate::kShort:
      crossing = verdict.keep;
      take(segment, to, crossing);
      segment.base = segment.taken;  // Packets are cut anew from here.
      complete(UsbOutcome::kDone);
      break;
  }
  return faults_->lane.crossed(crossing) ? Moved::kBroken : Moved::kOn;
}

bool InPipe::ends_short(const Segment& segment) const noexcept {
  return (segment.size - segment.base) % endpoint_.packet_bytes != 0;
}

bool InPipe::completes(const Segment& segment, const Pending& to, std::size_t count) const noexcept {
  const bool over = segment.ended && segment.taken + count == segment.size;
  return to.data.size() + count == to.length || (over && (bulk() || ends_short(segment)));
}

void InPipe::take(Segment& segment, Pending& to, std::size_t count) {
  if (count == 0) {
    return;  // A packet of no bytes; the segment's may have moved already.
  }
  if (segment.ended && segment.taken == 0 && count == segment.size && to.data.empty()) {
    keep_spare(std::move(to.data));
    to.data = std::move(segment.bytes);
  } else {
    const auto from = segment.bytes.begin() + static_cast<std::ptrdiff_t>(segment.taken);
    to.data.insert(to.data.end(), from, from + static_cast<std::ptrdiff_t>(count));
  }
  segment.taken += count;
  queued_ -= count;
  if (!segment.ended) {
    forget_taken(segment);
  }
}

void InPipe::forget_taken(Segment& segment) {
  // The last packet stays: what ends the transfer depends on whether there was one.
  const std::size_t packets = (segment.taken - segment.base) / endpoint_.packet_bytes;
  const std::size_t known = segment.base + (std::max<std::size_t>(packets, 1) - 1) * endpoint_.packet_bytes;
  if (known >= kForgetBytes) {
    segment.bytes.erase(segment.bytes.begin(), segment.bytes.begin() + static_cast<std::ptrdiff_t>(known));
    segment.size -= known;
    segment.taken -= known;
    segment.base = 0;
  }
}

void InPipe::settle(const Segment& segment, const Pending& to, std::size_t count) {
  const bool full = to.data.size() == to.length;
  const bool over = segment.ended && segment.taken == segment.size;
  if (!over) {
    if (full) {
      complete(UsbOutcome::kDone);
    }
    return;
  }
  const bool short_end = ends_short(segment);
  // A full transfer leaves the packet of no bytes, which this end needs, to the next one.
  const bool end_is_due = bulk() && !short_end && full && count > 0;
  if (full || short_end || bulk()) {
    complete(UsbOutcome::kDone);
  }
  if (!end_is_due) {
    pop_segment();
  }
}

void InPipe::lose(Segment& segment, std::size_t count) {
  segment.taken += count;
  queued_ -= count;
  pending_.front().data.clear();
  complete(UsbOutcome::kBabble);
  if (segment.ended && segment.taken == segment.size) {
    pop_segment();
  }
}

void InPipe::complete(UsbOutcome outcome) {
  Pending& done = pending_.front();
  completions_.add_in(done.id, outcome, std::move(done.data));
  pending_.pop_front();
}

void InPipe::pop_segment() {
  keep_spare(std::move(segments_.front().bytes));
  segments_.pop_front();
}

void InPipe::keep_spare(std::vector<std::byte>&& buffer) {
  if (buffer.capacity() > 0 && spare_.size() < kMostSpare) {
    buffer.clear();
    spare_.push_back(std::move(buffer));
  }
}

std::vector<std::byte> InPipe::fresh_buffer() {
  if (spare_.empty()) {
    return {};
  }
  std::vector<std::byte> buffer = std::move(spare_.back());
  spare_.pop_back();
  return buffer;
}

}  // namespace scatter::simulator
