#include "host_sdk/formats/bird.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include <fmt/format.h>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/sample_list_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "tests/unit/formats/real_data.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

const std::string kSmall = R"({"metadata": {"type": "BRDF", "sample": {"name": "tile"}, "n": [1, true]},
"data": {
 "theta_i": {"unit": "deg", "values": [10, 10, 10]},
 "phi_i": {"unit": "°", "values": [0, 0, 0]},
 "theta_r": {"unit": "deg", "values": [5, 20, 5]},
 "phi_r": {"unit": "deg", "values": [180, 90, 180]},
 "wavelength_i": {"unit": "nm", "values": [550, 550, 650]},
 "BRDF": {"unit": "sr^-1", "values": [0.25, 0.125, 0.5]},
 "uBRDF": {"unit": "%", "values": [2, 4, 8]}}})";

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

/// Rows theta_r x phi_r at one incidence; f = theta_r + phi_r / 1000.
std::string table(const std::vector<double>& theta, const std::vector<double>& phi,
                  std::size_t skipped = 1'000'000) {
  std::array<std::string, 5> columns;
  std::size_t row = 0;
  for (const double t : theta) {
    for (const double p : phi) {
      if (row++ == skipped) {
        continue;
      }
      const std::array<double, 5> values{30, 0, t, p, t + p / 1000};
      for (std::size_t c = 0; c < 5; ++c) {
        columns[c] += fmt::format("{}{}", columns[c].empty() ? "" : ",", values[c]);
      }
    }
  }
  return fmt::format(
      R"({{"data": {{"theta_i": {{"unit": "deg", "values": [{}]}}, "phi_i": {{"unit": "deg", "values": [{}]}},
"theta_r": {{"unit": "deg", "values": [{}]}}, "phi_r": {{"unit": "deg", "values": [{}]}},
"BRDF": {{"unit": "1/sr", "values": [{}]}}}}, "metadata": {{}}}})",
      columns[0], columns[1], columns[2], columns[3], columns[4]);
}

GridBrdf model_grid(double theta_last = 90) {
  GridLayout layout;
  layout.theta_count = static_cast<std::size_t>(theta_last / 5) + 1;
  layout.phi_count = 36;
  layout.theta_step = radians(5);
  layout.incidences = {{0, 0, 0}, {0, radians(20.0317), 0}, {0, radians(60), 0}};
  return sample_on_grid(*make_model("ggx:alpha=0.3,f0=0.04,albedo=0.3").value(), layout).value();
}

}  // namespace

TEST_CASE("BiRD rows become samples, wavelengths channels, and percent uncertainties absolute") {
  // PROVES: formats.md 4, generation A.
  const ScatteredSamples samples = decode_bird_samples(kSmall, "small.brdf").value();
  REQUIRE(samples.channels == 2);
  REQUIRE(samples.wavelengths_nm == std::vector<float>{550, 650});
  REQUIRE(samples.size() == 2);
  REQUIRE(samples.f_per_sr[0] == 0.25F);
  REQUIRE(samples.f_per_sr[1] == 0.5F);
  REQUIRE(samples.systematic_per_sr[0] == Approx(0.005));
  REQUIRE(samples.systematic_per_sr[1] == Approx(0.04));
  REQUIRE(samples.origin_of(0) == Origin::kMeasured);
  REQUIRE(samples.origin_of(1) == Origin::kInvalid);  // 650 nm is missing there
  REQUIRE(samples.metadata.at("notes") == "1 geometries lack a wavelength: invalid\n");
  REQUIRE(samples.metadata.at("bird.sample.name") == "tile");
  REQUIRE(samples.metadata.at("bird.n.1") == "true");
  REQUIRE(degrees(theta_of(samples.omega_i[0])) == Approx(10));
  REQUIRE(degrees(phi_of(samples.omega_o[0])) == Approx(180));
  const auto brdf = decode_bird(kSmall, "small.brdf").value();
  std::array<double, 2> f{};
  REQUIRE(brdf->eval(from_spherical(radians(10), 0), from_spherical(radians(5), radians(180)), f) ==
          Origin::kMeasured);
  REQUIRE(f == std::array<double, 2>{0.25, 0.5});
  REQUIRE(brdf->eval(from_spherical(radians(10), 0), from_spherical(radians(6), radians(180)), f) ==
          Origin::kInvalid);
}

TEST_CASE("BiRD generations B and C hold the same as A") {
  const std::string b = R"({"metadata": {}, "data": {"variables": [
    {"name": "theta_i", "type": "number", "unit": "rad", "description": ""},
    {"name": "phi_i", "type": "number", "unit": "rad", "description": ""},
    {"name": "theta_r", "type": "number", "unit": "rad", "description": ""},
    {"name": "phi_r", "type": "number", "unit": "rad", "description": ""},
    {"name": "operator", "type": "string", "unit": "", "description": ""},
    {"name": "BRDF", "type": "number", "unit": "sr-1", "description": ""}],
    "values": [[0.174533, 0, 0.0872665, 3.14159, "x", 0.25], [0.174533, 0, 0.349066, 1.5708, "y", 0.125]]}})";
  const ScatteredSamples samples = decode_bird_samples(b, "b").value();
  REQUIRE(samples.f_per_sr == std::vector<float>{0.25F, 0.125F});
  REQUIRE(degrees(theta_of(samples.omega_o[1])) == Approx(20).margin(1e-4));
  const std::string c = R"({"head": {"by": "me"}, "data": {"wavelengths": [550, 650], "theta_i": [10, 10],
    "phi_i": [0, 0], "theta_v": [-5, 20], "phi_v": [0, 90], "pol": "u",
    "data": [[0.25, 0.125], [0.5, 0.75]]}})";
  const ScatteredSamples old = decode_bird_samples(c, "c").value();
  REQUIRE(old.f_per_sr == std::vector<float>{0.25F, 0.5F, 0.125F, 0.75F});
  // theta -5 at phi 0 is theta 5 at phi 180.
  REQUIRE(degrees(phi_of(old.omega_o[0])) == Approx(180));
  REQUIRE(degrees(theta_of(old.omega_o[0])) == Approx(5));
  REQUIRE(old.metadata.at("bird.head.by") == "me");
  REQUIRE(old.metadata.at("bird.pol") == "u");
}

TEST_CASE("BiRD polarizations: unpolarized counts, else their mean, and it is said") {
  const std::string rows =
      R"({"metadata": {}, "data": {"theta_i": {"unit":"deg","values":[0,0]}, "phi_i": {"unit":"deg","values":[0,0]},
      "theta_r": {"unit":"deg","values":[10,10]}, "phi_r": {"unit":"deg","values":[60,60]},
      "polarization_i": {"notation": "sp", "values": ["p", "s"]},
      "BRDF": {"unit":"1/sr","values":[0.25, 0.75]}}})";
  const ScatteredSamples mean = decode_bird_samples(rows, "x").value();
  REQUIRE(mean.f_per_sr == std::vector<float>{0.5F});
  REQUIRE(mean.metadata.at("polarization") == "mean of p, s");
  const ScatteredSamples u = decode_bird_samples(replaced(rows, "\"s\"]", "\"u\"]"), "x").value();
  REQUIRE(u.f_per_sr == std::vector<float>{0.75F});
  REQUIRE(u.metadata.at("polarization") == "u");
  const std::string stokes =
      replaced(replaced(rows, "\"sp\"", "\"inStokes\""), "[\"p\", \"s\"]", "[[1,1,0,0],[1,-1,0,0]]");
  REQUIRE(decode_bird_samples(stokes, "x").value().metadata.at("polarization") ==
          "mean of 1 1 0 0, 1 -1 0 0");
}

TEST_CASE("BiRD rows that fill a grid open as one, whatever their steps") {
  const std::vector<double> phi{0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330};
  const auto even = decode_bird(table({0, 10, 20, 30}, phi), "even").value();
  const auto* grid = dynamic_cast<const GridBrdf*>(even.get());
  REQUIRE(grid != nullptr);
  REQUIRE(grid->content().theta_count == 4);
  REQUIRE(grid->content().phi_count == 12);
  REQUIRE(grid->content().parts[0].f_per_sr[0][2 * 12 + 3] == Approx(20.09));
  REQUIRE(
      std::ranges::all_of(grid->content().parts[0].origin, [](Origin o) { return o == Origin::kMeasured; }));

  const auto uneven = decode_bird(table({0, 5, 15, 30}, phi), "uneven").value();
  grid = dynamic_cast<const GridBrdf*>(uneven.get());
  REQUIRE(grid != nullptr);
  REQUIRE(grid->content().theta_count == 7);
  const GridPart& part = grid->content().parts[0];
  REQUIRE(part.origin[3 * 12 + 3] == Origin::kMeasured);
  REQUIRE(part.origin[2 * 12 + 3] == Origin::kInterpolated);
  REQUIRE(part.f_per_sr[0][2 * 12 + 3] == Approx(10.09));

  const auto hole = decode_bird(table({0, 10, 20, 30}, phi, 15), "hole").value();
  grid = dynamic_cast<const GridBrdf*>(hole.get());
  REQUIRE(grid != nullptr);
  REQUIRE(grid->content().parts[0].origin[15] == Origin::kInvalid);
  REQUIRE(grid->content().parts[0].origin[14] == Origin::kMeasured);

  // In the plane only, or with steps that no grid has: a list.
  for (const auto& list : {table({0, 10, 20, 30}, {0, 180}), table({1.2345, 2.7182, 10.1, 30}, phi)}) {
    REQUIRE(dynamic_cast<const SampleListBrdf*>(decode_bird(list, "list").value().get()) != nullptr);
  }
}

TEST_CASE("A grid written as BiRD comes back with values, angles, flags, uncertainty and metadata") {
  GridBrdf::Content content = model_grid(75).content();
  for (GridPart& part : content.parts) {
    part.origin[40] = Origin::kInvalid;
    part.origin[41] = Origin::kInterpolated;
    part.origin[100] = Origin::kExtrapolated;
    part.random_per_sr = part.f_per_sr;
    part.systematic_per_sr = part.f_per_sr;
    for (auto& plane : part.random_per_sr) {
      for (float& value : plane) {
        value *= 0.01F;
      }
    }
  }
  content.metadata = {
      {"sample", "tile \"7\""}, {"quality", "{\"a\":\n1}"}, {"created", "2026-05-04T03:02:01Z"}};
  const GridBrdf grid = GridBrdf::make(content).value();
  const std::string text = encode_bird(grid).value();
  REQUIRE(encode_bird(grid).value() == text);
  const auto back = decode_bird(text, "back").value();
  const auto* b = dynamic_cast<const GridBrdf*>(back.get());
  REQUIRE(b != nullptr);
  REQUIRE(b->content().metadata == content.metadata);
  REQUIRE(b->content().wavelengths_nm == content.wavelengths_nm);
  REQUIRE(b->content().parts.size() == 3);
  for (std::size_t p = 0; p < 3; ++p) {
    const GridPart& x = grid.content().parts[p];
    const GridPart& y = b->content().parts[p];
    REQUIRE(y.theta_i == Approx(x.theta_i).epsilon(1e-9));
    REQUIRE(y.origin == x.origin);
    for (std::size_t n = 0; n < x.origin.size(); ++n) {
      for (std::size_t c = 0; c < 3 && x.origin[n] != Origin::kInvalid; ++c) {
        REQUIRE(y.f_per_sr[c][n] == x.f_per_sr[c][n]);
        REQUIRE(y.random_per_sr[c][n] == x.random_per_sr[c][n]);
        REQUIRE(y.systematic_per_sr[c][n] == x.systematic_per_sr[c][n]);
      }
    }
  }
}

TEST_CASE("What is written as BiRD obeys schema v1.0") {
  // PROVES: formats.md 4: required fields, equal lengths, 0 <= theta <= 90, 0 <= phi < 360.
  const auto json = nlohmann::json::parse(encode_bird(model_grid()).value());
  REQUIRE(json.size() == 2);
  for (const char* key : {"schema", "id", "type", "timestamp", "provenance", "description", "method",
                          "instrumentation", "software", "sample", "environment"}) {
    CAPTURE(key);
    REQUIRE(json["metadata"].contains(key));
  }
  REQUIRE(json["metadata"]["type"] == "BRDF");
  REQUIRE(json["metadata"]["timestamp"] == "1970-01-01T00:00:00+00");
  const auto& data = json["data"];
  const std::size_t rows = data["BRDF"]["values"].size();
  REQUIRE(rows == std::size_t{3 * 3 * 19 * 36});
  for (const auto& [key, column] : data.items()) {
    for (const auto& variable : key == "adhoc_variables" ? column : nlohmann::json{{key, column}}) {
      REQUIRE(variable["values"].size() == rows);
    }
  }
  for (std::size_t k = 0; k < rows; ++k) {
    const double theta = data["theta_r"]["values"][k];
    const double phi = data["phi_r"]["values"][k];
    REQUIRE((theta >= 0 && theta <= 90));
    REQUIRE((phi >= 0 && phi < 360));
  }
  GridBrdf::Content turned = model_grid().content();
  turned.parts[1].phi_i = 2 * kPi - 1e-15;
  const auto again = nlohmann::json::parse(encode_bird(GridBrdf::make(turned).value()).value());
  for (const double phi : again["data"]["phi_i"]["values"]) {
    REQUIRE(phi < 360);
  }
  REQUIRE(encode_bird(*make_model("film:transmittance=0.6,haze=0.3").value()).error().code ==
          ErrorCode::kInvalidArgument);
}

TEST_CASE("A BiRD file with a fault names the byte or the field and what was expected") {
  struct Case {
    std::string text;
    const char* says;
    ErrorCode code = ErrorCode::kDataLoss;
  };
  std::string deep = R"({"metadata": )";
  deep.append(1000, '[').append(1000, ']').append("}");
  for (const auto& [text, says, code] :
       {Case{replaced(kSmall, "0.125", "0.12.5"), "bad.brdf: byte "},
        Case{replaced(kSmall, "0.125", "NaN"), "byte "},
        Case{replaced(kSmall, "0.125", "1e999"), "byte "},
        Case{replaced(kSmall, "0.125", "1e99"), "expected a finite number"},
        Case{replaced(kSmall, "0.125", "\"x\""), "data.BRDF.values after 2 values: numbers and words"},
        Case{replaced(kSmall, "0.125", "null"), "data.BRDF.values after 1 values: 'null' among the values"},
        Case{replaced(kSmall, "0.125", "{}"), "an object among the values"},
        Case{replaced(kSmall, "0.25, 0.125", "0.25"), "values, expected the 2 of BRDF"},
        Case{replaced(kSmall, "\"theta_r\"", "\"theta_x\""), "data.theta_r is missing"},
        Case{replaced(kSmall, "\"BRDF\": {", "\"BXDF\": {"), "without BRDF values",
             ErrorCode::kInvalidArgument},
        Case{replaced(kSmall, "\"phi_r\"", "\"theta_r\""), "the same key twice"},
        Case{replaced(kSmall, "\"type\": \"BRDF\"", "\"type\": \"BRDF\", \"type\": \"x\""),
             "metadata.type: is there twice"},
        Case{replaced(kSmall, "sr^-1", "furlong"), "data.BRDF: unit 'furlong', expected 1/sr"},
        Case{replaced(kSmall, "\"unit\": \"deg\"", "\"unit\": \"gon\""), "data.theta_i: unit 'gon'"},
        Case{replaced(kSmall, "\"nm\"", "\"m\""), "data.wavelength_i: unit 'm', expected nm or um"},
        Case{replaced(kSmall, "\"unit\": \"nm\", ", ""), "data.wavelength_i: no unit, expected nm or um"},
        Case{replaced(replaced(kSmall, "wavelength_i", "wavelength_r"), "\"nm\"", "\"m\""),
             "data.wavelength_r: unit 'm'"},
        Case{replaced(kSmall, "[5, 20, 5]", "[5, 95, 5]"), "data.theta_r.values[1]"},
        Case{replaced(kSmall, "[5, 20, 5]", "[5, 95, 5]"), "95 deg, expected theta_r 0..90"},
        Case{replaced(kSmall, "[10, 10, 10]", "[10, 90, 10]"), "90 deg, expected theta_i below 90"},
        Case{replaced(kSmall, "[180, 90, 180]", "[180, 1e9, 180]"), "data.phi_r.values[1]"},
        Case{replaced(kSmall, "[180, 90, 180]", "[180, 1e9, 180]"), "1e+09 deg, expected phi_r 0..360"},
        Case{replaced(kSmall, "550, 550", "550, -1"), "-1 nm, expected 100..1000000 nm"},
        Case{replaced(kSmall, "550, 550", "550, 0.55"), "data.wavelength_i.values[1]"},
        Case{replaced(kSmall, "\"type\": \"BRDF\"", "\"type\": \"BTDF\""),
             "metadata.type is 'BTDF', expected BRDF", ErrorCode::kUnimplemented},
        Case{deep, "nested deeper than 64 levels"},
        Case{"", "byte "},
        Case{"[1]", "without BRDF values", ErrorCode::kInvalidArgument}}) {
    const auto brdf = decode_bird(text, "bad.brdf");
    CAPTURE(says);
    REQUIRE_FALSE(brdf.has_value());
    CAPTURE(brdf.error().what);
    REQUIRE(brdf.error().code == code);
    REQUIRE(brdf.error().what.starts_with("bad.brdf: "));
    REQUIRE(brdf.error().what.find(says) != std::string::npos);
    REQUIRE_FALSE(brdf.error().remedy.empty());
  }
}

TEST_CASE("A BiRD fault is placed by bytes of the file, a byte-order mark included") {
  const auto byte_after = [](const std::string& text, std::string_view word) {
    return text.find(word) + word.size();
  };
  for (const std::string& text : {kSmall, "\xEF\xBB\xBF" + kSmall}) {
    const std::string null = replaced(text, "0.125", "null");
    REQUIRE(decode_bird(null, "x").error().what ==
            fmt::format("x: byte {}: data.BRDF.values after 1 values: 'null' among the values",
                        byte_after(null, "null")));
    const std::string steep = replaced(text, "[5, 20, 5]", "[5, 95, 5]");
    REQUIRE(decode_bird(steep, "x").error().what ==
            fmt::format("x: data.theta_r.values[1] (list at byte {}): 95 deg, expected theta_r 0..90",
                        steep.find("[5, 95") + 1));
  }
}

TEST_CASE("Faults in BiRD generations B and C are placed in their own lists") {
  const std::string b = R"({"metadata": {}, "data": {"variables": [
    {"name": "theta_i", "unit": "deg"}, {"name": "phi_i", "unit": "deg"}, {"name": "theta_r", "unit": "deg"},
    {"name": "phi_r", "unit": "deg"}, {"name": "BRDF", "unit": "1/sr"}],
    "values": [[10, 0, 5, 0, 0.25], [10, 0, 95, 0, 0.25]]}})";
  REQUIRE(decode_bird_samples(b, "b").error().what.find("data.values[1] theta_r (list at byte ") !=
          std::string::npos);
  const std::string c = R"({"head": {}, "data": {"wavelengths": [550, 0.65], "theta_i": [10, 10],
    "phi_i": [0, 0], "theta_v": [5, 95], "phi_v": [0, 90], "data": [[1, 2], [3, 4]]}})";
  REQUIRE(decode_bird_samples(c, "c").error().what.find("data.wavelengths[1] (list at byte ") !=
          std::string::npos);
  REQUIRE(decode_bird_samples(replaced(c, "0.65", "650"), "c").error().what.find("data.theta_v[1] (") !=
          std::string::npos);
}

TEST_CASE("A BiRD file of generation A warns of required metadata that it lacks") {
  REQUIRE(
      decode_bird_samples(kSmall, "x").value().metadata.at("warnings") ==
      "the metadata lack what BiRD's schema v1.0 requires: schema, id, timestamp, provenance, description, "
      "method, instrumentation, software, environment\n");
  REQUIRE(decode_bird_samples(replaced(kSmall, "\"type\": \"BRDF\"", "\"type\": \"x\""), "x")
              .value()
              .metadata.at("warnings")
              .find("metadata.type is 'x', expected BRDF") != std::string::npos);
  const std::string bare =
      replaced(kSmall, R"("metadata": {"type": "BRDF", "sample": {"name": "tile"}, "n": [1, true]},)", "");
  REQUIRE(decode_bird_samples(bare, "x").value().metadata.at("warnings").find(": schema, id, type, ") !=
          std::string::npos);
  // What our writer writes is whole.
  const auto own = decode_bird_samples(encode_bird(model_grid()).value(), "x").value();
  REQUIRE_FALSE(own.metadata.contains("warnings"));
}

TEST_CASE("Real BiRD files open: the example as a list, the 2018 one as a grid") {
  if (const auto path = test::real_data("bird/example_generation_a.brdf"); path) {
    const auto brdf = decode_bird(read_file(*path).value(), "a").value();
    const auto* list = dynamic_cast<const SampleListBrdf*>(brdf.get());
    REQUIRE(list != nullptr);
    REQUIRE(list->samples().size() == 1);
    REQUIRE(list->samples().wavelengths_nm == std::vector<float>{550, 650, 750, 850});
    // Its rows: 0.254 and 0.263 for the two polarizations at 550 nm.
    REQUIRE(list->samples().f_per_sr[0] == Approx((0.254 + 0.263) / 2));
    REQUIRE(list->samples().metadata.at("bird.provenance.organization") == "Aalto University");
    REQUIRE_FALSE(list->samples().metadata.contains("warnings"));
  }
  if (const auto path = test::real_data("bird/generation_c.json"); path) {
    const auto brdf = decode_bird(read_file(*path).value(), "c").value();
    const auto* grid = dynamic_cast<const GridBrdf*>(brdf.get());
    REQUIRE(grid != nullptr);
    REQUIRE(grid->channels() == 9);
    REQUIRE(grid->content().parts.size() == 6);  // theta_i 0, 10 at phi_i 0, 10, 20
    REQUIRE(grid->content().theta_count == 18);  // 0..85 in steps of 5
    REQUIRE(grid->content().phi_count == 12);
    // Its first rows: p 0.04357787137382907, s twice that, at theta -85.
    REQUIRE(grid->content().parts[0].f_per_sr[0][17 * 12 + 6] == Approx(0.04357787137382907 * 1.5));
  }
}
