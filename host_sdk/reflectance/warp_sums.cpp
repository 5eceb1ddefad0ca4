#include "host_sdk/reflectance/warp_sums.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

// x86 targets that differ from their neighbours in nothing that is used here.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "host_sdk/reflectance/warp_sums.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scatter::reflectance::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Blocks that are summed together.
constexpr std::size_t kTogether = 4;

/// Sum of a block of nodes, still spread over the lanes.
template <class D>
HWY_INLINE hn::Vec<D> spread_sum(D d, const float* v) {
  const hn::Rebind<float, D> f;
  auto sum = hn::PromoteTo(d, hn::LoadU(f, v));
  for (std::size_t k = hn::Lanes(d); k < kWarpBlock; k += hn::Lanes(d)) {
    sum = hn::Add(sum, hn::PromoteTo(d, hn::LoadU(f, v + k)));
  }
  return sum;
}

/// Sums of kTogether blocks of nodes: few steps across lanes, because all sums take them together.
template <class D>
HWY_INLINE void sums_of_blocks(D d, const float* v, double* HWY_RESTRICT out) {
  const auto a = spread_sum(d, v);
  const auto b = spread_sum(d, v + kWarpBlock);
  const auto c = spread_sum(d, v + 2 * kWarpBlock);
  const auto e = spread_sum(d, v + 3 * kWarpBlock);
#if HWY_TARGET == HWY_SCALAR || HWY_HAVE_SCALABLE
  hn::StoreU(a, d, out);
  hn::StoreU(b, d, out + 1);
  hn::StoreU(c, d, out + 2);
  hn::StoreU(e, d, out + 3);
#else
  const auto ab = hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  const auto ce = hn::Add(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e));
  if constexpr (hn::MaxLanes(D()) == kTogether) {
    hn::StoreU(hn::Add(hn::ConcatLowerLower(d, ce, ab), hn::ConcatUpperUpper(d, ce, ab)), d, out);
  } else {
    hn::StoreU(ab, d, out);
    hn::StoreU(ce, d, out + 2);
  }
#endif
}

/// Also the largest of the values' bits: with 0x7F800000 or more, a value has its sign set or is not finite.
std::uint32_t sum_rows_and_look(std::span<const float> values, std::size_t width, double* sums) {
#if HWY_HAVE_SCALABLE
  // Vectors of unknown length would need another way across the lanes.
  const hn::CappedTag<double, 1> d;
#else
  const hn::CappedTag<double, kTogether> d;
#endif
  const hn::CappedTag<float, kWarpBlock> f;
  const hn::RebindToUnsigned<decltype(f)> u;
  auto largest = hn::Zero(u);
  std::uint32_t largest_of_rest = 0;
  const std::size_t blocks = width / kWarpBlock / kTogether * kTogether;
  const std::size_t stored = (width - 1) / kWarpBlock;
  for (const float* row = values.data(); row != values.data() + values.size(); row += width) {
    const auto first = static_cast<double>(row[0]);
    // Of nodes; half of the first and the last one are taken away where a sum is stored.
    double nodes = 0;
    *sums++ = 0;
    std::size_t block = 0;
    for (; block < blocks; block += kTogether) {
      const float* v = row + block * kWarpBlock;
      HWY_ALIGN std::array<double, kTogether> sum;
      sums_of_blocks(d, v, sum.data());
      for (std::size_t k = 0; k < kTogether * kWarpBlock; k += hn::Lanes(u)) {
        largest = hn::Max(largest, hn::BitCast(u, hn::LoadU(f, v + k)));
      }
      for (std::size_t k = 0; k < kTogether; ++k) {
        nodes += sum[k];
        if (block + k < stored) {
          *sums++ = nodes + 0.5 * (static_cast<double>(v[(k + 1) * kWarpBlock]) - first);
        }
      }
    }
    for (; block < width / kWarpBlock; ++block) {
      const float* v = row + block * kWarpBlock;
      for (std::size_t k = 0; k < kWarpBlock; k += hn::Lanes(u)) {
        largest = hn::Max(largest, hn::BitCast(u, hn::LoadU(f, v + k)));
      }
      nodes += hn::GetLane(hn::SumOfLanes(d, spread_sum(d, v)));
      if (block < stored) {
        *sums++ = nodes + 0.5 * (static_cast<double>(v[kWarpBlock]) - first);
      }
    }
    for (std::size_t node = block * kWarpBlock; node < width; ++node) {
      nodes += static_cast<double>(row[node]);
      largest_of_rest = std::max(largest_of_rest, std::bit_cast<std::uint32_t>(row[node]));
    }
    *sums++ = nodes - 0.5 * (first + static_cast<double>(row[width - 1]));
  }
  return std::max(largest_of_rest, hn::GetLane(hn::MaxOfLanes(u, largest)));
}

}  // namespace scatter::reflectance::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scatter::reflectance {

HWY_EXPORT(sum_rows_and_look);

bool sum_rows(std::span<const float> values, std::size_t width, double* sums) noexcept {
  constexpr std::uint32_t kInfinity = 0x7F800000U;
  // -0 has its sign set too, and is a density.
  return HWY_DYNAMIC_DISPATCH(sum_rows_and_look)(values, width, sums) < kInfinity ||
         std::ranges::all_of(
             values, [](float v) { return v >= 0 && std::bit_cast<std::uint32_t>(v) != kInfinity; });
}

}  // namespace scatter::reflectance
#endif
