// Measures a sample on the simulated instrument and asks the result for one value.
#include <array>
#include <cmath>
#include <cstdio>

#include "host_sdk/device/device.h"
#include "host_sdk/measurement/measure.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace {

int complain(const scatter::Error& error) {
  std::fprintf(stderr, "error: %s\nremedy: %s\n", error.what.c_str(), error.remedy.c_str());
  return 1;
}

}  // namespace

int main() {
  scatter::device::TransportRegistry registry;    // tcp:, unix: and replay: are built in,
  scatter::tools::register_sim_scheme(registry);  // sim: comes with the simulator.
  scatter::device::OpenOptions open;
  open.registry = &registry;
  auto device = scatter::device::Device::open("sim:?sample=ggx:alpha=0.2,f0=0.04,albedo=0.3&seed=1", open);
  if (!device) {
    return complain(device.error());
  }

  // Calibrates first, because a fresh instrument has no calibration.
  scatter::measurement::MeasureOptions options;
  options.recording = "first_measurement.scat";
  const auto result = scatter::measurement::measure(*device, options);
  if (!result) {
    return complain(result.error());
  }
  if (result->uncalibrated) {
    return complain(*result->uncalibrated);
  }
  for (const scatter::measurement::QualityItem& item : result->quality) {
    if (item.verdict == scatter::measurement::Verdict::kFail) {
      std::printf("%s: %s\n", item.name.c_str(), item.advice.c_str());
    }
  }

  // Light from 40 degrees, seen from 20 degrees on the far side: f_r in 1/sr, no cosine.
  using namespace scatter::reflectance;
  const GridBrdf& brdf = result->measurement->brdf;
  const Direction light = from_spherical(radians(40), 0);
  const Direction eye = from_spherical(radians(20), kPi);
  std::array<double, 3> f_per_sr{};
  std::array<double, 3> random{};
  std::array<double, 3> systematic{};
  if (brdf.eval(light, eye, f_per_sr) == Origin::kInvalid ||
      !brdf.uncertainty(light, eye, random, systematic)) {
    return 1;
  }
  std::printf("f_r(630 nm) = %.4f +- %.4f 1/sr\n", f_per_sr[0], std::hypot(random[0], systematic[0]));
  return 0;
}
