// The main walk in process: simulated light to a BRDF that one can trust.
// The full list of figures, with more seeds, is `./run accept`.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "host_sdk/device/device.h"
#include "host_sdk/measurement/measure.h"
#include "host_sdk/reflectance/compare.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "tools/sim_scheme/sim_scheme.h"

using namespace scatter;
namespace fs = std::filesystem;

namespace {

/// A folder of its own for each test case.
class Folder {
 public:
  Folder()
      : path_(fs::temp_directory_path() /
              ("scatter-measure-" + std::to_string(reinterpret_cast<std::uintptr_t>(this)))) {
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] fs::path file(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

device::Device open(const std::string& uri) {
  device::TransportRegistry registry;
  tools::register_sim_scheme(registry);
  device::OpenOptions options;
  options.registry = &registry;
  auto device = device::Device::open(uri, options);
  if (!device) {
    FAIL(device.error().what);
  }
  return std::move(*device);
}

measurement::MeasureResult measure(const std::string& uri, const fs::path& recording,
                                   bool correct_tilt = false) {
  device::Device device = open(uri);
  measurement::MeasureOptions options;
  options.recording = recording;
  options.use_library = false;
  options.process.correct_tilt = correct_tilt;
  auto result = measurement::measure(device, options);
  if (!result) {
    FAIL(result.error().what);
  }
  return std::move(*result);
}

reflectance::Comparison against(const measurement::MeasureResult& result, const std::string& spec) {
  const auto truth = reflectance::make_model(spec);
  REQUIRE(truth);
  auto comparison = reflectance::compare(result.measurement->brdf, **truth, {});
  REQUIRE(comparison);
  return std::move(*comparison);
}

void check_limits(const reflectance::Comparison& c) {
  CHECK(c.median_relative_error <= 0.005);
  CHECK(c.p95_relative_error <= 0.02);
  for (const auto& incidence : c.incidences) {
    // No instrument of this kind sees what goes straight through a film: that is in the truth alone.
    const double straight = std::abs(incidence.dirac_a - incidence.dirac_b);
    CHECK(std::abs(incidence.albedo_error - straight) <= 0.003);
  }
}

const measurement::QualityItem& item(const measurement::MeasureResult& result, const std::string& name) {
  for (const measurement::QualityItem& row : result.quality) {
    if (row.name == name) {
      return row;
    }
  }
  FAIL("no quality row " << name);
  throw 0;
}

}  // namespace

TEST_CASE("A measurement finds the known BRDF within half a percent, and its random uncertainty is honest") {
  const Folder folder;
  for (const char* spec :
       {"lambertian:0.5", "ggx:alpha=0.1,f0=0.04,albedo=0.3", "film:transmittance=0.6,haze=0.3"}) {
    const auto result = measure("sim:?sample=" + std::string(spec) + "&seed=11", folder.file("r.scat"));
    REQUIRE(result.measurement);
    const auto c = against(result, spec);
    INFO(spec);
    check_limits(c);
    REQUIRE(c.reduced_chi_square);
    CHECK(*c.reduced_chi_square > 0.8);
    CHECK(*c.reduced_chi_square < 1.25);
    CHECK(result.ledger.balances());
    CHECK(result.instrument_seconds <= 3);
    CHECK(result.calibration.has_value());
  }
}

TEST_CASE("With drawn references the 95 % intervals cover the truth in about 95 % of bins") {
  // Twelve instruments; the promise of 93 to 97 % over a hundred is checked by `./run accept`. One
  // instrument's share varies by about 5 % with its draws, the mean of twelve by about 1.5 %.
  const Folder folder;
  double sum = 0;
  constexpr int kInstruments = 12;
  const std::string spec = "ggx:alpha=0.2,f0=0.04,albedo=0.3";
  for (int seed = 1; seed <= kInstruments; ++seed) {
    const auto result = measure("sim:?sample=" + spec + "&references=drawn&seed=" + std::to_string(seed),
                                folder.file("r.scat"));
    const auto c = against(result, spec);
    REQUIRE(c.coverage_95);
    sum += *c.coverage_95;
  }
  CHECK(sum / kInstruments > 0.905);
  CHECK(sum / kInstruments < 0.995);
}

TEST_CASE("Tilt is told within 0.1 deg, and corrected measurements keep the error limits") {
  const Folder folder;
  const std::string spec = "ggx:alpha=0.1,f0=0.04,albedo=0.3";
  const auto result = measure("sim:?sample=" + spec + "+tilt=1.0@30&seed=2", folder.file("r.scat"), true);
  CHECK(std::abs(item(result, "tilt_x_deg").value - std::cos(reflectance::radians(30))) < 0.1);
  CHECK(std::abs(item(result, "tilt_y_deg").value - std::sin(reflectance::radians(30))) < 0.1);
  check_limits(against(result, spec));
}

TEST_CASE("What is wrong with sample or calibration is flagged with what to do") {
  const Folder folder;
  struct Row {
    const char* query;
    const char* name;
  };
  for (const Row& row : {Row{"sample=lambertian:0.5+translucent=0.1", "ambient_share"},
                         Row{"sample=lambertian:0.5+soft=0.2", "repeat_difference"},
                         Row{"sample=ggx:alpha=0.01,f0=0.95", "saturated_share"},
                         Row{"sample=lambertian:0.5&calibration=stale", "calibration_age_s"},
                         Row{"sample=lambertian:0.5&calibration=none", "calibration_missing"},
                         Row{"sample=lambertian:0.5&fault=led:4", "calibration_missing"}}) {
    INFO(row.query);
    const auto result = measure("sim:?" + std::string(row.query) + "&seed=4", folder.file("r.scat"));
    const measurement::QualityItem& flagged = item(result, row.name);
    CHECK((flagged.verdict == measurement::Verdict::kWarn || flagged.verdict == measurement::Verdict::kFail));
    CHECK_FALSE(flagged.advice.empty());
  }
}

TEST_CASE("A recording made without calibration is processed with one made later, of any session") {
  const Folder folder;
  device::Device instrument = open("sim:?sample=lambertian:0.5&seed=9");
  measurement::MeasureOptions options;
  options.recording = folder.file("raw.scat");
  REQUIRE(measurement::record(instrument, options));
  const auto without = measurement::process(options.recording, {});
  REQUIRE_FALSE(without);
  CHECK(without.error().code == ErrorCode::kFailedPrecondition);
  CHECK(without.error().remedy.find("--calibration") != std::string::npos);

  const auto calibration = measurement::calibrate(instrument, {});
  REQUIRE(calibration);
  REQUIRE(measurement::save(*calibration->references, folder.file("cal.scat")));
  const auto loaded = measurement::load_references(folder.file("cal.scat"));
  REQUIRE(loaded);
  measurement::ProcessOptions with;
  with.references = *loaded;
  auto measurement = measurement::process(options.recording, with);
  REQUIRE(measurement);
  const auto truth = reflectance::make_model("lambertian:0.5");
  const auto c = reflectance::compare(measurement->brdf, **truth, {});
  REQUIRE(c);
  check_limits(*c);
}

TEST_CASE("A recording cut in the middle is processed from its whole frames and says so") {
  const Folder folder;
  const auto whole = measure("sim:?sample=lambertian:0.5&seed=6", folder.file("r.scat"));
  REQUIRE(whole.measurement);
  // 70 % of the file: the first sweep is whole, the second is not.
  fs::copy_file(folder.file("r.scat"), folder.file("cut.scat"));
  fs::resize_file(folder.file("cut.scat"), fs::file_size(folder.file("r.scat")) * 85 / 100);
  const auto cut = measurement::process(folder.file("cut.scat"), {});
  REQUIRE(cut);
  bool told = false;
  for (const measurement::QualityItem& row : cut->quality) {
    told = told || row.name == "recording_damaged";
  }
  CHECK(told);
  const auto truth = reflectance::make_model("lambertian:0.5");
  const auto c = reflectance::compare(cut->brdf, **truth, {});
  REQUIRE(c);
  CHECK(c->median_relative_error <= 0.006);
}
