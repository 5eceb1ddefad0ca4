#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "simulator/random/stream.h"
#include "simulator/samples/aspect.h"
#include "simulator/samples/sample.h"

namespace {

using namespace scatter::simulator;
using scatter::reflectance::from_spherical;
using scatter::reflectance::kPi;
using scatter::reflectance::make_model;
using scatter::reflectance::radians;
using Vector = scatter::reflectance::Direction;
using Values = std::array<double, 3>;

std::shared_ptr<const Sample> sample(const std::string& spec) {
  auto made = Sample::make(spec);
  REQUIRE(made.has_value());
  return *made;
}

Values radiance(const Aspect& aspect, const Vector& source, const Vector& camera) {
  Values out{};
  aspect.radiance(source, {&camera, 1}, out);
  return out;
}

/// Rotation of v about a unit axis (Rodrigues).
Vector rotated(const Vector& v, const Vector& axis, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const Vector k = cross(axis, v);
  const double along = dot(axis, v) * (1 - c);
  return {v.x * c + k.x * s + axis.x * along, v.y * c + k.y * s + axis.y * along,
          v.z * c + k.z * s + axis.z * along};
}

}  // namespace

TEST_CASE("Sample specs give surface and defects") {
  const auto s = sample("ggx:alpha=0.2,f0=0.04,albedo=0.3+tilt=1.5@30+uneven=0.5+translucent=0.1+soft=0.2");
  CHECK(s->defects().tilt_rad == Approx(radians(1.5)));
  CHECK(s->defects().tilt_azimuth_rad == Approx(radians(30)));
  CHECK(s->defects().uneven_rad == Approx(radians(0.5)));
  CHECK(s->defects().translucent == Approx(0.1));
  CHECK(s->defects().soft == Approx(0.2));
  CHECK_FALSE(s->transmits());
  CHECK(sample("film:transmittance=0.6,haze=0.3")->transmits());
  CHECK(sample("lambertian:0.5")->defects().tilt_rad == 0);
}

TEST_CASE("A bad sample spec is refused with the key, its range and a remedy") {
  const auto refused = [](const std::string& spec, const std::string& part) {
    const auto made = Sample::make(spec);
    REQUIRE_FALSE(made.has_value());
    CAPTURE(spec, made.error().what);
    CHECK(made.error().what.find(part) != std::string::npos);
    CHECK_FALSE(made.error().remedy.empty());
  };
  refused("", "no surface");
  refused("velvet", "unknown kind of surface");
  refused("lambertian:0.5+tilt=11@0", "0..10");
  refused("lambertian:0.5+tilt=1@east", "azimuth");
  refused("lambertian:0.5+soft=2", "soft is '2', expected a share 0..1");
  refused("lambertian:0.5+translucent=", "translucent is ''");
  refused("lambertian:0.5+uneven=nan", "degrees 0..10");
  refused("lambertian:0.5+soft=0.1+soft=0.2", "soft is given twice");
  refused("lambertian:0.5+wobbly=1", "unknown defect 'wobbly'");
  refused("lambertian:1.5", "albedo");
  refused("ggx:alpha=0.2,shine=3", "shine");
}

TEST_CASE("A flat sample shows f cos(theta_i)") {
  const auto model = make_model("ggx:alpha=0.3,f0=0.05,albedo=0.2");
  const Vector source = from_spherical(0.7, 0.3);
  const Vector camera = from_spherical(0.5, 2.9);
  const Aspect aspect(*sample("ggx:alpha=0.3,f0=0.05,albedo=0.2"), 3, source);
  Values f{};
  (void)(*model)->eval(source, camera, f);
  CHECK(radiance(aspect, source, camera)[1] == Approx(f[1] * std::cos(0.7)).epsilon(1e-12));
}

TEST_CASE("A tilted sample scatters as the flat one seen from the turned instrument") {
  const auto model = make_model("ggx:alpha=0.15,f0=0.3/0.2/0.1,albedo=0.2");
  const double tilt = radians(2.5);
  const double azimuth = radians(35);
  const Vector source = from_spherical(0.9, 0.0);
  const Aspect aspect(*sample("ggx:alpha=0.15,f0=0.3/0.2/0.1,albedo=0.2+tilt=2.5@35"), 3, source);
  const Vector axis{-std::sin(azimuth), std::cos(azimuth), 0};
  for (const Vector& camera :
       {from_spherical(0.8, 3.1), from_spherical(0.2, 1.0), from_spherical(1.2, 4.0)}) {
    const Vector in = rotated(source, axis, -tilt);
    Values f{};
    (void)(*model)->eval(in, rotated(camera, axis, -tilt), f);
    const Values seen = radiance(aspect, source, camera);
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(seen[c] == Approx(f[c] * in.z).epsilon(1e-9));
    }
  }
  // It leans towards the azimuth: the mirror direction moves there by twice the tilt.
  const Vector straight = Aspect(*sample("lambertian:1+tilt=2.5@35"), 3, {0, 0, 1}).straight();
  CHECK(theta_of(straight) == Approx(2 * tilt));
  CHECK(phi_of(straight) == Approx(azimuth));
}

TEST_CASE("An uneven sample averages its facets with their visible areas") {
  for (const double uneven_deg : {0.5, 2.0}) {
    const std::string base = "ggx:alpha=0.1,f0=0.1,albedo=0.2";
    const auto model = make_model(base);
    const Vector source = from_spherical(radians(40), 0.0);
    const Aspect aspect(*sample(base + "+uneven=" + std::to_string(uneven_deg)), 3, source);
    for (const Vector& camera : {from_spherical(radians(40), kPi), from_spherical(radians(46), kPi),
                                 from_spherical(radians(10), 1.0)}) {
      RandomStream random({4, Purpose::kFaults, 9});
      const double slope = std::tan(radians(uneven_deg));
      const int count = 200000;
      double sum = 0;
      double square = 0;
      for (int i = 0; i < count; ++i) {
        // Slopes p, q lean the facet's normal to (-p, -q, 1) and make its area sqrt(1 + p^2 + q^2).
        const Vector steep{-slope * random.normal(), -slope * random.normal(), 1.0};
        const Vector normal = normalized(steep);
        const double angle = theta_of(normal);
        const Vector axis = scatter::reflectance::normalized({-normal.y, normal.x, 0});
        const Vector in = rotated(source, axis, -angle);
        const Vector out = rotated(camera, axis, -angle);
        Values f{};
        (void)(*model)->eval(in, out, f);
        const double term = f[0] * in.z * std::max(out.z, 0.0) / (normal.z * camera.z);
        sum += term;
        square += term * term;
      }
      const double mean = sum / count;
      const double error = std::sqrt((square / count - mean * mean) / count);
      CAPTURE(uneven_deg);
      CHECK(radiance(aspect, source, camera)[0] == Approx(mean).margin(5 * error + 2e-4 * mean));
    }
  }
}

TEST_CASE("Film lights the camera from below only, straight light apart") {
  const auto film = sample("film:transmittance=0.6,haze=0.3");
  const Vector below = from_spherical(radians(140), 0.0);
  const Aspect aspect(*film, 3, below);
  CHECK(radiance(aspect, below, from_spherical(0.3, 1.0))[0] ==
        Approx(0.6 * 0.3 / kPi * std::cos(radians(40))).epsilon(1e-12));
  Aspect::Regular part;
  REQUIRE(aspect.regular(part));
  CHECK(part.weight[2] == Approx(0.6 * 0.7));
  CHECK(theta_of(part.towards) == Approx(radians(40)));
  CHECK(phi_of(part.towards) == Approx(kPi));
  CHECK_FALSE(Aspect(*film, 3, from_spherical(0.3, 0.0)).lit());
  CHECK_FALSE(Aspect(*sample("lambertian:0.5"), 3, below).lit());
}

TEST_CASE("A measured file lies under the instrument as its reader evaluates it") {
  const char* folder = std::getenv("SCATTER_REAL_DATA");
  const std::filesystem::path path = std::filesystem::path(folder != nullptr ? folder : "../shared/data") /
                                     "zemax/brown_vinyl_measured_brdf.bsdf";
  if (!std::filesystem::exists(path)) {
    std::cout << "skipped: no real data\n";
    return;
  }
  const auto brdf = scatter::formats::open_brdf(path.string());
  REQUIRE(brdf.has_value());
  const Vector source = from_spherical(radians(40), 0.0);
  const Aspect aspect(*sample("file:" + path.string()), 3, source);
  for (const Vector& camera :
       {from_spherical(0.7, 3.0), from_spherical(0.2, 1.0), from_spherical(1.1, 3.3)}) {
    std::vector<double> f((*brdf)->channels());
    REQUIRE((*brdf)->eval(source, camera, f) != scatter::reflectance::Origin::kInvalid);
    CHECK(f[0] > 0);
    CHECK(radiance(aspect, source, camera)[0] == Approx(f[0] * std::cos(radians(40))).epsilon(1e-9));
  }
  // A plus sign in a path is part of the path.
  const auto missing = Sample::make("file:no+such+file=x.bsdf+soft=0.1");
  REQUIRE_FALSE(missing.has_value());
  CHECK(missing.error().what.find("no+such+file=x.bsdf") != std::string::npos);
}

TEST_CASE("A soft sample loses its share with a time constant of one second") {
  const auto soft = sample("lambertian:0.5+soft=0.2");
  CHECK(soft->signal_share(0) == 1.0);
  CHECK(soft->signal_share(1) == Approx(1 - 0.2 * (1 - std::exp(-1.0))));
  CHECK(soft->signal_share(60) == Approx(0.8));
}

TEST_CASE("A mono surface shows the same in every colour") {
  class Mono final : public scatter::reflectance::Brdf {
   public:
    [[nodiscard]] scatter::reflectance::ScatterType type() const noexcept override {
      return scatter::reflectance::ScatterType::kBrdf;
    }
    [[nodiscard]] std::size_t channels() const noexcept override { return wavelengths_.size(); }
    [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override { return wavelengths_; }
    [[nodiscard]] scatter::reflectance::Origin eval(const Vector& /*omega_i*/, const Vector& /*omega_o*/,
                                                    std::span<double> f) const noexcept override {
      for (std::size_t k = 0; k < f.size(); ++k) {
        f[k] = static_cast<double>(k + 1);
      }
      return scatter::reflectance::Origin::kMeasured;
    }
    std::vector<float> wavelengths_;
  };
  auto mono = std::make_shared<Mono>();
  mono->wavelengths_ = {550.0F};
  const Vector up{0, 0, 1};
  const Sample one(std::make_shared<const UniformSurface>(mono), {});
  CHECK(radiance(Aspect(one, 3, up), up, from_spherical(0.3, 0)) == Values{1, 1, 1});
  // Spectral data: the nearest wavelength stands for each LED.
  auto spectrum = std::make_shared<Mono>();
  spectrum->wavelengths_ = {400, 470, 520, 580, 640, 700};
  const Sample many(std::make_shared<const UniformSurface>(spectrum), {});
  CHECK(radiance(Aspect(many, 3, up), up, from_spherical(0.3, 0)) == Values{5, 3, 2});
}
