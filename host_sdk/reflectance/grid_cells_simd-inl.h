// Where directions lie in a grid: incidences around the light, cells around the outgoing direction.
// Included once per SIMD target, inside foreach_target.
#if defined(SCATTER_REFLECTANCE_GRID_CELLS_SIMD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SCATTER_REFLECTANCE_GRID_CELLS_SIMD_INL_H_
#undef SCATTER_REFLECTANCE_GRID_CELLS_SIMD_INL_H_
#else
#define SCATTER_REFLECTANCE_GRID_CELLS_SIMD_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "host_sdk/reflectance/grid_lookup.h"
#include "host_sdk/reflectance/grid_lookup_simd-inl.h"

HWY_BEFORE_NAMESPACE();
namespace scatter::reflectance::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Outgoing direction seen from the mirror direction of the light, which is its z.
template <class D>
struct Offset {
  hn::Vec<D> x, y, z;
};

/// Two incidences around that of the light, and what turns an offset into their frames.
template <class D>
struct Bracket {
  hn::Vec<D> lower, upper;
  hn::Vec<D> lower_cos, lower_sin, upper_cos, upper_sin;
  hn::Vec<D> lower_column, upper_column;
  hn::Vec<D> share;
  hn::Mask<D> outside, valid;
};

template <class D>
HWY_INLINE hn::Mask<D> never(D d) {
  return hn::MaskFromVec(hn::Zero(d));
}

/// The cell of a direction in a block.
template <class D, class V = hn::Vec<D>>
HWY_INLINE Cell<D> cell_of(D d, const NormalLookup& grid, V x, V y, V z, V column_offset) {
  const V theta = upper_angle(d, hn::Sqrt(hn::MulAdd(x, x, hn::Mul(y, y))), z);
  const V phi = full_angle(d, y, x);
  const V last_row = set_to(d, grid.last_row);
  const V columns = set_to(d, grid.column_count);
  Cell<D> cell;
  V row = hn::Mul(theta, set_to(d, grid.row_per_rad));
  cell.beyond = hn::Gt(row, set_to(d, grid.last_row + grid.same_node));
  cell.unsure = never(d);
  if constexpr (kIsFloat<D>) {
    cell.unsure = hn::Lt(hn::Abs(hn::Sub(row, last_row)), set_to(d, kUnsureInFloat));
  }
  row = hn::Min(row, last_row);
  V column = hn::MulAdd(phi, set_to(d, grid.column_per_rad), column_offset);
  column = hn::Sub(column, hn::IfThenElseZero(hn::Ge(column, columns), columns));
  V row_below;
  V column_below;
  split_steps(d, row, grid.same_node, row_below, cell.row_share);
  split_steps(d, column, grid.same_node, column_below, cell.column_share);
  column_below = hn::Sub(column_below, hn::IfThenElseZero(hn::Ge(column_below, columns), columns));
  cell.found = hn::And(hn::And(hn::Ge(row_below, hn::Zero(d)), hn::Le(row_below, last_row)),
                       hn::And(hn::Ge(column_below, hn::Zero(d)), hn::Lt(column_below, columns)));
  cell.node = hn::MulAdd(row_below, set_to(d, static_cast<double>(grid.table.columns())), column_below);
  return cell;
}

/// Node below an angle on an axis and the share of the next one.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void place_on(D d, const AngleAxis& axis, double same_angle, V angle, V& below, V& share,
                         hn::Mask<D>& outside, hn::Mask<D>& unsure) {
  using T = hn::TFromD<D>;
  const V first = set_to(d, axis.nodes.front());
  const V last = set_to(d, axis.nodes.back());
  if (axis.open_low) {
    outside = hn::Or(outside, hn::Lt(angle, set_to(d, axis.nodes.front() - same_angle)));
    unsure = hn::Or(unsure, hn::Lt(hn::Abs(hn::Sub(angle, first)), set_to(d, kUnsureAngle)));
  }
  if (axis.open_high) {
    outside = hn::Or(outside, hn::Gt(angle, set_to(d, axis.nodes.back() + same_angle)));
    unsure = hn::Or(unsure, hn::Lt(hn::Abs(hn::Sub(angle, last)), set_to(d, kUnsureAngle)));
  }
  const V inside = hn::Max(first, hn::Min(angle, last));
  if (axis.equal_steps) {
    split_steps(d, hn::Mul(hn::Sub(inside, first), set_to(d, axis.per_rad)), same_angle * axis.per_rad, below,
                share);
    return;
  }
  HWY_ALIGN std::array<T, HWY_MAX_BYTES / sizeof(T)> value;
  HWY_ALIGN std::array<T, HWY_MAX_BYTES / sizeof(T)> rest;
  hn::Store(inside, d, value.data());
  const std::size_t top = axis.nodes.size() - 1;
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    const double at = static_cast<double>(value[lane]);
    std::size_t node = 0;
    if (at > axis.nodes.front()) {
      const auto slice = static_cast<std::size_t>((at - axis.nodes.front()) * axis.guess_per_rad);
      node = axis.guess[std::min(slice, axis.guess.size() - 1)];
      while (node < top && axis.nodes[node + 1] <= at + same_angle) {
        ++node;
      }
    }
    rest[lane] = node == top || std::abs(at - axis.nodes[node]) <= same_angle
                     ? T{0}
                     : static_cast<T>((at - axis.nodes[node]) / (axis.nodes[node + 1] - axis.nodes[node]));
    value[lane] = static_cast<T>(node);
  }
  below = hn::Load(d, value.data());
  share = hn::Load(d, rest.data());
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE Cell<D> cell_of(D d, const SpecularLookup& grid, const Offset<D>& offset) {
  const V rho =
      upper_angle(d, hn::Sqrt(hn::MulAdd(offset.x, offset.x, hn::Mul(offset.y, offset.y))), offset.z);
  V psi = grid.folded ? upper_angle(d, hn::Abs(offset.y), offset.x) : full_angle(d, offset.y, offset.x);
  if (grid.periodic) {
    const V first = set_to(d, grid.azimuth.nodes.front() - grid.same_angle);
    psi = hn::Add(psi, hn::IfThenElseZero(hn::Lt(psi, first), set_to(d, 2 * kPi)));
  }
  Cell<D> cell;
  cell.beyond = never(d);
  cell.unsure = never(d);
  V row;
  V column;
  place_on(d, grid.azimuth, grid.same_angle, psi, row, cell.row_share, cell.beyond, cell.unsure);
  place_on(d, grid.radial, grid.same_angle, rho, column, cell.column_share, cell.beyond, cell.unsure);
  const V rows = set_to(d, static_cast<double>(grid.azimuth.nodes.size()));
  const V columns = set_to(d, static_cast<double>(grid.radial.nodes.size()));
  cell.found = hn::And(hn::And(hn::Ge(row, hn::Zero(d)), hn::Lt(row, rows)),
                       hn::And(hn::Ge(column, hn::Zero(d)), hn::Lt(column, columns)));
  cell.node = hn::MulAdd(row, set_to(d, static_cast<double>(grid.table.columns())), column);
  return cell;
}

/// Entries of a short table, one per lane; index holds whole numbers.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V pick(D d, const std::vector<float>& table, std::size_t count,
                  hn::Vec<hn::RebindToSigned<D>> index) {
  if (HWY_LIKELY(count <= hn::Lanes(d))) {
    return hn::TableLookupLanes(hn::LoadU(d, table.data()), hn::IndicesFromVec(d, index));
  }
  return hn::GatherIndex(d, table.data(), index);
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE Bracket<D> bracket_of(D d, const IncidenceAxis& axis, V sin_i, V cos_i) {
  const hn::RebindToSigned<D> whole;
  const V not_below = set_to(d, -axis.same_angle);
  V reached = hn::Zero(d);
  for (std::size_t p = 0; p < axis.count; ++p) {
    // sin(theta_i - theta of p): the sign decides, and it needs no angle.
    const V from = hn::MulSub(sin_i, hn::Set(d, axis.cosine[p]), hn::Mul(cos_i, hn::Set(d, axis.sine[p])));
    reached = hn::Add(reached, hn::IfThenElseZero(hn::Ge(from, not_below), hn::Set(d, 1.0F)));
  }
  const V top = hn::Set(d, static_cast<float>(axis.count - 1));
  Bracket<D> b;
  b.lower = hn::Max(hn::Sub(reached, hn::Set(d, 1.0F)), hn::Zero(d));
  const auto lower = hn::ConvertTo(whole, b.lower);
  b.lower_cos = pick(d, axis.cosine, axis.count, lower);
  b.lower_sin = pick(d, axis.sine, axis.count, lower);
  const V from_lower = hn::MulSub(sin_i, b.lower_cos, hn::Mul(cos_i, b.lower_sin));
  const auto none = hn::Eq(reached, hn::Zero(d));
  const auto exact = hn::And(hn::Not(none), hn::Le(hn::Abs(from_lower), set_to(d, axis.same_angle)));
  b.outside = hn::Or(none, hn::And(hn::Not(exact), hn::Eq(b.lower, top)));
  const auto alone = hn::Or(exact, b.outside);
  b.upper = hn::IfThenElse(alone, b.lower, hn::Add(b.lower, hn::Set(d, 1.0F)));
  const auto upper = hn::ConvertTo(whole, b.upper);
  b.share = hn::IfThenZeroElse(
      alone, hn::Mul(hn::Sub(upper_angle(d, sin_i, cos_i), pick(d, axis.theta, axis.count, lower)),
                     pick(d, axis.inverse_gap, axis.count, lower)));
  b.lower_column = pick(d, axis.column_offset, axis.count, lower);
  b.upper_column = pick(d, axis.column_offset, axis.count, upper);
  // An incidence of the grid itself needs no turning.
  b.upper_cos = hn::IfThenElse(exact, cos_i, pick(d, axis.cosine, axis.count, upper));
  b.upper_sin = hn::IfThenElse(exact, sin_i, pick(d, axis.sine, axis.count, upper));
  b.lower_cos = hn::IfThenElse(exact, cos_i, b.lower_cos);
  b.lower_sin = hn::IfThenElse(exact, sin_i, b.lower_sin);
  return b;
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE Bracket<D> bracket_and_offset(D d, const IncidenceAxis& axis, bool transmits, double lowest_z,
                                         const hn::TFromD<D>* omega_i, const hn::TFromD<D>* omega_o,
                                         Offset<D>& offset) {
  V ix, iy, iz, ox, oy, oz;
  hn::LoadInterleaved3(d, omega_i, ix, iy, iz);
  hn::LoadInterleaved3(d, omega_o, ox, oy, oz);
  const V up = transmits ? hn::Neg(oz) : oz;
  const V sin_i = hn::Sqrt(hn::MulAdd(ix, ix, hn::Mul(iy, iy)));
  const auto normal = hn::Lt(sin_i, set_to(d, axis.same_angle));
  const V inverse = hn::Div(set_to(d, 1.0), hn::Max(sin_i, set_to(d, 1e-30)));
  const V c = hn::IfThenElse(normal, set_to(d, axis.normal_cos_phi), hn::Mul(ix, inverse));
  const V s = hn::IfThenElse(normal, set_to(d, axis.normal_sin_phi), hn::Mul(iy, inverse));
  const V along = hn::MulAdd(ox, c, hn::Mul(oy, s));
  offset.x = hn::MulAdd(along, iz, hn::Mul(up, sin_i));
  offset.y = hn::MulSub(oy, c, hn::Mul(ox, s));
  offset.z = hn::MulSub(up, iz, hn::Mul(along, sin_i));
  Bracket<D> b = bracket_of(d, axis, sin_i, iz);
  // x == x is false for NaN only, which every component of either direction puts into x or y.
  const auto numbers = hn::And(hn::Eq(offset.x, offset.x), hn::Eq(offset.y, offset.y));
  b.valid = hn::And(numbers, hn::And(hn::Gt(iz, hn::Zero(d)), hn::Gt(up, set_to(d, lowest_z))));
  return b;
}

}  // namespace scatter::reflectance::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
