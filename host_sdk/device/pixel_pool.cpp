#include "host_sdk/device/pixel_pool.h"

#include <new>
#include <utility>

namespace scatter::device {

namespace {
constexpr std::align_val_t kAlignment{64};

struct Release {
  void operator()(std::byte* memory) const noexcept { ::operator delete[](memory, kAlignment); }
};
using Memory = std::unique_ptr<std::byte[], Release>;
}  // namespace

struct PixelPool::Store {
  struct Idle {
    Memory memory;
    std::size_t bytes;
  };
  std::mutex mutex;
  std::vector<Idle> idle;
};

std::shared_ptr<PixelPool::Store> PixelPool::make_store() {
  auto store = std::make_shared<Store>();
  store->idle.reserve(kKept);
  return store;
}

std::shared_ptr<std::byte[]> PixelPool::take(std::size_t bytes) {
  Memory memory;
  std::size_t size = bytes;
  {
    const std::lock_guard lock(store_->mutex);
    while (!store_->idle.empty() && !memory) {
      // Buffers that have become too small are of an earlier run: let them go.
      Store::Idle last = std::move(store_->idle.back());
      store_->idle.pop_back();
      if (last.bytes >= bytes && last.bytes / 2 <= bytes) {
        memory = std::move(last.memory);
        size = last.bytes;
      }
    }
  }
  if (!memory) {
    memory.reset(static_cast<std::byte*>(::operator new[](bytes == 0 ? 1 : bytes, kAlignment, std::nothrow)));
    if (!memory) {
      return nullptr;
    }
  }
  std::byte* raw = memory.release();
  return {raw, [store = store_, size](std::byte* back) {
            Memory owned(back);
            const std::lock_guard lock(store->mutex);
            if (store->idle.size() < kKept) {
              store->idle.push_back({std::move(owned), size});
            }
          }};
}

}  // namespace scatter::device
