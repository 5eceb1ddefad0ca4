#include "host_sdk/formats/conversion_losses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host_sdk/formats/dirac_share.h"
#include "host_sdk/formats/exr_tile_layout.h"
#include "host_sdk/formats/grid_to_write.h"
#include "host_sdk/formats/open_brdf.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::Direction;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;

/// Directions stand off the nodes of grids of 1 deg, where interpolation shows.
constexpr std::size_t kThetas = 45;
constexpr std::size_t kPhis = 120;
constexpr std::size_t kMostIncidences = 12;
/// Below these shares two figures count as the same.
constexpr double kSameValue = 5e-4;
constexpr double kSymmetric = 1e-3;
constexpr float kSmallestNormalHalf = 6.1035e-5F;
constexpr double kLargestHalf = 65504;

std::string percent(double share) {
  return share >= 0.001 ? fmt::format("{:.1f} %", 100 * share) : fmt::format("{:.1g} %", 100 * share);
}

/// Incidences of a table that has values everywhere, whatever the data had.
std::vector<Direction> lights_everywhere() {
  std::vector<Direction> out;
  for (const double deg : {0.0, 20.0, 40.0, 60.0, 80.0}) {
    out.push_back(reflectance::from_spherical(radians(deg), 0));
  }
  return out;
}

/// Incidences to ask at: those of the data, thinned evenly.
std::vector<Direction> lights_of(const Brdf& brdf, const EncodeOptions& options) {
  const auto all = incidences_of(brdf, options);
  const std::size_t count = std::min(all.size(), kMostIncidences);
  std::vector<Direction> out;
  for (std::size_t k = 0; k < count; ++k) {
    const auto& chosen = all[count < 2 ? 0 : k * (all.size() - 1) / (count - 1)];
    out.push_back(reflectance::from_spherical(chosen.theta_i, chosen.phi_i));
  }
  return out;
}

Direction turned(const Direction& d, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {c * d.x - s * d.y, s * d.x + c * d.y, d.z};
}

/// Which channel of the file stands for each of the data.
std::vector<std::size_t> matching_channels(const Brdf& data, const Brdf& file) {
  std::vector<std::size_t> out;
  const auto wanted = data.wavelengths_nm();
  const auto found = file.wavelengths_nm();
  for (std::size_t c = 0; c < data.channels(); ++c) {
    if (file.channels() == data.channels() && !wanted.empty() && !found.empty()) {
      const auto nearest = std::ranges::min_element(
          found, {}, [&](float wavelength) { return std::abs(wavelength - wanted[c]); });
      // Two channels of one wavelength are told apart by their places.
      const auto at = static_cast<std::size_t>(nearest - found.begin());
      out.push_back(found[c] == wanted[c] ? c : at);
    } else {
      out.push_back(std::min(c, file.channels() - 1));
    }
  }
  return out;
}

/// The file against the data, direction by direction.
struct Difference {
  std::vector<std::pair<double, double>> errors;  ///< Relative error, solid angle.
  double values = 0;                              ///< Solid angle of all below, over the channels.
  double negative = 0;                            ///< Negative in the data, not in the file.
  double least = 0;                               ///< Of those.
  double small = 0;                               ///< Too small for a normal half.
  double most = 0;
  double directions = 0;  ///< Solid angle with a value in the data.
  double without = 0;     ///< Of it without a value in the file.
  double promoted = 0;    ///< Of it with an origin that is better in the file.
  bool file_has_values = false;
};

Difference difference(const Brdf& data, const Brdf& file, std::span<const Direction> lights) {
  Difference out;
  const double side = data.type() == reflectance::ScatterType::kBtdf ? -1 : 1;
  const auto channel = matching_channels(data, file);
  std::vector<Direction> omega_o(kPhis);
  std::vector<double> a(kPhis * file.channels());
  std::vector<double> b(kPhis * data.channels());
  std::vector<Origin> origin_a(kPhis);
  std::vector<Origin> origin_b(kPhis);
  for (const Direction& light : lights) {
    for (std::size_t t = 0; t < kThetas; ++t) {
      const double theta = (static_cast<double>(t) + 0.37) * kPi / 2 / kThetas;
      for (std::size_t p = 0; p < kPhis; ++p) {
        omega_o[p] = reflectance::from_spherical(theta, (static_cast<double>(p) + 0.41) * 2 * kPi / kPhis);
        omega_o[p].z *= side;
      }
      file.eval_batch(light, omega_o, a, origin_a);
      data.eval_batch(light, omega_o, b, origin_b);
      const double weight = std::sin(theta);
      for (std::size_t p = 0; p < kPhis; ++p) {
        const bool held = origin_a[p] != Origin::kInvalid;
        out.file_has_values = out.file_has_values || held;
        if (origin_b[p] == Origin::kInvalid) {
          continue;
        }
        out.directions += weight;
        out.without += held ? 0 : weight;
        out.promoted += held && origin_a[p] < origin_b[p] ? weight : 0;
        for (std::size_t c = 0; c < channel.size() && held; ++c) {
          const double found = a[p * file.channels() + channel[c]];
          const double wanted = b[p * data.channels() + c];
          out.values += weight;
          out.most = std::max(out.most, wanted);
          out.small += wanted != 0 && std::abs(wanted) < kSmallestNormalHalf ? weight : 0;
          if (wanted > 0 && origin_b[p] != Origin::kExtrapolated) {
            out.errors.emplace_back(std::abs(found - wanted) / wanted, weight);
          }
          if (wanted < 0 && found >= 0) {
            out.negative += weight;
            out.least = std::min(out.least, wanted);
          }
        }
      }
    }
  }
  return out;
}

/// Typical relative difference between f and what it should equal, by pairs of directions that
/// `partner` makes of a geometry; 0 where no pair has values.
template <typename Partner>
double asymmetry(const Brdf& brdf, std::span<const Direction> lights, const Partner& partner) {
  const double side = brdf.type() == reflectance::ScatterType::kBtdf ? -1 : 1;
  std::vector<double> a(brdf.channels());
  std::vector<double> b(brdf.channels());
  std::vector<double> found;
  for (const Direction& light : lights) {
    for (double theta = 10; theta < 75; theta += 10) {
      for (double phi = 0; phi < 360; phi += 15) {
        Direction omega_o = reflectance::from_spherical(radians(theta), radians(phi));
        omega_o.z *= side;
        const auto [other_i, other_o] = partner(light, omega_o);
        if (brdf.eval(light, omega_o, a) == Origin::kInvalid ||
            brdf.eval(other_i, other_o, b) == Origin::kInvalid) {
          continue;
        }
        for (std::size_t c = 0; c < a.size(); ++c) {
          const double mean = (std::abs(a[c]) + std::abs(b[c])) / 2;
          found.push_back(mean > 0 ? std::abs(a[c] - b[c]) / mean : 0);
        }
      }
    }
  }
  if (found.empty()) {
    return 0;
  }
  const auto middle = found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2);
  std::ranges::nth_element(found, middle);
  return *middle;
}

/// f(o, i) with its light at the azimuth of this one, where data of one rotation have it.
double irreciprocity(const Brdf& brdf, std::span<const Direction> lights) {
  return asymmetry(brdf, lights, [](const Direction& omega_i, const Direction& omega_o) {
    const double angle = std::atan2(omega_i.y, omega_i.x) - std::atan2(omega_o.y, omega_o.x);
    return std::pair(turned(omega_o, angle), turned(omega_i, angle));
  });
}

double anisotropy(const Brdf& brdf, std::span<const Direction> lights) {
  return asymmetry(brdf, lights, [](const Direction& omega_i, const Direction& omega_o) {
    return std::pair(turned(omega_i, radians(60)), turned(omega_o, radians(60)));
  });
}

bool knows_uncertainty(const Brdf& brdf, std::span<const Direction> lights) {
  std::vector<double> random(brdf.channels());
  std::vector<double> systematic(brdf.channels());
  const double side = brdf.type() == reflectance::ScatterType::kBtdf ? -1 : 1;
  return std::ranges::any_of(lights, [&](const Direction& light) {
    return brdf.uncertainty(light, {-light.x, -light.y, side * light.z}, random, systematic) ||
           brdf.uncertainty(light, {0, 0, side}, random, systematic);
  });
}

std::string channel_names(const Brdf& brdf, const std::vector<std::size_t>& channels) {
  const auto wavelengths = brdf.wavelengths_nm();
  std::vector<std::string> names;
  for (const std::size_t c : channels) {
    names.push_back(wavelengths.empty() ? fmt::format("{}", c) : fmt::format("{:g}", wavelengths[c]));
  }
  return fmt::format("{}{}", fmt::join(names, ", "), wavelengths.empty() ? "" : " nm");
}

class Clauses {
 public:
  void add(std::string clause) { clauses_.push_back(std::move(clause)); }
  [[nodiscard]] std::vector<std::string> take() && { return std::move(clauses_); }

  void dirac(const Brdf& source, std::span<const Direction> lights) {
    if (const auto share = dirac_share(source, lights)) {
      const std::string albedo = share->most - share->least < 5e-5
                                     ? fmt::format("{:.4f}", share->most)
                                     : fmt::format("{:.4f} to {:.4f}", share->least, share->most);
      add(fmt::format("the share of light that leaves in exactly one direction (Dirac, albedo {})", albedo));
    }
  }

  void channels(const Brdf& brdf, const std::vector<std::size_t>& kept) {
    std::vector<std::size_t> dropped;
    for (std::size_t c = 0; c < brdf.channels(); ++c) {
      if (std::ranges::find(kept, c) == kept.end()) {
        dropped.push_back(c);
      }
    }
    if (!dropped.empty()) {
      std::string text =
          fmt::format("{} of {} channels: {} dropped, {} kept", dropped.size(), brdf.channels(),
                      channel_names(brdf, dropped), channel_names(brdf, kept));
      if (kept.size() > brdf.channels() - dropped.size()) {
        text += " (one of them for several colours)";
      }
      add(std::move(text));
    }
  }

  void values(Difference& found, const Writer& writer, const EncodeOptions& options) {
    if (!found.file_has_values) {
      add("all values: no direction of the file has one");
      return;
    }
    if (found.without > kSameValue * found.directions) {
      add(fmt::format("values in {} of the directions", percent(found.without / found.directions)));
    }
    error_of(found);
    if (found.negative > 0) {
      add(fmt::format("negative values ({} of all, down to {:.3g} 1/sr), which become 0",
                      percent(found.negative / found.values), found.least));
    }
    if (writer.format == Format::kExrTiles && options.half_precision) {
      std::string text = "digits beyond the third (half floats)";
      if (found.small > 0) {
        text += fmt::format("; values below 6.1e-5 1/sr ({} of all) keep fewer, --float keeps them",
                            percent(found.small / found.values));
      }
      if (found.most > kLargestHalf) {
        text += fmt::format("; values above {} 1/sr (up to {:.4g}) are cut, --float keeps them", kLargestHalf,
                            found.most);
      }
      add(std::move(text));
    }
  }

  void origins(const Difference& found) {
    if (found.promoted > kSameValue * found.directions) {
      add(
          fmt::format("origins: {} of the directions are interpolated or extrapolated, which the file does "
                      "not tell",
                      percent(found.promoted / found.directions)));
    }
  }

  void metadata(const Metadata& given, const Metadata& held) {
    std::vector<std::string> lost;
    for (const auto& [key, value] : given) {
      if (!held.contains(key)) {
        lost.push_back(key);
      }
    }
    if (!lost.empty()) {
      constexpr std::size_t kShown = 5;
      const std::size_t shown = std::min(lost.size(), kShown);
      add(fmt::format("metadata: {} of {} keys ({}{})", lost.size(), given.size(),
                      fmt::join(lost.begin(), lost.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
                      shown < lost.size() ? ", ..." : ""));
    }
  }

 private:
  /// Quantiles: a mean of relative errors would be that of the darkest values.
  void error_of(Difference& found) {
    std::ranges::sort(found.errors);
    double total = 0;
    for (const auto& [error, weight] : found.errors) {
      total += weight;
    }
    double below = 0;
    double median = 0;
    double p95 = 0;
    for (const auto& [error, weight] : found.errors) {
      median = below < 0.5 * total ? error : median;
      p95 = below < 0.95 * total ? error : p95;
      below += weight;
    }
    if (p95 > kSameValue) {
      add(fmt::format("detail between the nodes: error {} (median), 95 % of the values within {}",
                      percent(median), percent(p95)));
    }
  }

  std::vector<std::string> clauses_;
};

}  // namespace

Result<std::vector<std::string>> conversion_losses(const Brdf& source, const Brdf& written,
                                                   const Writer& writer, const EncodeOptions& options,
                                                   std::string_view bytes) {
  const auto file = decode_brdf(bytes, "the file written");
  if (!file) {
    return std::unexpected(file.error());
  }
  const auto kept = channels_to_write(written, writer, options);
  if (!kept) {
    return std::unexpected(kept.error());
  }
  const auto some = only_channels(written, *kept);
  if (!some) {
    return std::unexpected(some.error());
  }
  EncodeOptions asked = options;
  if (writer.format == Format::kExrTiles && asked.theta_i.empty() &&
      own_incidences(written).theta_i.empty()) {
    asked.theta_i = {0, radians(20), radians(40), radians(60)};  // Those of encode_exr_tiles.
  }
  const std::vector<Direction> lights = lights_of(written, asked);
  Clauses clauses;
  clauses.dirac(source, lights);
  clauses.channels(written, *kept);
  Difference found = difference(**some, **file, lights);
  clauses.values(found, writer, options);
  const bool everywhere = writer.format == Format::kMerl || writer.format == Format::kRgl;
  clauses.origins(everywhere ? difference(**some, **file, lights_everywhere()) : found);
  if (writer.digits > 0) {
    // Tristimulus values have more digits, so that the colours come back (zemax.h).
    const bool tristimulus = writer.format == Format::kZemax && kept->size() == 3 && !options.rgb_sections;
    const int usual = tristimulus ? 7 : writer.digits;
    clauses.add(fmt::format("digits beyond number {}", options.digits > 0 ? options.digits : usual));
  }
  if (const double differs = anisotropy(**some, lights);
      differs > kSymmetric && anisotropy(**file, lights) < differs / 10) {
    clauses.add(fmt::format("anisotropy: turned by 60 deg the data differ by {} (median), the file does not",
                            percent(differs)));
  }
  if (writer.format == Format::kMerl) {
    if (const double differs = irreciprocity(**some, lights); differs > kSymmetric) {
      clauses.add(
          fmt::format("the order of light and detector: exchanged directions differ by {} (median), "
                      "the file has one value for both (reciprocity)",
                      percent(differs)));
    }
  }
  if (knows_uncertainty(**some, lights)) {
    if (!knows_uncertainty(**file, lights)) {
      clauses.add("uncertainty");
    } else if (writer.format == Format::kExrTiles) {
      clauses.add("random and systematic uncertainty, which become one");
    }
  }
  if ((*file)->wavelengths_nm().empty() && !(*some)->wavelengths_nm().empty()) {
    clauses.add(fmt::format("wavelengths ({})", channel_names(written, *kept)));
  }
  clauses.metadata(metadata_of(written, options), metadata_of(**file, {}));
  return std::move(clauses).take();
}

}  // namespace scatter::formats
