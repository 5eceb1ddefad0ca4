// A text that tells how far somebody has read in it. Internal to formats.
#pragma once

#include <cstddef>
#include <iterator>

namespace scatter::formats {

/// Iterator that leaves its place in `reached`, which outlives it: the parser's events have none.
class CountedChar {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  CountedChar(const char* at, const char** reached) : at_(at), reached_(reached) {}
  reference operator*() const noexcept { return *at_; }
  CountedChar& operator++() noexcept {
    *reached_ = ++at_;
    return *this;
  }
  CountedChar operator++(int) noexcept {
    const CountedChar before = *this;
    ++*this;
    return before;
  }
  [[nodiscard]] bool operator==(const CountedChar& other) const noexcept { return at_ == other.at_; }

 private:
  const char* at_;
  const char** reached_;
};

}  // namespace scatter::formats
