#include "host_sdk/measurement/process.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>

#include "host_sdk/device/recording_reader.h"
#include "host_sdk/measurement/lanes.h"
#include "host_sdk/measurement/provenance.h"
#include "host_sdk/measurement/quality_checks.h"
#include "host_sdk/measurement/recorded_scan.h"
#include "host_sdk/measurement/resampler.h"
#include "host_sdk/measurement/tilt_fit.h"
#include "host_sdk/measurement/uncertainty.h"

namespace scatter::measurement {
namespace {

using reflectance::Direction;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;

// Nodes overlap: each pixel counts in about (kernel area / node area) of them, so that noise in an
// integral over nodes averages less than if nodes were independent.
constexpr double kNodeOverlap = 7.0;

std::vector<HeadSamples> head_samples(const NodeValues& nodes, const GridShape& grid,
                                      const LaneSelection& selection) {
  std::vector<HeadSamples> heads;
  for (std::size_t l = 0; l < selection.lanes.size();) {
    std::size_t end = l;
    while (end < selection.lanes.size() && selection.lanes[end].head == selection.lanes[l].head) {
      ++end;
    }
    HeadSamples head;
    head.omega_i = selection.lanes[l].omega_i;
    const Direction mirror = reflectance::mirrored(head.omega_i);
    for (std::size_t j = 0; j < grid.theta_count; ++j) {
      const double sine = std::sin(static_cast<double>(j) * grid.theta_step);
      for (std::size_t i = 0; i < grid.phi_count; ++i) {
        const std::size_t node = j * grid.phi_count + i;
        if (nodes.kind[node] != NodeKind::kSeen) {
          continue;
        }
        const Direction w = grid.direction(node);
        // Every 2 deg around the lobe, every 6 deg elsewhere, evenly over the sphere.
        const std::size_t spacing =
            reflectance::angle_between(w, mirror) < 25.0 * reflectance::kPi / 180.0 ? 2 : 6;
        const auto stride = std::max<std::size_t>(
            1, static_cast<std::size_t>(std::lround(static_cast<double>(spacing) / std::max(sine, 1e-3))));
        if (j % spacing != 0 || i % std::min(stride, grid.phi_count) != 0) {
          continue;
        }
        double f = 0;
        double variance = 0;
        for (std::size_t k = l; k < end; ++k) {
          f += static_cast<double>(nodes.value[node * nodes.lanes + k]);
          variance += static_cast<double>(nodes.variance[node * nodes.lanes + k]);
        }
        const auto n = static_cast<double>(end - l);
        if (std::isfinite(variance) && variance > 0) {
          head.omega_o.push_back(w);
          head.f_per_sr.push_back(f / n);
          head.sigma_per_sr.push_back(std::sqrt(variance) / n);
        }
      }
    }
    heads.push_back(std::move(head));
    l = end;
  }
  return heads;
}

GridBrdf::Content grid_content(const NodeValues& nodes, const std::vector<float>& systematic,
                               const GridShape& grid, const SampleFrame& frame, const RecordedScan& scan,
                               const LaneSelection& selection, double sample_rotation_rad) {
  GridBrdf::Content content;
  content.type = selection.transmission ? reflectance::ScatterType::kBtdf : reflectance::ScatterType::kBrdf;
  content.theta_count = grid.theta_count;
  content.phi_count = grid.phi_count;
  content.theta_step = grid.theta_step;
  content.phi_step = grid.phi_step;
  for (std::size_t l = 0; l < selection.lanes.size();) {
    std::size_t end = l;
    while (end < selection.lanes.size() && selection.lanes[end].head == selection.lanes[l].head) {
      ++end;
    }
    content.channels = end - l;
    content.wavelengths_nm.clear();
    GridPart part;
    const Direction level = selection.lanes[l].omega_i;
    const Direction wi = frame.to_sample(level);
    part.theta_i = reflectance::theta_of(wi);
    part.phi_i = reflectance::phi_of(wi);
    part.rotation_rad = sample_rotation_rad;
    part.pixels = nodes.pixels;
    part.origin.assign(grid.nodes(), Origin::kInvalid);
    for (std::size_t node = 0; node < grid.nodes(); ++node) {
      bool finite = true;
      for (std::size_t k = l; k < end; ++k) {
        finite = finite && std::isfinite(nodes.variance[node * nodes.lanes + k]);
      }
      if (!finite) {
        continue;
      }
      switch (nodes.kind[node]) {
        case NodeKind::kSeen:
          part.origin[node] = Origin::kMeasured;
          break;
        case NodeKind::kBlind:
          part.origin[node] = Origin::kInterpolated;
          break;
        case NodeKind::kOutside:
          part.origin[node] = Origin::kExtrapolated;
          break;
        case NodeKind::kEmpty:
          break;
      }
    }
    for (std::size_t k = l; k < end; ++k) {
      const Lane& lane = selection.lanes[k];
      content.wavelengths_nm.push_back(scan.descriptor.illuminations[lane.illumination].wavelength_nm);
      // The references lay level: a tilted sample receives cos(theta_i') where they received cos(theta_i).
      const double level_share = level.z / wi.z;
      std::vector<float>& f = part.f_per_sr.emplace_back(grid.nodes(), 0.0F);
      std::vector<float>& random = part.random_per_sr.emplace_back(grid.nodes(), 0.0F);
      std::vector<float>& fixed = part.systematic_per_sr.emplace_back(grid.nodes(), 0.0F);
      for (std::size_t node = 0; node < grid.nodes(); ++node) {
        if (part.origin[node] == Origin::kInvalid) {
          continue;
        }
        const std::size_t at = node * nodes.lanes + k;
        const double value = static_cast<double>(nodes.value[at]) * level_share;
        const double variance = static_cast<double>(nodes.variance[at]) * level_share * level_share +
                                value * value * lane.monitor_relative_variance;
        f[node] = static_cast<float>(value);
        random[node] = static_cast<float>(std::sqrt(variance));
        fixed[node] = static_cast<float>(static_cast<double>(systematic[at]) * level_share);
      }
    }
    content.parts.push_back(std::move(part));
    l = end;
  }
  return content;
}

}  // namespace

std::vector<AlbedoRow> measured_albedo(const GridBrdf& brdf) {
  const GridBrdf::Content& c = brdf.content();
  std::vector<AlbedoRow> rows;
  for (const GridPart& part : c.parts) {
    AlbedoRow row{part.theta_i, part.phi_i, {}, {}};
    for (std::size_t ch = 0; ch < c.channels; ++ch) {
      double albedo = 0, random2 = 0, fixed = 0;
      for (std::size_t node = 0; node < part.origin.size(); ++node) {
        if (part.origin[node] != Origin::kMeasured) {
          continue;
        }
        const double weight = std::abs(brdf.omega_o(node).z) * brdf.solid_angle_sr(node);
        albedo += weight * static_cast<double>(part.f_per_sr[ch][node]);
        if (!part.random_per_sr.empty()) {
          const double r = weight * static_cast<double>(part.random_per_sr[ch][node]);
          random2 += r * r;
          fixed += weight * static_cast<double>(part.systematic_per_sr[ch][node]);
        }
      }
      row.albedo.push_back(albedo);
      row.standard_uncertainty.push_back(std::sqrt(random2 * kNodeOverlap + fixed * fixed));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

Result<Measurement> process(const std::filesystem::path& recording, const ProcessOptions& options) {
  const std::string name = recording.string();
  auto reader = device::RecordingReader::open(recording);
  if (!reader) {
    return std::unexpected(reader.error());
  }
  auto opened = open_scan(*reader, name, options.references);
  if (!opened) {
    return std::unexpected(opened.error());
  }
  RecordedScan& scan = *opened;
  Resampler::Options grid_options;
  for (const protocol::Illumination& source : scan.descriptor.illuminations) {
    grid_options.source_radius_rad =
        std::max(grid_options.source_radius_rad, static_cast<double>(source.angular_radius_rad));
  }
  // Reading is one thread's work; the grid's operator is built beside it.
  SampleFrame frame = sample_frame(0, 0, options.sample_rotation_rad);
  PixelGeometry geometry;
  std::optional<Resampler> resampler;
  Status read;
  oneapi::tbb::parallel_invoke([&] { read = read_frames(*reader, name, scan); },
                               [&] {
                                 geometry = pixel_geometry(scan.descriptor, scan.hot_pixels);
                                 resampler = Resampler::build(geometry, scan.descriptor, frame, grid_options);
                               });
  if (!read) {
    return std::unexpected(read.error());
  }
  const LaneSelection selection = select_lanes(scan);
  if (selection.lanes.empty()) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("{}: calibration {} has no reference for any illumination of the recording", name,
                            scan.references->id_hex()),
                "calibrate for the same geometry (reflection or transmission) as the measurement");
  }
  LaneImages images = lane_images(scan, selection);
  const std::size_t lanes = selection.lanes.size();
  spread_saturation(images, geometry, lanes);
  NodeValues nodes = resampler->apply(images.f_per_sr, images.variance, lanes);

  std::optional<TiltFit> tilt;
  bool corrected = false;
  if (!selection.transmission) {
    // The fit works in the instrument's frame; a turned sample's nodes are turned back by its lane
    // directions.
    LaneSelection turned = selection;
    for (Lane& lane : turned.lanes) {
      lane.omega_i = frame.to_sample(lane.omega_i);
    }
    tilt = fit_tilt(head_samples(nodes, grid_options.grid, turned));
    if (tilt && options.sample_rotation_rad != 0) {
      const double c = std::cos(options.sample_rotation_rad);
      const double s = std::sin(options.sample_rotation_rad);
      const Tilt t = tilt->tilt;
      tilt->tilt.x_rad = c * t.x_rad - s * t.y_rad;
      tilt->tilt.y_rad = s * t.x_rad + c * t.y_rad;
    }
    if (options.correct_tilt && tilt && tilt->tilt.told) {
      frame = sample_frame(tilt->tilt.x_rad, tilt->tilt.y_rad, options.sample_rotation_rad);
      resampler = Resampler::build(geometry, scan.descriptor, frame, grid_options);
      nodes = resampler->apply(images.f_per_sr, images.variance, lanes);
      corrected = true;
    }
  }

  const std::vector<float> systematic =
      systematic_uncertainty(nodes, grid_options.grid, frame, scan, selection);
  GridBrdf::Content content =
      grid_content(nodes, systematic, grid_options.grid, frame, scan, selection, options.sample_rotation_rad);
  content.metadata = provenance(scan, corrected ? &tilt->tilt : nullptr);
  auto brdf = GridBrdf::make(std::move(content));
  if (!brdf) {
    return std::unexpected(brdf.error());
  }

  Measurement m{std::move(*brdf),
                {},
                {},
                {},
                scan.ledger,
                scan.descriptor,
                scan.instrument_seconds,
                scan.raw_bytes,
                scan.id,
                scan.references->id_hex()};
  m.albedo = measured_albedo(m.brdf);
  if (tilt) {
    m.tilt = tilt->tilt;
  }
  m.quality = quality_report({scan, selection, m.brdf, m.albedo, tilt, corrected});
  return m;
}

}  // namespace scatter::measurement
