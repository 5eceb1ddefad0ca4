// Interpolation in a CellTable, and where on an axis an angle lies. Included once per SIMD target,
// inside foreach_target.
#if defined(SCATTER_REFLECTANCE_GRID_LOOKUP_SIMD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SCATTER_REFLECTANCE_GRID_LOOKUP_SIMD_INL_H_
#undef SCATTER_REFLECTANCE_GRID_LOOKUP_SIMD_INL_H_
#else
#define SCATTER_REFLECTANCE_GRID_LOOKUP_SIMD_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "host_sdk/reflectance/angle_simd-inl.h"
#include "host_sdk/reflectance/grid_lookup.h"

HWY_BEFORE_NAMESPACE();
namespace scatter::reflectance::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Pairs that are located together before their values are read: the reads then overlap.
inline constexpr std::size_t kTogether = 64;

/// Cells of up to four blocks for each pair. T is double or float.
template <class T>
struct Located {
  HWY_ALIGN std::array<std::array<std::int32_t, kTogether>, 4> node;
  HWY_ALIGN std::array<std::array<T, kTogether>, 4> row_share;
  HWY_ALIGN std::array<std::array<T, kTogether>, 4> column_share;
  HWY_ALIGN std::array<T, kTogether> share;            ///< Of the second of two blocks.
  HWY_ALIGN std::array<std::int32_t, kTogether> code;  ///< As CellTable's; kMixed: float cannot decide it.
};

template <class D>
struct Cell {
  hn::Vec<D> node;
  hn::Vec<D> row_share;
  hn::Vec<D> column_share;
  hn::Mask<D> beyond;
  hn::Mask<D> found;   ///< False only for input that is no direction.
  hn::Mask<D> unsure;  ///< In float: whether `beyond` holds hangs on the last bits.
};

template <class D>
inline constexpr bool kIsFloat = sizeof(hn::TFromD<D>) == sizeof(float);

/// Whole steps below a position, and the rest. In double a position nearer to a node than `same` is the node.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void split_steps(D d, V position, double same, V& below, V& share) {
  if constexpr (kIsFloat<D>) {
    below = hn::Floor(position);
    share = hn::Sub(position, below);
  } else {
    const V nearest = hn::Round(position);
    const auto snapped = hn::Lt(hn::Abs(hn::Sub(position, nearest)), hn::Set(d, same));
    const V at = hn::IfThenElse(snapped, nearest, position);
    below = hn::Floor(at);
    share = hn::Sub(at, below);
  }
}

/// Four nodes' channels [c, c + lanes) mixed bilinearly, as a + t (b - a): exact where both are equal
/// and where t is 0.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V cell_value(D d, const float* first, std::size_t node_floats, std::size_t row_floats,
                        hn::TFromD<D> row_share, hn::TFromD<D> column_share) {
  const auto load = [d](const float* from) HWY_ATTR {
    if constexpr (kIsFloat<D>) {
      return hn::LoadU(d, from);
    } else {
      return hn::PromoteTo(d, hn::LoadU(hn::Rebind<float, D>(), from));
    }
  };
#if HWY_TARGET <= HWY_AVX2
  // Both columns of a row in one register.
  if constexpr (kIsFloat<D>) {
    if (node_floats == 4) {
      const hn::FixedTag<float, 8> both;
      const auto top = hn::LoadU(both, first);
      const auto mixed =
          hn::MulAdd(hn::Set(both, row_share), hn::Sub(hn::LoadU(both, first + row_floats), top), top);
      const V left = hn::LowerHalf(mixed);
      return hn::MulAdd(hn::Set(d, column_share), hn::Sub(hn::UpperHalf(d, mixed), left), left);
    }
  }
#endif
  const V t = hn::Set(d, row_share);
  const V a = load(first);
  const V b = load(first + node_floats);
  const V low = hn::MulAdd(t, hn::Sub(load(first + row_floats), a), a);
  const V high = hn::MulAdd(t, hn::Sub(load(first + row_floats + node_floats), b), b);
  return hn::MulAdd(hn::Set(d, column_share), hn::Sub(high, low), low);
}

/// One channel: two floats per node, the second of which is the code.
template <class T>
HWY_INLINE T one_value(const float* first, std::size_t row_floats, T row_share, T column_share) {
  const T low = first[0] + row_share * (static_cast<T>(first[row_floats]) - first[0]);
  const T high = first[2] + row_share * (static_cast<T>(first[row_floats + 2]) - first[2]);
  return low + column_share * (high - low);
}

template <class D>
HWY_INLINE void store_as_double(D d, hn::Vec<D> value, double* out) {
  if constexpr (!kIsFloat<D>) {
    hn::StoreU(value, d, out);
  } else {
#if HWY_TARGET == HWY_SCALAR || HWY_TARGET <= HWY_AVX2
    const hn::Rebind<double, D> wide;
    hn::StoreU(hn::PromoteTo(wide, value), wide, out);
#else
    // Four doubles do not fit into one register.
    const hn::Half<D> half;
    const hn::Rebind<double, decltype(half)> wide;
    hn::StoreU(hn::PromoteTo(wide, hn::LowerHalf(half, value)), wide, out);
    hn::StoreU(hn::PromoteTo(wide, hn::UpperHalf(half, value)), wide, out + hn::Lanes(wide));
#endif
  }
}

template <class T>
HWY_INLINE bool at_node(T share) {
  if constexpr (sizeof(T) == sizeof(float)) {
    return share < static_cast<T>(kUnsureInFloat) || share > static_cast<T>(1 - kUnsureInFloat);
  } else {
    return share == 0;
  }
}

/// Whether the scalar code has to say which nodes of a cell of several origins are in use.
template <class T>
HWY_NOINLINE bool must_ask(const Located<T>& located, std::size_t k, std::size_t blocks) {
  bool ask = (located.code[k] & CellTable::kMixed) != 0;
  for (std::size_t b = 0; b < blocks && located.code[k] != CellTable::kNothing; ++b) {
    ask = ask || at_node(located.row_share[b][k]) || at_node(located.column_share[b][k]);
  }
  return ask;
}

/// Reads and mixes the values of located pairs. Blocks is 1, 2 (mixed by `share`) or 0: `count`
/// blocks with constant weights. Channels is 0 for any number.
template <std::size_t Blocks, std::size_t Channels, class T>
HWY_INLINE void mix_channels(const CellTable& table, const Located<T>& located, std::size_t pairs,
                             std::size_t count, const T* weights, double* HWY_RESTRICT f,
                             Origin* HWY_RESTRICT origin) {
  const hn::CappedTag<T, 4> d;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t channels = Channels == 0 ? table.channels() : Channels;
  const std::size_t node_floats = Channels == 0 ? table.node_floats() : CellTable::node_floats(Channels);
  const std::size_t row_floats = table.columns() * node_floats;
  const std::size_t blocks = Blocks == 0 ? count : Blocks;
  const float* const data = table.data();
  for (std::size_t k = 0; k < pairs; ++k) {
    std::array<const float*, Blocks == 0 ? 4 : Blocks> first;
    std::int32_t code = located.code[k];
    for (std::size_t b = 0; b < blocks; ++b) {
      first[b] = data + static_cast<std::size_t>(located.node[b][k]) * node_floats;
      code |= CellTable::code_at(first[b], node_floats);
    }
    if (HWY_UNLIKELY(code >= CellTable::kMixed)) {
      if (must_ask(located, k, blocks)) {
        origin[k] = kAskScalar;
        continue;
      }
      code &= CellTable::kNothing;
    }
    origin[k] = CellTable::origin_of(code);
    double* out = f + k * channels;
    const T keep = code == CellTable::kNothing ? T{0} : T{1};
    if (Channels == 0 && channels == 1) {
      T sum = 0;
      for (std::size_t b = 0; b < blocks; ++b) {
        const T value = one_value(first[b], row_floats, located.row_share[b][k], located.column_share[b][k]);
        if constexpr (Blocks == 2) {
          sum = b == 0 ? value : sum + located.share[k] * (value - sum);
        } else {
          sum += (Blocks == 1 ? T{1} : weights[b]) * value;
        }
      }
      *out = static_cast<double>(keep * sum);
      continue;
    }
    for (std::size_t c = 0; c < channels; c += lanes) {
      const auto value_of = [&](std::size_t b) HWY_ATTR {
        return cell_value(d, first[b] + c, node_floats, row_floats, located.row_share[b][k],
                          located.column_share[b][k]);
      };
      auto sum = value_of(0);
      if constexpr (Blocks == 2) {
        sum = hn::MulAdd(hn::Set(d, located.share[k]), hn::Sub(value_of(1), sum), sum);
      } else if constexpr (Blocks == 0) {
        sum = hn::Mul(sum, hn::Set(d, weights[0]));
        for (std::size_t b = 1; b < blocks; ++b) {
          sum = hn::MulAdd(hn::Set(d, weights[b]), value_of(b), sum);
        }
      }
      sum = hn::Mul(sum, hn::Set(d, keep));
      // A store that reaches into the next pair's place is overwritten by that pair.
      if (HWY_LIKELY(k + 1 < pairs) || c + lanes <= channels) {
        store_as_double(d, sum, out + c);
      } else {
        std::array<double, 4> last;
        store_as_double(d, sum, last.data());
        std::copy_n(last.data(), channels - c, out + c);
      }
    }
  }
}

template <std::size_t Blocks, class T>
HWY_INLINE void mix(const CellTable& table, const Located<T>& located, std::size_t pairs, std::size_t count,
                    const T* weights, double* HWY_RESTRICT f, Origin* HWY_RESTRICT origin) {
  if (Blocks != 0 && table.channels() == 3) {
    mix_channels<Blocks, 3>(table, located, pairs, count, weights, f, origin);
  } else {
    mix_channels<Blocks, 0>(table, located, pairs, count, weights, f, origin);
  }
}

}  // namespace scatter::reflectance::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
