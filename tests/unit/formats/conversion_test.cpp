// Every format to every format and back, with the losses that docs/formats.md states.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/formats/sample_list_brdf.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/formats/zemax.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tests/unit/formats/real_data.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

const std::map<std::string, std::string> kMetadata{{"calibration_id", "0011"},
                                                   {"recording_id", "run 7"},
                                                   {"software", "test"},
                                                   {"quality", "{\"a\": [1, 2]}\nline \\ two "},
                                                   {"a key: with + and @", ""}};

GridBrdf grid_of(const char* spec, double last_theta_deg = 75) {
  GridLayout layout;
  layout.theta_step = radians(3);
  layout.theta_count = static_cast<std::size_t>(last_theta_deg / 3) + 1;
  layout.phi_count = 120;
  layout.incidences = {{0, 0, 0}, {0, radians(20), 0}, {0, radians(50), 0}};
  GridBrdf::Content content = sample_on_grid(*make_model(spec).value(), layout).value().content();
  content.metadata = kMetadata;
  return GridBrdf::make(std::move(content)).value();
}

std::shared_ptr<const Brdf> there_and_back(const Brdf& brdf, std::string_view word,
                                           EncodeOptions options = {}) {
  const auto bytes = encode_brdf(brdf, *writer_named(word).value(), options);
  if (!bytes) {
    CAPTURE(word, bytes.error().what);
    FAIL("cannot be written");
  }
  const auto back = decode_brdf(*bytes, "back");
  if (!back) {
    CAPTURE(word, back.error().what);
    FAIL("cannot be read back");
  }
  return *back;
}

/// Largest |a - b| / b over directions up to 60 deg at the incidences of the grid.
double worst(const Brdf& a, const Brdf& b, const std::vector<double>& theta_i) {
  std::vector<double> x(a.channels());
  std::vector<double> y(b.channels());
  double difference = 0;
  const double side = a.type() == ScatterType::kBtdf ? -1 : 1;
  for (const double ti : theta_i) {
    for (double theta = 0; theta < radians(61); theta += radians(6)) {
      for (double phi = 0; phi < 2 * kPi; phi += radians(15)) {
        Direction o = from_spherical(theta, phi);
        o.z *= side;
        if (b.eval(from_spherical(ti, 0), o, y) == Origin::kInvalid) {
          continue;
        }
        REQUIRE(a.eval(from_spherical(ti, 0), o, x) != Origin::kInvalid);
        for (std::size_t c = 0; c < std::min(x.size(), y.size()); ++c) {
          difference = std::max(difference, std::abs(x[c] - y[c]) / std::max(std::abs(y[c]), 1e-4));
        }
      }
    }
  }
  return difference;
}

const std::map<std::string, std::string>* metadata_in(const Brdf& brdf) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    return &grid->content().metadata;
  }
  if (const auto* grid = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    return &grid->content().metadata;
  }
  return nullptr;
}

}  // namespace

TEST_CASE("Every writer is named once, and has an extension and a meaning") {
  for (const formats::Writer& writer : writers()) {
    CAPTURE(writer.word);
    REQUIRE(writer_named(writer.word).value() == &writer);
    REQUIRE(writer.extension.starts_with('.'));
    REQUIRE_FALSE(writer.meaning.empty());
  }
  REQUIRE(writer_for("x/a.EXR").value()->word == "exr");
  REQUIRE(writer_for("a.brdf").value()->word == "bird");
  REQUIRE(writer_named("nonsense").error().remedy.find("zemax") != std::string::npos);
  REQUIRE(writer_for("a.xyz").error().remedy.find(".bsdf (zemax)") != std::string::npos);
}

TEST_CASE("A smooth grid goes to every format and back within what resampling costs") {
  const GridBrdf grid = grid_of("ggx:alpha=0.5,f0=0.04,albedo=0.3");
  // On the grid's own nodes only digits are lost. On others the bilinear mean of 3 deg steps of a
  // lobe of alpha 0.5 is 2 % off at worst (step^2 / 8 times the second derivative, both axes). MERL
  // cells lie at all incidences, of which this grid has three: the kinks between them cost more. RGL
  // nodes crowd where the light goes, its worst place is where it does not.
  for (const auto& [word, tolerance] : {std::pair{"exr", 1e-6},
                                        {"bird", 1e-6},
                                        {"minidiff", 1e-6},
                                        {"zemax", 0.02},
                                        {"tiles", 0.02},
                                        {"merl", 0.15},
                                        {"rgl", 0.15}}) {
    CAPTURE(word);
    const auto back = there_and_back(grid, word);
    REQUIRE(back->channels() == 3);
    REQUIRE(worst(*back, grid, {radians(20), radians(50)}) < tolerance);
    if (const auto* metadata = metadata_in(*back); metadata != nullptr) {
      for (const auto& [key, value] : kMetadata) {
        CAPTURE(key);
        REQUIRE(metadata->at(key) == value);
      }
    }
  }
}

TEST_CASE("Writers are deterministic and a second trip loses nothing more") {
  const GridBrdf grid = grid_of("ggx:alpha=0.3,f0=0.04,albedo=0.3");
  for (const char* word : {"exr", "bird", "minidiff", "zemax"}) {
    CAPTURE(word);
    const formats::Writer& writer = *writer_named(word).value();
    const std::string once = encode_brdf(grid, writer).value();
    REQUIRE(encode_brdf(grid, writer).value() == once);
    const auto back = decode_brdf(once, "once").value();
    const auto twice = decode_brdf(encode_brdf(*back, writer).value(), "twice").value();
    REQUIRE(worst(*twice, *back, {0, radians(20), radians(50)}) < 1e-5);
  }
}

TEST_CASE("Channels, digits and steps are as asked") {
  const GridBrdf grid = grid_of("ggx:alpha=0.5/0.4/0.3,f0=0.04,albedo=0.3/0.2/0.1");
  std::vector<double> one(1);
  std::vector<double> all(3);
  const Direction i = from_spherical(radians(20), 0);
  const Direction o = from_spherical(radians(30), radians(90));
  REQUIRE(grid.eval(i, o, all) == Origin::kMeasured);
  for (const char* word : {"exr", "bird", "minidiff", "zemax", "tiles"}) {
    CAPTURE(word);
    const auto back = there_and_back(grid, word, {.channel = 2});
    REQUIRE(back->channels() == 1);
    REQUIRE(back->eval(i, o, one) != Origin::kInvalid);
    REQUIRE(one[0] == Approx(all[2]).epsilon(0.02));
  }
  REQUIRE(encode_brdf(grid, *writer_named("zemax").value(), {.channel = 3}).error().code ==
          ErrorCode::kInvalidArgument);
  REQUIRE(encode_brdf(grid, *writer_named("zemax").value(), {.digits = 18}).error().code ==
          ErrorCode::kInvalidArgument);
  const auto fine = there_and_back(
      grid, "zemax",
      {.theta_i = {radians(10)}, .theta_step = radians(5), .phi_step = radians(10), .digits = 9});
  const auto& content = dynamic_cast<const SpecularGridBrdf&>(*fine).content();
  REQUIRE(content.theta_i.size() == 1);
  REQUIRE(degrees(content.radial[1]) == Approx(5));
  REQUIRE(degrees(content.azimuth[1]) == Approx(10));
}

TEST_CASE("Zemax files: XYZ is the tristimulus of our colours, and ours come back") {
  // PROVES: docs/decisions/0007. Y of BT.709 is 0.2126 R + 0.7152 G + 0.0722 B (spec reflectance.md 1).
  const GridBrdf grid = grid_of("lambertian:0.5/0.3/0.1");
  const std::string text = encode_brdf(grid, *writer_named("zemax").value()).value();
  REQUIRE(text.find("SpectralContent  XYZ") != std::string::npos);
  std::string foreign = text;
  for (std::size_t at = 0; (at = foreign.find("# scatter.@", at)) != std::string::npos;) {
    foreign.replace(at, 11, "# nothing.@");
  }
  std::vector<double> xyz(3);
  std::vector<double> rgb(3);
  const Direction i = from_spherical(radians(20), 0);
  const Direction o = from_spherical(radians(30), radians(90));
  REQUIRE(decode_zemax(foreign, "f").value().eval(i, o, xyz) != Origin::kInvalid);
  REQUIRE(xyz[1] == Approx((0.2126 * 0.5 + 0.7152 * 0.3 + 0.0722 * 0.1) / kPi).epsilon(1e-6));
  REQUIRE(decode_zemax(text, "t").value().eval(i, o, rgb) != Origin::kInvalid);
  for (std::size_t c = 0; c < 3; ++c) {
    REQUIRE(rgb[c] == Approx(std::array{0.5, 0.3, 0.1}[c] / kPi).epsilon(5e-6));
  }
  const std::string as_is = encode_brdf(grid, *writer_named("zemax").value(), {.rgb_sections = true}).value();
  REQUIRE(as_is.find("TristimulusR") != std::string::npos);
  REQUIRE(decode_zemax(as_is, "t").value().eval(i, o, rgb) != Origin::kInvalid);
  REQUIRE(rgb[0] == Approx(0.5 / kPi).epsilon(5e-4));  // four digits
  // What was XYZ stays XYZ.
  const std::string again = encode_zemax(decode_zemax(foreign, "f").value()).value();
  std::vector<double> kept(3);
  REQUIRE(decode_zemax(again, "a").value().eval(i, o, kept) != Origin::kInvalid);
  REQUIRE(kept[1] == Approx(xyz[1]).epsilon(5e-4));
}

TEST_CASE("Zemax files are PlaneSymmetrical, Asymmetrical or Asymmetrical4D as the data are") {
  const std::string plane =
      encode_brdf(grid_of("lambertian:0.5", 90), *writer_named("zemax").value()).value();
  REQUIRE(plane.find("Symmetry  PlaneSymmetrical\n") != std::string::npos);
  REQUIRE(plane.find("@origin") == std::string::npos);  // all measured above the horizon: nothing to say
  GridBrdf::Content content = grid_of("lambertian:0.5", 90).content();
  for (auto& part : content.parts) {
    part.f_per_sr[0][10 * 120 + 17] *= 1.01F;
  }
  const std::string skew =
      encode_brdf(GridBrdf::make(content).value(), *writer_named("zemax").value()).value();
  REQUIRE(skew.find("Symmetry  Asymmetrical\n") != std::string::npos);
  const std::size_t parts = content.parts.size();
  for (std::size_t p = 0; p < parts; ++p) {
    content.parts.push_back(content.parts[p]);
    content.parts.back().rotation_rad = radians(90);
    content.parts.back().phi_i = radians(90);
  }
  const GridBrdf rotated = GridBrdf::make(content).value();
  const std::string turned = encode_brdf(rotated, *writer_named("zemax").value()).value();
  REQUIRE(turned.find("Symmetry  Asymmetrical4D\n") != std::string::npos);
  REQUIRE(decode_zemax(turned, "t").value().content().rotation.size() == 2);
  REQUIRE(worst(decode_zemax(turned, "t").value(), rotated, {radians(20)}) < 0.02);
  for (const char* word : {"minidiff", "bird"}) {
    const auto back = there_and_back(rotated, word);
    const auto& b = dynamic_cast<const GridBrdf&>(*back).content();
    REQUIRE(b.parts.size() == rotated.content().parts.size());
    REQUIRE(b.parts.back().rotation_rad == Approx(radians(90)).epsilon(1e-6));
  }
}

TEST_CASE("Zemax and MiniDiff bring origins back, and transmission") {
  GridBrdf::Content content = grid_of("ggx:alpha=0.5,f0=0.04,albedo=0.3").content();
  for (auto& part : content.parts) {
    part.origin[5 * 120 + 7] = Origin::kInvalid;
    part.origin[6 * 120 + 7] = Origin::kInterpolated;
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  const auto minidiff = decode_minidiff(encode_minidiff(grid).value(), "m").value();
  const auto& m = minidiff.content();
  REQUIRE(m.theta_count == 31);  // on to 90 deg in the same steps
  for (std::size_t n = 0; n < grid.content().parts[1].origin.size(); ++n) {
    REQUIRE(m.parts[1].origin[n] == grid.content().parts[1].origin[n]);
  }
  REQUIRE(m.parts[1].origin[28 * 120] == Origin::kExtrapolated);
  const auto zemax = there_and_back(grid, "zemax");
  std::vector<double> f(3);
  const Direction i = from_spherical(radians(20), 0);
  REQUIRE(zemax->eval(i, from_spherical(radians(15), radians(21)), f) == Origin::kInvalid);
  REQUIRE(zemax->eval(i, from_spherical(radians(80), radians(200)), f) == Origin::kExtrapolated);
  REQUIRE(zemax->eval(i, from_spherical(radians(40), radians(200)), f) == Origin::kMeasured);

  const GridBrdf film = grid_of("film:transmittance=0.6,haze=0.3");
  for (const auto& [word, tolerance] : {std::pair{"minidiff", 1e-6}, {"zemax", 0.02}, {"exr", 1e-6}}) {
    CAPTURE(word);
    const auto back = there_and_back(film, word);
    REQUIRE(back->type() == ScatterType::kBtdf);
    REQUIRE(worst(*back, film, {0, radians(20), radians(50)}) < tolerance);
  }
  for (const char* word : {"bird", "merl", "rgl"}) {
    CAPTURE(word);
    REQUIRE(encode_brdf(film, *writer_named(word).value()).error().code == ErrorCode::kInvalidArgument);
  }
}

TEST_CASE("The total scatter written is that of the values written") {
  const GridBrdf grid = grid_of("lambertian:0.5", 90);
  const auto zemax = there_and_back(grid, "zemax", {.channel = 0});
  const auto& content = dynamic_cast<const SpecularGridBrdf&>(*zemax).content();
  for (const double total : content.stated_total[0]) {
    REQUIRE(total == Approx(0.5).epsilon(2e-3));  // bilinear cells at the horizon
  }
  REQUIRE_FALSE(content.metadata.contains("notes"));
}

TEST_CASE("Scattered samples go to BiRD, and nowhere else without a chain of estimators") {
  ScatteredSamples samples;
  samples.channels = 1;
  for (const double theta : {1.25, 33.3, 80.0}) {
    samples.omega_i.push_back(from_spherical(radians(20), radians(3)));
    samples.omega_o.push_back(from_spherical(radians(theta), radians(7 * theta)));
    samples.f_per_sr.push_back(static_cast<float>(theta));
  }
  samples.metadata = kMetadata;
  const auto list = SampleListBrdf::make(samples).value();
  const auto back = there_and_back(list, "bird");
  const auto& b = dynamic_cast<const SampleListBrdf&>(*back).samples();
  REQUIRE(b.f_per_sr == samples.f_per_sr);
  REQUIRE(b.metadata == kMetadata);
  std::array<double, 1> f{};
  REQUIRE(back->eval(samples.omega_i[1], samples.omega_o[1], f) == Origin::kMeasured);
  for (const formats::Writer& writer : writers()) {
    CAPTURE(writer.word);
    if (writer.word != "bird") {
      REQUIRE(encode_brdf(list, writer).error().code == ErrorCode::kFailedPrecondition);
    }
  }
}

TEST_CASE("Every real file goes to every format and back") {
  for (const char* name : {"zemax/brown_vinyl_measured_brdf.bsdf", "zemax/fdtd_4aoi_361x181_brdf.bsdf",
                           "rgl/aurora_white_rgb.bsdf", "rgl/ilm_solo_m_68_rgb.bsdf",
                           "bird/generation_c.json", "bird/example_generation_a.brdf"}) {
    const auto path = test::real_data(name);
    if (!path) {
      continue;
    }
    const auto brdf = open_brdf(path->string()).value();
    const bool list = dynamic_cast<const SampleListBrdf*>(brdf.get()) != nullptr;
    for (const formats::Writer& writer : writers()) {
      CAPTURE(name, writer.word);
      if (list && writer.word != "bird") {
        continue;
      }
      // Steps that keep the text small.
      const auto back = there_and_back(
          *brdf, writer.word, {.theta_step = list ? 0 : radians(5), .phi_step = list ? 0 : radians(10)});
      REQUIRE(back->channels() > 0);
    }
  }
}
