#include <tbb/global_control.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <numeric>
#include <string>
#include <vector>

#include "simulator/bench/bench.h"

namespace {

using namespace scatter::simulator;
using scatter::protocol::ObjectId;
using scatter::protocol::Target;
using scatter::reflectance::kPi;
using scatter::reflectance::radians;

constexpr std::size_t kSide = 480;
constexpr std::size_t kPixels = kSide * kSide;

std::unique_ptr<Bench> bench(const std::string& spec, BenchOptions options = {}) {
  auto sample = Sample::make(spec);
  REQUIRE(sample.has_value());
  options.sample = *sample;
  auto made = Bench::make(std::move(options));
  REQUIRE(made.has_value());
  return std::move(*made);
}

std::vector<float> expected(Bench& b, const Exposure& e) {
  std::vector<float> electrons(kPixels);
  b.expected_electrons(e, electrons);
  return electrons;
}

/// Pixel at (x, y) [px] from the image's centre, where no head and no blind spot is.
std::size_t pixel(int x, int y) {
  return static_cast<std::size_t>((240 + y) * static_cast<int>(kSide) + 240 + x);
}
const std::vector<std::size_t> kOpenPixels{pixel(5, 40), pixel(-30, 60), pixel(0, -100), pixel(90, 90),
                                           pixel(-120, 20)};

Exposure lit(Target target, std::uint8_t illumination, std::uint32_t exposure_us = 2500) {
  return {.target = target, .illumination = illumination, .exposure_us = exposure_us};
}

double mean_of(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::vector<std::uint32_t> hot_pixels(const Bench& b) {
  const auto bytes = b.object(ObjectId::kHotPixels);
  std::vector<std::uint32_t> list(bytes.size() / 4);
  std::memcpy(list.data(), bytes.data(), list.size() * 4);
  return list;
}

}  // namespace

TEST_CASE("Descriptor states the reference instrument of the specification") {
  const auto b = bench("lambertian:0.5", {.seed = 0xABC});
  const auto& d = b->descriptor();
  CHECK(d.serial.str() == "SIM-00000abc");
  CHECK(d.illuminations.size() == 12);
  CHECK(d.illuminations[11].theta_rad == Approx(radians(60)));
  CHECK(d.illuminations[4].wavelength_nm == 525);
  CHECK(d.sensor.bits == 10);
  CHECK(d.sensor.full_well_e == 10000);
  CHECK(d.sensor.read_noise_e == 25);
  CHECK(d.transmission_module == 0);
  // 75 deg lie at 224 px, and the whole image lies on the sensor.
  const auto radius = [&](double t) {
    return d.optics.radius_px * (d.optics.a1 * t + d.optics.a3 * t * t * t + d.optics.a5 * std::pow(t, 5));
  };
  CHECK(radius(radians(75)) == Approx(224).margin(0.5));
  CHECK(radius(d.optics.image_theta_max_rad) < 480 - std::max(d.optics.center_x_px, d.optics.center_y_px));

  const auto film = bench("film:transmittance=0.6,haze=0.3", {.profile = Profile::kFine});
  CHECK(film->descriptor().transmission_module == 1);
  CHECK(film->descriptor().illuminations.size() == 24);
  CHECK(film->descriptor().illuminations[23].theta_rad == Approx(kPi));
  CHECK(film->descriptor().sensor.width_px == 1024);
  CHECK(film->descriptor().sensor.bits == 12);
  CHECK(bench("lambertian:0.5", {.transmission_module = true})->descriptor().illuminations.size() == 24);
}

TEST_CASE("Bench without a sample is refused") {
  const auto made = Bench::make({});
  REQUIRE_FALSE(made.has_value());
  CHECK(made.error().code == scatter::ErrorCode::kInvalidArgument);
}

// PROVES: instrument.md 4 step 6 holds for this instrument when its certificates are exact.
TEST_CASE("White and black references turn a sample's signal into its BRDF") {
  const auto b = bench("lambertian:0.5/0.3/0.1");
  const double white = 0.99 / kPi;
  const double black = 0.012 / kPi;
  const double truth[] = {0.5 / kPi, 0.3 / kPi, 0.1 / kPi};
  for (const std::uint8_t i : std::vector<std::uint8_t>{0, 4, 8, 11}) {
    const auto s = expected(*b, lit(Target::kSample, i));
    const auto w = expected(*b, lit(Target::kWhiteReference, i));
    const auto k = expected(*b, lit(Target::kBlackReference, i));
    for (const std::size_t p : kOpenPixels) {
      const double f = black + (white - black) * (s[p] - k[p]) / (w[p] - k[p]);
      CHECK(f == Approx(truth[i % 3]).epsilon(1e-4));
    }
    // 80 % of the full well within the gain's 1 % rms, the falloff and the stray light of 0.2 %.
    CHECK(w[pixel(5, 40)] == Approx(8000).epsilon(0.08));
  }
}

TEST_CASE("Translucent standard and opaque black turn a film's signal into its BTDF") {
  const auto b = bench("film:transmittance=0.6,haze=0.3");
  for (const std::uint8_t i : std::vector<std::uint8_t>{12, 16, 20, 23}) {
    const auto s = expected(*b, lit(Target::kSample, i));
    const auto w = expected(*b, lit(Target::kTranslucentReference, i));
    const auto k = expected(*b, lit(Target::kBlackReference, i));
    for (const std::size_t p : {pixel(5, 100), pixel(60, 60), pixel(0, -130)}) {
      CHECK(0.5 / kPi * (s[p] - k[p]) / (w[p] - k[p]) == Approx(0.18 / kPi).epsilon(1e-4));
    }
    // The opaque black leaves the stray light alone: 0.2 % of the standard's 8000 electrons.
    CHECK(k[pixel(0, 0)] == Approx(16 + 0.125).epsilon(0.1));
  }
  // From above nothing comes back but stray light.
  CHECK(expected(*b, lit(Target::kSample, 3))[pixel(5, 40)] < 25);
}

// PROVES: instrument.md 2, noise: Poisson on electrons, 25 e- read noise, 10 e-/DN, rounding.
TEST_CASE("Counts scatter about the signal model as shot, read and rounding noise do") {
  const auto b = bench("lambertian:0.5");
  const auto& sensor = b->descriptor().sensor;
  for (const std::uint32_t exposure_us : {20U, 300U, 3000U}) {
    Exposure e = lit(Target::kSample, 1, exposure_us);
    const auto electrons = expected(*b, e);
    std::vector<double> sum(kPixels, 0.0);
    std::vector<double> square(kPixels, 0.0);
    std::vector<std::uint16_t> dn(kPixels);
    const int frames = 24;
    for (int k = 0; k < frames; ++k) {
      e.index = static_cast<std::uint64_t>(k);
      (void)b->expose(e, dn);
      for (std::size_t p = 0; p < kPixels; ++p) {
        sum[p] += dn[p];
        square[p] += static_cast<double>(dn[p]) * dn[p];
      }
    }
    double offset = 0;
    double offset_square = 0;
    double ratio = 0;
    double count = 0;
    for (std::size_t p = 0; p < kPixels; ++p) {
      const double q = electrons[p];
      if (q > 9000 || q < 1) {
        continue;
      }
      const double slope = 1 + 2 * sensor.linearity * q / sensor.full_well_e;
      const double level = (q + sensor.linearity * (q * q + q) / sensor.full_well_e) / sensor.gain_e_per_dn;
      const double mean = sum[p] / frames;
      const double variance = (square[p] - frames * mean * mean) / (frames - 1);
      const double gain2 = double{sensor.gain_e_per_dn} * sensor.gain_e_per_dn;
      ratio += variance / ((q * slope * slope + 625) / gain2 + 1.0 / 12);
      offset += mean - level;
      offset_square += (mean - level) * (mean - level) - variance / frames;
      count += 1;
    }
    REQUIRE(count > 1e5);
    CAPTURE(exposure_us);
    // Mean of `count` variances with 23 degrees of freedom each: 5 standard errors.
    CHECK(ratio / count == Approx(1).margin(5 * std::sqrt(2.0 / (23 * count))));
    // What is left is the black level of 16 DN and its pattern of 0.5 DN rms.
    CHECK(offset / count == Approx(16).margin(0.02));
    CHECK(std::sqrt(offset_square / count - (offset / count) * (offset / count)) ==
          Approx(0.5).epsilon(0.02));
  }
}

TEST_CASE("An exposure is the same for any window, order of calls and number of threads") {
  const auto b = bench("ggx:alpha=0.2,f0=0.04,albedo=0.3");
  Exposure e = lit(Target::kSample, 5);
  e.index = 42;
  e.scheduled_us = 1'000'000;
  std::vector<std::uint16_t> whole(kPixels);
  const std::uint32_t monitor = b->expose(e, whole);
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const auto other = bench("ggx:alpha=0.2,f0=0.04,albedo=0.3");
    std::vector<std::uint16_t> again(kPixels);
    CHECK(other->expose(e, again) == monitor);
    CHECK(again == whole);
  }
  Exposure window = e;
  window.x = 33;
  window.y = 100;
  window.width = 111;
  window.height = 51;
  std::vector<std::uint16_t> part(111 * 51);
  CHECK(b->expose(window, part) == monitor);
  for (std::size_t y = 0; y < 51; ++y) {
    CHECK(std::equal(part.begin() + static_cast<std::ptrdiff_t>(y * 111),
                     part.begin() + static_cast<std::ptrdiff_t>((y + 1) * 111),
                     whole.begin() + static_cast<std::ptrdiff_t>((y + 100) * kSide + 33)));
  }
  e.index = 43;
  std::vector<std::uint16_t> next(kPixels);
  CHECK(b->expose(e, next) != monitor);
  CHECK(next != whole);
}

TEST_CASE("An exposure outside the sensor or of no such LED is black") {
  const auto b = bench("lambertian:0.5");
  std::vector<std::uint16_t> dn(100, 7);
  Exposure e = lit(Target::kSample, 0);
  e.x = 475;
  e.width = 10;
  e.height = 10;
  CHECK(b->expose(e, dn) == 0);
  CHECK(std::ranges::all_of(dn, [](auto v) { return v == 0; }));
  e.x = 0;
  e.illumination = 12;
  CHECK(b->expose(e, dn) == 0);
}

TEST_CASE("Overexposed pixels stop at the full well") {
  const auto b = bench("lambertian:0.9");
  std::vector<std::uint16_t> dn(kPixels);
  (void)b->expose(lit(Target::kSample, 0, 100000), dn);
  // 10,000 e- less 1 % of non-linearity, 10 e-/DN, 16 DN black level; 6 sigma of 2.6 DN.
  for (const std::size_t p : kOpenPixels) {
    CHECK(dn[p] == Approx(16 + 990).margin(16));
  }
  CHECK(std::ranges::max(dn) <= 1023);
}

TEST_CASE("Dark current doubles every 7 K as the sensor warms") {
  const auto b = bench("lambertian:0.5");
  Exposure dark{.target = Target::kDarkCap, .exposure_us = 200000};
  const auto cold = expected(*b, dark);
  const auto cold_kelvin = b->temperatures(100000).sensor_mK;
  dark.scheduled_us = 1200'000'000;
  const auto warm = expected(*b, dark);
  const auto warm_kelvin = b->temperatures(1200'100'000).sensor_mK;
  CHECK(mean_of(warm) / mean_of(cold) ==
        Approx(std::exp2(1e-3 * (warm_kelvin - cold_kelvin) / 7.0)).epsilon(1e-4));
  // 50 e-/s at 25 C for 0.2 s in a pixel that is not hot.
  auto sorted = cold;
  std::ranges::nth_element(sorted, sorted.begin() + kPixels / 2);
  CHECK(sorted[kPixels / 2] == Approx(10.0).epsilon(1e-3));
  CHECK(b->temperatures(0).led_board_mK == 298150);
  CHECK(b->temperatures(60'000'000).led_board_mK == Approx(298150 + 2000 * (1 - std::exp(-1.0))).margin(1));
}

TEST_CASE("Monitor follows the LEDs' drift once its own slope is taken out") {
  const auto b = bench("lambertian:0.5");
  const std::size_t p = pixel(5, 40);
  Exposure e = lit(Target::kWhiteReference, 2);
  std::vector<double> ratio;
  std::vector<double> light;
  std::vector<std::uint16_t> one(1);
  for (std::uint64_t k = 0; k < 60; ++k) {
    e.scheduled_us = k * 10'000'000;
    e.index = k;
    light.push_back(double{expected(*b, e)[p]});
    Exposure small = e;
    small.width = small.height = 1;
    const double slope = b->descriptor().monitor_slope_per_K;
    const double kelvin = 1e-3 * (b->temperatures(e.scheduled_us).led_board_mK - 298150);
    ratio.push_back(light.back() / (b->expose(small, one) / (1 + slope * kelvin)));
  }
  const double mean = std::accumulate(ratio.begin(), ratio.end(), 0.0) / 60;
  double variance = 0;
  for (const double r : ratio) {
    variance += (r / mean - 1) * (r / mean - 1) / 59;
  }
  // The monitor's noise of 0.02 %, known to 1 / sqrt(2 * 59) = 9 %.
  CHECK(std::sqrt(variance) == Approx(2e-4).epsilon(0.4));
  // -0.3 % per kelvin over 2 K, and the supply's 0.1 %.
  const auto [low, high] = std::ranges::minmax(light);
  CHECK((high - low) / high > 0.005);
  CHECK((high - low) / high < 0.009);
}

TEST_CASE("Factory objects tell the hot pixels and the gain of every pixel") {
  const auto b = bench("lambertian:0.5", {.seed = 9});
  const auto hot = hot_pixels(*b);
  CHECK(hot.size() == Approx(0.0005 * kPixels).margin(3));
  CHECK(std::ranges::is_sorted(hot));
  const auto dark = expected(*b, {.target = Target::kDarkCap, .exposure_us = 100000});
  std::size_t bright = 0;
  for (const float q : dark) {
    bright += q > 100 ? 1 : 0;
  }
  CHECK(bright == hot.size());
  CHECK(std::ranges::all_of(hot, [&](std::uint32_t p) { return dark[p] > 500; }));

  // Neighbours see the same light, so their ratio is the ratio of their gains.
  const auto map = b->object(ObjectId::kPrnuMap);
  REQUIRE(map.size() == kPixels);
  const auto gain = [&](std::size_t p) { return 1 + 1e-3 * static_cast<std::int8_t>(map[p]); };
  const auto white = expected(*b, lit(Target::kWhiteReference, 0));
  double square = 0;
  for (int x = 20; x < 120; ++x) {
    const std::size_t p = pixel(x, 50);
    const double ratio = (white[p] - 0.125) / gain(p);
    const double sides = ((white[p - 1] - 0.125) / gain(p - 1) + (white[p + 1] - 0.125) / gain(p + 1)) / 2;
    if (!std::ranges::binary_search(hot, static_cast<std::uint32_t>(p)) &&
        !std::ranges::binary_search(hot, static_cast<std::uint32_t>(p - 1)) &&
        !std::ranges::binary_search(hot, static_cast<std::uint32_t>(p + 1))) {
      CHECK(ratio == Approx(sides).epsilon(2e-4));
    }
    square += (gain(p) - 1) * (gain(p) - 1) / 100;
  }
  CHECK(std::sqrt(square) == Approx(0.01).epsilon(0.35));
}

TEST_CASE("Pixels behind the source heads are dark within the certified blind spots") {
  const auto b = bench("lambertian:0.5");
  const auto white = expected(*b, lit(Target::kWhiteReference, 9));
  const auto& o = b->descriptor().optics;
  std::size_t blind = 0;
  for (std::size_t p = 0; p < kPixels; ++p) {
    const double dx = static_cast<double>(p % kSide) + 0.5 - o.center_x_px;
    const double dy = static_cast<double>(p / kSide) + 0.5 - o.center_y_px;
    const double r = std::hypot(dx, dy);
    if (r < o.radius_px * radians(70) && white[p] < 100) {
      ++blind;
      const double phi = std::remainder(std::atan2(dy, dx) - o.rotation_rad, 2 * kPi);
      CHECK(std::abs(r * std::sin(phi)) < o.radius_px * radians(2.5));
      CHECK(r * std::cos(phi) > -o.radius_px * radians(2.5));
    }
  }
  // Four discs of about 2.1 deg: 4 * pi * (184 * 0.0367)^2 pixels, less the distortion at 40 and 60 deg.
  CHECK(blind == Approx(540).margin(80));
}

TEST_CASE("Ambient light under a translucent sample is there with the LEDs off as well") {
  const auto leaky = bench("lambertian:0.5+translucent=0.1");
  const auto tight = bench("lambertian:0.5");
  const Exposure off{.exposure_us = 2500};
  const std::size_t p = pixel(5, 40);
  // A tenth of what a perfect white returns: 800 / 0.99 electrons.
  CHECK(expected(*leaky, off)[p] == Approx(808).epsilon(0.08));
  CHECK(expected(*tight, off)[p] < 1);
  CHECK(expected(*leaky, lit(Target::kSample, 0))[p] - expected(*tight, lit(Target::kSample, 0))[p] ==
        Approx(expected(*leaky, off)[p] - expected(*tight, off)[p]).epsilon(1e-3));
  CHECK(expected(*leaky, {.target = Target::kWhiteReference, .exposure_us = 2500})[p] < 1);
}

TEST_CASE("A soft sample's signal sinks from the moment it was placed") {
  const auto soft = bench("lambertian:0.5+soft=0.2");
  const auto firm = bench("lambertian:0.5");
  Exposure e = lit(Target::kSample, 3);
  e.scheduled_us = 5'000'000;
  e.placed_us = 3'000'000;
  const std::size_t p = pixel(5, 40);
  const double stray_and_dark = expected(*firm, {.target = Target::kDarkCap,
                                                 .illumination = 3,
                                                 .exposure_us = 2500,
                                                 .scheduled_us = e.scheduled_us})[p];
  CHECK((expected(*soft, e)[p] - stray_and_dark) / (expected(*firm, e)[p] - stray_and_dark) ==
        Approx(1 - 0.2 * (1 - std::exp(-2.00125))).epsilon(1e-5));
}

// PROVES: instrument.md 2, standard deviations of drawn references.
TEST_CASE("Drawn instruments scatter about their certificates with the stated deviations") {
  const int seeds = 40;
  std::vector<double> white;
  std::vector<double> black;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto drawn =
        bench("lambertian:0.5", {.seed = static_cast<std::uint64_t>(seed), .references = References::kDrawn});
    const auto at = [&](Target target) {
      std::vector<float> q(1);
      Exposure e = lit(target, 1);
      e.x = 245;
      e.y = 280;
      e.width = e.height = 1;
      drawn->expected_electrons(e, q);
      return double{q[0]};
    };
    // Relative to the sample, whose surface is never drawn: gain and geometry cancel.
    const double stray = at(Target::kDarkCap);
    const double sample = at(Target::kSample) - stray;
    white.push_back((at(Target::kWhiteReference) - stray) / sample / (0.99 / 0.5) - 1);
    black.push_back((at(Target::kBlackReference) - stray) / sample / (0.012 / 0.5) - 1);
  }
  const auto rms = [](const std::vector<double>& values) {
    return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0) /
                     static_cast<double>(values.size()));
  };
  // An rms of 40 draws is known to 11 %: four of its standard errors.
  CHECK(rms(white) == Approx(0.003).epsilon(0.45));
  CHECK(rms(black) == Approx(0.05).epsilon(0.45));
}

TEST_CASE("A dead LED is dark, to its monitor too") {
  const auto b = bench("lambertian:0.5", {.faults = {.dead_illumination = 4}});
  std::vector<std::uint16_t> dn(kPixels);
  CHECK(b->expose(lit(Target::kSample, 4), dn) == 0);
  CHECK(dn[pixel(5, 40)] < 40);
  CHECK(b->expose(lit(Target::kSample, 5), dn) > 490000);
  CHECK(dn[pixel(5, 40)] > 300);
}

TEST_CASE("Drifting LEDs change signal and monitor alike") {
  const auto b = bench("lambertian:0.5", {.faults = {.led_drift_per_s = 0.01}});
  const auto healthy = bench("lambertian:0.5");
  Exposure e = lit(Target::kWhiteReference, 4);
  e.scheduled_us = 10'000'000;
  std::vector<std::uint16_t> dn(kPixels);
  const std::size_t p = pixel(5, 40);
  CHECK(expected(*b, e)[p] / expected(*healthy, e)[p] == Approx(1.1).epsilon(1e-3));
  CHECK(b->expose(e, dn) / static_cast<double>(healthy->expose(e, dn)) == Approx(1.1).epsilon(1e-3));
}

TEST_CASE("Hot pixels that appeared later are not in the factory's list") {
  const auto b = bench("lambertian:0.5", {.faults = {.extra_hot_pixels = 50}});
  const auto healthy = bench("lambertian:0.5");
  CHECK(hot_pixels(*b) == hot_pixels(*healthy));
  const auto dark = expected(*b, {.target = Target::kDarkCap, .exposure_us = 100000});
  CHECK(std::ranges::count_if(dark, [](float q) { return q > 100; }) ==
        Approx(static_cast<double>(hot_pixels(*b).size()) + 50).margin(2));
}

TEST_CASE("Dirt takes light away in specks") {
  const auto b = bench("lambertian:0.5", {.faults = {.dirt = 0.5}});
  const auto healthy = bench("lambertian:0.5");
  const auto dirty = expected(*b, lit(Target::kWhiteReference, 0));
  const auto clean = expected(*healthy, lit(Target::kWhiteReference, 0));
  std::size_t dimmed = 0;
  for (std::size_t p = 0; p < kPixels; ++p) {
    REQUIRE(dirty[p] <= clean[p]);
    dimmed += clean[p] > 1000 && dirty[p] < 0.8F * clean[p] ? 1 : 0;
  }
  CHECK(dimmed > 100);
  CHECK(dimmed < kPixels / 20);
}

TEST_CASE("A knocked head and a moved sensor shift the specular peak that the descriptor predicts") {
  const std::string spec = "ggx:alpha=0.05,f0=0.5";
  const auto peak = [&](BenchFaults faults) {
    const auto b = bench(spec, {.faults = faults});
    const auto q = expected(*b, lit(Target::kSample, 9, 10));
    double sum = 0;
    double x = 0;
    // Around the mirror direction of the 60 deg head.
    for (std::size_t p = 0; p < kPixels; ++p) {
      const double at = static_cast<double>(p % kSide) + 0.5;
      if (at < 130 && at > 20 && std::abs(static_cast<double>(p / kSide) - 240) < 40) {
        sum += double{q[p]} * q[p];
        x += double{q[p]} * q[p] * at;
      }
    }
    return x / sum;
  };
  const double healthy = peak({});
  CHECK(peak({.decentred_px = 2}) - healthy == Approx(2).margin(0.1));
  // d r / d theta at 60 deg: 184 (1 - t^2 / 8 + t^4 / 384) = 159 px per radian, away from the centre.
  CHECK(peak({.misaligned_head = 3, .misalignment_rad = radians(1)}) - healthy ==
        Approx(-159 * radians(1)).margin(0.6));
}
