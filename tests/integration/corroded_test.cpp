// A corroded sheet under the instrument: one calibration, several places, each against its own truth.
#include <filesystem>

#include "host_sdk/measurement/measure.h"
#include "host_sdk/reflectance/compare.h"
#include "simulator/samples/sample.h"
#include "simulator/samples/sample_brdf.h"
#include "tests/integration/rig.h"

using namespace scatter;
using namespace scatter::integration;

TEST_CASE("Places of a corroded sheet are measured with one calibration, each as its own truth says") {
  const auto recording = std::filesystem::temp_directory_path() / "scatter_corroded_test.scat";
  const auto instrument = instrument_of(
      "?sample=corroded:age=5,extent_mm=10,starting_points=6,metal_alpha=0.25,spot=0.2/0.6&seed=3");
  auto device = open_on(instrument);
  REQUIRE(device.has_value());
  measurement::MeasureOptions options;
  options.recording = recording;
  options.use_library = false;
  std::vector<double> albedo;
  for (const simulator::Place& place : {simulator::Place{0.2, 0.6}, simulator::Place{0.7, 0.1}}) {
    REQUIRE(instrument->put(instrument->sample()->moved(place)).has_value());
    const auto result = measurement::measure(*device, options);
    REQUIRE(result.has_value());
    REQUIRE(result->measurement.has_value());
    if (result->calibration) {
      options.references = result->calibration->references;
      options.process.references = options.references;
    }
    CHECK(result->calibration.has_value() == albedo.empty());
    const auto truth = simulator::SampleBrdf::make(instrument->sample()->surface_spec());
    REQUIRE(truth.has_value());
    const auto c = reflectance::compare(result->measurement->brdf, **truth, {});
    REQUIRE(c.has_value());
    CHECK(c->median_relative_error <= 0.005);
    CHECK(c->p95_relative_error <= 0.02);
    for (const auto& incidence : c->incidences) {
      CHECK(incidence.albedo_error <= 0.003);
    }
    CHECK(c->reduced_chi_square.value_or(0) > 0.8);
    CHECK(c->reduced_chi_square.value_or(0) < 1.25);
    albedo.push_back(result->measurement->albedo.front().albedo.front());
  }
  CHECK(albedo[0] != Approx(albedo[1]).epsilon(0.01));
  std::filesystem::remove(recording);
}

TEST_CASE("A film does not go where a sheet lay") {
  const auto instrument = instrument_of("?sample=lambertian:0.5");
  const auto put = instrument->put(*simulator::Sample::make("film:transmittance=0.6,haze=0.3"));
  REQUIRE_FALSE(put.has_value());
  CHECK(put.error().code == ErrorCode::kFailedPrecondition);
}
