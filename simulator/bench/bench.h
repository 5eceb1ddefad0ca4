// The photons' side of the simulated instrument: sources, sample, optics, sensor, noise, temperature.
// It integrates spot, source disc and pixel from its own true parameters; host code sees only the
// descriptor, the factory objects and the frames.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "host_sdk/error/error.h"
#include "protocol/descriptor.h"
#include "protocol/messages.h"
#include "protocol/types.h"
#include "simulator/bench/faults.h"
#include "simulator/samples/sample.h"

namespace scatter::simulator {

enum class Profile : std::uint8_t {
  kHs1,     ///< 480 x 480, 10 bit.
  kFine,    ///< 1024 x 1024, 12 bit.
  kBinned,  ///< HS-1 read in blocks of 4 x 4: 120 x 120, 10 bit. For slow links.
};

/// How the true instrument differs from its certificates.
enum class References : std::uint8_t {
  kExact,  ///< Not at all.
  kDrawn,  ///< By seeded draws with the standard deviations that the descriptor states.
};

struct BenchOptions {
  std::uint64_t seed = 1;  ///< Of everything random: instrument, draws and noise.
  Profile profile = Profile::kHs1;
  References references = References::kExact;
  bool transmission_module = false;           ///< Mounted anyway when the sample transmits.
  bool reference_stage = true;                ///< Only told to the descriptor.
  std::shared_ptr<const Sample> sample = {};  ///< Must be given.
  BenchFaults faults = {};
};

struct Exposure {
  static constexpr std::uint8_t kNoLight = 0xFF;

  protocol::Target target = protocol::Target::kSample;
  std::uint8_t illumination = kNoLight;  ///< Index into the descriptor's list, or kNoLight.
  std::uint32_t exposure_us = 0;
  std::uint64_t scheduled_us = 0;  ///< Start, as accumulated exposure + readout (+ stage) time since boot.
  std::uint64_t placed_us = 0;     ///< Scheduled time at which the target was placed.
  std::uint64_t index = 0;         ///< Exposures before this one since boot: the key of its noise.
  std::uint16_t x = 0, y = 0;      ///< Window, pixels.
  std::uint16_t width = 0;         ///< 0 = to the right edge.
  std::uint16_t height = 0;        ///< 0 = to the bottom edge.
};

/// Threads   const functions and `expose` may be called from any number of threads; the result of an
///           exposure depends on its arguments, the options and the sample alone, never on earlier calls, the
///           window or the number of threads.
class Bench {
 public:
  /// Errors    kInvalidArgument: no sample.
  /// Cost      some ms; the light of each head is integrated at its first exposure (about 0.1 s).
  [[nodiscard]] static Result<std::unique_ptr<Bench>> make(BenchOptions options);
  ~Bench();

  [[nodiscard]] const protocol::Descriptor& descriptor() const noexcept;
  /// Bytes of kHotPixels and kPrnuMap as messages.h lays them out; empty for other objects.
  [[nodiscard]] std::span<const std::byte> object(protocol::ObjectId id) const noexcept;

  /// Takes one exposure and gives the monitor's mean reading [uV].
  /// Shape     dn.size() == window's width * height, row major.
  /// Range     window inside the sensor, illumination in the list or kNoLight; otherwise dn is black.
  std::uint32_t expose(const Exposure& exposure, std::span<std::uint16_t> dn);

  /// Expected electrons of the same exposure before noise, saturation and non-linearity [e-].
  void expected_electrons(const Exposure& exposure, std::span<float> electrons);

  /// Puts another sample in the place of the one before; exposures from now on see it. Not while one is
  /// taken. Range     not null, on the same side of the light as the first one.
  void put(std::shared_ptr<const Sample> sample);
  [[nodiscard]] const std::shared_ptr<const Sample>& sample() const noexcept;

  struct Temperatures {
    std::int32_t sensor_mK = 0;
    std::int32_t led_board_mK = 0;
  };
  [[nodiscard]] Temperatures temperatures(std::uint64_t scheduled_us) const noexcept;

 private:
  struct Parts;
  explicit Bench(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace scatter::simulator
