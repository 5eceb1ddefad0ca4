#include "simulator/bench/bench.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "simulator/bench/light.h"
#include "simulator/bench/profile.h"
#include "simulator/bench/truth.h"
#include "simulator/random/noise.h"
#include "simulator/random/stream.h"

namespace scatter::simulator {
namespace {

using protocol::Target;

constexpr double kMonitorNominal_uv = 500000;
constexpr double kMonitorNoise = 2e-4;
constexpr double kLedSlope_per_K = -0.003;
constexpr double kLedWarming_K = 2.0;
constexpr double kLedTime_s = 60.0;
constexpr double kSensorWarming_K = 1.5;
constexpr double kSensorTime_s = 300.0;
/// Slow drift of the LEDs' supply: amplitude and period.
constexpr double kSupplyDrift = 1e-3;
constexpr double kSupplyPeriod_s = 97.0;
/// The translucent standard also reflects; nobody is meant to measure that.
constexpr double kTranslucentReflects_per_sr = 0.45 / reflectance::kPi;

/// Expected electrons of a pixel are scale * sensitivity * light + stray * ... + dark * ...
struct Terms {
  const float* light = nullptr;  ///< Per pixel L/E_perp of the sample; null: `level` everywhere.
  float level = 0;               ///< L/E_perp of a Lambertian reference.
  float light_scale = 0;         ///< e- per unit of L/E_perp.
  float stray_scale = 0;
  float leak_scale = 0;
  float dark_scale = 0;
};

}  // namespace

struct Bench::Parts {
  explicit Parts(BenchOptions o)
      : options(std::move(o)),
        descriptor(certified_descriptor(options, options.transmission_module || options.sample->transmits())),
        truth(draw_truth(descriptor, options)),
        lens(truth.lens),
        images(truth.heads.size()) {}

  /// The sample under one head; made at its first use.
  struct HeadImage {
    std::once_flag once;
    LightImage light;
    bool lit = false;
  };

  /// image += more, or the first of them.
  static void add(LightImage more, LightImage& image) {
    for (std::size_t c = 0; c < image.size(); ++c) {
      if (image[c].empty()) {
        image[c] = std::move(more[c]);
      } else {
        std::ranges::transform(image[c], more[c], image[c].begin(), std::plus<>());
      }
    }
  }

  const HeadImage& image(std::size_t head) {
    HeadImage& slot = images[head];
    std::call_once(slot.once, [&] {
      const Head& source = truth.heads[head];
      for (const Aspect& aspect :
           Aspect::summands(*options.sample, descriptor.spot_diameter_mm, source.towards)) {
        slot.lit = aspect.lit();
        if (slot.lit) {
          add(integrate(lens, descriptor.sensor.width_px, descriptor.sensor.height_px, source, aspect),
              slot.light);
        }
      }
    });
    return slot;
  }

  [[nodiscard]] double led_kelvin(double time_s) const noexcept {
    return kLedWarming_K * (1 - std::exp(-time_s / kLedTime_s));
  }
  [[nodiscard]] double sensor_kelvin(double time_s) const noexcept {
    return kSensorWarming_K * (1 - std::exp(-time_s / kSensorTime_s));
  }

  /// M_s: output of a lit LED, 1 at the reference temperature.
  [[nodiscard]] double output(double time_s) const noexcept {
    const double supply =
        kSupplyDrift * std::sin(2 * reflectance::kPi * time_s / kSupplyPeriod_s + truth.drift_phase);
    return (1 + kLedSlope_per_K * led_kelvin(time_s)) * (1 + supply) *
           std::max(0.0, 1 + options.faults.led_drift_per_s * time_s);
  }

  /// BRDF (from above) or BTDF (from below) of a reference.
  [[nodiscard]] double reference_per_sr(Target target, std::size_t colour, bool below) const noexcept {
    switch (target) {
      case Target::kWhiteReference:
        return below ? 0.0 : truth.white_per_sr[colour];
      case Target::kBlackReference:
        return below ? 0.0 : truth.black_per_sr[colour];
      case Target::kTranslucentReference:
        return below ? truth.translucent_per_sr[colour] : kTranslucentReflects_per_sr;
      case Target::kSample:
      case Target::kDarkCap:
        break;
    }
    return 0.0;
  }

  struct Lit {
    bool on = false;
    double output = 0;
  };
  [[nodiscard]] Lit lit(const Exposure& e) const noexcept {
    if (e.illumination >= descriptor.illuminations.size() ||
        e.illumination == options.faults.dead_illumination) {
      return {};
    }
    return {true, output(middle_s(e))};
  }
  /// Drift and temperature within one exposure are those of its middle.
  [[nodiscard]] static double middle_s(const Exposure& e) noexcept {
    return 1e-6 * (static_cast<double>(e.scheduled_us) + 0.5 * e.exposure_us);
  }

  [[nodiscard]] Terms terms(const Exposure& e) {
    const double time_s = middle_s(e);
    const double exposure_s = 1e-6 * e.exposure_us;
    const double doublings = sensor_kelvin(time_s) / double{descriptor.sensor.dark_doubling_K};
    Terms t;
    t.dark_scale = static_cast<float>(exposure_s * std::exp2(doublings));
    if (e.target == Target::kSample) {
      t.leak_scale = static_cast<float>(exposure_s * options.sample->defects().translucent);
    }
    const Lit led = lit(e);
    if (!led.on) {
      return t;
    }
    t.stray_scale = static_cast<float>(exposure_s * led.output);
    const protocol::Illumination& source = descriptor.illuminations[e.illumination];
    const Head& head = truth.heads[source.head];
    double share = 1;
    if (e.target == Target::kSample) {
      const HeadImage& seen = image(source.head);
      if (seen.lit) {
        t.light = seen.light[source.channel].data();
      }
      share = options.sample->signal_share(time_s - 1e-6 * static_cast<double>(e.placed_us));
    } else {
      t.level = static_cast<float>(reference_per_sr(e.target, source.channel, head.towards.z < 0) *
                                   mean_cosine(head));
    }
    t.light_scale = static_cast<float>(exposure_s * led.output * share * truth.gain[e.illumination]);
    return t;
  }

  void mean_electrons(const Terms& t, std::size_t first, std::span<float> out) const noexcept {
    const float* sensitivity = truth.sensitivity.data() + first;
    const float* stray = truth.stray_e_per_s.data() + first;
    const float* leak = truth.leak_e_per_s.data() + first;
    const float* dark = truth.dark_e_per_s.data() + first;
    for (std::size_t k = 0; k < out.size(); ++k) {
      const float light = t.light != nullptr ? t.light[first + k] : t.level;
      out[k] = t.light_scale * light * sensitivity[k] + t.stray_scale * stray[k] + t.leak_scale * leak[k] +
               t.dark_scale * dark[k];
    }
  }

  /// Well, amplifier and converter.
  void read_out(std::size_t first, std::span<const float> electrons, std::span<const float> noise,
                std::uint16_t* dn) const noexcept {
    const protocol::SensorInfo& s = descriptor.sensor;
    const float well = s.full_well_e;
    const auto bend = static_cast<float>(truth.linearity / double{well});
    const float per_electron = 1.0F / s.gain_e_per_dn;
    const auto top = static_cast<float>((1U << s.bits) - 1U);
    const float* offset = truth.offset_dn.data() + first;
    for (std::size_t k = 0; k < electrons.size(); ++k) {
      const float q = electrons[k] < well ? electrons[k] : well;
      const float level = (q + bend * q * q + s.read_noise_e * noise[k]) * per_electron + offset[k] + 0.5F;
      const float clipped = level < 0.0F ? 0.0F : level > top ? top : level;
      dn[k] = static_cast<std::uint16_t>(static_cast<std::int32_t>(clipped));
    }
  }

  struct Frame {
    std::size_t x, y, width, height;
    bool valid;
  };
  [[nodiscard]] Frame frame(const Exposure& e, std::size_t given) const noexcept {
    const protocol::SensorInfo& s = descriptor.sensor;
    const std::size_t width = e.width != 0 ? e.width : s.width_px - std::min(e.x, s.width_px);
    const std::size_t height = e.height != 0 ? e.height : s.height_px - std::min(e.y, s.height_px);
    const bool valid =
        e.x + width <= s.width_px && e.y + height <= s.height_px && width * height == given &&
        (e.illumination == Exposure::kNoLight || e.illumination < descriptor.illuminations.size());
    return {e.x, e.y, width, height, valid};
  }

  /// Calls row(first pixel on the sensor, first pixel in the window, count) for every row.
  template <typename Row>
  void rows(const Frame& f, const Row& row) const {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, f.height, 16), [&](const auto& range) {
      for (std::size_t y = range.begin(); y != range.end(); ++y) {
        row((f.y + y) * descriptor.sensor.width_px + f.x, y * f.width, f.width);
      }
    });
  }

  BenchOptions options;
  protocol::Descriptor descriptor;
  Truth truth;
  Lens lens;
  std::vector<HeadImage> images;
};

Bench::Bench(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Bench::~Bench() = default;

Result<std::unique_ptr<Bench>> Bench::make(BenchOptions options) {
  if (options.sample == nullptr) {
    return fail(ErrorCode::kInvalidArgument, "bench: no sample given", "make one with Sample::make");
  }
  return std::unique_ptr<Bench>(new Bench(std::make_unique<Parts>(std::move(options))));
}

const protocol::Descriptor& Bench::descriptor() const noexcept {
  return parts_->descriptor;
}

std::span<const std::byte> Bench::object(protocol::ObjectId id) const noexcept {
  switch (id) {
    case protocol::ObjectId::kHotPixels:
      return parts_->truth.hot_pixels;
    case protocol::ObjectId::kPrnuMap:
      return parts_->truth.gain_map;
    case protocol::ObjectId::kDescriptor:
      break;
  }
  return {};
}

std::uint32_t Bench::expose(const Exposure& exposure, std::span<std::uint16_t> dn) {
  Parts& parts = *parts_;
  const Parts::Frame frame = parts.frame(exposure, dn.size());
  if (!frame.valid) {
    std::ranges::fill(dn, std::uint16_t{0});
    return 0;
  }
  const Terms terms = parts.terms(exposure);
  const RandomKey key{parts.options.seed, Purpose::kFrameNoise, exposure.index};
  parts.rows(frame, [&](std::size_t first, std::size_t at, std::size_t width) {
    constexpr std::size_t kStep = 512;
    std::array<float, kStep> electrons;
    std::array<float, kStep> noise;
    for (std::size_t x = 0; x < width; x += kStep) {
      const std::size_t count = std::min(kStep, width - x);
      const std::span mean = std::span(electrons).first(count);
      parts.mean_electrons(terms, first + x, mean);
      draw_shot_and_read_noise(key, static_cast<std::uint32_t>(first + x), mean, mean,
                               std::span(noise).first(count));
      parts.read_out(first + x, mean, std::span(noise).first(count), dn.data() + at + x);
    }
  });
  const Parts::Lit led = parts.lit(exposure);
  RandomStream random({parts.options.seed, Purpose::kMonitorNoise, exposure.index});
  const double sees = led.on ? led.output * (1 + double{parts.descriptor.monitor_slope_per_K} *
                                                     parts.led_kelvin(Parts::middle_s(exposure)))
                             : 0.0;
  const double reading_uv = kMonitorNominal_uv * sees * (1 + kMonitorNoise * random.normal());
  return static_cast<std::uint32_t>(std::lround(std::max(0.0, reading_uv)));
}

void Bench::expected_electrons(const Exposure& exposure, std::span<float> electrons) {
  Parts& parts = *parts_;
  const Parts::Frame frame = parts.frame(exposure, electrons.size());
  if (!frame.valid) {
    std::ranges::fill(electrons, 0.0F);
    return;
  }
  const Terms terms = parts.terms(exposure);
  parts.rows(frame, [&](std::size_t first, std::size_t at, std::size_t width) {
    parts.mean_electrons(terms, first, electrons.subspan(at, width));
  });
}

void Bench::put(std::shared_ptr<const Sample> sample) {
  parts_->options.sample = std::move(sample);
  parts_->images = std::vector<Parts::HeadImage>(parts_->truth.heads.size());
}

const std::shared_ptr<const Sample>& Bench::sample() const noexcept {
  return parts_->options.sample;
}

Bench::Temperatures Bench::temperatures(std::uint64_t scheduled_us) const noexcept {
  const double time_s = 1e-6 * static_cast<double>(scheduled_us);
  const auto reference = parts_->descriptor.sensor.reference_temperature_mK;
  return {reference + static_cast<std::int32_t>(std::lround(1000 * parts_->sensor_kelvin(time_s))),
          reference + static_cast<std::int32_t>(std::lround(1000 * parts_->led_kelvin(time_s)))};
}

}  // namespace scatter::simulator
