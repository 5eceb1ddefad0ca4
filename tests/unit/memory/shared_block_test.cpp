#include "host_sdk/memory/shared_block.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <thread>
#include <vector>

namespace scatter {
namespace {

using Block = std::shared_ptr<std::uint32_t[]>;

/// On both sides of each border between ways to get memory.
const std::vector<std::size_t> kSizes{0,       1,       100,     16'383,  16'384,   16'385,
                                      164'738, 262'143, 262'144, 262'145, 2'000'000};

Block marked(std::size_t count, std::uint32_t mark) {
  Block block = shared_block<std::uint32_t>(count);
  std::fill_n(block.get(), count, mark);
  return block;
}

bool holds(const Block& block, std::size_t count, std::uint32_t mark) {
  return std::all_of(block.get(), block.get() + count, [mark](std::uint32_t v) { return v == mark; });
}

TEST_CASE("No block of shared memory overlaps another one, whatever their sizes") {
  std::vector<Block> blocks;
  for (std::uint32_t k = 0; k < 3 * kSizes.size(); ++k) {
    blocks.push_back(marked(kSizes[k % kSizes.size()], k));
  }
  for (std::uint32_t k = 0; k < blocks.size(); ++k) {
    REQUIRE(holds(blocks[k], kSizes[k % kSizes.size()], k));
  }
}

TEST_CASE("A block keeps its numbers when its neighbours go and their memory is used again") {
  constexpr std::size_t kCount = 164'738;
  std::vector<Block> blocks;
  for (std::uint32_t k = 0; k < 40; ++k) {
    blocks.push_back(marked(kCount, k));
  }
  for (std::uint32_t k = 0; k < 40; ++k) {
    if (k % 7 != 3) {
      blocks[k].reset();
    }
  }
  std::vector<Block> later;
  for (std::uint32_t k = 0; k < 40; ++k) {
    later.push_back(marked(kCount, 1000 + k));
  }
  for (std::uint32_t k = 3; k < 40; k += 7) {
    REQUIRE(holds(blocks[k], kCount, k));
  }
}

TEST_CASE("Blocks suit every number") {
  std::vector<std::shared_ptr<std::byte[]>> blocks;
  for (std::size_t bytes = 65'500; bytes < 65'600; ++bytes) {
    blocks.push_back(shared_bytes(bytes));
    REQUIRE(reinterpret_cast<std::uintptr_t>(blocks.back().get()) % alignof(std::max_align_t) == 0);
  }
}

TEST_CASE("Files read one after another take memory that is there already") {
  const auto place_of_one = [] { return reinterpret_cast<std::uintptr_t>(marked(164'738, 1).get()); };
  const std::uintptr_t first = place_of_one();
  REQUIRE(place_of_one() == first);
}

TEST_CASE("Blocks end where their chunk does, and those of RGL files leave at most a fifth of it unused") {
  constexpr std::size_t kChunk = std::size_t{4} << 20;
  constexpr std::size_t kRglFile = 658'952;
  for (const std::size_t bytes : {std::size_t{70'000}, kRglFile}) {
    const std::size_t count = 20 * kChunk / bytes;
    std::vector<std::shared_ptr<std::byte[]>> blocks;
    std::vector<std::uintptr_t> begins;
    for (std::size_t k = 0; k < count; ++k) {
      blocks.push_back(shared_bytes(bytes));
      begins.push_back(reinterpret_cast<std::uintptr_t>(blocks.back().get()));
    }
    std::ranges::sort(begins);
    // A chunk's blocks follow each other at once.
    std::size_t chunks = 1;
    std::uintptr_t first = begins[0];
    for (std::size_t k = 1; k < count; ++k) {
      if (begins[k] - begins[k - 1] > bytes + 64) {
        ++chunks;
        first = begins[k];
      }
      REQUIRE(begins[k] + bytes - first <= kChunk);
    }
    REQUIRE(static_cast<double>(chunks * kChunk) <= 1.2 * static_cast<double>(count * bytes));
  }
}

TEST_CASE("Threads may take and give back blocks at the same time") {
  constexpr std::size_t kCount = 20'000;
  std::vector<std::thread> threads;
  std::vector<int> wrong(4, 0);
  for (std::uint32_t t = 0; t < wrong.size(); ++t) {
    threads.emplace_back([t, &wrong] {
      std::vector<Block> held(5);
      for (std::uint32_t k = 0; k < 40'000; ++k) {
        Block& block = held[k * 7 % held.size()];
        const std::uint32_t mark = t << 20U | k;
        block = shared_block<std::uint32_t>(kCount);
        block[0] = mark;
        block[kCount - 1] = mark;
        std::this_thread::yield();
        wrong[t] += block[0] == mark && block[kCount - 1] == mark ? 0 : 1;
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  REQUIRE(std::ranges::count(wrong, 0) == 4);
}

}  // namespace
}  // namespace scatter
