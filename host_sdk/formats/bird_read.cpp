#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <ranges>
#include <tuple>
#include <utility>
#include <vector>

#include "host_sdk/formats/bird.h"
#include "host_sdk/formats/bird_table.h"
#include "host_sdk/formats/even_grid.h"
#include "host_sdk/formats/sample_list_brdf.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::degrees;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatteredSamples;

/// Angles are the same when they agree to this [1/deg].
constexpr double kUnitsPerDegree = 1e4;
constexpr std::int32_t kTurn = 3'600'000;
constexpr std::size_t kMostChannels = 1024;
constexpr std::size_t kMostHoles = 16;  ///< Per value.
constexpr double kWidestTheta = 20;
constexpr double kWidestPhi = 45;

/// A geometry in units of 0.0001 deg: what rows are gathered by.
struct Geometry {
  std::int32_t theta_i = 0, phi_i = 0, theta_o = 0, phi_o = 0;
  [[nodiscard]] auto operator<=>(const Geometry&) const = default;
};

/// Samples with their geometries and the rotation of the sample, in the order of the file.
struct Gathered {
  ScatteredSamples samples;
  std::vector<Geometry> geometry;
  std::vector<std::array<double, 4>> angles_deg;  ///< Unrounded, of the first row of each geometry.
  std::vector<float> rotation_deg;                ///< Empty: not stated.
};

class Gatherer {
 public:
  Gatherer(BirdTable table, std::string_view name) : table_(std::move(table)), name_(name) {}

  Result<Gathered> gather() {
    Status status = find_columns();
    if (status) {
      status = find_channels();
    }
    if (status) {
      status = read_rows();
    }
    if (!status) {
      return std::unexpected(status.error());
    }
    add_up();
    out_.samples.metadata.merge(table_.metadata);
    table_.warnings.put_into(out_.samples.metadata);
    if (Status checked = check(out_.samples); !checked) {
      return bad(checked.error().what);
    }
    return std::move(out_);
  }

 private:
  struct Row {
    Geometry geometry;
    std::uint32_t sample = 0;
    std::uint16_t channel = 0;
    std::uint8_t state = 0;
  };

  [[nodiscard]] std::unexpected<Error> bad(
      std::string_view what, std::string_view remedy = "export the file again or correct this place") const {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name_, what), std::string(remedy));
  }
  [[nodiscard]] std::unexpected<Error> bad_unit(const char* key, const std::string& unit,
                                                std::string_view expected) const {
    return bad(unit.empty() ? fmt::format("data.{}: no unit, expected {}", key, expected)
                            : fmt::format("data.{}: unit '{}', expected {}", key, printable(unit), expected));
  }

  [[nodiscard]] const BirdColumn* find(std::string_view key) const {
    const auto it = table_.columns.find(std::string(key));
    return it == table_.columns.end() ? nullptr : &it->second;
  }

  Status find_columns() {
    constexpr std::array<const char*, 4> kAngles{"theta_i", "phi_i", "theta_r", "phi_r"};
    for (std::size_t k = 0; k < kAngles.size(); ++k) {
      const BirdColumn* column = find(kAngles[k]);
      if (column == nullptr || column->numbers.empty()) {
        return bad(fmt::format("data.{} is missing", kAngles[k]));
      }
      const std::string& unit = column->unit;
      if (unit != "deg" && unit != "\xC2\xB0" && unit != "rad" && unit != "degree" && unit != "degrees") {
        return bad_unit(kAngles[k], unit, "deg or rad");
      }
      angles_[k] = {column, unit == "rad" ? degrees(1.0) : 1.0};
    }
    const BirdColumn* values = find("BRDF");
    if (values->numbers.empty()) {
      return bad("data.BRDF: no numbers");
    }
    if (values->unit != "1/sr" && values->unit != "sr^-1" && values->unit != "sr-1" &&
        values->unit != "sr\xE2\x81\xBB\xC2\xB9") {
      return bad_unit("BRDF", values->unit, "1/sr or sr^-1");
    }
    if (const BirdColumn* u = find("uBRDF"); u != nullptr && !u->numbers.empty()) {
      relative_ = u->unit == "%";
      if (!relative_ && u->unit != values->unit && u->unit != "1/sr" && u->unit != "sr^-1" &&
          u->unit != "sr-1") {
        return bad_unit("uBRDF", u->unit, "that of BRDF or %");
      }
    }
    for (const char* word : {"polarization_i", "pol", "polarization_r"}) {
      if (const BirdColumn* column = find(word); column != nullptr && !column->states.empty()) {
        polarizations_.push_back(column);
      }
    }
    return {};
  }

  Status find_channels() {
    const char* key = "wavelength_i";
    const BirdColumn* column = find(key);
    if (column == nullptr || column->numbers.empty()) {
      key = "wavelength_r";
      column = find(key);
    }
    const std::size_t rows = find("BRDF")->size();
    channel_.assign(rows, 0);
    out_.samples.channels = 1;
    if (column == nullptr || column->numbers.empty()) {
      return numbered_channels();
    }
    const bool micrometres =
        column->unit == "\xCE\xBCm" || column->unit == "\xC2\xB5m" || column->unit == "um";
    if (!micrometres && column->unit != "nm") {
      return bad_unit(key, column->unit, "nm or um");
    }
    std::map<float, std::uint16_t> known;
    for (std::size_t row = 0; row < rows; ++row) {
      const auto nm = static_cast<float>(column->numbers[row] * (micrometres ? 1000 : 1));
      if (!is_wavelength(static_cast<double>(nm))) {
        return bad(fmt::format("{}: {} nm, expected {}", column->place(row), nm, kWavelengthRange),
                   "state the wavelength in nanometres, or give the unit um");
      }
      const auto [it, is_new] = known.emplace(nm, static_cast<std::uint16_t>(known.size()));
      if (is_new) {
        out_.samples.wavelengths_nm.push_back(nm);
        if (known.size() > kMostChannels) {
          return bad("more than 1024 wavelengths");
        }
      }
      channel_[row] = it->second;
    }
    out_.samples.channels = known.size();
    return {};
  }

  /// Our writer numbers channels that have no wavelength.
  Status numbered_channels() {
    const BirdColumn* column = find("scatter_channel");
    for (std::size_t row = 0; column != nullptr && row < column->numbers.size(); ++row) {
      const double number = column->numbers[row];
      if (!(number >= 0 && number < kMostChannels) || number != std::floor(number)) {
        return bad(
            fmt::format("{}: {}, expected a channel 0..{}", column->place(row), number, kMostChannels - 1));
      }
      channel_[row] = static_cast<std::uint16_t>(number);
      out_.samples.channels = std::max(out_.samples.channels, static_cast<std::size_t>(number) + 1);
    }
    return {};
  }

  /// Angles of one row [0.0001 deg], theta positive and phi in 0..<360.
  Result<Geometry> geometry_of(std::size_t row, std::array<double, 4>& exact) const {
    std::array<std::int32_t, 4> units{};
    for (std::size_t side = 0; side < 2; ++side) {
      double theta = angles_[2 * side].first->numbers[row] * angles_[2 * side].second;
      double phi = angles_[2 * side + 1].first->numbers[row] * angles_[2 * side + 1].second;
      if (!(std::abs(theta) <= 90 + 0.5 / kUnitsPerDegree) || (side == 0 && std::abs(theta) >= 90)) {
        return bad(fmt::format("{}: {:g} deg, expected theta_{}", angles_[2 * side].first->place(row), theta,
                               side == 0 ? "i below 90" : "r 0..90"));
      }
      if (!(std::abs(phi) <= 360 + 0.5 / kUnitsPerDegree)) {
        return bad(fmt::format("{}: {:g} deg, expected phi_{} 0..360",
                               angles_[2 * side + 1].first->place(row), phi, side == 0 ? "i" : "r"));
      }
      if (theta < 0) {
        theta = -theta;
        phi += 180;
      }
      exact[2 * side] = theta;
      exact[2 * side + 1] = phi;
      const auto turned = static_cast<std::int32_t>(std::llround(std::fmod(phi, 360.0) * kUnitsPerDegree));
      units[2 * side] = static_cast<std::int32_t>(std::llround(theta * kUnitsPerDegree));
      units[2 * side + 1] = ((turned % kTurn) + kTurn) % kTurn;
    }
    return Geometry{.theta_i = units[0], .phi_i = units[1], .theta_o = units[2], .phi_o = units[3]};
  }

  /// Gives every row its sample, in the order in which geometries come.
  Status read_rows() {
    const std::size_t rows = channel_.size();
    const std::vector<double>& values = find("BRDF")->numbers;
    std::map<Geometry, std::uint32_t> known;
    rows_.reserve(rows);
    auto hint = known.end();
    for (std::size_t row = 0; row < rows; ++row) {
      std::array<double, 4> exact{};
      const auto geometry = geometry_of(row, exact);
      if (!geometry) {
        return std::unexpected(geometry.error());
      }
      if (hint == known.end() || hint->first != *geometry) {
        bool is_new = false;
        std::tie(hint, is_new) = known.emplace(*geometry, static_cast<std::uint32_t>(known.size()));
        if (is_new) {
          out_.geometry.push_back(*geometry);
          out_.angles_deg.push_back(exact);
        }
      }
      if (const double f = values[row]; !(std::abs(f) <= std::numeric_limits<float>::max())) {
        return bad(fmt::format("{}: {}, expected a finite number for 32 bits", find("BRDF")->place(row), f));
      }
      std::uint8_t state = 0;
      if (!polarizations_.empty()) {
        state = polarizations_.front()->states[row];
      }
      rows_.push_back({*geometry, hint->second, channel_[row], state});
    }
    // Holes in the table of geometries and channels take memory that the file did not pay for.
    const std::size_t cells = out_.geometry.size() * out_.samples.channels;
    if (cells > kMostHoles * rows + kMostChannels) {
      return bad(fmt::format("{} geometries with {} wavelengths, but only {} values", out_.geometry.size(),
                             out_.samples.channels, rows));
    }
    return {};
  }

  /// Means over repeats and polarizations.
  void add_up() {
    ScatteredSamples& samples = out_.samples;
    const std::size_t count = out_.geometry.size();
    const std::size_t cells = count * samples.channels;
    const std::vector<double>& f = find("BRDF")->numbers;
    const auto numbers = [&](const char* key) -> const std::vector<double>* {
      const BirdColumn* column = find(key);
      return column == nullptr || column->numbers.empty() ? nullptr : &column->numbers;
    };
    const auto* total = numbers("uBRDF");
    const auto* random = numbers("scatter_random");
    const auto* systematic = numbers("scatter_systematic");
    const auto* origin = numbers("scatter_origin");
    const auto* rotation = numbers("scatter_rotation");
    const bool exact = random != nullptr && systematic != nullptr;
    const std::optional<std::uint8_t> unpolarized = state_named("u");
    std::vector<bool> has_unpolarized(cells, false);
    for (const Row& row : rows_) {
      if (unpolarized && !polarizations_.empty() && row.state == *unpolarized) {
        has_unpolarized[row.sample * samples.channels + row.channel] = true;
      }
    }
    std::vector<double> sums(cells, 0.0);
    std::vector<double> randoms(exact ? cells : 0, 0.0);
    std::vector<double> systematics(exact || total != nullptr ? cells : 0, 0.0);
    std::vector<std::uint32_t> counts(cells, 0);
    samples.origin.assign(count, Origin::kMeasured);
    out_.rotation_deg.assign(rotation != nullptr ? count : 0, 0.0F);
    std::vector<bool> used(table_.states.size(), false);
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const Row& row = rows_[k];
      const std::size_t cell = row.sample * samples.channels + row.channel;
      if (has_unpolarized[cell] && row.state != *unpolarized) {
        continue;
      }
      if (!polarizations_.empty()) {
        used[row.state] = true;
      }
      ++counts[cell];
      sums[cell] += f[k];
      if (exact) {
        randoms[cell] += (*random)[k];
        systematics[cell] += (*systematic)[k];
      } else if (total != nullptr) {
        systematics[cell] += (*total)[k] * (relative_ ? std::abs(f[k]) / 100 : 1);
      }
      if (origin != nullptr) {
        const double o = (*origin)[k];
        const auto stated = o == 1   ? Origin::kMeasured
                            : o == 2 ? Origin::kInterpolated
                            : o == 3 ? Origin::kExtrapolated
                                     : Origin::kInvalid;
        samples.origin[row.sample] = combined(samples.origin[row.sample], stated);
      }
      if (rotation != nullptr) {
        out_.rotation_deg[row.sample] = static_cast<float>((*rotation)[k]);
      }
    }
    std::size_t incomplete = 0;
    const auto mean = [&](const std::vector<double>& sum, std::vector<float>& out) {
      for (std::size_t cell = 0; cell < sum.size(); ++cell) {
        out.push_back(counts[cell] == 0 ? 0.0F : static_cast<float>(sum[cell] / counts[cell]));
      }
    };
    mean(sums, samples.f_per_sr);
    mean(systematics, samples.systematic_per_sr);
    mean(randoms, samples.random_per_sr);
    if (samples.random_per_sr.empty() && !samples.systematic_per_sr.empty()) {
      samples.random_per_sr.assign(cells, 0.0F);
    }
    for (std::size_t s = 0; s < count; ++s) {
      const std::array<double, 4>& a = out_.angles_deg[s];
      samples.omega_i.push_back(reflectance::from_spherical(radians(a[0]), radians(a[1])));
      // Rounding of radians may lie beyond the horizon.
      samples.omega_o.push_back(reflectance::from_spherical(radians(std::min(a[2], 90.0)), radians(a[3])));
      const auto first = counts.begin() + static_cast<std::ptrdiff_t>(s * samples.channels);
      if (std::find(first, first + static_cast<std::ptrdiff_t>(samples.channels), 0U) !=
          first + static_cast<std::ptrdiff_t>(samples.channels)) {
        samples.origin[s] = Origin::kInvalid;
        ++incomplete;
      }
    }
    if (incomplete > 0) {
      samples.metadata["notes"] = fmt::format("{} geometries lack a wavelength: invalid\n", incomplete);
    }
    std::string polarization;
    for (std::size_t s = 0; s < used.size(); ++s) {
      polarization += used[s] ? fmt::format("{}{}", polarization.empty() ? "" : ", ", table_.states[s]) : "";
    }
    if (!polarization.empty()) {
      samples.metadata["polarization"] =
          polarization.find(',') == std::string::npos ? polarization : "mean of " + polarization;
    }
  }

  [[nodiscard]] std::optional<std::uint8_t> state_named(std::string_view word) const {
    const auto it = std::ranges::find(table_.states, word);
    return it == table_.states.end() ? std::nullopt
                                     : std::optional(static_cast<std::uint8_t>(it - table_.states.begin()));
  }

  static std::string printable(std::string_view text) {
    std::string out(text.substr(0, 20));
    std::ranges::replace_if(out, [](char c) { return c < ' ' || c > '~'; }, '?');
    return out;
  }

  BirdTable table_;
  std::string_view name_;
  std::array<std::pair<const BirdColumn*, double>, 4> angles_{};  ///< With degrees per unit.
  bool relative_ = false;
  std::vector<const BirdColumn*> polarizations_;
  std::vector<std::uint16_t> channel_;
  std::vector<Row> rows_;
  Gathered out_;
};

/// Ascending and distinct, in degrees.
std::vector<double> distinct(std::vector<std::int32_t> units) {
  std::ranges::sort(units);
  units.erase(std::ranges::unique(units).begin(), units.end());
  std::vector<double> out;
  for (const std::int32_t unit : units) {
    out.push_back(unit / kUnitsPerDegree);
  }
  return out;
}

/// The grid that the samples make, if they make one.
std::optional<GridBrdf> as_grid(const Gathered& in) {
  const ScatteredSamples& samples = in.samples;
  std::vector<std::int32_t> thetas;
  std::vector<std::int32_t> phis;
  std::map<std::pair<std::int32_t, std::int32_t>, std::vector<std::size_t>> incidences;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const Geometry& g = in.geometry[s];
    thetas.push_back(g.theta_o);
    if (g.theta_o != 0) {
      phis.push_back(g.phi_o);
    }
    incidences[{g.theta_i, g.phi_i}].push_back(s);
  }
  const std::vector<double> theta = distinct(std::move(thetas));
  const std::vector<double> phi = distinct(std::move(phis));
  const auto layout = even_layout(theta, phi, kWidestTheta, kWidestPhi);
  if (!layout || 2 * samples.size() < incidences.size() * theta.size() * phi.size()) {
    return std::nullopt;
  }
  bool rotated = false;
  for (auto it = incidences.begin(); it != incidences.end(); ++it) {
    rotated = rotated || (std::next(it) != incidences.end() && std::next(it)->first.first == it->first.first);
  }
  GridBrdf::Content content;
  content.channels = samples.channels;
  content.wavelengths_nm = samples.wavelengths_nm;
  content.theta_count = layout->theta_count;
  content.theta_step = radians(layout->theta_step_deg);
  content.phi_count = layout->phi_count;
  content.phi_step = 2 * kPi / static_cast<double>(layout->phi_count);
  content.metadata = samples.metadata;
  const std::size_t nodes = theta.size() * phi.size();
  for (const auto& list : incidences | std::views::values) {
    if (2 * list.size() < nodes) {
      return std::nullopt;
    }
    GridPart part;
    part.theta_i = radians(in.angles_deg[list.front()][0]);
    part.phi_i = radians(in.angles_deg[list.front()][1]);
    part.rotation_rad = rotated ? part.phi_i : 0;
    if (!in.rotation_deg.empty()) {
      part.rotation_rad = radians(in.rotation_deg[list.front()]);
    }
    part.origin.assign(nodes, Origin::kInvalid);
    const std::array<std::pair<const std::vector<float>*, std::vector<std::vector<float>>*>, 3> planes{
        {{&samples.f_per_sr, &part.f_per_sr},
         {&samples.random_per_sr, &part.random_per_sr},
         {&samples.systematic_per_sr, &part.systematic_per_sr}}};
    for (const auto& [from, to] : planes) {
      to->assign(from->empty() ? 0 : samples.channels, std::vector<float>(nodes));
    }
    for (const std::size_t s : list) {
      const Geometry& g = in.geometry[s];
      const auto place = [](const std::vector<double>& axis, std::int32_t units) {
        const auto it = std::ranges::lower_bound(axis, (units - 0.5) / kUnitsPerDegree);
        return static_cast<std::size_t>(it - axis.begin()) % axis.size();
      };
      const std::size_t node = place(theta, g.theta_o) * phi.size() + place(phi, g.phi_o);
      part.origin[node] = samples.origin_of(s);
      for (const auto& [from, to] : planes) {
        for (std::size_t c = 0; c < to->size(); ++c) {
          (*to)[c][node] = (*from)[s * samples.channels + c];
        }
      }
    }
    content.parts.push_back(on_even_grid(part, theta, phi, *layout));
  }
  auto grid = GridBrdf::make(std::move(content));
  return grid ? std::optional(std::move(*grid)) : std::nullopt;
}

Result<Gathered> gathered(std::string_view text, std::string_view name) {
  auto table = read_bird_table(text, name);
  if (!table) {
    return std::unexpected(std::move(table.error()));
  }
  return Gatherer(std::move(*table), name).gather();
}

}  // namespace

Result<ScatteredSamples> decode_bird_samples(std::string_view text, std::string_view name) {
  auto found = gathered(text, name);
  return found ? Result<ScatteredSamples>(std::move(found->samples)) : std::unexpected(found.error());
}

Result<std::shared_ptr<const Brdf>> decode_bird(std::string_view text, std::string_view name) {
  auto found = gathered(text, name);
  if (!found) {
    return std::unexpected(std::move(found.error()));
  }
  if (auto grid = as_grid(*found)) {
    return std::make_shared<const GridBrdf>(std::move(*grid));
  }
  auto list = SampleListBrdf::make(std::move(found->samples));
  if (!list) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name, list.error().what), list.error().remedy);
  }
  return std::make_shared<const SampleListBrdf>(std::move(*list));
}

}  // namespace scatter::formats
