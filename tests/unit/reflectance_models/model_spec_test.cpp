#include "host_sdk/reflectance/models/model_spec.h"

#include <fmt/format.h>

#include <array>
#include <catch2/catch.hpp>
#include <fstream>
#include <string>

#include "host_sdk/reflectance/models/disney.h"
#include "host_sdk/reflectance/models/ggx.h"
#include "host_sdk/reflectance/models/ggx_transmission.h"

using namespace scatter::reflectance;
using scatter::ErrorCode;

namespace {

template <typename Model>
const Model& as(const std::shared_ptr<const Brdf>& model) {
  const auto* out = dynamic_cast<const Model*>(model.get());
  REQUIRE(out != nullptr);
  return *out;
}

std::array<double, 3> eval(const Brdf& model, const Direction& i, const Direction& o) {
  std::array<double, 3> f{};
  (void)model.eval(i, o, f);
  return f;
}

const Direction kIn = from_spherical(0.5, 0.3);
const Direction kOut = from_spherical(0.7, 3.0);

}  // namespace

TEST_CASE("Specs accept a positional first value, defaults and colours") {
  const auto model = make_model("ggx:0.1/0.2/0.3,albedo=0.3").value();
  const auto& ggx = as<Ggx>(model);
  REQUIRE(ggx.parameters().alpha == ChannelValues{0.1, 0.2, 0.3});
  REQUIRE(ggx.parameters().f0 == uniform(0.04));
  REQUIRE(ggx.parameters().albedo == uniform(0.3));
  REQUIRE_FALSE(ggx.parameters().alpha_y.has_value());
  REQUIRE(is_model_spec("ggx:nonsense"));
  REQUIRE(is_model_spec("sum:nonsense"));
  REQUIRE_FALSE(is_model_spec("ggx"));
  REQUIRE_FALSE(is_model_spec("sum"));
  REQUIRE_FALSE(is_model_spec("file:ggx"));
}

TEST_CASE("A spec's keys reach the parameter of their name") {
  const auto disney =
      make_model(
          "disney:base=0.1/0.2/0.3,metallic=0.11,subsurface=0.12,specular=0.13,roughness=0.14,"
          "specular_tint=0.15,anisotropic=0.16,sheen=0.17,sheen_tint=0.18,clearcoat=0.19,"
          "clearcoat_gloss=0.21")
          .value();
  const Disney::Parameters& p = as<Disney>(disney).parameters();
  REQUIRE(p.base_color == ChannelValues{0.1, 0.2, 0.3});
  REQUIRE(std::array{p.metallic, p.subsurface, p.specular, p.roughness, p.specular_tint, p.anisotropic,
                     p.sheen, p.sheen_tint, p.clearcoat, p.clearcoat_gloss} ==
          std::array{0.11, 0.12, 0.13, 0.14, 0.15, 0.16, 0.17, 0.18, 0.19, 0.21});
  const auto through = make_model("ggx-transmission:alpha=0.1,alpha_y=0.2,ior=1.4/1.5/1.6").value();
  REQUIRE(as<GgxTransmission>(through).parameters().alpha_x == uniform(0.1));
  REQUIRE(as<GgxTransmission>(through).parameters().alpha_y == uniform(0.2));
  REQUIRE(as<GgxTransmission>(through).parameters().eta == ChannelValues{1.4, 1.5, 1.6});
}

TEST_CASE("A sum is the weighted sum of its parts, mirrors included") {
  const auto sum = make_model(
                       "sum:ggx:alpha=0.1,f0=0.5,weight=0.5/0.4/0.3,ward:alpha=0.3,ks=0.2,lambertian:0.3,"
                       "mirror:0.4,weight=0.25")
                       .value();
  const auto a = eval(*make_model("ggx:alpha=0.1,f0=0.5").value(), kIn, kOut);
  const auto b = eval(*make_model("ward:alpha=0.3,ks=0.2").value(), kIn, kOut);
  const auto f = eval(*sum, kIn, kOut);
  REQUIRE(f[0] == Approx(0.5 * a[0] + b[0] + 0.3 / kPi).epsilon(1e-13));
  REQUIRE(f[2] == Approx(0.3 * a[2] + b[2] + 0.3 / kPi).epsilon(1e-13));
  std::array<double, 3> mirror{};
  REQUIRE(sum->dirac(kIn, mirror));
  REQUIRE(mirror[1] == Approx(0.1).epsilon(1e-14));
}

TEST_CASE("A conductor by name is the conductor of its constants at the channels' wavelengths") {
  // Copper at 525 nm by hand, between the rows 520.9 (1.18, 2.608) and 548.6 (1.02, 2.577).
  const double t = (525 - 520.9) / (548.6 - 520.9);
  const double n = 1.18 + t * (1.02 - 1.18);
  const double k = 2.608 + t * (2.577 - 2.608);
  const auto by_name = make_model("conductor:metal=copper,alpha=0.2").value();
  const auto by_index = make_model(fmt::format("conductor:alpha=0.2,n={},k={}", n, k)).value();
  REQUIRE(eval(*by_name, kIn, kOut)[1] == Approx(eval(*by_index, kIn, kOut)[1]).epsilon(1e-13));
}

TEST_CASE("Every model's description makes it, and docs/models.md describes every key") {
  std::ifstream file("docs/models.md");
  const std::string document{std::istreambuf_iterator<char>(file), {}};
  REQUIRE_FALSE(document.empty());
  for (const ModelDescription& model : model_descriptions()) {
    CAPTURE(model.name);
    CHECK(is_model_spec(fmt::format("{}:", model.name)));
    CHECK(document.find(fmt::format("`{}:", model.name)) != std::string::npos);
    for (const ModelKey& key : model.keys) {
      CAPTURE(key.name);
      CHECK(document.find(fmt::format("`{}`", key.name)) != std::string::npos);
    }
  }
}

TEST_CASE("A wrong spec is refused with the key, its range and the models") {
  struct Case {
    const char* spec;
    const char* says;
  };
  for (const auto& [spec, says] :
       {Case{"ggx:alpha=2", "alpha is '2', expected 0.001..1"},
        Case{"ggx:alpha=nan", "alpha is 'nan'"},
        Case{"ggx:f0=0.1", "alpha is missing (0.001..1)"},
        Case{"ggx:alpha=0.1,alpha=0.2", "given twice"},
        Case{"ggx:alpha=0.1,beta=3", "unknown key 'beta', expected alpha, alpha_y, f0, albedo"},
        Case{"ggx:alpha=0.1,", "comma"},
        Case{"lambertian:", "albedo is missing"},
        Case{"lambertian:0.5x", "albedo is '0.5x'"},
        Case{"lambertian:0.5/0.5", "albedo is"},
        Case{"lambertian:0.1/0.2/0.3/0.4", "albedo is"},
        Case{"lambertian:0.5/", "albedo is"},
        Case{"lambertian:1.01", "expected 0..1"},
        Case{"film:0.6", "haze is missing"},
        Case{"glass:1", "unknown model"},
        Case{"", "unknown model"},
        Case{"ggx:alpha", "alpha is 'alpha'"},
        Case{"ggx:,alpha=0.1", "alpha is ''"},
        Case{"ggx:0.1,weight=0.5", "unknown key 'weight'"},
        Case{"disney:metallic=0.1/0.2/0.3", "expected 0..1 (one number)"},
        Case{"conductor:alpha=0.1", "either metal or both n and k"},
        Case{"conductor:alpha=0.1,n=1", "either metal or both n and k"},
        Case{"conductor:alpha=0.1,metal=gold,k=1", "either metal or both n and k"},
        Case{"conductor:alpha=0.1,metal=", "metal is '', expected a name"},
        Case{"conductor:alpha=0.1,metal=tin", "use one of aluminium, brass, chromium, copper"},
        Case{"ggx-transmission:alpha=0.1,ior=1.001", "light goes straight on"},
        Case{"ggx-dielectric:alpha=0.1,ior=1.5/1/1.5", "light goes straight on"},
        Case{"sum:", "'' starts with no model"},
        Case{"sum:ggx", "starts with no model"},
        Case{"sum:alpha=0.1,ggx:0.1", "'alpha=0.1,ggx:0.1' starts with no model"},
        Case{"sum:ggx:0.1,,lambertian:0.5", "comma"},
        Case{"sum:ggx:0.1,", "comma"},
        Case{"sum:sum:ggx:0.1", "starts with no model"},
        Case{"sum:film:transmittance=0.5,haze=0.1", "film cannot be summed"},
        Case{"sum:mirror:0.6,mirror:0.6", "more than 1"},
        Case{"sum:ggx:0.1,weight=2", "weight is '2', expected 0..1"}}) {
    CAPTURE(spec);
    const auto model = make_model(spec);
    REQUIRE_FALSE(model.has_value());
    CHECK(model.error().code == ErrorCode::kInvalidArgument);
    CAPTURE(model.error().what, model.error().remedy);
    CHECK(model.error().what.find(says) != std::string::npos);
    CHECK_FALSE(model.error().remedy.empty());
  }
  CHECK(make_model("glass:1").error().remedy.find("lambertian, mirror, phong") != std::string::npos);
  CHECK(make_model("ggx:2").error().remedy.find("use ggx:alpha=0.001..1[,alpha_y=0.001..1]") !=
        std::string::npos);
  CHECK_FALSE(make_model(fmt::format("ggx:{}", std::string(5000, '1'))).has_value());
}
