#include "host_sdk/reflectance/grid_lookup.h"

#include <algorithm>
#include <cmath>

// Two x86 targets that differ from their neighbours in nothing that is used here.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "host_sdk/reflectance/grid_lookup.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "host_sdk/reflectance/angle_simd-inl.h"
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
HWY_INLINE hn::Mask<D> Never(D d) {
  return hn::MaskFromVec(hn::Zero(d));
}

/// The cell of a direction in a block.
template <class D, class V = hn::Vec<D>>
HWY_INLINE Cell<D> CellOf(D d, const NormalLookup& grid, V x, V y, V z, V column_offset) {
  const V theta = UpperAngle(d, hn::Sqrt(hn::MulAdd(x, x, hn::Mul(y, y))), z);
  const V phi = FullAngle(d, y, x);
  const V last_row = SetTo(d, grid.last_row);
  const V columns = SetTo(d, grid.column_count);
  Cell<D> cell;
  V row = hn::Mul(theta, SetTo(d, grid.row_per_rad));
  cell.beyond = hn::Gt(row, SetTo(d, grid.last_row + grid.same_node));
  cell.unsure = Never(d);
  if constexpr (kIsFloat<D>) {
    cell.unsure = hn::Lt(hn::Abs(hn::Sub(row, last_row)), SetTo(d, kUnsureInFloat));
  }
  row = hn::Min(row, last_row);
  V column = hn::MulAdd(phi, SetTo(d, grid.column_per_rad), column_offset);
  column = hn::Sub(column, hn::IfThenElseZero(hn::Ge(column, columns), columns));
  V row_below;
  V column_below;
  Split(d, row, grid.same_node, row_below, cell.row_share);
  Split(d, column, grid.same_node, column_below, cell.column_share);
  column_below = hn::Sub(column_below, hn::IfThenElseZero(hn::Ge(column_below, columns), columns));
  cell.found = hn::And(hn::And(hn::Ge(row_below, hn::Zero(d)), hn::Le(row_below, last_row)),
                       hn::And(hn::Ge(column_below, hn::Zero(d)), hn::Lt(column_below, columns)));
  cell.node = hn::MulAdd(row_below, SetTo(d, static_cast<double>(grid.table.columns())), column_below);
  return cell;
}

/// Node below an angle on an axis and the share of the next one.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void Place(D d, const AngleAxis& axis, double same_angle, V angle, V& below, V& share,
                      hn::Mask<D>& outside, hn::Mask<D>& unsure) {
  using T = hn::TFromD<D>;
  const V first = SetTo(d, axis.nodes.front());
  const V last = SetTo(d, axis.nodes.back());
  if (axis.open_low) {
    outside = hn::Or(outside, hn::Lt(angle, SetTo(d, axis.nodes.front() - same_angle)));
    unsure = hn::Or(unsure, hn::Lt(hn::Abs(hn::Sub(angle, first)), SetTo(d, kUnsureAngle)));
  }
  if (axis.open_high) {
    outside = hn::Or(outside, hn::Gt(angle, SetTo(d, axis.nodes.back() + same_angle)));
    unsure = hn::Or(unsure, hn::Lt(hn::Abs(hn::Sub(angle, last)), SetTo(d, kUnsureAngle)));
  }
  const V inside = hn::Max(first, hn::Min(angle, last));
  if (axis.equal_steps) {
    Split(d, hn::Mul(hn::Sub(inside, first), SetTo(d, axis.per_rad)), same_angle * axis.per_rad, below,
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
HWY_INLINE Cell<D> CellOf(D d, const SpecularLookup& grid, const Offset<D>& offset) {
  const V rho =
      UpperAngle(d, hn::Sqrt(hn::MulAdd(offset.x, offset.x, hn::Mul(offset.y, offset.y))), offset.z);
  V psi = grid.folded ? UpperAngle(d, hn::Abs(offset.y), offset.x) : FullAngle(d, offset.y, offset.x);
  if (grid.periodic) {
    const V first = SetTo(d, grid.azimuth.nodes.front() - grid.same_angle);
    psi = hn::Add(psi, hn::IfThenElseZero(hn::Lt(psi, first), SetTo(d, 2 * kPi)));
  }
  Cell<D> cell;
  cell.beyond = Never(d);
  cell.unsure = Never(d);
  V row;
  V column;
  Place(d, grid.azimuth, grid.same_angle, psi, row, cell.row_share, cell.beyond, cell.unsure);
  Place(d, grid.radial, grid.same_angle, rho, column, cell.column_share, cell.beyond, cell.unsure);
  const V rows = SetTo(d, static_cast<double>(grid.azimuth.nodes.size()));
  const V columns = SetTo(d, static_cast<double>(grid.radial.nodes.size()));
  cell.found = hn::And(hn::And(hn::Ge(row, hn::Zero(d)), hn::Lt(row, rows)),
                       hn::And(hn::Ge(column, hn::Zero(d)), hn::Lt(column, columns)));
  cell.node = hn::MulAdd(row, SetTo(d, static_cast<double>(grid.table.columns())), column);
  return cell;
}

/// Entries of a short table, one per lane; index holds whole numbers.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V Pick(D d, const std::vector<float>& table, std::size_t count,
                  hn::Vec<hn::RebindToSigned<D>> index) {
  if (HWY_LIKELY(count <= hn::Lanes(d))) {
    return hn::TableLookupLanes(hn::LoadU(d, table.data()), hn::IndicesFromVec(d, index));
  }
  return hn::GatherIndex(d, table.data(), index);
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE Bracket<D> BracketOf(D d, const IncidenceAxis& axis, V sin_i, V cos_i) {
  const hn::RebindToSigned<D> whole;
  const V not_below = SetTo(d, -axis.same_angle);
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
  b.lower_cos = Pick(d, axis.cosine, axis.count, lower);
  b.lower_sin = Pick(d, axis.sine, axis.count, lower);
  const V from_lower = hn::MulSub(sin_i, b.lower_cos, hn::Mul(cos_i, b.lower_sin));
  const auto none = hn::Eq(reached, hn::Zero(d));
  const auto exact = hn::And(hn::Not(none), hn::Le(hn::Abs(from_lower), SetTo(d, axis.same_angle)));
  b.outside = hn::Or(none, hn::And(hn::Not(exact), hn::Eq(b.lower, top)));
  const auto alone = hn::Or(exact, b.outside);
  b.upper = hn::IfThenElse(alone, b.lower, hn::Add(b.lower, hn::Set(d, 1.0F)));
  const auto upper = hn::ConvertTo(whole, b.upper);
  b.share = hn::IfThenZeroElse(
      alone, hn::Mul(hn::Sub(UpperAngle(d, sin_i, cos_i), Pick(d, axis.theta, axis.count, lower)),
                     Pick(d, axis.inverse_gap, axis.count, lower)));
  b.lower_column = Pick(d, axis.column_offset, axis.count, lower);
  b.upper_column = Pick(d, axis.column_offset, axis.count, upper);
  // An incidence of the grid itself needs no turning.
  b.upper_cos = hn::IfThenElse(exact, cos_i, Pick(d, axis.cosine, axis.count, upper));
  b.upper_sin = hn::IfThenElse(exact, sin_i, Pick(d, axis.sine, axis.count, upper));
  b.lower_cos = hn::IfThenElse(exact, cos_i, b.lower_cos);
  b.lower_sin = hn::IfThenElse(exact, sin_i, b.lower_sin);
  return b;
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE Bracket<D> BracketAndOffset(D d, const IncidenceAxis& axis, bool transmits, double lowest_z,
                                       const hn::TFromD<D>* omega_i, const hn::TFromD<D>* omega_o,
                                       Offset<D>& offset) {
  V ix, iy, iz, ox, oy, oz;
  hn::LoadInterleaved3(d, omega_i, ix, iy, iz);
  hn::LoadInterleaved3(d, omega_o, ox, oy, oz);
  const V up = transmits ? hn::Neg(oz) : oz;
  const V sin_i = hn::Sqrt(hn::MulAdd(ix, ix, hn::Mul(iy, iy)));
  const auto normal = hn::Lt(sin_i, SetTo(d, axis.same_angle));
  const V inverse = hn::Div(SetTo(d, 1.0), hn::Max(sin_i, SetTo(d, 1e-30)));
  const V c = hn::IfThenElse(normal, SetTo(d, axis.normal_cos_phi), hn::Mul(ix, inverse));
  const V s = hn::IfThenElse(normal, SetTo(d, axis.normal_sin_phi), hn::Mul(iy, inverse));
  const V along = hn::MulAdd(ox, c, hn::Mul(oy, s));
  offset.x = hn::MulAdd(along, iz, hn::Mul(up, sin_i));
  offset.y = hn::MulSub(oy, c, hn::Mul(ox, s));
  offset.z = hn::MulSub(up, iz, hn::Mul(along, sin_i));
  Bracket<D> b = BracketOf(d, axis, sin_i, iz);
  // x == x is false for NaN only, which every component of either direction puts into x or y.
  const auto numbers = hn::And(hn::Eq(offset.x, offset.x), hn::Eq(offset.y, offset.y));
  b.valid = hn::And(numbers, hn::And(hn::Gt(iz, hn::Zero(d)), hn::Gt(up, SetTo(d, lowest_z))));
  return b;
}

template <class D>
HWY_INLINE hn::Vec<hn::Rebind<std::int32_t, D>> ToIndex(hn::Vec<D> whole) {
  if constexpr (kIsFloat<D>) {
    return hn::ConvertTo(hn::Rebind<std::int32_t, D>(), whole);
  } else {
    return hn::DemoteTo(hn::Rebind<std::int32_t, D>(), whole);
  }
}

template <class D>
HWY_INLINE void StoreCell(D d, const Cell<D>& cell, hn::Mask<D> ok, const CellTable& table, hn::Vec<D> block,
                          std::size_t place, std::size_t k, Located<hn::TFromD<D>>& out) {
  const hn::Rebind<std::int32_t, D> index;
  const auto first = hn::Mul(ToIndex<D>(hn::IfThenElseZero(ok, block)),
                             hn::Set(index, static_cast<std::int32_t>(table.nodes_per_block())));
  hn::StoreU(hn::Add(first, ToIndex<D>(hn::IfThenElseZero(ok, cell.node))), index, &out.node[place][k]);
  hn::Store(hn::IfThenElseZero(ok, cell.row_share), d, &out.row_share[place][k]);
  hn::Store(hn::IfThenElseZero(ok, cell.column_share), d, &out.column_share[place][k]);
}

template <class D>
HWY_INLINE void StoreCode(D d, hn::Mask<D> ok, hn::Mask<D> outside, hn::Mask<D> between, hn::Mask<D> unsure,
                          std::int32_t best, std::size_t k, Located<hn::TFromD<D>>& out) {
  const auto or_better = [&](hn::Mask<D> where, std::int32_t code, hn::Vec<D> otherwise)
                             HWY_ATTR { return hn::IfThenElse(where, SetTo(d, best | code), otherwise); };
  hn::Vec<D> code = or_better(between, CellTable::kBetween, SetTo(d, best));
  code = or_better(outside, CellTable::kOutside, code);
  if constexpr (kIsFloat<D>) {
    code = or_better(unsure, CellTable::kMixed, code);
  }
  code = hn::IfThenElse(ok, code, SetTo(d, CellTable::kNothing));
  hn::StoreU(ToIndex<D>(code), hn::Rebind<std::int32_t, D>(), &out.code[k]);
}

/// Cells of Lanes(d) pairs in the two blocks around each omega_i.
template <class D, class Grid>
HWY_INLINE void Locate(D d, const Grid& grid, const hn::TFromD<D>* omega_i, const hn::TFromD<D>* omega_o,
                       std::size_t k, Located<hn::TFromD<D>>& out) {
  Offset<D> q;
  if constexpr (std::is_same_v<Grid, NormalLookup>) {
    const Bracket<D> b =
        BracketAndOffset(d, grid.incidences, grid.transmits, grid.lowest_z, omega_i, omega_o, q);
    const Cell<D> lower = CellOf(d, grid, hn::MulSub(q.x, b.lower_cos, hn::Mul(q.z, b.lower_sin)), q.y,
                                 hn::MulAdd(q.x, b.lower_sin, hn::Mul(q.z, b.lower_cos)), b.lower_column);
    const Cell<D> upper = CellOf(d, grid, hn::MulSub(q.x, b.upper_cos, hn::Mul(q.z, b.upper_sin)), q.y,
                                 hn::MulAdd(q.x, b.upper_sin, hn::Mul(q.z, b.upper_cos)), b.upper_column);
    const auto ok = hn::And(b.valid, hn::And(lower.found, upper.found));
    StoreCell(d, lower, ok, grid.table, b.lower, 0, k, out);
    StoreCell(d, upper, ok, grid.table, b.upper, 1, k, out);
    hn::Store(hn::IfThenElseZero(ok, b.share), d, &out.share[k]);
    StoreCode(d, ok, hn::Or(b.outside, hn::Or(lower.beyond, upper.beyond)), hn::Gt(b.share, hn::Zero(d)),
              hn::Or(lower.unsure, upper.unsure), 0, k, out);
  } else {
    const Bracket<D> b = BracketAndOffset(d, grid.incidences, grid.transmits, 0, omega_i, omega_o, q);
    const Cell<D> cell = CellOf(d, grid, q);
    const auto ok = hn::And(b.valid, cell.found);
    StoreCell(d, cell, ok, grid.table, b.lower, 0, k, out);
    StoreCell(d, cell, ok, grid.table, b.upper, 1, k, out);
    hn::Store(hn::IfThenElseZero(ok, b.share), d, &out.share[k]);
    StoreCode(d, ok, hn::Or(b.outside, cell.beyond), hn::Gt(b.share, hn::Zero(d)), cell.unsure, 0, k, out);
  }
}

/// Cells of Lanes(d) directions in the blocks of one omega_i.
template <class D, class Grid>
HWY_INLINE void Locate(D d, const Grid& grid, const IncidenceShares& incidence, const hn::TFromD<D>* omega_o,
                       std::size_t k, Located<hn::TFromD<D>>& out) {
  using V = hn::Vec<D>;
  constexpr bool kNormal = std::is_same_v<Grid, NormalLookup>;
  V ox, oy, oz;
  hn::LoadInterleaved3(d, omega_o, ox, oy, oz);
  const V z = grid.transmits ? hn::Neg(oz) : oz;
  const V cos_phi = SetTo(d, incidence.cos_phi);
  const V sin_phi = SetTo(d, incidence.sin_phi);
  const V x = hn::MulAdd(ox, cos_phi, hn::Mul(oy, sin_phi));
  const V y = hn::MulSub(oy, cos_phi, hn::Mul(ox, sin_phi));
  double lowest_z = 0;
  if constexpr (kNormal) {
    lowest_z = grid.lowest_z;
  }
  auto ok = hn::And(hn::And(hn::Eq(x, x), hn::Eq(y, y)), hn::Gt(z, SetTo(d, lowest_z)));
  auto beyond = Never(d);
  std::array<Cell<D>, 4> cells;
  // About the mirror direction all blocks share one cell.
  const std::size_t different = kNormal ? incidence.count : 1;
  for (std::size_t b = 0; b < different; ++b) {
    const BlockShare& block = incidence.blocks[b];
    const V cosine = SetTo(d, block.cos_turn);
    const V sine = SetTo(d, block.sin_turn);
    const Offset<D> at{hn::MulSub(x, cosine, hn::Mul(z, sine)), y, hn::MulAdd(x, sine, hn::Mul(z, cosine))};
    if constexpr (kNormal) {
      cells[b] = CellOf(d, grid, at.x, at.y, at.z, SetTo(d, block.column_offset));
    } else {
      cells[b] = CellOf(d, grid, at);
    }
    ok = hn::And(ok, cells[b].found);
    beyond = hn::Or(beyond, cells[b].beyond);
  }
  for (std::size_t b = 0; b < incidence.count; ++b) {
    StoreCell(d, cells[std::min(b, different - 1)], ok, grid.table,
              SetTo(d, static_cast<double>(incidence.blocks[b].block)), b, k, out);
  }
  StoreCode(d, ok, beyond, Never(d), Never(d), CellTable::code_of(incidence.origin), k, out);
}

/// Directions of a chunk as float triples, zeros (which are invalid) after the last.
using Triples = std::array<float, 3 * kTogether>;

HWY_INLINE void ToFloat(std::span<const Direction> directions, Triples& out) {
  const hn::ScalableTag<double> d;
  const hn::Rebind<float, decltype(d)> narrow;
  const std::size_t count = 3 * directions.size();
  const double* in = &directions.front().x;
  std::size_t k = 0;
  for (; k + hn::Lanes(d) <= count; k += hn::Lanes(d)) {
    hn::StoreU(hn::DemoteTo(narrow, hn::LoadU(d, in + k)), narrow, &out[k]);
  }
  for (; k < out.size(); ++k) {
    out[k] = k < count ? static_cast<float>(in[k]) : 0.0F;
  }
}

template <class Grid>
void Pairs(const Grid& grid, std::span<const Direction> omega_i, std::span<const Direction> omega_o,
           std::span<double> f, std::span<Origin> origin) {
  const hn::ScalableTag<float> d;
  Located<float> located;
  HWY_ALIGN Triples i;
  HWY_ALIGN Triples o;
  for (std::size_t from = 0; from < omega_o.size(); from += kTogether) {
    const std::size_t count = std::min(kTogether, omega_o.size() - from);
    ToFloat(omega_i.subspan(from, count), i);
    ToFloat(omega_o.subspan(from, count), o);
    for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
      Locate(d, grid, &i[3 * k], &o[3 * k], k, located);
    }
    Mix<2, float>(grid.table, located, count, 2, nullptr, &f[from * grid.table.channels()], &origin[from]);
  }
}

template <class Grid>
void Outgoing(const Grid& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
              std::span<double> f, std::span<Origin> origin) {
  const hn::ScalableTag<double> d;
  Located<double> located;
  std::array<double, 4> weights{};
  for (std::size_t b = 0; b < incidence.count; ++b) {
    weights[b] = incidence.blocks[b].weight;
  }
  located.share.fill(weights[1]);
  for (std::size_t from = 0; from < omega_o.size(); from += kTogether) {
    const std::size_t count = std::min(kTogether, omega_o.size() - from);
    std::size_t k = 0;
    for (; k + hn::Lanes(d) <= count; k += hn::Lanes(d)) {
      Locate(d, grid, incidence, &omega_o[from + k].x, k, located);
    }
    if (k < count) {
      std::array<Direction, HWY_MAX_BYTES / sizeof(double)> rest{};
      std::copy_n(&omega_o[from + k], count - k, rest.begin());
      Locate(d, grid, incidence, &rest.front().x, k, located);
    }
    double* out = &f[from * grid.table.channels()];
    if (incidence.count == 1) {
      Mix<1, double>(grid.table, located, count, 1, nullptr, out, &origin[from]);
    } else if (incidence.count == 2) {
      Mix<2, double>(grid.table, located, count, 2, nullptr, out, &origin[from]);
    } else {
      Mix<0, double>(grid.table, located, count, incidence.count, weights.data(), out, &origin[from]);
    }
  }
}

/// All that is needed of one pair before its angles are known.
struct OnePair {
  bool valid = false;
  bool outside = false;
  Direction offset;  ///< As Offset.
  double sin_i = 0;
  double cos_i = 1;
  std::size_t lower = 0;
  std::size_t upper = 0;
  bool exact = false;
};

HWY_INLINE OnePair PrepareOne(const IncidenceAxis& axis, bool transmits, double lowest_z,
                              const Direction& omega_i, const Direction& omega_o) {
  OnePair p;
  const double up = transmits ? -omega_o.z : omega_o.z;
  p.sin_i = std::sqrt(omega_i.x * omega_i.x + omega_i.y * omega_i.y);
  p.cos_i = omega_i.z;
  const bool normal = p.sin_i < axis.same_angle;
  const double inverse = 1 / std::max(p.sin_i, 1e-200);
  const double c = normal ? axis.normal_cos_phi : omega_i.x * inverse;
  const double s = normal ? axis.normal_sin_phi : omega_i.y * inverse;
  const double along = omega_o.x * c + omega_o.y * s;
  p.offset = {along * p.cos_i + up * p.sin_i, omega_o.y * c - omega_o.x * s, up * p.cos_i - along * p.sin_i};
  p.valid = p.cos_i > 0 && up > lowest_z && p.offset.x == p.offset.x && p.offset.y == p.offset.y;
  std::size_t reached = 0;
  for (const IncidenceAxis::Incidence& i : axis.one_by_one) {
    reached += p.sin_i * i.cosine - p.cos_i * i.sine >= -axis.same_angle ? 1 : 0;
  }
  p.lower = std::max<std::size_t>(reached, 1) - 1;
  const IncidenceAxis::Incidence& lower = axis.one_by_one[p.lower];
  p.exact = reached > 0 && p.sin_i * lower.cosine - p.cos_i * lower.sine <= axis.same_angle;
  p.outside = reached == 0 || (reached == axis.count && !p.exact);
  p.upper = p.exact || p.outside ? p.lower : p.lower + 1;
  return p;
}

/// Angles of eight points with y >= 0.
HWY_INLINE void EightAngles(const std::array<double, 8>& y, const std::array<double, 8>& x,
                            std::array<double, 8>& angle) {
  const hn::CappedTag<double, 8> d;
  for (std::size_t k = 0; k < y.size(); k += hn::Lanes(d)) {
    hn::StoreU(UpperAngle(d, hn::LoadU(d, &y[k]), hn::LoadU(d, &x[k])), d, &angle[k]);
  }
}

HWY_INLINE Origin MixOne(const CellTable& table, const OnePair& p, bool beyond, Located<double>& located,
                         double theta_i, const IncidenceAxis& axis, std::span<double> f) {
  const bool alone = p.lower == p.upper;
  const IncidenceAxis::Incidence& lower = axis.one_by_one[p.lower];
  located.share[0] = alone ? 0 : (theta_i - lower.theta) * lower.inverse_gap;
  located.code[0] = (p.outside || beyond ? CellTable::kOutside : 0) | (alone ? 0 : CellTable::kBetween);
  Origin origin = Origin::kInvalid;
  Mix<2, double>(table, located, 1, 2, nullptr, f.data(), &origin);
  return origin;
}

HWY_INLINE Origin Nothing(std::span<double> f) {
  std::ranges::fill(f, 0.0);
  return Origin::kInvalid;
}

Origin NormalOne(const NormalLookup& grid, const Direction& omega_i, const Direction& omega_o,
                 std::span<double> f) {
  const IncidenceAxis& axis = grid.incidences;
  const OnePair p = PrepareOne(axis, grid.transmits, grid.lowest_z, omega_i, omega_o);
  if (!p.valid) {
    return Nothing(f);
  }
  const IncidenceAxis::Incidence& lower = axis.one_by_one[p.lower];
  const IncidenceAxis::Incidence& upper = axis.one_by_one[p.upper];
  // An incidence of the grid itself needs no turning.
  const double lower_cos = p.exact ? p.cos_i : lower.cosine;
  const double lower_sin = p.exact ? p.sin_i : lower.sine;
  const double upper_cos = p.exact ? p.cos_i : upper.cosine;
  const double upper_sin = p.exact ? p.sin_i : upper.sine;
  const Direction& q = p.offset;
  const double lower_x = q.x * lower_cos - q.z * lower_sin;
  const double upper_x = q.x * upper_cos - q.z * upper_sin;
  const double y = std::abs(q.y);
  const double yy = q.y * q.y;
  HWY_ALIGN std::array<double, 8> angle;
  EightAngles({std::sqrt(lower_x * lower_x + yy), y, std::sqrt(upper_x * upper_x + yy), y, p.sin_i, 0, 0, 0},
              {q.x * lower_sin + q.z * lower_cos, lower_x, q.x * upper_sin + q.z * upper_cos, upper_x,
               p.cos_i, 1, 1, 1},
              angle);
  const double column_0 =
      (q.y < 0 ? 2 * kPi - angle[1] : angle[1]) * grid.column_per_rad + lower.column_offset;
  const double column_1 =
      (q.y < 0 ? 2 * kPi - angle[3] : angle[3]) * grid.column_per_rad + upper.column_offset;
  const double row_0 = angle[0] * grid.row_per_rad;
  const double row_1 = angle[2] * grid.row_per_rad;
  const double count = grid.column_count;
  const hn::CappedTag<double, 4> d;
  HWY_ALIGN std::array<double, 4> below{
      std::min(row_0, grid.last_row), column_0 >= count ? column_0 - count : column_0,
      std::min(row_1, grid.last_row), column_1 >= count ? column_1 - count : column_1};
  HWY_ALIGN std::array<double, 4> share;
  for (std::size_t k = 0; k < below.size(); k += hn::Lanes(d)) {
    hn::Vec<decltype(d)> whole;
    hn::Vec<decltype(d)> rest;
    Split(d, hn::Load(d, &below[k]), grid.same_node, whole, rest);
    hn::Store(whole, d, &below[k]);
    hn::Store(rest, d, &share[k]);
  }
  Located<double> located;
  for (std::size_t b = 0; b < 2; ++b) {
    const double row = below[2 * b];
    const double column = below[2 * b + 1] >= count ? below[2 * b + 1] - count : below[2 * b + 1];
    if (!(row >= 0 && row <= grid.last_row && column >= 0 && column < count)) {
      return Nothing(f);
    }
    located.node[b][0] = static_cast<std::int32_t>(grid.table.index(
        b == 0 ? p.lower : p.upper, static_cast<std::size_t>(row), static_cast<std::size_t>(column)));
    located.row_share[b][0] = share[2 * b];
    located.column_share[b][0] = share[2 * b + 1];
  }
  const double end = grid.last_row + grid.same_node;
  return MixOne(grid.table, p, row_0 > end || row_1 > end, located, angle[4], axis, f);
}

Origin SpecularOne(const SpecularLookup& grid, const Direction& omega_i, const Direction& omega_o,
                   std::span<double> f) {
  const OnePair p = PrepareOne(grid.incidences, grid.transmits, 0, omega_i, omega_o);
  if (!p.valid) {
    return Nothing(f);
  }
  using One = hn::CappedTag<double, 1>;
  const One d;
  const Offset<One> offset{hn::Set(d, p.offset.x), hn::Set(d, p.offset.y), hn::Set(d, p.offset.z)};
  const auto cell = CellOf(d, grid, offset);
  if (!hn::AllTrue(d, cell.found)) {
    return Nothing(f);
  }
  const auto node = static_cast<std::int32_t>(hn::GetLane(cell.node));
  const auto step = static_cast<std::int32_t>(grid.table.nodes_per_block());
  Located<double> located;
  located.node[0][0] = node + static_cast<std::int32_t>(p.lower) * step;
  located.node[1][0] = node + static_cast<std::int32_t>(p.upper) * step;
  located.row_share[0][0] = located.row_share[1][0] = hn::GetLane(cell.row_share);
  located.column_share[0][0] = located.column_share[1][0] = hn::GetLane(cell.column_share);
  const double theta_i = hn::GetLane(UpperAngle(d, hn::Set(d, p.sin_i), hn::Set(d, p.cos_i)));
  return MixOne(grid.table, p, hn::AllTrue(d, cell.beyond), located, theta_i, grid.incidences, f);
}

void NormalPairs(const NormalLookup& grid, std::span<const Direction> omega_i,
                 std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  Pairs(grid, omega_i, omega_o, f, origin);
}
void SpecularPairs(const SpecularLookup& grid, std::span<const Direction> omega_i,
                   std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  Pairs(grid, omega_i, omega_o, f, origin);
}
void NormalOutgoing(const NormalLookup& grid, const IncidenceShares& incidence,
                    std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  Outgoing(grid, incidence, omega_o, f, origin);
}
void SpecularOutgoing(const SpecularLookup& grid, const IncidenceShares& incidence,
                      std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  Outgoing(grid, incidence, omega_o, f, origin);
}

}  // namespace scatter::reflectance::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace scatter::reflectance {

HWY_EXPORT(NormalOne);
HWY_EXPORT(SpecularOne);
HWY_EXPORT(NormalPairs);
HWY_EXPORT(SpecularPairs);
HWY_EXPORT(NormalOutgoing);
HWY_EXPORT(SpecularOutgoing);

void look_up(const NormalLookup& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
             std::span<double> f_per_sr, std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(NormalOutgoing)(grid, incidence, omega_o, f_per_sr, origin);
}

void look_up(const SpecularLookup& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
             std::span<double> f_per_sr, std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(SpecularOutgoing)(grid, incidence, omega_o, f_per_sr, origin);
}

Origin look_up_one(const NormalLookup& grid, const Direction& omega_i, const Direction& omega_o,
                   std::span<double> f_per_sr) noexcept {
  return HWY_DYNAMIC_DISPATCH(NormalOne)(grid, omega_i, omega_o, f_per_sr);
}

Origin look_up_one(const SpecularLookup& grid, const Direction& omega_i, const Direction& omega_o,
                   std::span<double> f_per_sr) noexcept {
  return HWY_DYNAMIC_DISPATCH(SpecularOne)(grid, omega_i, omega_o, f_per_sr);
}

void look_up_pairs(const NormalLookup& grid, std::span<const Direction> omega_i,
                   std::span<const Direction> omega_o, std::span<double> f_per_sr,
                   std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(NormalPairs)(grid, omega_i, omega_o, f_per_sr, origin);
}

void look_up_pairs(const SpecularLookup& grid, std::span<const Direction> omega_i,
                   std::span<const Direction> omega_o, std::span<double> f_per_sr,
                   std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(SpecularPairs)(grid, omega_i, omega_o, f_per_sr, origin);
}

}  // namespace scatter::reflectance

#endif
