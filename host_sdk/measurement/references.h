// A calibration in memory: dark model and averaged reference images of one session.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "protocol/descriptor.h"
#include "protocol/types.h"

namespace scatter::measurement {

/// Image of rates per pixel of the full sensor, with the variance of each.
struct RateImage {
  std::vector<float> rate;      ///< [e-/s per volt of LED monitor].
  std::vector<float> variance;  ///< Of rate; 0 rate with infinite variance where saturated in all exposures.
};

/// Signal without light: dn(t, T) = offset + dark_rate * t * 2^((T - temperature) / doubling) / gain.
struct DarkModel {
  std::vector<float> offset_dn;
  std::vector<float> dark_rate_e_per_s;
  float offset_variance_dn2 = 0;      ///< Of offset_dn, per pixel.
  float rate_variance_e2_per_s2 = 0;  ///< Of dark_rate_e_per_s, per pixel.
  std::int32_t sensor_temperature_mK = 0;
};

/// Reference images of one illumination.
struct ReferenceImages {
  std::uint8_t illumination = 0;
  RateImage reference;  ///< White tile, or translucent standard for the transmission module.
  RateImage black;
  /// Distinct exposures that `reference` was taken with, ascending, times the monitor [s V]: rate times the
  /// longest that fits the well is the level the sensor worked at.
  std::vector<float> reference_exposures;
};

/// Immutable content of a calibration; identified by the SHA-256 of its serialised bytes.
///
/// Serialised form, little endian: "OSREF001", u32 header length, header (JSON text: serial, size,
/// illuminations, certificates, times, temperatures), then planes of width * height in row order:
/// dark offset f32, dark rate f32, then per illumination reference rate f32, reference variance
/// bf16 (upper half of an f32), black rate f32, black variance bf16.
class ReferenceSet {
 public:
  struct Content {
    std::string serial;
    std::uint16_t width = 0;
    std::uint16_t height = 0;
    DarkModel dark;
    std::vector<ReferenceImages> illuminations;
    std::vector<protocol::ReferenceCertificate> certificates;  ///< Those that hold for the references used.
    std::uint64_t unix_time_s = 0;
    std::uint64_t device_time_us = 0;
    std::int32_t sensor_temperature_mK = 0;
    std::int32_t led_temperature_mK = 0;
  };

  [[nodiscard]] static std::shared_ptr<const ReferenceSet> make(Content content);
  /// A part (window) of a set that keeps the set's name.
  [[nodiscard]] static std::shared_ptr<const ReferenceSet> with_identity(
      Content content, const std::array<std::uint8_t, 32>& sha256);
  /// `known_sha256` saves the hashing where another checksum covers the bytes (a recording's copy).
  /// Errors  kDataLoss naming what does not fit.
  [[nodiscard]] static Result<std::shared_ptr<const ReferenceSet>> parse(
      std::span<const std::byte> bytes,
      const std::optional<std::array<std::uint8_t, 32>>& known_sha256 = std::nullopt);
  [[nodiscard]] std::vector<std::byte> serialise() const;

  [[nodiscard]] const Content& content() const noexcept { return content_; }
  [[nodiscard]] const std::array<std::uint8_t, 32>& sha256() const noexcept { return sha256_; }
  [[nodiscard]] protocol::CalibrationId id() const noexcept;
  [[nodiscard]] std::string id_hex() const;
  [[nodiscard]] const ReferenceImages* find(std::uint8_t illumination) const noexcept;
  [[nodiscard]] const protocol::ReferenceCertificate* certificate(protocol::Target kind) const noexcept;

 private:
  ReferenceSet() = default;
  Content content_;
  std::array<std::uint8_t, 32> sha256_{};
};

}  // namespace scatter::measurement
