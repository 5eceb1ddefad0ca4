// Buffers for pixels that are reused when their last user drops them.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

namespace scatter::device {

/// Threads  any; buffers may be dropped on any thread, after the pool too.
/// Memory   keeps at most kKept idle buffers, all of the size asked for last or larger.
class PixelPool {
 public:
  static constexpr std::size_t kKept = 12;

  /// At least `bytes` bytes of unspecified contents, 64-byte aligned; null when memory is short.
  [[nodiscard]] std::shared_ptr<std::byte[]> take(std::size_t bytes);

 private:
  struct Store;
  std::shared_ptr<Store> store_ = make_store();
  static std::shared_ptr<Store> make_store();
};

}  // namespace scatter::device
