#include "host_sdk/reflectance/grid_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "host_sdk/reflectance/lookup_chunks.h"

namespace scatter::reflectance {
namespace {

constexpr std::uint32_t kPole = std::numeric_limits<std::uint32_t>::max();
/// Two incidences closer than this are the same one [rad]; far below any instrument's geometry.
constexpr double kSameAngle = 1e-6;
/// Fractions of a step nearer to a node than this are that node: rounding of angles must not
/// pull in a neighbour, which may be invalid.
constexpr double kSameNode = 1e-6;
/// Rotations farther apart than this are not interpolated [rad].
constexpr double kWidestRotationGap = kPi / 2 + kSameAngle;
/// The lookup counts nodes in 32 bits.
constexpr double kMostNodes = 2147483648.0;

std::unexpected<Error> bad(const std::string& what) {
  return fail(ErrorCode::kInvalidArgument, "grid: " + what, "give every part the sizes that the grid states");
}

double wrapped(double phi) noexcept {
  phi = std::fmod(phi, 2 * kPi);
  return phi < 0 ? phi + 2 * kPi : phi;
}

/// Index below a position on an axis and the share of the next one; 0 at a node.
std::pair<std::size_t, double> split(double position) noexcept {
  const double nearest = std::round(position);
  if (std::abs(position - nearest) < kSameNode) {
    return {static_cast<std::size_t>(nearest), 0.0};
  }
  const double below = std::floor(position);
  return {static_cast<std::size_t>(below), position - below};
}

Status check_planes(const std::vector<std::vector<float>>& planes, const std::vector<Origin>& origin,
                    std::size_t channels, bool optional, double lowest, const std::string& name) {
  if (optional && planes.empty()) {
    return {};
  }
  if (planes.size() != channels) {
    return bad(fmt::format("{} has {} channels, expected {}", name, planes.size(), channels));
  }
  for (std::size_t c = 0; c < channels; ++c) {
    if (planes[c].size() != origin.size()) {
      return bad(
          fmt::format("{}, channel {} has {} nodes, expected {}", name, c, planes[c].size(), origin.size()));
    }
    for (std::size_t n = 0; n < origin.size(); ++n) {
      const double value = planes[c][n];
      if (origin[n] != Origin::kInvalid && !(std::isfinite(value) && value >= lowest)) {
        return bad(fmt::format("{}, channel {}, node {} is {}, expected a finite number{}", name, c, n, value,
                               lowest == 0 ? " >= 0" : ""));
      }
    }
  }
  return {};
}

Status check_part(const GridBrdf::Content& content, std::size_t index) {
  const GridPart& part = content.parts[index];
  const std::size_t nodes = content.theta_count * content.phi_count;
  const std::string name = fmt::format("part {}", index);
  if (!(part.theta_i >= 0 && part.theta_i < kPi / 2) || !std::isfinite(part.phi_i) ||
      !std::isfinite(part.rotation_rad)) {
    return bad(fmt::format("{}: theta_i {} deg, phi_i {} deg, rotation {} deg, expected 0 <= theta_i < 90",
                           name, degrees(part.theta_i), degrees(part.phi_i), degrees(part.rotation_rad)));
  }
  if (part.origin.size() != nodes) {
    return bad(fmt::format("{} has {} origins, expected {} x {} = {}", name, part.origin.size(),
                           content.theta_count, content.phi_count, nodes));
  }
  if (std::ranges::any_of(part.origin, [](Origin o) { return o > Origin::kExtrapolated; })) {
    return bad(name + " has an origin above 3");
  }
  if (!part.pixels.empty() && part.pixels.size() != nodes) {
    return bad(fmt::format("{} has {} pixel counts, expected {}", name, part.pixels.size(), nodes));
  }
  const double any = -std::numeric_limits<double>::infinity();
  if (Status status =
          check_planes(part.f_per_sr, part.origin, content.channels, false, any, name + " values");
      !status) {
    return status;
  }
  if (Status status = check_planes(part.random_per_sr, part.origin, content.channels, true, 0,
                                   name + " random uncertainty");
      !status) {
    return status;
  }
  return check_planes(part.systematic_per_sr, part.origin, content.channels, true, 0,
                      name + " systematic uncertainty");
}

/// Mean of the valid nodes of row 0; exact when they are equal, as they should be.
float pole_mean(const std::vector<float>& plane, const std::vector<Origin>& origin, std::size_t phi_count) {
  double total = 0;
  double count = 0;
  float first = 0;
  bool equal = true;
  for (std::size_t i = 0; i < phi_count; ++i) {
    if (origin[i] == Origin::kInvalid) {
      continue;
    }
    if (count == 0) {
      first = plane[i];
    }
    equal = equal && plane[i] == first;
    total += plane[i];
    count += 1;
  }
  if (equal || count == 0) {
    return first;
  }
  return static_cast<float>(total / count);
}

}  // namespace

Result<GridBrdf> GridBrdf::make(Content content) {
  if (content.channels == 0 || content.theta_count < 2 || content.phi_count < 1 || content.parts.empty()) {
    return bad(fmt::format("{} channels, {} x {} nodes, {} parts, expected at least 1, 2 x 1 and 1",
                           content.channels, content.theta_count, content.phi_count, content.parts.size()));
  }
  const double last_theta = static_cast<double>(content.theta_count - 1) * content.theta_step;
  const double turn = static_cast<double>(content.phi_count) * content.phi_step;
  if (!(content.theta_step > 0 && last_theta <= kPi / 2 + kSameAngle)) {
    return bad(fmt::format("theta_o ends at {} deg, expected at most 90", degrees(last_theta)));
  }
  if (!(std::abs(turn - 2 * kPi) < kSameAngle)) {
    return bad(fmt::format("phi_o covers {} deg, expected 360", degrees(turn)));
  }
  if (!content.wavelengths_nm.empty() && content.wavelengths_nm.size() != content.channels) {
    return bad(
        fmt::format("{} wavelengths for {} channels", content.wavelengths_nm.size(), content.channels));
  }
  const double nodes = static_cast<double>(content.theta_count + 1) *
                       static_cast<double>(content.phi_count + 1) * static_cast<double>(content.parts.size());
  if (!(nodes < kMostNodes)) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("grid: {:.3g} nodes, expected less than 2^31", nodes), "use a coarser grid");
  }
  for (std::size_t p = 0; p < content.parts.size(); ++p) {
    if (Status status = check_part(content, p); !status) {
      return std::unexpected(status.error());
    }
  }
  std::ranges::stable_sort(content.parts, {}, [](const GridPart& part) {
    return std::tuple(part.rotation_rad, part.theta_i, part.phi_i);
  });
  return GridBrdf(std::move(content));
}

GridBrdf::GridBrdf(Content content) : content_(std::move(content)) {
  const std::vector<GridPart>& parts = content_.parts;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (p == 0 || parts[p].rotation_rad - parts[p - 1].rotation_rad > kSameAngle) {
      groups_.push_back({p, 0, 0});
    }
    groups_.back().count += 1;
    groups_.back().phi_i = wrapped(parts[p].phi_i);
  }
  std::ranges::stable_sort(groups_, {}, &Group::phi_i);

  const std::size_t channels = content_.channels;
  pole_.assign(3 * parts.size() * channels, 0.0);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const GridPart& part = parts[p];
    const std::array<const std::vector<std::vector<float>>*, 3> planes{&part.f_per_sr, &part.random_per_sr,
                                                                       &part.systematic_per_sr};
    for (std::size_t plane = 0; plane < planes.size(); ++plane) {
      for (std::size_t c = 0; c < channels && !planes[plane]->empty(); ++c) {
        pole_[(plane * parts.size() + p) * channels + c] =
            pole_mean((*planes[plane])[c], part.origin, content_.phi_count);
      }
    }
    Origin origin = Origin::kInvalid;
    for (std::size_t i = 0; i < content_.phi_count; ++i) {
      origin = std::max(origin, part.origin[i]);
    }
    pole_origin_.push_back(origin);
  }
  build_lookup();
}

void GridBrdf::build_lookup() {
  const std::size_t rows = content_.theta_count;
  const std::size_t columns = content_.phi_count;
  CellTable table(content_.channels, content_.parts.size(), rows + 1, columns + 1);
  for (std::size_t p = 0; p < content_.parts.size(); ++p) {
    const GridPart& part = content_.parts[p];
    for (std::size_t j = 0; j < rows; ++j) {
      for (std::size_t i = 0; i < columns; ++i) {
        const std::size_t node = j * columns + i;
        const Origin origin = j == 0 ? pole_origin_[p] : part.origin[node];
        const std::size_t at = table.index(p, j, i);
        table.set_origin(at, origin);
        for (std::size_t c = 0; c < content_.channels && origin != Origin::kInvalid; ++c) {
          table.set(at, c,
                    j == 0 ? static_cast<float>(pole_[p * content_.channels + c]) : part.f_per_sr[c][node]);
        }
      }
      table.copy_node(table.index(p, j, 0), table.index(p, j, columns));
    }
    for (std::size_t i = 0; i <= columns; ++i) {
      table.copy_node(table.index(p, rows - 1, i), table.index(p, rows, i));
    }
  }
  table.close_cells();
  lookup_.table = std::move(table);
  lookup_.transmits = content_.type == ScatterType::kBtdf;
  lookup_.lowest_z = -kSameAngle;
  lookup_.row_per_rad = 1 / content_.theta_step;
  lookup_.column_per_rad = 1 / content_.phi_step;
  lookup_.last_row = static_cast<double>(rows - 1);
  lookup_.column_count = static_cast<double>(columns);
  lookup_.same_node = kSameNode;

  const auto together = [](const GridPart& a, const GridPart& b) {
    return b.theta_i - a.theta_i <= 2 * kSameAngle;
  };
  if (groups_.size() > 1 || std::ranges::adjacent_find(content_.parts, together) != content_.parts.end()) {
    return;
  }
  std::vector<double> theta_i;
  std::vector<double> column_offset;
  for (const GridPart& part : content_.parts) {
    theta_i.push_back(part.theta_i);
    column_offset.push_back(wrapped(part.phi_i) / content_.phi_step);
  }
  IncidenceAxis& axis = lookup_.incidences;
  axis.set(theta_i, column_offset);
  axis.same_angle = kSameAngle;
  axis.normal_cos_phi = std::cos(groups_.front().phi_i);
  axis.normal_sin_phi = std::sin(groups_.front().phi_i);
}

Direction GridBrdf::omega_i(std::size_t part) const noexcept {
  return from_spherical(content_.parts[part].theta_i, content_.parts[part].phi_i);
}

std::vector<Direction> GridBrdf::own_incidences() const {
  std::vector<Direction> out;
  for (std::size_t part = 0; part < content_.parts.size(); ++part) {
    out.push_back(omega_i(part));
  }
  return out;
}

Direction GridBrdf::omega_o(std::size_t node) const noexcept {
  const double theta = static_cast<double>(node / content_.phi_count) * content_.theta_step;
  const double phi = static_cast<double>(node % content_.phi_count) * content_.phi_step;
  Direction w = from_spherical(theta, phi);
  if (content_.type == ScatterType::kBtdf) {
    w.z = -w.z;
  }
  return w;
}

double GridBrdf::solid_angle_sr(std::size_t node) const noexcept {
  const double theta = static_cast<double>(node / content_.phi_count) * content_.theta_step;
  const double low = std::max(0.0, theta - content_.theta_step / 2);
  const double high = std::min(kPi / 2, theta + content_.theta_step / 2);
  // cos a - cos b as a product: no digits lost in the narrow cells at the pole.
  return content_.phi_step * 2 * std::sin((low + high) / 2) * std::sin((high - low) / 2);
}

void GridBrdf::add_tap(std::size_t part, std::size_t row, std::size_t column, double weight,
                       Blend& out) const noexcept {
  if (weight == 0) {
    return;
  }
  const std::size_t node = row * content_.phi_count + column;
  const Origin origin = row == 0 ? pole_origin_[part] : content_.parts[part].origin[node];
  out.origin = combined(out.origin, origin);
  out.taps[out.count++] = {static_cast<std::uint32_t>(part),
                           row == 0 ? kPole : static_cast<std::uint32_t>(node), weight};
}

void GridBrdf::blend_part(std::size_t part, const Direction& local_o, double weight,
                          Blend& out) const noexcept {
  const double last_row = static_cast<double>(content_.theta_count - 1);
  double row_position = theta_of(local_o) / content_.theta_step;
  if (row_position > last_row + kSameNode) {
    out.origin = combined(out.origin, Origin::kExtrapolated);
  }
  row_position = std::min(row_position, last_row);
  const double phi = wrapped(phi_of(local_o) + content_.parts[part].phi_i);
  auto [row, row_share] = split(row_position);
  auto [column, column_share] = split(phi / content_.phi_step);
  column %= content_.phi_count;
  const std::size_t next = (column + 1) % content_.phi_count;
  // Row 0 is one point: one tap stands for all its azimuths.
  if (row == 0) {
    add_tap(part, 0, 0, weight * (1 - row_share), out);
  } else {
    add_tap(part, row, column, weight * (1 - row_share) * (1 - column_share), out);
    add_tap(part, row, next, weight * (1 - row_share) * column_share, out);
  }
  add_tap(part, row + 1, column, weight * row_share * (1 - column_share), out);
  add_tap(part, row + 1, next, weight * row_share * column_share, out);
}

void GridBrdf::add_shares(const Group& group, double theta_i, double phi_i, double weight,
                          IncidenceShares& out) const noexcept {
  const std::vector<GridPart>& parts = content_.parts;
  const std::size_t end = group.first + group.count;
  const auto add = [&](std::size_t part, double turn, double share) {
    out.blocks[out.count++] = {static_cast<std::uint32_t>(part), std::cos(turn), std::sin(turn),
                               wrapped(parts[part].phi_i) / content_.phi_step, share};
  };
  std::size_t above = group.first;
  while (above < end && parts[above].theta_i < theta_i - kSameAngle) {
    ++above;
  }
  if (above < end && parts[above].theta_i <= theta_i + kSameAngle) {
    // Several azimuths at the same incidence: the nearest one answers.
    std::size_t best = above;
    for (std::size_t p = above + 1; p < end && parts[p].theta_i <= theta_i + kSameAngle; ++p) {
      if (std::cos(parts[p].phi_i - phi_i) > std::cos(parts[best].phi_i - phi_i) + kSameAngle) {
        best = p;
      }
    }
    add(best, 0, weight);
    return;
  }
  // Turning about the normal of the plane of incidence keeps the angles about the mirror direction.
  if (above == group.first || above == end) {
    const std::size_t nearest = above == end ? end - 1 : above;
    out.origin = combined(out.origin, Origin::kExtrapolated);
    add(nearest, parts[nearest].theta_i - theta_i, weight);
    return;
  }
  const std::size_t below = above - 1;
  const double share = (theta_i - parts[below].theta_i) / (parts[above].theta_i - parts[below].theta_i);
  out.origin = combined(out.origin, Origin::kInterpolated);
  add(below, parts[below].theta_i - theta_i, weight * (1 - share));
  add(above, parts[above].theta_i - theta_i, weight * share);
}

IncidenceShares GridBrdf::shares_of(const Direction& omega_i) const noexcept {
  IncidenceShares out;
  if (!(omega_i.z > 0)) {
    out.origin = Origin::kInvalid;
    return out;
  }
  const double sin_i = std::hypot(omega_i.x, omega_i.y);
  const double theta_i = std::atan2(sin_i, omega_i.z);
  // At normal incidence the light has no azimuth: the first group's own one is taken.
  const bool normal = sin_i < kSameAngle;
  const double phi_i = normal ? groups_.front().phi_i : phi_of(omega_i);
  out.cos_phi = normal ? std::cos(phi_i) : omega_i.x / sin_i;
  out.sin_phi = normal ? std::sin(phi_i) : omega_i.y / sin_i;
  if (groups_.size() == 1) {
    add_shares(groups_.front(), theta_i, phi_i, 1, out);
    return out;
  }
  std::size_t next = 0;
  while (next < groups_.size() && groups_[next].phi_i < phi_i - kSameAngle) {
    ++next;
  }
  const Group& after = groups_[next % groups_.size()];
  const Group& before = groups_[(next + groups_.size() - 1) % groups_.size()];
  const double to_after = wrapped(after.phi_i - phi_i + kSameAngle) - kSameAngle;
  const double from_before = wrapped(phi_i - before.phi_i);
  if (to_after < kSameAngle) {
    add_shares(after, theta_i, phi_i, 1, out);
  } else if (const double gap = to_after + from_before; gap > kWidestRotationGap) {
    out.origin = combined(out.origin, Origin::kExtrapolated);
    add_shares(to_after < from_before ? after : before, theta_i, phi_i, 1, out);
  } else {
    out.origin = combined(out.origin, Origin::kInterpolated);
    add_shares(before, theta_i, phi_i, to_after / gap, out);
    add_shares(after, theta_i, phi_i, from_before / gap, out);
  }
  return out;
}

GridBrdf::Blend GridBrdf::blend(const Direction& omega_i, const Direction& omega_o) const noexcept {
  const IncidenceShares shares = shares_of(omega_i);
  Blend out;
  out.origin = shares.origin;
  const double up = content_.type == ScatterType::kBrdf ? omega_o.z : -omega_o.z;
  if (shares.origin == Origin::kInvalid || !(up > -kSameAngle)) {
    out.origin = Origin::kInvalid;
    return out;
  }
  const Direction local{omega_o.x * shares.cos_phi + omega_o.y * shares.sin_phi,
                        omega_o.y * shares.cos_phi - omega_o.x * shares.sin_phi, up};
  for (const BlockShare& share : std::span(shares.blocks).first(shares.count)) {
    const double c = share.cos_turn;
    const double s = share.sin_turn;
    blend_part(share.block, {local.x * c - local.z * s, local.y, local.x * s + local.z * c}, share.weight,
               out);
  }
  return out;
}

bool GridBrdf::sum(const Blend& blend, Plane plane, std::span<double> out) const noexcept {
  std::ranges::fill(out, 0.0);
  if (blend.origin == Origin::kInvalid) {
    return false;
  }
  for (std::size_t k = 0; k < blend.count; ++k) {
    const Tap& tap = blend.taps[k];
    const GridPart& part = content_.parts[tap.part];
    const auto& planes = plane == Plane::kValue    ? part.f_per_sr
                         : plane == Plane::kRandom ? part.random_per_sr
                                                   : part.systematic_per_sr;
    const std::size_t pole =
        (static_cast<std::size_t>(plane) * content_.parts.size() + tap.part) * content_.channels;
    for (std::size_t c = 0; c < content_.channels; ++c) {
      out[c] += tap.weight * (tap.node == kPole ? pole_[pole + c] : static_cast<double>(planes[c][tap.node]));
    }
  }
  return true;
}

Origin GridBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                      std::span<double> f_per_sr) const noexcept {
  Origin origin = kAskScalar;
  if (lookup_.incidences.count != 0) {
    origin = look_up_one(lookup_, omega_i, omega_o, f_per_sr);
  }
  return origin == kAskScalar ? ask_scalar(omega_i, omega_o, f_per_sr) : origin;
}

Origin GridBrdf::ask_scalar(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept {
  const Blend found = blend(omega_i, omega_o);
  (void)sum(found, Plane::kValue, f_per_sr);
  return found.origin;
}

void GridBrdf::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                          std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const IncidenceShares shares = shares_of(omega_i);
  if (shares.origin == Origin::kInvalid) {
    std::ranges::fill(f_per_sr, 0.0);
    std::ranges::fill(origin, Origin::kInvalid);
    return;
  }
  in_chunks(
      omega_o.size(), channels(), f_per_sr, origin,
      [&](std::size_t first, std::span<double> f, std::span<Origin> from) {
        look_up(lookup_, shares, omega_o.subspan(first, from.size()), f, from);
      },
      [&](std::size_t k, std::span<double> f) { return ask_scalar(omega_i, omega_o[k], f); });
}

void GridBrdf::eval_pairs(std::span<const Direction> omega_i, std::span<const Direction> omega_o,
                          std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  if (lookup_.incidences.count == 0) {
    Brdf::eval_pairs(omega_i, omega_o, f_per_sr, origin);
    return;
  }
  in_chunks(
      omega_o.size(), channels(), f_per_sr, origin,
      [&](std::size_t first, std::span<double> f, std::span<Origin> from) {
        look_up_pairs(lookup_, omega_i.subspan(first, from.size()), omega_o.subspan(first, from.size()), f,
                      from);
      },
      [&](std::size_t k, std::span<double> f) { return ask_scalar(omega_i[k], omega_o[k], f); });
}

bool GridBrdf::uncertainty(const Direction& omega_i, const Direction& omega_o,
                           std::span<double> random_per_sr,
                           std::span<double> systematic_per_sr) const noexcept {
  const Blend found = blend(omega_i, omega_o);
  if (found.origin == Origin::kInvalid) {
    return false;
  }
  for (std::size_t k = 0; k < found.count; ++k) {
    const GridPart& part = content_.parts[found.taps[k].part];
    if (part.random_per_sr.empty() || part.systematic_per_sr.empty()) {
      return false;
    }
  }
  // Neighbouring bins share pixels, so their errors are taken as fully correlated.
  return sum(found, Plane::kRandom, random_per_sr) && sum(found, Plane::kSystematic, systematic_per_sr);
}

}  // namespace scatter::reflectance
