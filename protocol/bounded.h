// Fixed-capacity containers for message fields: no heap, the bound is part of the type.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace scatter::protocol {

/// Up to N elements of T, stored inline. On the wire: u16 count, then the elements.
template <typename T, std::size_t N>
class BoundedArray {
 public:
  static_assert(N <= 0xFFFF);
  static constexpr std::size_t kCapacity = N;

  constexpr BoundedArray() noexcept = default;

  [[nodiscard]] constexpr std::size_t size() const noexcept { return size_; }
  [[nodiscard]] constexpr bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] constexpr const T& operator[](std::size_t i) const noexcept { return items_[i]; }
  [[nodiscard]] constexpr T& operator[](std::size_t i) noexcept { return items_[i]; }
  [[nodiscard]] constexpr const T* begin() const noexcept { return items_.data(); }
  [[nodiscard]] constexpr const T* end() const noexcept { return items_.data() + size_; }
  [[nodiscard]] constexpr T* begin() noexcept { return items_.data(); }
  [[nodiscard]] constexpr T* end() noexcept { return items_.data() + size_; }
  [[nodiscard]] constexpr std::span<const T> view() const noexcept { return {items_.data(), size_}; }

  constexpr void clear() noexcept { size_ = 0; }
  /// False, and nothing changes, when full.
  constexpr bool push_back(const T& item) noexcept {
    if (size_ == N) {
      return false;
    }
    items_[size_++] = item;
    return true;
  }
  /// Copies at most N elements; false when some did not fit.
  constexpr bool assign(std::span<const T> source) noexcept {
    size_ = std::min(source.size(), N);
    std::copy_n(source.begin(), size_, items_.begin());
    return size_ == source.size();
  }
  /// New elements are value-initialised; `count` is clamped to N.
  constexpr void resize(std::size_t count) noexcept {
    const std::size_t wanted = std::min(count, N);
    for (std::size_t i = size_; i < wanted; ++i) {
      items_[i] = T{};
    }
    size_ = wanted;
  }

  friend constexpr bool operator==(const BoundedArray& a, const BoundedArray& b) noexcept {
    return std::ranges::equal(a.view(), b.view());
  }

 private:
  std::array<T, N> items_{};
  std::size_t size_ = 0;
};

/// Up to N bytes of UTF-8 text. On the wire: u16 count, then the bytes, no terminator.
template <std::size_t N>
class BoundedString : public BoundedArray<char, N> {
 public:
  constexpr BoundedString() noexcept = default;
  // Implicit on purpose: text literals initialise message fields. Longer text is cut at N bytes.
  constexpr BoundedString(std::string_view text) noexcept { this->assign({text.data(), text.size()}); }
  constexpr BoundedString(const char* text) noexcept : BoundedString(std::string_view(text)) {}
  [[nodiscard]] constexpr std::string_view str() const noexcept { return {this->begin(), this->size()}; }
};

/// Raw bytes at the end of a message (frame data, object chunks); a view, never a copy.
/// On the wire: the rest of the payload. Only the last field of a message may have this type.
using TailBytes = std::span<const std::byte>;

}  // namespace scatter::protocol
