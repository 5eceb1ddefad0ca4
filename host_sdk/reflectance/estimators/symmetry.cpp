#include "host_sdk/reflectance/estimators/symmetry.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

namespace scatter::reflectance {
namespace {

/// As GridBrdf: nearer to a node than this share of a step is that node.
constexpr double kSameNode = 1e-6;

/// The mirror image of a column: two columns and the share of the second.
struct Image {
  std::size_t first = 0;
  std::size_t second = 0;
  double share = 0;
};

Image image_of(std::size_t column, double phi_i, const GridBrdf::Content& content) {
  const double count = static_cast<double>(content.phi_count);
  double position = 2 * phi_i / content.phi_step - static_cast<double>(column);
  position = std::fmod(position, count);
  position = position < 0 ? position + count : position;
  const double nearest = std::round(position);
  if (std::abs(position - nearest) < kSameNode) {
    const auto only = static_cast<std::size_t>(nearest) % content.phi_count;
    return {only, only, 0};
  }
  const auto first = static_cast<std::size_t>(position) % content.phi_count;
  return {first, (first + 1) % content.phi_count, position - std::floor(position)};
}

double at_image(const std::vector<float>& plane, std::size_t row, const Image& image) {
  const double first = static_cast<double>(plane[row + image.first]);
  return image.share == 0
             ? first
             : first * (1 - image.share) + static_cast<double>(plane[row + image.second]) * image.share;
}

Origin origin_at(const std::vector<Origin>& origin, std::size_t row, const Image& image) {
  return image.share == 0 ? origin[row + image.first]
                          : combined(origin[row + image.first], origin[row + image.second]);
}

/// Puts a into node n of a plane set, if there is one.
void set(std::vector<std::vector<float>>& planes, std::size_t channel, std::size_t node, double value) {
  planes[channel][node] = static_cast<float>(value);
}

}  // namespace

Result<AveragedGrid> average_mirror_halves(const GridBrdf& grid) {
  GridBrdf::Content content = grid.content();
  std::size_t averaged = 0;
  std::size_t filled = 0;
  for (GridPart& part : content.parts) {
    const GridPart before = part;
    for (std::size_t n = 0; n < part.origin.size(); ++n) {
      const std::size_t row = n / content.phi_count * content.phi_count;
      const Image image = image_of(n - row, part.phi_i, content);
      const Origin theirs = origin_at(before.origin, row, image);
      if (theirs == Origin::kInvalid || (image.share == 0 && row + image.first == n)) {
        continue;
      }
      const bool alone = before.origin[n] == Origin::kInvalid;
      (alone ? filled : averaged) += 1;
      part.origin[n] = alone ? combined(theirs, Origin::kInterpolated) : combined(theirs, before.origin[n]);
      const double own = alone ? 0 : 0.5;
      for (std::size_t c = 0; c < content.channels; ++c) {
        // A node without a value may hold NaN, which no weight of 0 takes away.
        const auto mine = [&](const auto& planes) { return alone ? 0.0 : static_cast<double>(planes[c][n]); };
        set(part.f_per_sr, c, n,
            own * mine(before.f_per_sr) + (1 - own) * at_image(before.f_per_sr[c], row, image));
        if (!before.random_per_sr.empty()) {
          set(part.random_per_sr, c, n,
              std::hypot(own * mine(before.random_per_sr),
                         (1 - own) * at_image(before.random_per_sr[c], row, image)));
        }
        if (!before.systematic_per_sr.empty()) {
          set(part.systematic_per_sr, c, n,
              own * mine(before.systematic_per_sr) +
                  (1 - own) * at_image(before.systematic_per_sr[c], row, image));
        }
      }
      if (!before.pixels.empty()) {
        part.pixels[n] = static_cast<float>((alone ? 0.0 : static_cast<double>(before.pixels[n])) +
                                            at_image(before.pixels, row, image));
      }
    }
  }
  content.metadata["mirror_symmetry"] =
      fmt::format("halves about the plane of incidence averaged ({} nodes, {} filled)", averaged, filled);
  Result<GridBrdf> made = GridBrdf::make(std::move(content));
  if (!made) {
    return std::unexpected(made.error());
  }
  return AveragedGrid{std::move(*made), averaged, filled};
}

Result<AveragedGrid> average_reciprocal(const GridBrdf& grid, const Brdf& estimator) {
  if (grid.type() != ScatterType::kBrdf || estimator.type() != ScatterType::kBrdf) {
    return fail(ErrorCode::kInvalidArgument, "reciprocity: the data is a BTDF, expected a BRDF",
                "measure transmission from both sides instead");
  }
  if (estimator.channels() != grid.channels()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("reciprocity: the estimator has {} channels, expected {}", estimator.channels(),
                            grid.channels()),
                "make the estimator from the same data");
  }
  GridBrdf::Content content = grid.content();
  const std::size_t channels = content.channels;
  std::size_t averaged = 0;
  for (std::size_t p = 0; p < content.parts.size(); ++p) {
    GridPart& part = content.parts[p];
    const std::size_t nodes = part.origin.size();
    const Direction omega_i = grid.omega_i(p);
    std::vector<Direction> from(nodes);
    const std::vector<Direction> to(nodes, omega_i);
    for (std::size_t n = 0; n < nodes; ++n) {
      from[n] = grid.omega_o(n);
    }
    std::vector<double> reversed(nodes * channels);
    std::vector<Origin> origin(nodes);
    estimator.eval_pairs(from, to, reversed, origin);
    std::vector<double> random(channels);
    std::vector<double> systematic(channels);
    const bool knows = !part.random_per_sr.empty() && !part.systematic_per_sr.empty();
    for (std::size_t n = 0; n < nodes; ++n) {
      const bool usable = origin[n] == Origin::kMeasured || origin[n] == Origin::kInterpolated;
      // Straight back the pair is its own reverse.
      if (!usable || part.origin[n] == Origin::kInvalid || angle_between(from[n], omega_i) < kSameNode) {
        continue;
      }
      const bool both = knows && estimator.uncertainty(from[n], omega_i, random, systematic);
      averaged += 1;
      part.origin[n] = combined(part.origin[n], origin[n]);
      for (std::size_t c = 0; c < channels; ++c) {
        double own = 0.5;
        if (both) {
          const double mine = std::hypot(part.random_per_sr[c][n], part.systematic_per_sr[c][n]);
          const double theirs = std::hypot(random[c], systematic[c]);
          const double total = mine * mine + theirs * theirs;
          own = total > 0 ? theirs * theirs / total : 0.5;
        }
        set(part.f_per_sr, c, n,
            own * static_cast<double>(part.f_per_sr[c][n]) + (1 - own) * reversed[n * channels + c]);
        if (both) {
          set(part.random_per_sr, c, n,
              std::hypot(own * static_cast<double>(part.random_per_sr[c][n]), (1 - own) * random[c]));
          set(part.systematic_per_sr, c, n,
              own * static_cast<double>(part.systematic_per_sr[c][n]) + (1 - own) * systematic[c]);
        }
      }
    }
  }
  content.metadata["reciprocity"] = fmt::format("averaged with exchanged directions ({} nodes)", averaged);
  Result<GridBrdf> made = GridBrdf::make(std::move(content));
  if (!made) {
    return std::unexpected(made.error());
  }
  return AveragedGrid{std::move(*made), averaged, 0};
}

}  // namespace scatter::reflectance
