// Short-lived arrays for batches, without going to the heap each time.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>

namespace scatter::reflectance {

/// Arrays that live as long as this object, from memory that the thread keeps for the next one.
///
/// Memory    per thread, as much as the deepest nesting has asked for; freed when the thread ends.
/// Errors    out of memory ends the program, as in any noexcept function.
/// Threads   one object belongs to one thread; objects end in the reverse order of their making.
class Scratch {
 public:
  Scratch() noexcept;
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  /// Not initialised.
  template <typename T>
    requires(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>)
  [[nodiscard]] std::span<T> take(std::size_t count) noexcept {
    return {static_cast<T*>(take_bytes(count * sizeof(T))), count};
  }

 private:
  [[nodiscard]] static void* take_bytes(std::size_t bytes) noexcept;

  std::size_t block_;
  std::size_t used_;
};

}  // namespace scatter::reflectance
