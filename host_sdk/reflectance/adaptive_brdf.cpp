#include "host_sdk/reflectance/adaptive_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace scatter::reflectance {
namespace {

/// The tables hold f cos(theta_o), so that f cannot be told from them where the cosine is smaller.
constexpr double kHorizon = 1e-6;

/// Two angles of the tables closer than this are the same [rad]; they are floats.
constexpr double kSameAngle = 1e-6;
/// How far the covered azimuths may miss a whole, half or quarter turn [rad].
constexpr double kSameTurn = 1e-3;
/// Least density of half vectors per square radian that a pdf is divided by: at the pole it is 0.
constexpr double kLeastJacobian = 1e-6;

std::unexpected<Error> bad(const std::string& what) {
  return fail(ErrorCode::kInvalidArgument, what, "export the material again");
}

/// Without branches, and with nothing but equality, order and bits, so that the compiler can look
/// at many at once on any machine: NaN and infinity have all exponent bits set.
bool all_finite(std::span<const float> values) noexcept {
  constexpr std::uint32_t kExponent = 0x7F800000U;
  std::uint32_t bad = 0;
  for (const float value : values) {
    bad |= (std::bit_cast<std::uint32_t>(value) & kExponent) == kExponent ? 1U : 0U;
  }
  return bad == 0;
}

bool all_positive(std::span<const float> values) noexcept {
  std::uint32_t bad = 0;
  for (const float value : values) {
    bad |= value < 0 ? 1U : 0U;
  }
  return bad == 0;
}

Status check_axis(std::string_view name, std::span<const float> axis, double low, double high) {
  if (axis.empty()) {
    return bad(fmt::format("{} has no values", name));
  }
  for (std::size_t k = 0; k < axis.size(); ++k) {
    const auto value = static_cast<double>(axis[k]);
    if (!(value >= low - kSameTurn && value <= high + kSameTurn)) {
      return bad(fmt::format("{}[{}] is {}, expected {:.4f} to {:.4f}", name, k, value, low, high));
    }
    if (k > 0 && !(axis[k] > axis[k - 1])) {
      return bad(
          fmt::format("{}[{}] is {} after {}, expected ascending values", name, k, value, axis[k - 1]));
    }
  }
  return {};
}

Status check_size(std::string_view name, const BilinearTables& tables, std::size_t count) {
  if (tables.width < 2 || tables.height < 2 || tables.values.size() / tables.width / tables.height != count ||
      tables.values.size() != count * tables.size()) {
    return bad(fmt::format("{}: {} values for {} tables of {} x {}, at least 2 x 2", name,
                           tables.values.size(), count, tables.width, tables.height));
  }
  return {};
}

Status check_tables(std::string_view name, const BilinearTables& tables, std::size_t count,
                    bool may_be_negative) {
  if (Status status = check_size(name, tables, count); !status) {
    return status;
  }
  const std::span<const float> values(tables.values.data(), tables.values.size());
  if (!all_finite(values) || (!may_be_negative && !all_positive(values))) {
    const auto at = std::ranges::find_if(
        values, [&](float v) { return !std::isfinite(v) || (!may_be_negative && v < 0); });
    return bad(fmt::format("{}: value {} is {}, expected a finite number{}", name, at - values.begin(), *at,
                           may_be_negative ? "" : " of at least 0"));
  }
  return {};
}

/// The check of the values comes with the sums of the warp.
Result<BilinearWarp> warp_of(std::string_view name, BilinearTables tables) {
  auto warp = BilinearWarp::make(std::move(tables));
  if (!warp) {
    warp.error().what = fmt::format("{}: {}", name, warp.error().what);
  }
  return warp;
}

/// How often the covered azimuths go into a turn; 0: not 1, 2 or 4 times, or from a wrong start.
int reduction_of(std::span<const float> phi_i) {
  const double first = static_cast<double>(phi_i.front());
  const double covered = static_cast<double>(phi_i.back()) - first;
  for (const int times : {1, 2, 4}) {
    if (std::abs(covered - 2 * kPi / times) < kSameTurn) {
      return times == 1 || std::abs(first + kPi) < kSameTurn ? times : 0;
    }
  }
  return 0;
}

/// Neighbours on an axis and the share of the upper one; the value is clamped to the axis.
struct Bracket {
  std::size_t below = 0;
  std::size_t above = 0;
  double share = 0;
  Origin origin = Origin::kMeasured;
};

Bracket bracket(std::span<const float> axis, double value) noexcept {
  const std::size_t last = axis.size() - 1;
  const auto at = [&](std::size_t k) { return static_cast<double>(axis[k]); };
  if (value <= at(0) || last == 0) {
    return {0, 0, 0, std::abs(value - at(0)) < kSameAngle ? Origin::kMeasured : Origin::kExtrapolated};
  }
  if (value >= at(last)) {
    return {last, last, 0, value - at(last) < kSameAngle ? Origin::kMeasured : Origin::kExtrapolated};
  }
  const auto above = static_cast<std::size_t>(
      std::ranges::upper_bound(axis, value, {}, [](float v) { return static_cast<double>(v); }) -
      axis.begin());
  const double share = (value - at(above - 1)) / (at(above) - at(above - 1));
  const bool on_node = value - at(above - 1) < kSameAngle || at(above) - value < kSameAngle;
  return {above - 1, above, share, on_node ? Origin::kMeasured : Origin::kInterpolated};
}

/// Rounding in other programs leaves luminances a little below 0.
BilinearTables without_negatives(const BilinearTables& tables) {
  if (all_positive({tables.values.data(), tables.values.size()})) {
    return tables;
  }
  std::vector<float> values(tables.values.begin(), tables.values.end());
  for (float& value : values) {
    value = std::max(value, 0.0F);
  }
  return {tables.width, tables.height, std::move(values)};
}

double turn_into_square(double phi) noexcept {
  const double y = (phi + kPi) / (2 * kPi);
  return y - std::floor(y);
}

}  // namespace

Result<AdaptiveBrdf> AdaptiveBrdf::make(Content content) {
  const std::size_t slices = content.phi_i.size() * content.theta_i.size();
  if (content.channels == 0 || content.channels > 100'000 ||
      (!content.wavelengths_nm.empty() && content.wavelengths_nm.size() != content.channels)) {
    return bad(
        fmt::format("{} wavelengths for {} channels", content.wavelengths_nm.size(), content.channels));
  }
  for (const Status& status :
       {check_axis("phi_i", content.phi_i, -2 * kPi, 2 * kPi),
        check_axis("theta_i", content.theta_i, 0, kPi / 2), check_tables("ndf", content.ndf, 1, false),
        check_tables("sigma", content.sigma, 1, false), check_size("vndf", content.vndf, slices),
        check_tables("luminance", content.luminance, slices, true),
        check_tables("spectra", content.spectra, slices * content.channels, true)}) {
    if (!status) {
      return std::unexpected(status.error());
    }
  }
  if (content.luminance.width != content.spectra.width ||
      content.luminance.height != content.spectra.height ||
      (!content.valid.empty() && content.valid.size() != content.luminance.values.size())) {
    return bad(
        fmt::format("spectra are {} x {}, luminance {} x {} with {} marks of validity, expected the same",
                    content.spectra.width, content.spectra.height, content.luminance.width,
                    content.luminance.height, content.valid.size()));
  }
  if (content.phi_i.size() > 2 && reduction_of(content.phi_i) == 0) {
    return bad(
        fmt::format("phi_i covers {:.4f} to {:.4f}, expected a turn, or from -pi half or a quarter of one",
                    content.phi_i.front(), content.phi_i.back()));
  }
  auto vndf = warp_of("vndf", std::exchange(content.vndf, {}));
  auto luminance = warp_of("luminance", without_negatives(content.luminance));
  if (!vndf || !luminance) {
    return std::unexpected(!vndf ? vndf.error() : luminance.error());
  }
  return AdaptiveBrdf(std::move(content), std::move(*vndf), std::move(*luminance));
}

AdaptiveBrdf::AdaptiveBrdf(Content content, BilinearWarp vndf, BilinearWarp luminance)
    : content_(std::move(content)),
      vndf_(std::move(vndf)),
      luminance_(std::move(luminance)),
      reduction_(content_.phi_i.size() > 2 ? reduction_of(content_.phi_i) : 1) {}

AdaptiveBrdf::Incidence AdaptiveBrdf::incidence(const Direction& omega_i) const noexcept {
  Incidence out;
  out.omega_i = omega_i;
  if (reduction_ >= 2) {
    // Into azimuths below 0: by half a turn, or by mirroring x and y each by itself.
    out.mirror_y = omega_i.y >= 0 ? -1 : 1;
    out.mirror_x = reduction_ == 2 ? out.mirror_y : (omega_i.x >= 0 ? -1.0 : 1.0);
    out.omega_i.x *= out.mirror_x;
    out.omega_i.y *= out.mirror_y;
  }
  const double theta = theta_of(out.omega_i);
  out.phi_i = std::atan2(out.omega_i.y, out.omega_i.x);
  double wanted = out.phi_i;
  if (!isotropic() && wanted < static_cast<double>(content_.phi_i.front()) - kSameAngle) {
    wanted += 2 * kPi;
  }
  const Bracket in_theta = bracket(content_.theta_i, theta);
  const Bracket in_phi = bracket(content_.phi_i, wanted);
  out.origin = isotropic() ? in_theta.origin : combined(in_theta.origin, in_phi.origin);
  for (const auto& [phi, phi_weight] :
       {std::pair(in_phi.below, 1 - in_phi.share), std::pair(in_phi.above, in_phi.share)}) {
    for (const auto& [row, weight] :
         {std::pair(in_theta.below, 1 - in_theta.share), std::pair(in_theta.above, in_theta.share)}) {
      if (phi_weight * weight > 0) {
        out.mix.table[out.mix.count] = phi * content_.theta_i.size() + row;
        out.mix.weight[out.mix.count++] = phi_weight * weight;
      }
    }
  }
  const SquarePoint u{std::sqrt(theta / (kPi / 2)), turn_into_square(out.phi_i)};
  const BilinearTables& sigma = content_.sigma;
  out.sigma = bilinear(sigma.values.data(), sigma.width, cell_at(sigma.width, sigma.height, u));
  return out;
}

SquarePoint AdaptiveBrdf::square_point(const Incidence& incidence, const Direction& m) const noexcept {
  const double phi = std::atan2(m.y, m.x) - (isotropic() ? incidence.phi_i : 0);
  return {std::sqrt(theta_of(m) / (kPi / 2)), turn_into_square(phi)};
}

Origin AdaptiveBrdf::eval_at(const Incidence& incidence, const Direction& omega_o,
                             double* f_per_sr) const noexcept {
  const std::size_t channels = content_.channels;
  if (!(incidence.omega_i.z > 0 && omega_o.z > kHorizon) || !(incidence.sigma > 0)) {
    std::fill_n(f_per_sr, channels, 0.0);
    return Origin::kInvalid;
  }
  const Direction& i = incidence.omega_i;
  const Direction m = normalized(
      {i.x + incidence.mirror_x * omega_o.x, i.y + incidence.mirror_y * omega_o.y, i.z + omega_o.z});
  const SquarePoint u = square_point(incidence, m);
  const BilinearTables& spectra = content_.spectra;
  const BilinearCell cell = cell_at(spectra.width, spectra.height, vndf_.invert(u, incidence.mix));
  double factor = 1 / omega_o.z;
  if (content_.jacobian) {
    const BilinearTables& ndf = content_.ndf;
    factor *=
        bilinear(ndf.values.data(), ndf.width, cell_at(ndf.width, ndf.height, u)) / (4 * incidence.sigma);
  }
  Origin origin = incidence.origin;
  for (std::size_t c = 0; c < channels; ++c) {
    double sum = 0;
    for (std::size_t k = 0; k < incidence.mix.count; ++k) {
      const float* table = spectra.values.data() + (incidence.mix.table[k] * channels + c) * spectra.size();
      sum += incidence.mix.weight[k] * bilinear(table, spectra.width, cell);
    }
    f_per_sr[c] = std::max(0.0, sum * factor);
  }
  for (std::size_t k = 0; k < incidence.mix.count && !content_.valid.empty(); ++k) {
    const std::uint8_t* valid = content_.valid.data() + incidence.mix.table[k] * spectra.size() + cell.node;
    const bool all =
        valid[0] != 0 && valid[1] != 0 && valid[spectra.width] != 0 && valid[spectra.width + 1] != 0;
    origin = all ? origin : Origin::kExtrapolated;
  }
  return origin;
}

Origin AdaptiveBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                          std::span<double> f_per_sr) const noexcept {
  return eval_at(incidence(omega_i), omega_o, f_per_sr.data());
}

void AdaptiveBrdf::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                              std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const Incidence common = incidence(omega_i);
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    const Origin o = eval_at(common, omega_o[k], f_per_sr.data() + k * content_.channels);
    if (!origin.empty()) {
      origin[k] = o;
    }
  }
}

double AdaptiveBrdf::pdf(const Direction& omega_i, const Direction& omega_o) const noexcept {
  const Incidence here = incidence(omega_i);
  if (!(here.omega_i.z > 0 && omega_o.z > 0)) {
    return 0;
  }
  const Direction m = normalized({here.omega_i.x + here.mirror_x * omega_o.x,
                                  here.omega_i.y + here.mirror_y * omega_o.y, here.omega_i.z + omega_o.z});
  const SquarePoint u = square_point(here, m);
  const double density = vndf_.density(u, here.mix) * luminance_.density(vndf_.invert(u, here.mix), here.mix);
  // Solid angle of m per area of the square: dtheta/dx = pi x, dphi/dy = 2 pi.
  const double jacobian = std::max(2 * kPi * kPi * u.x * std::hypot(m.x, m.y), kLeastJacobian);
  return density / (jacobian * 4 * dot(here.omega_i, m));
}

Direction AdaptiveBrdf::sample(const Direction& omega_i, const SquarePoint& uniform) const noexcept {
  const Incidence here = incidence(omega_i);
  const SquarePoint u = vndf_.sample(luminance_.sample(uniform, here.mix), here.mix);
  const double phi = (2 * u.y - 1) * kPi + (isotropic() ? here.phi_i : 0);
  const Direction m = from_spherical(u.x * u.x * kPi / 2, phi);
  const double twice = 2 * dot(here.omega_i, m);
  return {here.mirror_x * (twice * m.x - here.omega_i.x), here.mirror_y * (twice * m.y - here.omega_i.y),
          twice * m.z - here.omega_i.z};
}

std::vector<Direction> AdaptiveBrdf::own_incidences() const {
  std::vector<double> azimuths{0};
  if (!isotropic()) {
    azimuths.assign(content_.phi_i.begin(), content_.phi_i.end());
    if (azimuths.back() - azimuths.front() > 2 * kPi - kSameTurn) {
      azimuths.pop_back();
    }
  }
  std::vector<Direction> out;
  for (const double phi : azimuths) {
    for (const float theta : content_.theta_i) {
      // All azimuths of light along the normal are one, and light along the surface does not arrive.
      if ((theta > 0 || phi == azimuths.front()) && std::cos(theta) > kHorizon) {
        out.push_back(from_spherical(theta, phi));
      }
    }
  }
  return out;
}

}  // namespace scatter::reflectance
