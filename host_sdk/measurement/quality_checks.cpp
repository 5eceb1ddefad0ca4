#include "host_sdk/measurement/quality_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace scatter::measurement {
namespace {

using reflectance::degrees;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;

constexpr double kTiltLimit_deg = 0.3;
constexpr double kLobeResidualLimit = 0.05;
constexpr double kAmbientLimit = 0.01;
constexpr double kSoftLimit = 0.005;
constexpr double kSaturationLimit = 0.001;
constexpr double kLowSignalLimit = 0.10;
constexpr double kLowSignalUncertainty = 0.05;
constexpr double kLedDriftLimit = 0.02;
constexpr double kReciprocityLimit = 0.03;
constexpr double kSymmetryLimit = 0.03;
constexpr double kDimLevel_dn = 20;  // Mean over the picture.

QualityItem item(std::string name, double value, double limit, bool good, Verdict otherwise,
                 std::string advice, std::string found = {}) {
  return {std::move(name), value, limit, good ? Verdict::kOk : otherwise,
          good ? std::move(found) : std::move(advice)};
}

double median(std::vector<double>& values) {
  if (values.empty()) {
    return 0;
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void add_ledger(const QualityInput& in, std::vector<QualityItem>& out) {
  const protocol::Ledger& l = in.scan.ledger;
  const auto lost = static_cast<double>(l.exposed - std::min(l.exposed, l.delivered));
  out.push_back(item("ledger_unbalanced", l.balances() ? 0 : 1, 0, l.balances(), Verdict::kFail,
                     "the loss ledger does not balance: measure again and report this with the recording"));
  out.push_back(item("frames_lost", lost, 0, lost == 0, Verdict::kWarn,
                     "frames were lost (see the ledger): the measurement uses the rest; check the cable, "
                     "then measure again"));
  out.push_back(item("frames_damaged", static_cast<double>(in.scan.damaged_frames), 0,
                     in.scan.damaged_frames == 0, Verdict::kWarn,
                     "damaged frames were left out; check the cable, then measure again"));
  if (!in.scan.integrity.empty()) {
    out.push_back({"recording_damaged", 1, 0, Verdict::kWarn, in.scan.integrity});
  }
  for (const std::string& omitted : in.selection.omitted) {
    out.push_back(
        {"illumination_omitted", 1, 0, Verdict::kWarn, omitted + "; calibrate again, or check that LED"});
  }
}

void add_calibration(const QualityInput& in, std::vector<QualityItem>& out) {
  const ReferenceSet::Content& c = in.scan.references->content();
  const double age_s =
      static_cast<double>(in.scan.creation_unix_ns) * 1e-9 - static_cast<double>(c.unix_time_s);
  const double life_s = in.scan.descriptor.reference_lifetime_s;
  out.push_back(item("calibration_age_s", age_s, life_s, std::abs(age_s) <= life_s, Verdict::kWarn,
                     "the calibration is too old for this measurement: run `scatter calibrate`, then process "
                     "this recording with it"));
  std::int32_t sensor = c.sensor_temperature_mK;
  for (const FrameRecord& frame : in.scan.frames) {
    if (std::abs(frame.begin.sensor_temperature_mK - c.sensor_temperature_mK) >
        std::abs(sensor - c.sensor_temperature_mK)) {
      sensor = frame.begin.sensor_temperature_mK;
    }
  }
  const double change_K = 1e-3 * std::abs(sensor - c.sensor_temperature_mK);
  const double span_K = 1e-3 * in.scan.descriptor.calibration_span_mK;
  out.push_back(item(
      "temperature_change_K", change_K, span_K, change_K <= span_K, Verdict::kWarn,
      "the instrument's temperature moved since the calibration: let it settle, calibrate, measure again"));
}

void add_light(const QualityInput& in, std::vector<QualityItem>& out) {
  struct Range {
    double low = std::numeric_limits<double>::infinity();
    double high = 0;
  };
  std::map<std::uint8_t, Range> monitor;
  std::map<std::pair<std::uint8_t, std::uint32_t>, const FrameRecord*>
      first;  // Of each illumination and exposure.
  double soft = 0;
  std::string dead;
  for (const FrameRecord& frame : in.scan.frames) {
    if (frame.begin.kind != protocol::FrameKind::kLight) {
      continue;
    }
    Range& range = monitor[frame.begin.illumination];
    range.low = std::min(range.low, frame.monitor_v);
    range.high = std::max(range.high, frame.monitor_v);
    if ((frame.end.flags & protocol::kFrameMonitorLow) != 0) {
      dead = fmt::format("{}", frame.begin.illumination);
    }
    const auto [at, is_first] =
        first.emplace(std::pair(frame.begin.illumination, frame.begin.exposure_us), &frame);
    const FrameRecord& earlier = *at->second;
    // The same illumination and exposure in another sweep is the same picture, if nothing moved. Dim
    // frames carry too little light for a verdict at the half-percent level.
    if (!is_first && earlier.begin.sweep != frame.begin.sweep && earlier.level_dn > kDimLevel_dn) {
      soft = std::max(
          soft, std::abs(frame.level_dn / frame.monitor_v / (earlier.level_dn / earlier.monitor_v) - 1));
    }
  }
  double drift = 0;
  for (const auto& [illumination, range] : monitor) {
    if (range.low > 0) {
      drift = std::max(drift, range.high / range.low - 1);
    }
  }
  out.push_back(item("repeat_difference", soft, kSoftLimit, soft <= kSoftLimit, Verdict::kWarn,
                     "repeated frames disagree: the sample is soft or moved; let it settle or support it, "
                     "then measure again"));
  out.push_back(item(
      "led_drift", drift, kLedDriftLimit, drift <= kLedDriftLimit, Verdict::kWarn,
      "the LEDs drifted during the measurement (the monitor corrects for it): let the instrument warm up"));
  if (!dead.empty()) {
    out.push_back(
        {"led_dead", 1, 0, Verdict::kFail, "illumination " + dead + " gives no light: check the LED head"});
  }

  const LightSums::Planes* off_light = in.scan.light.find(kLedOff);
  if (off_light != nullptr && !in.selection.lanes.empty()) {
    // Light that is there with the LEDs off, as a share of a white surface's light under the LEDs.
    double off = 0;
    double lit = 0;
    const Lane& lane = in.selection.lanes[in.selection.lanes.size() / 2];
    for (std::size_t p = 0; p < off_light->image.rate.size(); ++p) {
      const double w = static_cast<double>(lane.references->reference.rate[p]) / lane.light->inverse_monitor;
      if (w > 0 && std::isfinite(off_light->image.variance[p])) {
        off += static_cast<double>(off_light->image.rate[p]);
        lit += w;
      }
    }
    const double share = lit > 0 ? off / lit : 0;
    out.push_back(item("ambient_share", share, kAmbientLimit, share <= kAmbientLimit, Verdict::kWarn,
                       "light reaches the sensor with the LEDs off: the sample is translucent or does not "
                       "lie flat; put a black matte "
                       "backing behind it, shade it, and measure again (the share was subtracted)"));
  }
}

void add_coverage(const QualityInput& in, std::vector<QualityItem>& out) {
  const GridBrdf::Content& c = in.brdf.content();
  double measured = 0, saturated = 0, low = 0, blind = 0, all = 0;
  for (const GridPart& part : c.parts) {
    for (std::size_t node = 0; node < part.origin.size(); ++node) {
      const double weight = in.brdf.solid_angle_sr(node);
      all += weight;
      switch (part.origin[node]) {
        case Origin::kInvalid:
          saturated += weight;
          break;
        case Origin::kInterpolated:
          blind += weight;
          break;
        case Origin::kExtrapolated:
          break;
        case Origin::kMeasured: {
          measured += weight;
          bool weak = false;
          for (std::size_t ch = 0; ch < c.channels; ++ch) {
            const double u = std::hypot(static_cast<double>(part.random_per_sr[ch][node]),
                                        static_cast<double>(part.systematic_per_sr[ch][node]));
            weak = weak || u > kLowSignalUncertainty * std::abs(static_cast<double>(part.f_per_sr[ch][node]));
          }
          low += weak ? weight : 0;
          break;
        }
      }
    }
  }
  out.push_back(item("saturated_share", all > 0 ? saturated / all : 0, kSaturationLimit,
                     saturated <= kSaturationLimit * all, Verdict::kWarn,
                     "directions saturated even at the shortest exposure have no value: the sample is too "
                     "mirror-like there"));
  out.push_back(item("low_signal_share", measured > 0 ? low / measured : 1, kLowSignalLimit,
                     low <= kLowSignalLimit * measured && measured > 0, Verdict::kWarn,
                     "many directions have more than 5 % uncertainty: raise --time-budget or --repeats, or "
                     "average several measurements"));
  out.push_back(item("blind_share", all > 0 ? blind / all : 0, 0, true, Verdict::kOk, "",
                     "directions hidden by the source heads; interpolated and flagged"));
}

/// Mean over channels at a node; NaN unless measured.
double measured_value(const GridBrdf::Content& c, const GridPart& part, std::size_t j, std::size_t i) {
  const std::size_t node = j * c.phi_count + i % c.phi_count;
  if (part.origin[node] != Origin::kMeasured) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  double sum = 0;
  for (std::size_t ch = 0; ch < c.channels; ++ch) {
    sum += static_cast<double>(part.f_per_sr[ch][node]);
  }
  return sum / static_cast<double>(c.channels);
}

/// Mean over channels between nodes, linear in both angles; NaN next to a node without value.
double measured_between(const GridBrdf::Content& c, const GridPart& part, double theta, double phi) {
  const double y = theta / c.theta_step;
  const double x =
      phi / c.phi_step - std::floor(phi / (2 * reflectance::kPi)) * static_cast<double>(c.phi_count);
  const auto j = static_cast<std::size_t>(y);
  const auto i = static_cast<std::size_t>(x);
  if (j + 1 >= c.theta_count) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double v = y - static_cast<double>(j);
  const double u = x - static_cast<double>(i);
  return (1 - v) * ((1 - u) * measured_value(c, part, j, i) + u * measured_value(c, part, j, i + 1)) +
         v * ((1 - u) * measured_value(c, part, j + 1, i) + u * measured_value(c, part, j + 1, i + 1));
}

void add_physics(const QualityInput& in, std::vector<QualityItem>& out) {
  const GridBrdf::Content& c = in.brdf.content();
  double highest = 0;
  double excess = 0;
  for (const AlbedoRow& row : in.albedo) {
    for (std::size_t ch = 0; ch < row.albedo.size(); ++ch) {
      highest = std::max(highest, row.albedo[ch]);
      excess = std::max(excess, row.albedo[ch] - 2 * row.standard_uncertainty[ch]);
    }
  }
  out.push_back(item(
      "highest_albedo", highest, 1.0, excess <= 1.0, Verdict::kFail,
      "more light comes back than goes in: check the white reference and its certificate, calibrate again"));

  if (c.type == reflectance::ScatterType::kBrdf) {
    std::vector<double> differences;
    for (std::size_t a = 0; a < c.parts.size(); ++a) {
      for (std::size_t b = a + 1; b < c.parts.size(); ++b) {
        const GridPart& pa = c.parts[a];
        const GridPart& pb = c.parts[b];
        if (pa.rotation_rad != pb.rotation_rad || pa.theta_i < 0.05 || pb.theta_i < 0.05) {
          continue;
        }
        for (std::size_t i = 5; i < c.phi_count; i += 5) {
          const double turn = static_cast<double>(i) * c.phi_step;
          const double there = measured_between(c, pa, pb.theta_i, pa.phi_i + turn);
          const double back = measured_between(c, pb, pa.theta_i, pb.phi_i - turn);
          const double mean = 0.5 * (there + back);
          if (std::isfinite(mean) && mean > 0) {
            differences.push_back(std::abs(there - back) / mean);
          }
        }
      }
    }
    if (!differences.empty()) {
      const double value = median(differences);
      out.push_back(item("reciprocity_difference", value, kReciprocityLimit, value <= kReciprocityLimit,
                         Verdict::kWarn,
                         "f(i, o) and f(o, i) differ: the sample is uneven, translucent, or not level"));
    }
  }

  std::vector<double> halves;
  for (const GridPart& part : c.parts) {
    for (std::size_t j = 5; j < c.theta_count; j += 3) {
      for (std::size_t i = 5; i < c.phi_count / 2; i += 5) {
        const double theta = static_cast<double>(j) * c.theta_step * 0.9999;
        const double turn = static_cast<double>(i) * c.phi_step;
        const double left = measured_between(c, part, theta, part.phi_i + turn);
        const double right = measured_between(c, part, theta, part.phi_i - turn);
        const double mean = 0.5 * (left + right);
        if (std::isfinite(mean) && mean > 0) {
          halves.push_back(std::abs(left - right) / mean);
        }
      }
    }
  }
  if (!halves.empty()) {
    const double value = median(halves);
    out.push_back(item("mirror_asymmetry", value, kSymmetryLimit, value <= kSymmetryLimit, Verdict::kWarn,
                       "both sides of the plane of incidence differ: the sample is tilted sideways or "
                       "anisotropic; measure it at 0 and "
                       "90 deg and merge"));
  }
}

void add_tilt(const QualityInput& in, std::vector<QualityItem>& out) {
  if (!in.tilt) {
    return;
  }
  const Tilt& t = in.tilt->tilt;
  const double x = degrees(t.x_rad);
  const double y = degrees(t.y_rad);
  const double size = std::hypot(x, y);
  const double error = std::isfinite(t.standard_error_rad) ? degrees(t.standard_error_rad) : 90.0;
  if (!t.told) {
    const std::string why = "tilt cannot be told: the sample has no lobe narrow enough to show it";
    out.push_back({"tilt_deg", 0, kTiltLimit_deg, Verdict::kCannotTell, why});
    out.push_back({"tilt_standard_error_deg", error, 0.05, Verdict::kCannotTell, why});
    return;
  }
  const bool level = size <= kTiltLimit_deg;
  const std::string advice = in.tilt_corrected
                                 ? "tilt was corrected"
                                 : "the sample is not level: seat it again, or process with --correct-tilt";
  out.push_back(item("tilt_deg", size, kTiltLimit_deg, level || in.tilt_corrected, Verdict::kWarn, advice,
                     in.tilt_corrected ? advice : ""));
  out.push_back({"tilt_x_deg", x, 0, Verdict::kOk, "lean of the normal towards phi = 0"});
  out.push_back({"tilt_y_deg", y, 0, Verdict::kOk, "lean of the normal towards phi = 90 deg"});
  out.push_back({"tilt_standard_error_deg", error, 0.05, Verdict::kOk, ""});
  out.push_back(item("lobe_residual", in.tilt->lobe_residual, kLobeResidualLimit,
                     in.tilt->lobe_residual <= kLobeResidualLimit, Verdict::kOk, "",
                     "how far the specular lobes are from one common round lobe; a large value with little "
                     "tilt means an uneven surface"));
  if (in.tilt->lobe_residual > kLobeResidualLimit) {
    out.back().advice = "the specular lobes are not of one common round shape: the surface may be uneven";
  }
}

}  // namespace

std::vector<QualityItem> quality_report(const QualityInput& input) {
  std::vector<QualityItem> out;
  add_ledger(input, out);
  add_calibration(input, out);
  add_tilt(input, out);
  add_light(input, out);
  add_coverage(input, out);
  add_physics(input, out);
  return out;
}

}  // namespace scatter::measurement
