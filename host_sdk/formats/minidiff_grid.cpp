#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "host_sdk/formats/comment_fields.h"
#include "host_sdk/formats/minidiff_content.h"
#include "host_sdk/formats/text_scanner.h"
#include "host_sdk/formats/tristimulus.h"
#include "host_sdk/reflectance/albedo.h"

namespace scatter::formats {
namespace {

using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;
using Incidence = MiniDiffContent::Incidence;

constexpr double kSameAngleDeg = 1e-6;
/// Larger disagreement of TIS and integral is told.
constexpr double kToldMismatch = 0.05;
constexpr std::size_t kToldBlocks = 20;
constexpr std::string_view kExtrapolated = "#Extrapolated beyond radial ";

class Builder {
 public:
  explicit Builder(MiniDiffContent content) : in_(std::move(content)) {}

  Result<GridBrdf> build() {
    auto fields = read_comment_fields(in_.comments);
    if (!fields) {
      return std::unexpected(fields.error());
    }
    out_.type = in_.type;
    out_.theta_count = in_.layout.theta_count;
    out_.theta_step = radians(in_.layout.theta_step_deg);
    out_.phi_count = in_.layout.phi_count;
    out_.phi_step = 2 * kPi / static_cast<double>(out_.phi_count);
    if (Status status = add_parts(); !status) {
      return std::unexpected(status.error());
    }
    if (Status status = restore(*fields); !status) {
      return std::unexpected(status.error());
    }
    out_.metadata = std::move(in_.metadata);
    if (!fields->foreign.empty()) {
      out_.metadata["comments"] = fields->foreign;
    }
    for (auto& [key, value] : fields->metadata) {
      out_.metadata.insert_or_assign(key, std::move(value));
    }
    in_.warnings.put_into(out_.metadata);
    std::vector<GridPart> places;
    for (const GridPart& part : out_.parts) {
      places.push_back({.rotation_rad = part.rotation_rad,
                        .theta_i = part.theta_i,
                        .phi_i = part.phi_i,
                        .f_per_sr = {},
                        .random_per_sr = {},
                        .systematic_per_sr = {},
                        .pixels = {},
                        .origin = {}});
    }
    auto grid = GridBrdf::make(std::move(out_));
    return grid ? with_notes(std::move(*grid), places) : std::move(grid);
  }

 private:
  Status add_parts() {
    const bool rotated = std::ranges::any_of(in_.incidences, [&](const Incidence& a) {
      return std::ranges::count_if(in_.incidences, [&](const Incidence& b) {
               return std::abs(a.aoi_deg - b.aoi_deg) < kSameAngleDeg;
             }) > 1;
    });
    const std::vector<double> keys = in_.incidences.front().keys;
    out_.channels = keys.size();
    if (!in_.tristimulus && (keys.size() > 1 || keys.front() > 0)) {
      out_.wavelengths_nm.assign(keys.begin(), keys.end());
    }
    for (Incidence& incidence : in_.incidences) {
      auto part = part_of(incidence, rotated);
      if (!part) {
        return std::unexpected(part.error());
      }
      out_.parts.push_back(std::move(*part));
    }
    return {};
  }

  Result<GridPart> part_of(Incidence& incidence, bool rotated) {
    GridPart given;
    given.theta_i = radians(incidence.aoi_deg);
    given.phi_i = radians(incidence.poi_deg);
    given.rotation_rad = rotated ? given.phi_i : 0;
    given.f_per_sr = std::move(incidence.planes);
    const double limit = measured_to() + out_.theta_step * 1e-3;
    for (const double radial : in_.radial_deg) {
      given.origin.insert(given.origin.end(), in_.phi_deg.size(),
                          radians(radial) > limit ? Origin::kExtrapolated : Origin::kMeasured);
    }
    GridPart part = on_even_grid(given, in_.radial_deg, in_.phi_deg, in_.layout);
    if (!in_.plane_symmetric) {
      return part;
    }
    // Plane-symmetric azimuths count from the plane of incidence, so it must lie on a column.
    const double shift = incidence.poi_deg / in_.layout.phi_step_deg;
    if (std::abs(shift - std::round(shift)) > 1e-6) {
      return fail(ErrorCode::kUnimplemented, "plane-symmetric data whose POI is off the azimuth grid",
                  "export them as Asymmetric");
    }
    const auto count = static_cast<std::ptrdiff_t>(in_.layout.phi_count);
    const auto turn = ((static_cast<std::ptrdiff_t>(std::llround(shift)) % count) + count) % count;
    const auto rotate = [&](auto& plane) {
      for (auto row = plane.begin(); row != plane.end(); row += count) {
        std::rotate(row, row + (count - turn), row + count);
      }
    };
    std::ranges::for_each(part.f_per_sr, rotate);
    rotate(part.origin);
    return part;
  }

  /// Our own remark; in files of others everything counts as measured.
  [[nodiscard]] double measured_to() const {
    for (const std::string_view comment : in_.comments) {
      if (comment.starts_with(kExtrapolated)) {
        TextScanner scan(comment.substr(kExtrapolated.size()), "");
        return radians(scan.number("radial").value_or(90));
      }
    }
    return radians(90);
  }

  /// What our own writer left in the comments, blocks in the order of the file.
  Status restore(const CommentFields& fields) {
    const std::size_t nodes = out_.theta_count * out_.phi_count;
    if (const auto it = fields.own.find("origin"); it != fields.own.end()) {
      const auto origin = read_origin_runs(it->second, nodes * out_.parts.size());
      if (!origin) {
        return std::unexpected(origin.error());
      }
      for (std::size_t p = 0; p < out_.parts.size(); ++p) {
        std::copy_n(origin->begin() + static_cast<std::ptrdiff_t>(p * nodes), nodes,
                    out_.parts[p].origin.begin());
      }
    }
    if (const auto it = fields.own.find("rotation_deg"); it != fields.own.end()) {
      const auto rotation = read_float_list(it->second, out_.parts.size());
      if (!rotation) {
        return std::unexpected(rotation.error());
      }
      for (std::size_t p = 0; p < out_.parts.size(); ++p) {
        out_.parts[p].rotation_rad = radians((*rotation)[p]);
      }
    }
    if (const auto it = fields.own.find("tristimulus_of"); it != fields.own.end() && in_.tristimulus) {
      if (it->second != "bt709") {
        return fail(ErrorCode::kDataLoss, "tristimulus values of colours that this version does not know",
                    "read it with a newer version");
      }
      for (std::size_t p = 0; p < out_.parts.size(); ++p) {
        auto& f = out_.parts[p].f_per_sr;
        transform(kRgbFromXyz, f[0], f[1], f[2]);
        // One number per channel: planes of one value each.
        std::vector<double>& total = in_.incidences[p].totals;
        std::array<std::vector<double>, 3> one{{{total[0]}, {total[1]}, {total[2]}}};
        transform(kRgbFromXyz, one[0], one[1], one[2]);
        total = {one[0][0], one[1][0], one[2][0]};
      }
      in_.metadata["spectral_content"] = "RGB";
    }
    return {};
  }

  /// TIS is advisory: recomputed, and told where it disagrees. `places`: the parts in the order of
  /// the file, which GridBrdf sorts.
  GridBrdf with_notes(GridBrdf grid, const std::vector<GridPart>& places) const {
    std::string notes;
    std::size_t told = 0;
    for (std::size_t p = 0; p < places.size(); ++p) {
      const auto it = std::ranges::find_if(grid.content().parts, [&](const GridPart& part) {
        return part.theta_i == places[p].theta_i && part.phi_i == places[p].phi_i &&
               part.rotation_rad == places[p].rotation_rad;
      });
      const auto part = static_cast<std::size_t>(it - grid.content().parts.begin());
      const std::vector<double> found = grid_albedo(grid, part, reflectance::Region::kAll);
      for (std::size_t c = 0; c < found.size(); ++c) {
        const double stated = in_.incidences[p].totals[c];
        if (std::abs(found[c] - stated) > kToldMismatch * std::abs(stated) && ++told <= kToldBlocks) {
          notes += fmt::format(
              "channel {}, incidence {:g} deg, azimuth {:g} deg: TIS {:g}, integral {:.4g}, ratio {:.3f}\n",
              c, in_.incidences[p].aoi_deg, in_.incidences[p].poi_deg, stated, found[c], found[c] / stated);
        }
      }
    }
    if (told == 0) {
      return grid;
    }
    if (told > kToldBlocks) {
      notes +=
          fmt::format("{} more blocks whose TIS and integral differ by more than 5 %\n", told - kToldBlocks);
    }
    GridBrdf::Content noted = grid.content();
    if (std::string& earlier = noted.metadata["notes"]; earlier.find(notes) == std::string::npos) {
      earlier += notes;
    }
    return GridBrdf::make(std::move(noted)).value_or(std::move(grid));
  }

  MiniDiffContent in_;
  GridBrdf::Content out_;
};

}  // namespace

Result<GridBrdf> grid_of(MiniDiffContent content) {
  return Builder(std::move(content)).build();
}

}  // namespace scatter::formats
