// Interpolation in grids from direction vectors, three channels, random pairs. The peer looks one node's
// three values up at precomputed random places of the same grid and does no more, in two ways: one lookup
// after the other (each place waits for the last value, as a renderer's next ray waits for its last), and
// figures that end in .overlapped: all at once, as fast as the memory answers. `single` calls wait for each
// other too.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <random>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tests/bench/bench.h"

namespace scatter::bench {
namespace {

using reflectance::Direction;
using reflectance::from_spherical;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;
using reflectance::SpecularGridBrdf;

constexpr std::size_t kPairs = 1'000'000;
/// One call goes on with the next piece, so that rounds of fast and slow ways last equally long.
constexpr std::size_t kPiece = 20'000;
constexpr std::size_t kColumns = 360;

float lobe(std::size_t k) {
  return 0.1F + 0.001F * static_cast<float>(k % 977);
}

GridBrdf grid_of(std::size_t incidences, double step_deg, std::size_t rows) {
  GridBrdf::Content content;
  content.theta_count = rows;
  for (std::size_t p = 0; p < incidences; ++p) {
    GridPart& part = content.parts.emplace_back();
    part.theta_i = radians(step_deg * static_cast<double>(p));
    part.origin.assign(rows * kColumns, Origin::kMeasured);
    for (std::size_t c = 0; c < content.channels; ++c) {
      auto& plane = part.f_per_sr.emplace_back();
      for (std::size_t n = 0; n < rows * kColumns; ++n) {
        plane.push_back(lobe(n + c + p));
      }
    }
  }
  return GridBrdf::make(std::move(content)).value();
}

SpecularGridBrdf specular_grid_of(std::size_t incidences, double step_deg, std::size_t radials) {
  SpecularGridBrdf::Content content;
  content.rotation = {0};
  for (std::size_t p = 0; p < incidences; ++p) {
    content.theta_i.push_back(radians(step_deg * static_cast<double>(p)));
  }
  for (std::size_t k = 0; k < kColumns; ++k) {
    content.azimuth.push_back(radians(static_cast<double>(k)));
  }
  for (std::size_t k = 0; k < radials; ++k) {
    content.radial.push_back(radians(static_cast<double>(k)));
  }
  for (std::size_t c = 0; c < 3; ++c) {
    auto& plane = content.f_per_sr.emplace_back();
    for (std::size_t n = 0; n < incidences * kColumns * radials; ++n) {
      plane.push_back(lobe(n + c));
    }
  }
  return SpecularGridBrdf::make(std::move(content)).value();
}

/// Uniform on the sphere between the normal and the last incidence or row.
struct Pairs {
  std::vector<Direction> omega_i;
  std::vector<Direction> omega_o;

  explicit Pairs(double last_i_deg) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> unit(0, 1);
    for (std::size_t k = 0; k < kPairs; ++k) {
      omega_i.push_back(from_spherical(radians(last_i_deg) * unit(random), 2 * kPi * unit(random)));
      omega_o.push_back(
          from_spherical(std::acos(1 - unit(random) * (1 - std::cos(radians(75)))), 2 * kPi * unit(random)));
    }
  }
};

/// One block of planes[channel][node] per incidence.
using Block = std::vector<std::vector<float>>;

/// Figures of one grid; blocks are those in which it holds its values.
std::vector<Figure> figures_of(const std::string& name, const std::string& set, const reflectance::Brdf& brdf,
                               const std::vector<const Block*>& blocks, double last_i_deg) {
  const Pairs pairs(last_i_deg);
  std::vector<double> f(3 * kPairs);
  std::vector<Origin> origin(kPairs);
  const std::size_t nodes = blocks.front()->front().size();
  std::mt19937 random(2);
  struct Place {
    std::uint32_t block, node;
  };
  std::vector<Place> places;
  for (std::size_t k = 0; k < kPairs; ++k) {
    places.push_back(
        {static_cast<std::uint32_t>(random() % blocks.size()), static_cast<std::uint32_t>(random() % nodes)});
  }
  // Always 0, which the compiler cannot know: whatever it is multiplied with must be waited for.
  volatile std::uint32_t hidden = 0;
  const std::uint32_t nothing = hidden;
  const auto zero = static_cast<double>(nothing);
  std::size_t place = 0;
  const auto next = [&] {
    place = (place + kPiece) % kPairs;
    return place;
  };
  const auto overlapped = [&] {
    for (std::size_t k = next(), end = k + kPiece; k < end; ++k) {
      const Block& block = *blocks[places[k].block];
      for (std::size_t c = 0; c < 3; ++c) {
        f[3 * k + c] = static_cast<double>(block[c][places[k].node]);
      }
    }
    keep(f.data());
  };
  const auto one_by_one = [&] {
    float last = 0;
    for (std::size_t k = next(), end = k + kPiece; k < end; ++k) {
      const std::uint32_t node = places[k].node + (std::bit_cast<std::uint32_t>(last) & nothing);
      const Block& block = *blocks[places[k].block];
      for (std::size_t c = 0; c < 3; ++c) {
        last = block[c][node];
        f[3 * k + c] = static_cast<double>(last);
      }
    }
    keep(f.data());
  };
  const auto single = [&] {
    double last = 0;
    for (std::size_t k = next(), end = k + kPiece; k < end; ++k) {
      Direction omega_o = pairs.omega_o[k];
      omega_o.x += zero * last;
      origin[k] = brdf.eval(pairs.omega_i[k], omega_o, std::span(f).subspan(3 * k, 3));
      last = f[3 * k];
    }
    keep(f.data());
  };
  const auto batch = [&] {
    const std::size_t k = next();
    brdf.eval_pairs(std::span(pairs.omega_i).subspan(k, kPiece), std::span(pairs.omega_o).subspan(k, kPiece),
                    std::span(f).subspan(3 * k, 3 * kPiece), std::span(origin).subspan(k, kPiece));
    keep(f.data());
  };
  const Direction light = from_spherical(radians(0.45 * last_i_deg), 1);
  const auto outgoing = [&] {
    const std::size_t k = next();
    brdf.eval_batch(light, std::span(pairs.omega_o).subspan(k, kPiece),
                    std::span(f).subspan(3 * k, 3 * kPiece), std::span(origin).subspan(k, kPiece));
    keep(f.data());
  };
  const auto contest = [&](const std::string& way, const std::function<void()>& ours, bool alone) {
    return run_contest(
        name + "." + way + "." + set + (alone ? "" : ".overlapped"),
        {.unit = "M/s",
         .work = static_cast<double>(kPiece) / 1e6,
         .ours = ours,
         .peer = alone ? "lookup after lookup" : "overlapped lookups",
         .theirs = alone ? std::function<void()>(one_by_one) : std::function<void()>(overlapped)});
  };
  return {contest("single", single, true), contest("single", single, false), contest("batch", batch, true),
          contest("batch", batch, false), contest("outgoing", outgoing, true)};
}

std::vector<Figure> grid_figures() {
  std::vector<Figure> out;
  for (const auto& [set, incidences, step_deg, rows] :
       {std::tuple("gonio", 4, 20.0, 76), std::tuple("dense", 13, 5.0, 91)}) {
    const GridBrdf grid =
        grid_of(static_cast<std::size_t>(incidences), step_deg, static_cast<std::size_t>(rows));
    std::vector<const Block*> blocks;
    for (const GridPart& part : grid.content().parts) {
      blocks.push_back(&part.f_per_sr);
    }
    std::ranges::move(figures_of("eval.grid", set, grid, blocks, 60), std::back_inserter(out));
  }
  return out;
}

std::vector<Figure> specular_figures() {
  std::vector<Figure> out;
  for (const auto& [set, incidences, step_deg, radials] :
       {std::tuple("gonio", 4, 20.0, 76), std::tuple("dense", 13, 5.0, 91)}) {
    const SpecularGridBrdf grid =
        specular_grid_of(static_cast<std::size_t>(incidences), step_deg, static_cast<std::size_t>(radials));
    std::ranges::move(figures_of("eval.specular_grid", set, grid, {&grid.content().f_per_sr}, 60),
                      std::back_inserter(out));
  }
  return out;
}

const Benchmark kGrid{"eval.grid", grid_figures};
const Benchmark kSpecularGrid{"eval.specular_grid", specular_figures};

}  // namespace
}  // namespace scatter::bench
