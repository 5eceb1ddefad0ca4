#include "simulator/bench/profile.h"

#include <fmt/format.h>

#include <array>

namespace scatter::simulator {
namespace {

using reflectance::radians;

constexpr std::array<float, 3> kPeakNm{630.0F, 525.0F, 465.0F};
constexpr std::array<float, 3> kFwhmNm{18.0F, 32.0F, 22.0F};
constexpr std::array<double, 4> kReflectionHeadsDeg{0, 20, 40, 60};
constexpr std::array<double, 4> kTransmissionHeadsDeg{120, 140, 160, 180};
constexpr double kSourceRadiusDeg = 0.5;
constexpr double kBlindRadiusDeg = 2.5;

float single(double value) noexcept {
  return static_cast<float>(value);
}

void add_head(protocol::Descriptor& d, double theta_deg, std::uint8_t head) {
  for (std::uint8_t channel = 0; channel < 3; ++channel) {
    d.illuminations.push_back({.theta_rad = single(radians(theta_deg)),
                               .phi_rad = 0,
                               .wavelength_nm = kPeakNm[channel],
                               .fwhm_nm = kFwhmNm[channel],
                               .angular_radius_rad = single(radians(kSourceRadiusDeg)),
                               .head = head,
                               .channel = channel});
  }
}

protocol::ReferenceCertificate certificate(protocol::Target kind, std::string_view id, double f_per_sr,
                                           double relative_uncertainty) {
  protocol::ReferenceCertificate c;
  c.kind = kind;
  c.id = id;
  for (int channel = 0; channel < 3; ++channel) {
    c.f_per_sr.push_back(single(f_per_sr));
    c.relative_uncertainty.push_back(single(relative_uncertainty));
  }
  return c;
}

}  // namespace

protocol::Descriptor certified_descriptor(const BenchOptions& options, bool transmission) {
  const bool fine = options.profile == Profile::kFine;
  const auto side = static_cast<float>(binning(options.profile));
  const float area = side * side;
  const auto serial = static_cast<std::uint32_t>(options.seed ^ (options.seed >> 32U));
  protocol::Descriptor d;
  d.product = fine ? "OpenScatter HS-1 fine (simulated)" : "OpenScatter HS-1 (simulated)";
  d.serial = std::string_view(fmt::format("SIM-{:08x}", serial));
  d.hardware_revision = "1.0";
  const auto pixels = static_cast<std::uint16_t>((fine ? 1024 : 480) / binning(options.profile));
  // Binning adds the readings of side x side pixels: their electrons, wells and dark currents add up, their
  // read noise adds in squares, and the sum is given in the same 10 bits above the same black level.
  d.sensor = {.width_px = pixels,
              .height_px = pixels,
              .bits = static_cast<std::uint8_t>(fine ? 12 : 10),
              .min_exposure_us = 10,
              .max_exposure_us = 200000,
              .readout_us = fine ? 33000U : 16000U,
              .gain_e_per_dn = fine ? 2.5F : 10.0F * area,
              .full_well_e = 10000.0F * area,
              .read_noise_e = 25.0F * side,
              .black_level_dn = fine ? 64.0F : 16.0F,
              .dark_current_e_per_s = 50.0F * area,
              .dark_doubling_K = 7.0F,
              .reference_temperature_mK = 298150,
              .linearity = -0.01F};
  // A mild distortion: the first terms of the equisolid angle projection 2 sin(theta / 2), 75 deg
  // at 224 px of the 480 px window.
  const float scale = static_cast<float>(pixels) / 480.0F;
  d.optics = {.center_x_px = 240.6F * scale,
              .center_y_px = 239.5F * scale,
              .radius_px = 184.0F * scale,
              .a1 = 1.0F,
              .a3 = -1.0F / 24.0F,
              .a5 = 1.0F / 1920.0F,
              .rotation_rad = single(radians(0.7)),
              .theta_max_rad = single(radians(75)),
              .image_theta_max_rad = single(radians(80))};
  d.spot_diameter_mm = 3.0F;
  d.monitor_slope_per_K = 5e-4F;
  d.dark_lifetime_s = 30 * 60;
  d.reference_lifetime_s = 60 * 60;
  d.calibration_span_mK = 3000;
  d.reference_stage = options.reference_stage ? 1 : 0;
  d.transmission_module = transmission ? 1 : 0;
  d.uncertainty = {
      .linearity = 0.001F, .geometry_rad = single(radians(0.03)), .prnu = 0.001F, .monitor = 0.0002F};
  std::uint8_t head = 0;
  for (const double theta_deg : kReflectionHeadsDeg) {
    d.blind_spots.push_back({single(radians(theta_deg)), 0.0F, single(radians(kBlindRadiusDeg))});
    add_head(d, theta_deg, head++);
  }
  if (transmission) {
    for (const double theta_deg : kTransmissionHeadsDeg) {
      add_head(d, theta_deg, head++);
    }
  }
  using protocol::Target;
  d.certificates.push_back(certificate(Target::kWhiteReference, "SIM-WHITE", kWhite_per_sr, 0.003));
  d.certificates.push_back(certificate(Target::kBlackReference, "SIM-BLACK", kBlack_per_sr, 0.05));
  d.certificates.push_back(
      certificate(Target::kTranslucentReference, "SIM-TRANSLUCENT", kTranslucent_per_sr, 0.003));
  return d;
}

}  // namespace scatter::simulator
