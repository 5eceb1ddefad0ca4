// The instrument descriptor: every number host code needs to know of an instrument, so that it
// never hard-codes one. Read as object kDescriptor (see messages.h).
#pragma once

#include <cstdint>

#include "protocol/bounded.h"
#include "protocol/field.h"
#include "protocol/types.h"

namespace scatter::protocol {

/// One LED that can be lit: a head's position and one colour.
struct Illumination {
  float theta_rad = 0;      ///< From the sample's upper normal, 0..pi; above pi/2 = transmission module.
  float phi_rad = 0;        ///< Azimuth of the head.
  float wavelength_nm = 0;  ///< Peak.
  float fwhm_nm = 0;
  float angular_radius_rad = 0;  ///< Of the source's disc as the sample sees it.
  std::uint8_t head = 0;         ///< Heads are numbered in the order of the list.
  std::uint8_t channel = 0;      ///< 0 red, 1 green, 2 blue.
  static constexpr auto schema() {
    return fields(
        field("theta_rad", &Illumination::theta_rad, "rad",
              "head's angle from the upper normal, above pi/2 below the sample"),
        field("phi_rad", &Illumination::phi_rad, "rad", "head's azimuth"),
        field("wavelength_nm", &Illumination::wavelength_nm, "nm", "peak wavelength"),
        field("fwhm_nm", &Illumination::fwhm_nm, "nm", "full width at half maximum"),
        field("angular_radius_rad", &Illumination::angular_radius_rad, "rad", "radius of the source's disc"),
        field("head", &Illumination::head, "", "head number"),
        field("channel", &Illumination::channel, "", "0 red, 1 green, 2 blue"));
  }
  friend constexpr bool operator==(const Illumination&, const Illumination&) noexcept = default;
};

/// Disc of directions that the camera cannot see (a source head stands there).
struct BlindSpot {
  float theta_rad = 0;
  float phi_rad = 0;
  float radius_rad = 0;
  static constexpr auto schema() {
    return fields(field("theta_rad", &BlindSpot::theta_rad, "rad", "centre, from the normal"),
                  field("phi_rad", &BlindSpot::phi_rad, "rad", "centre, azimuth"),
                  field("radius_rad", &BlindSpot::radius_rad, "rad", "radius"));
  }
  friend constexpr bool operator==(const BlindSpot&, const BlindSpot&) noexcept = default;
};

/// Standard uncertainties of the factory calibration (k = 1).
struct FactoryUncertainty {
  float linearity = 0;     ///< Relative, full scale.
  float geometry_rad = 0;  ///< Of each pointing parameter: centre x and y, scale, rotation, source heads.
  float prnu = 0;          ///< Relative, per pixel.
  float monitor = 0;       ///< Relative, per reading.
  static constexpr auto schema() {
    using U = FactoryUncertainty;
    return fields(field("linearity", &U::linearity, "1", "relative, of full scale"),
                  field("geometry_rad", &U::geometry_rad, "rad", "of each pointing parameter"),
                  field("prnu", &U::prnu, "1", "relative, per pixel"),
                  field("monitor", &U::monitor, "1", "relative, per reading"));
  }
  friend constexpr bool operator==(const FactoryUncertainty&, const FactoryUncertainty&) noexcept = default;
};

/// Optics: a direction (theta, phi) images at
///   r = radius_px * (a1 theta + a3 theta^3 + a5 theta^5),
///   x = center_x_px + r cos(phi + rotation_rad),  y = center_y_px + r sin(phi + rotation_rad),
/// where pixel (i, j) covers [i, i+1) x [j, j+1).
struct Optics {
  float center_x_px = 0;
  float center_y_px = 0;
  float radius_px = 0;
  float a1 = 0;  ///< [1/rad]
  float a3 = 0;  ///< [1/rad^3]
  float a5 = 0;  ///< [1/rad^5]
  float rotation_rad = 0;
  float theta_max_rad = 0;        ///< Measured range; directions beyond it are extrapolated.
  float image_theta_max_rad = 0;  ///< The image goes on to here.
  static constexpr auto schema() {
    return fields(field("center_x_px", &Optics::center_x_px, "px", "image of theta = 0"),
                  field("center_y_px", &Optics::center_y_px, "px", "image of theta = 0"),
                  field("radius_px", &Optics::radius_px, "px", "R of r = R (a1 t + a3 t^3 + a5 t^5)"),
                  field("a1", &Optics::a1, "1/rad", "linear term"),
                  field("a3", &Optics::a3, "1/rad^3", "cubic term"),
                  field("a5", &Optics::a5, "1/rad^5", "quintic term"),
                  field("rotation_rad", &Optics::rotation_rad, "rad", "in-plane rotation"),
                  field("theta_max_rad", &Optics::theta_max_rad, "rad", "measured range"),
                  field("image_theta_max_rad", &Optics::image_theta_max_rad, "rad", "end of the image"));
  }
  friend constexpr bool operator==(const Optics&, const Optics&) noexcept = default;
};

/// Sensor: counts = black_level_dn + electrons / gain_e_per_dn, with electrons = q + linearity_e * q^2 /
/// full_well_e.
struct SensorInfo {
  std::uint16_t width_px = 0;
  std::uint16_t height_px = 0;
  std::uint8_t bits = 0;
  std::uint32_t min_exposure_us = 0;
  std::uint32_t max_exposure_us = 0;
  std::uint32_t readout_us = 0;  ///< Per full frame; a window costs its share of rows.
  float gain_e_per_dn = 0;
  float full_well_e = 0;
  float read_noise_e = 0;
  float black_level_dn = 0;
  float dark_current_e_per_s = 0;  ///< At reference_temperature_mK.
  float dark_doubling_K = 0;
  std::int32_t reference_temperature_mK = 0;
  float linearity = 0;  ///< Coefficient c of q_measured = q (1 + c q / full_well).
  static constexpr auto schema() {
    using S = SensorInfo;
    return fields(
        field("width_px", &S::width_px, "px", "columns"), field("height_px", &S::height_px, "px", "rows"),
        field("bits", &S::bits, "bit", "significant bits"),
        field("min_exposure_us", &S::min_exposure_us, "us", "shortest exposure"),
        field("max_exposure_us", &S::max_exposure_us, "us", "longest exposure"),
        field("readout_us", &S::readout_us, "us", "readout of a full frame"),
        field("gain_e_per_dn", &S::gain_e_per_dn, "e-/DN", "electrons per count"),
        field("full_well_e", &S::full_well_e, "e-", "electrons at saturation"),
        field("read_noise_e", &S::read_noise_e, "e-", "rms"),
        field("black_level_dn", &S::black_level_dn, "DN", "counts without light"),
        field("dark_current_e_per_s", &S::dark_current_e_per_s, "e-/s", "at the reference temperature"),
        field("dark_doubling_K", &S::dark_doubling_K, "K", "dark current doubles every"),
        field("reference_temperature_mK", &S::reference_temperature_mK, "mK",
              "at which the dark current is stated"),
        field("linearity", &S::linearity, "1", "c of q_measured = q (1 + c q / full_well)"));
  }
  friend constexpr bool operator==(const SensorInfo&, const SensorInfo&) noexcept = default;
};

/// Certificate of one reference, one value per colour channel (red, green, blue).
struct ReferenceCertificate {
  Target kind = Target::kWhiteReference;
  BoundedString<48> id{};
  BoundedArray<float, 4> f_per_sr{};  ///< BRDF (BTDF for the translucent standard), cosine not included.
  BoundedArray<float, 4> relative_uncertainty{};  ///< Standard, k = 1.
  static constexpr auto schema() {
    using C = ReferenceCertificate;
    return fields(field("kind", &C::kind, "", "2 white, 3 black, 4 translucent"),
                  field("id", &C::id, "", "certificate's name"),
                  field("f_per_sr", &C::f_per_sr, "1/sr", "BRDF or BTDF per colour, no cosine"),
                  field("relative_uncertainty", &C::relative_uncertainty, "1", "standard, k = 1"));
  }
  friend constexpr bool operator==(const ReferenceCertificate&,
                                   const ReferenceCertificate&) noexcept = default;
};

struct Descriptor {
  BoundedString<32> product{};
  BoundedString<32> serial{};
  BoundedString<32> hardware_revision{};
  SensorInfo sensor{};
  Optics optics{};
  float spot_diameter_mm = 0;     ///< At normal incidence.
  float monitor_slope_per_K = 0;  ///< Relative change of the monitor per kelvin of LED board.
  std::uint32_t dark_lifetime_s = 0;
  std::uint32_t reference_lifetime_s = 0;
  std::int32_t calibration_span_mK = 0;  ///< A calibration expires when the temperature moved further.
  std::uint8_t reference_stage = 0;      ///< 1: the device places sample and references itself.
  std::uint8_t transmission_module = 0;  ///< 1: mounted; its illuminations are in the list.
  FactoryUncertainty uncertainty{};
  BoundedArray<Illumination, kMaxIlluminations> illuminations{};
  BoundedArray<BlindSpot, 16> blind_spots{};
  BoundedArray<ReferenceCertificate, 4> certificates{};  ///< Of the references delivered with the instrument.
  static constexpr auto schema() {
    using D = Descriptor;
    return fields(field("product", &D::product, "", "product's name"),
                  field("serial", &D::serial, "", "serial number, unique"),
                  field("hardware_revision", &D::hardware_revision, "", "of the electronics"),
                  field("sensor", &D::sensor, "", "image sensor"),
                  field("optics", &D::optics, "", "where directions fall on the sensor"),
                  field("spot_diameter_mm", &D::spot_diameter_mm, "mm", "at normal incidence"),
                  field("monitor_slope_per_K", &D::monitor_slope_per_K, "1/K", "of the monitor's reading"),
                  field("dark_lifetime_s", &D::dark_lifetime_s, "s", "a dark calibration expires after this"),
                  field("reference_lifetime_s", &D::reference_lifetime_s, "s",
                        "a reference calibration expires after this"),
                  field("calibration_span_mK", &D::calibration_span_mK, "mK", "expires beyond"),
                  field("reference_stage", &D::reference_stage, "", "1: places references itself"),
                  field("transmission_module", &D::transmission_module, "", "1: mounted"),
                  field("uncertainty", &D::uncertainty, "", "of the factory calibration"),
                  field("illuminations", &D::illuminations, "", "every LED that can be lit"),
                  field("blind_spots", &D::blind_spots, "", "directions hidden by source heads"),
                  field("certificates", &D::certificates, "", "references delivered with the instrument"));
  }
  friend constexpr bool operator==(const Descriptor&, const Descriptor&) noexcept = default;
};

}  // namespace scatter::protocol
