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
#include "host_sdk/reflectance/grid_cells_simd-inl.h"
#include "host_sdk/reflectance/grid_lookup_simd-inl.h"

HWY_BEFORE_NAMESPACE();
namespace scatter::reflectance::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE hn::Vec<hn::Rebind<std::int32_t, D>> to_index(hn::Vec<D> whole) {
  if constexpr (kIsFloat<D>) {
    return hn::ConvertTo(hn::Rebind<std::int32_t, D>(), whole);
  } else {
    return hn::DemoteTo(hn::Rebind<std::int32_t, D>(), whole);
  }
}

template <class D>
HWY_INLINE void store_cell(D d, const Cell<D>& cell, hn::Mask<D> ok, const CellTable& table, hn::Vec<D> block,
                           std::size_t place, std::size_t k, Located<hn::TFromD<D>>& out) {
  const hn::Rebind<std::int32_t, D> index;
  const auto first = hn::Mul(to_index<D>(hn::IfThenElseZero(ok, block)),
                             hn::Set(index, static_cast<std::int32_t>(table.nodes_per_block())));
  hn::StoreU(hn::Add(first, to_index<D>(hn::IfThenElseZero(ok, cell.node))), index, &out.node[place][k]);
  hn::Store(hn::IfThenElseZero(ok, cell.row_share), d, &out.row_share[place][k]);
  hn::Store(hn::IfThenElseZero(ok, cell.column_share), d, &out.column_share[place][k]);
}

template <class D>
HWY_INLINE void store_code(D d, hn::Mask<D> ok, hn::Mask<D> outside, hn::Mask<D> between, hn::Mask<D> unsure,
                           std::int32_t best, std::size_t k, Located<hn::TFromD<D>>& out) {
  const auto or_better = [&](hn::Mask<D> where, std::int32_t code, hn::Vec<D> otherwise)
                             HWY_ATTR { return hn::IfThenElse(where, set_to(d, best | code), otherwise); };
  hn::Vec<D> code = or_better(between, CellTable::kBetween, set_to(d, best));
  code = or_better(outside, CellTable::kOutside, code);
  if constexpr (kIsFloat<D>) {
    code = or_better(unsure, CellTable::kMixed, code);
  }
  code = hn::IfThenElse(ok, code, set_to(d, CellTable::kNothing));
  hn::StoreU(to_index<D>(code), hn::Rebind<std::int32_t, D>(), &out.code[k]);
}

/// Cells of Lanes(d) pairs in the two blocks around each omega_i.
template <class D, class Grid>
HWY_INLINE void locate(D d, const Grid& grid, const hn::TFromD<D>* omega_i, const hn::TFromD<D>* omega_o,
                       std::size_t k, Located<hn::TFromD<D>>& out) {
  Offset<D> q;
  if constexpr (std::is_same_v<Grid, NormalLookup>) {
    const Bracket<D> b =
        bracket_and_offset(d, grid.incidences, grid.transmits, grid.lowest_z, omega_i, omega_o, q);
    const Cell<D> lower = cell_of(d, grid, hn::MulSub(q.x, b.lower_cos, hn::Mul(q.z, b.lower_sin)), q.y,
                                  hn::MulAdd(q.x, b.lower_sin, hn::Mul(q.z, b.lower_cos)), b.lower_column);
    const Cell<D> upper = cell_of(d, grid, hn::MulSub(q.x, b.upper_cos, hn::Mul(q.z, b.upper_sin)), q.y,
                                  hn::MulAdd(q.x, b.upper_sin, hn::Mul(q.z, b.upper_cos)), b.upper_column);
    const auto ok = hn::And(b.valid, hn::And(lower.found, upper.found));
    store_cell(d, lower, ok, grid.table, b.lower, 0, k, out);
    store_cell(d, upper, ok, grid.table, b.upper, 1, k, out);
    hn::Store(hn::IfThenElseZero(ok, b.share), d, &out.share[k]);
    store_code(d, ok, hn::Or(b.outside, hn::Or(lower.beyond, upper.beyond)), hn::Gt(b.share, hn::Zero(d)),
               hn::Or(lower.unsure, upper.unsure), 0, k, out);
  } else {
    const Bracket<D> b = bracket_and_offset(d, grid.incidences, grid.transmits, 0, omega_i, omega_o, q);
    const Cell<D> cell = cell_of(d, grid, q);
    const auto ok = hn::And(b.valid, cell.found);
    store_cell(d, cell, ok, grid.table, b.lower, 0, k, out);
    store_cell(d, cell, ok, grid.table, b.upper, 1, k, out);
    hn::Store(hn::IfThenElseZero(ok, b.share), d, &out.share[k]);
    store_code(d, ok, hn::Or(b.outside, cell.beyond), hn::Gt(b.share, hn::Zero(d)), cell.unsure, 0, k, out);
  }
}

/// Cells of Lanes(d) directions in the blocks of one omega_i.
template <class D, class Grid>
HWY_INLINE void locate(D d, const Grid& grid, const IncidenceShares& incidence, const hn::TFromD<D>* omega_o,
                       std::size_t k, Located<hn::TFromD<D>>& out) {
  using V = hn::Vec<D>;
  constexpr bool kNormal = std::is_same_v<Grid, NormalLookup>;
  V ox, oy, oz;
  hn::LoadInterleaved3(d, omega_o, ox, oy, oz);
  const V z = grid.transmits ? hn::Neg(oz) : oz;
  const V cos_phi = set_to(d, incidence.cos_phi);
  const V sin_phi = set_to(d, incidence.sin_phi);
  const V x = hn::MulAdd(ox, cos_phi, hn::Mul(oy, sin_phi));
  const V y = hn::MulSub(oy, cos_phi, hn::Mul(ox, sin_phi));
  double lowest_z = 0;
  if constexpr (kNormal) {
    lowest_z = grid.lowest_z;
  }
  auto ok = hn::And(hn::And(hn::Eq(x, x), hn::Eq(y, y)), hn::Gt(z, set_to(d, lowest_z)));
  auto beyond = never(d);
  std::array<Cell<D>, 4> cells;
  // About the mirror direction all blocks share one cell.
  const std::size_t different = kNormal ? incidence.count : 1;
  for (std::size_t b = 0; b < different; ++b) {
    const BlockShare& block = incidence.blocks[b];
    const V cosine = set_to(d, block.cos_turn);
    const V sine = set_to(d, block.sin_turn);
    const Offset<D> at{hn::MulSub(x, cosine, hn::Mul(z, sine)), y, hn::MulAdd(x, sine, hn::Mul(z, cosine))};
    if constexpr (kNormal) {
      cells[b] = cell_of(d, grid, at.x, at.y, at.z, set_to(d, block.column_offset));
    } else {
      cells[b] = cell_of(d, grid, at);
    }
    ok = hn::And(ok, cells[b].found);
    beyond = hn::Or(beyond, cells[b].beyond);
  }
  for (std::size_t b = 0; b < incidence.count; ++b) {
    store_cell(d, cells[std::min(b, different - 1)], ok, grid.table,
               set_to(d, static_cast<double>(incidence.blocks[b].block)), b, k, out);
  }
  store_code(d, ok, beyond, never(d), never(d), CellTable::code_of(incidence.origin), k, out);
}

/// Directions of a chunk as float triples, zeros (which are invalid) after the last.
using Triples = std::array<float, 3 * kTogether>;

HWY_INLINE void to_float(std::span<const Direction> directions, Triples& out) {
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
void pairs_of(const Grid& grid, std::span<const Direction> omega_i, std::span<const Direction> omega_o,
              std::span<double> f, std::span<Origin> origin) {
  const hn::ScalableTag<float> d;
  Located<float> located;
  HWY_ALIGN Triples i;
  HWY_ALIGN Triples o;
  for (std::size_t from = 0; from < omega_o.size(); from += kTogether) {
    const std::size_t count = std::min(kTogether, omega_o.size() - from);
    to_float(omega_i.subspan(from, count), i);
    to_float(omega_o.subspan(from, count), o);
    for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
      locate(d, grid, &i[3 * k], &o[3 * k], k, located);
    }
    mix<2, float>(grid.table, located, count, 2, nullptr, &f[from * grid.table.channels()], &origin[from]);
  }
}

template <class Grid>
void outgoing_of(const Grid& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
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
      locate(d, grid, incidence, &omega_o[from + k].x, k, located);
    }
    if (k < count) {
      std::array<Direction, HWY_MAX_BYTES / sizeof(double)> rest{};
      std::copy_n(&omega_o[from + k], count - k, rest.begin());
      locate(d, grid, incidence, &rest.front().x, k, located);
    }
    double* out = &f[from * grid.table.channels()];
    if (incidence.count == 1) {
      mix<1, double>(grid.table, located, count, 1, nullptr, out, &origin[from]);
    } else if (incidence.count == 2) {
      mix<2, double>(grid.table, located, count, 2, nullptr, out, &origin[from]);
    } else {
      mix<0, double>(grid.table, located, count, incidence.count, weights.data(), out, &origin[from]);
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

HWY_INLINE OnePair prepare_one(const IncidenceAxis& axis, bool transmits, double lowest_z,
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

using One = hn::CappedTag<double, 1>;

/// Angle of one point with y >= 0. Several calls overlap; packing them into one register would wait for
/// its lanes to be stored.
HWY_INLINE double one_angle(double y, double x) {
  const One d;
  return hn::GetLane(upper_angle(d, hn::Set(d, y), hn::Set(d, x)));
}

/// Cell of one direction in a block; false when it is no direction.
HWY_INLINE bool locate_one(const NormalLookup& grid, std::size_t block, const Direction& w,
                           double column_offset, std::size_t place, bool& beyond, Located<double>& located) {
  const One d;
  const auto cell =
      cell_of(d, grid, hn::Set(d, w.x), hn::Set(d, w.y), hn::Set(d, w.z), hn::Set(d, column_offset));
  located.node[place][0] = static_cast<std::int32_t>(block * grid.table.nodes_per_block()) +
                           static_cast<std::int32_t>(hn::GetLane(cell.node));
  located.row_share[place][0] = hn::GetLane(cell.row_share);
  located.column_share[place][0] = hn::GetLane(cell.column_share);
  beyond = beyond || hn::AllTrue(d, cell.beyond);
  return hn::AllTrue(d, cell.found);
}

HWY_INLINE Origin mix_one(const CellTable& table, const OnePair& p, bool beyond, Located<double>& located,
                          double theta_i, const IncidenceAxis& axis, std::span<double> f) {
  const bool alone = p.lower == p.upper;
  const IncidenceAxis::Incidence& lower = axis.one_by_one[p.lower];
  located.share[0] = alone ? 0 : (theta_i - lower.theta) * lower.inverse_gap;
  located.code[0] = (p.outside || beyond ? CellTable::kOutside : 0) | (alone ? 0 : CellTable::kBetween);
  Origin origin = Origin::kInvalid;
  mix<2, double>(table, located, 1, 2, nullptr, f.data(), &origin);
  return origin;
}

HWY_INLINE Origin no_value(std::span<double> f) {
  std::ranges::fill(f, 0.0);
  return Origin::kInvalid;
}

Origin normal_one(const NormalLookup& grid, const Direction& omega_i, const Direction& omega_o,
                  std::span<double> f) {
  const IncidenceAxis& axis = grid.incidences;
  const OnePair p = prepare_one(axis, grid.transmits, grid.lowest_z, omega_i, omega_o);
  if (!p.valid) {
    return no_value(f);
  }
  const IncidenceAxis::Incidence& lower = axis.one_by_one[p.lower];
  const IncidenceAxis::Incidence& upper = axis.one_by_one[p.upper];
  // An incidence of the grid itself needs no turning.
  const double lower_cos = p.exact ? p.cos_i : lower.cosine;
  const double lower_sin = p.exact ? p.sin_i : lower.sine;
  const double upper_cos = p.exact ? p.cos_i : upper.cosine;
  const double upper_sin = p.exact ? p.sin_i : upper.sine;
  const Direction& q = p.offset;
  Located<double> located;
  bool beyond = false;
  const bool found =
      locate_one(grid, p.lower, {q.x * lower_cos - q.z * lower_sin, q.y, q.x * lower_sin + q.z * lower_cos},
                 lower.column_offset, 0, beyond, located) &&
      locate_one(grid, p.upper, {q.x * upper_cos - q.z * upper_sin, q.y, q.x * upper_sin + q.z * upper_cos},
                 upper.column_offset, 1, beyond, located);
  return found ? mix_one(grid.table, p, beyond, located, one_angle(p.sin_i, p.cos_i), axis, f) : no_value(f);
}

Origin specular_one(const SpecularLookup& grid, const Direction& omega_i, const Direction& omega_o,
                    std::span<double> f) {
  const OnePair p = prepare_one(grid.incidences, grid.transmits, 0, omega_i, omega_o);
  if (!p.valid) {
    return no_value(f);
  }
  const One d;
  const Offset<One> offset{hn::Set(d, p.offset.x), hn::Set(d, p.offset.y), hn::Set(d, p.offset.z)};
  const auto cell = cell_of(d, grid, offset);
  if (!hn::AllTrue(d, cell.found)) {
    return no_value(f);
  }
  const auto node = static_cast<std::int32_t>(hn::GetLane(cell.node));
  const auto step = static_cast<std::int32_t>(grid.table.nodes_per_block());
  Located<double> located;
  located.node[0][0] = node + static_cast<std::int32_t>(p.lower) * step;
  located.node[1][0] = node + static_cast<std::int32_t>(p.upper) * step;
  located.row_share[0][0] = located.row_share[1][0] = hn::GetLane(cell.row_share);
  located.column_share[0][0] = located.column_share[1][0] = hn::GetLane(cell.column_share);
  const double theta_i = one_angle(p.sin_i, p.cos_i);
  return mix_one(grid.table, p, hn::AllTrue(d, cell.beyond), located, theta_i, grid.incidences, f);
}

void normal_pairs(const NormalLookup& grid, std::span<const Direction> omega_i,
                  std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  pairs_of(grid, omega_i, omega_o, f, origin);
}
void specular_pairs(const SpecularLookup& grid, std::span<const Direction> omega_i,
                    std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  pairs_of(grid, omega_i, omega_o, f, origin);
}
void normal_outgoing(const NormalLookup& grid, const IncidenceShares& incidence,
                     std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  outgoing_of(grid, incidence, omega_o, f, origin);
}
void specular_outgoing(const SpecularLookup& grid, const IncidenceShares& incidence,
                       std::span<const Direction> omega_o, std::span<double> f, std::span<Origin> origin) {
  outgoing_of(grid, incidence, omega_o, f, origin);
}

}  // namespace scatter::reflectance::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace scatter::reflectance {

HWY_EXPORT(normal_one);
HWY_EXPORT(specular_one);
HWY_EXPORT(normal_pairs);
HWY_EXPORT(specular_pairs);
HWY_EXPORT(normal_outgoing);
HWY_EXPORT(specular_outgoing);

void look_up(const NormalLookup& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
             std::span<double> f_per_sr, std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(normal_outgoing)(grid, incidence, omega_o, f_per_sr, origin);
}

void look_up(const SpecularLookup& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
             std::span<double> f_per_sr, std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(specular_outgoing)(grid, incidence, omega_o, f_per_sr, origin);
}

Origin look_up_one(const NormalLookup& grid, const Direction& omega_i, const Direction& omega_o,
                   std::span<double> f_per_sr) noexcept {
  return HWY_DYNAMIC_DISPATCH(normal_one)(grid, omega_i, omega_o, f_per_sr);
}

Origin look_up_one(const SpecularLookup& grid, const Direction& omega_i, const Direction& omega_o,
                   std::span<double> f_per_sr) noexcept {
  return HWY_DYNAMIC_DISPATCH(specular_one)(grid, omega_i, omega_o, f_per_sr);
}

void look_up_pairs(const NormalLookup& grid, std::span<const Direction> omega_i,
                   std::span<const Direction> omega_o, std::span<double> f_per_sr,
                   std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(normal_pairs)(grid, omega_i, omega_o, f_per_sr, origin);
}

void look_up_pairs(const SpecularLookup& grid, std::span<const Direction> omega_i,
                   std::span<const Direction> omega_o, std::span<double> f_per_sr,
                   std::span<Origin> origin) noexcept {
  HWY_DYNAMIC_DISPATCH(specular_pairs)(grid, omega_i, omega_o, f_per_sr, origin);
}

}  // namespace scatter::reflectance

#endif
