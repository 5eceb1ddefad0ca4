// Bytes between an interrupt and the main loop: one writer, one reader, no lock.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace scatter::firmware::mps2_an500 {

/// RAM: kBytes + 8. push* on one side and pop* on the other may interrupt each other.
template <std::uint32_t kBytes>
class ByteRing {
  static_assert(std::has_single_bit(kBytes), "the counters wrap at 2^32");

 public:
  [[nodiscard]] std::uint32_t used() const noexcept {
    return written_.load(std::memory_order_acquire) - read_.load(std::memory_order_acquire);
  }
  [[nodiscard]] std::uint32_t room() const noexcept { return kBytes - used(); }

  /// False when full.
  bool push(std::byte value) noexcept {
    const std::uint32_t at = written_.load(std::memory_order_relaxed);
    if (room() == 0) {
      return false;
    }
    bytes_[at % kBytes] = value;
    written_.store(at + 1, std::memory_order_release);
    return true;
  }
  /// As many as there is room for.
  std::size_t push(std::span<const std::byte> values) noexcept {
    const std::size_t count = std::min<std::size_t>(values.size(), room());
    const std::uint32_t at = written_.load(std::memory_order_relaxed);
    const std::size_t head = std::min<std::size_t>(count, kBytes - at % kBytes);
    std::copy_n(values.begin(), head, bytes_.begin() + at % kBytes);
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(head), count - head, bytes_.begin());
    written_.store(at + static_cast<std::uint32_t>(count), std::memory_order_release);
    return count;
  }

  /// Only while used() > 0.
  [[nodiscard]] std::byte pop() noexcept {
    const std::uint32_t at = read_.load(std::memory_order_relaxed);
    const std::byte value = bytes_[at % kBytes];
    read_.store(at + 1, std::memory_order_release);
    return value;
  }
  /// As many as there are.
  std::size_t pop(std::span<std::byte> out) noexcept {
    const std::size_t count = std::min<std::size_t>(out.size(), used());
    const std::uint32_t at = read_.load(std::memory_order_relaxed);
    const std::size_t head = std::min<std::size_t>(count, kBytes - at % kBytes);
    std::copy_n(bytes_.begin() + at % kBytes, head, out.begin());
    std::copy_n(bytes_.begin(), count - head, out.begin() + static_cast<std::ptrdiff_t>(head));
    read_.store(at + static_cast<std::uint32_t>(count), std::memory_order_release);
    return count;
  }

 private:
  std::atomic<std::uint32_t> written_{0};
  std::atomic<std::uint32_t> read_{0};
  std::array<std::byte, kBytes> bytes_{};
};

}  // namespace scatter::firmware::mps2_an500
