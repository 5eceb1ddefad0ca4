// Text built up in a message field: no heap, no printf. What does not fit is cut.
#pragma once

#include <cstdint>
#include <string_view>

#include "protocol/bounded.h"

namespace scatter::firmware {

class Text {
 public:
  Text() noexcept = default;
  explicit Text(std::string_view start) noexcept { *this << start; }

  Text& operator<<(std::string_view text) noexcept {
    for (const char c : text) {
      text_.push_back(c);
    }
    return *this;
  }
  Text& operator<<(std::uint64_t value) noexcept {
    char digits[20];
    std::size_t count = 0;
    do {
      digits[count++] = static_cast<char>('0' + value % 10);
      value /= 10;
    } while (value != 0);
    while (count > 0) {
      text_.push_back(digits[--count]);
    }
    return *this;
  }
  /// 0x and eight digits.
  Text& hexadecimal(std::uint32_t value) noexcept {
    *this << "0x";
    for (int shift = 28; shift >= 0; shift -= 4) {
      text_.push_back("0123456789ABCDEF"[(value >> shift) & 0xFU]);
    }
    return *this;
  }
  [[nodiscard]] std::string_view str() const noexcept { return text_.str(); }

 private:
  protocol::BoundedString<128> text_;
};

}  // namespace scatter::firmware
