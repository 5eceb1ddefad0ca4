#include "host_sdk/reflectance/estimators/chain.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "host_sdk/reflectance/estimators/extent.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "tests/unit/reflectance_estimators/made_data.h"

using namespace scatter::reflectance;
using namespace scatter::reflectance::made;

namespace {

double smooth(double theta_i, double theta_o, double phi) {
  return 1 + theta_i + std::sin(theta_o) * std::cos(phi);
}

std::shared_ptr<const Brdf> measured_grid() {
  return std::make_shared<const GridBrdf>(GridBrdf::make(grid_content({0, 20, 40, 60}, smooth)).value());
}
std::shared_ptr<const Brdf> measured_rings() {
  ScatteredSamples samples = rings({10, 30, 50}, {0, 10, 20, 30, 40, 50, 60, 70}, 10, smooth);
  samples.random_per_sr.assign(samples.size(), 0.1F);
  samples.systematic_per_sr.assign(samples.size(), 0.2F);
  return ScatteredBrdf::make(samples).value();
}

std::string refusal(const std::shared_ptr<const Brdf>& data, std::string_view text) {
  const auto chain = make_chain(data, text);
  return chain ? std::string("accepted") : chain.error().what + " | " + chain.error().remedy;
}

/// Same numbers and origins from single calls and from batches of odd sizes.
void require_batches_agree(const Brdf& brdf) {
  std::mt19937 random(11);
  const std::size_t n = brdf.channels();
  for (int light = 0; light < 12; ++light) {
    Direction i = light == 0 ? Direction{0, 0, 1} : light == 1 ? deg(20, 0) : random_direction(random);
    i = light == 2 ? Direction{0, 0, -1} : i;
    std::vector<Direction> o;
    for (int k = 0; k < 2500; ++k) {
      o.push_back(random_direction(random));
      if (k % 50 == 0) {
        o.back().z = -o.back().z;
      }
    }
    o[7] = {0, 0, 0};
    o[8] = {std::nan(""), 0, 1};
    o[9] = {0, 0, 1};
    o[10] = deg(75, 5);
    o[11] = {1, 0, 0};
    std::vector<double> f(o.size() * n, -1);
    std::vector<Origin> origin(o.size());
    brdf.eval_batch(i, o, f, origin);
    std::vector<double> unflagged(o.size() * n, -1);
    brdf.eval_batch(i, o, unflagged, {});
    for (std::size_t k = 0; k < o.size(); ++k) {
      std::vector<double> single(n, -1);
      const Origin expected = brdf.eval(i, o[k], single);
      REQUIRE(origin[k] == expected);
      for (std::size_t c = 0; c < n; ++c) {
        // A grid's vector unit may round float arithmetic differently.
        REQUIRE(f[k * n + c] == Approx(single[c]).epsilon(1e-5).margin(1e-6));
        REQUIRE(unflagged[k * n + c] == f[k * n + c]);
        REQUIRE((origin[k] != Origin::kInvalid || f[k * n + c] == 0));
      }
    }
  }
}

}  // namespace

TEST_CASE("A chain is what its text says, with every parameter spelled out") {
  const auto grid = measured_grid();
  const auto text = [&](std::string_view asked) { return make_chain(grid, asked).value().text; };
  REQUIRE(text("") == "");
  REQUIRE(text("linear,specular,clamp") == "linear:from=75,specular,clamp:over=both,from=75");
  REQUIRE(text("bezier:from=70,gradient:over=theta_i,p=0.2,m=10,distorted") ==
          "bezier:from=70,gradient:over=theta_i,p=0.2,m=10,l=0.5,distorted");
  REQUIRE(text("grid:step=10,axis=specular") == "grid:axis=specular,step=10");
  REQUIRE(make_chain(measured_rings(), "neighbors:k=4").value().text ==
          "neighbors:k=4,d_max=0.2,k_min=3,epsilon=1e-06");
  REQUIRE(make_chain(measured_rings(), "axis,none").value().text == "axis:gap=30,turn=90,none:from=70");
  for (const char* chain : {"linear,specular,clamp", "bezier,specular-spline", "plain,gradient:l=0.9"}) {
    const Chain first = make_chain(grid, chain).value();
    const Chain again = make_chain(grid, first.text).value();
    REQUIRE(again.text == first.text);
    REQUIRE(at(*again.brdf, deg(33, 5), deg(81, 170)).f == at(*first.brdf, deg(33, 5), deg(81, 170)).f);
  }
}

TEST_CASE("The default chain suits the data") {
  REQUIRE(default_chain(measured_grid()).value().text == "bezier:from=75,specular,clamp:over=theta_i");
  REQUIRE(make_chain(measured_grid(), "default").value().text ==
          "bezier:from=75,specular,clamp:over=theta_i");
  REQUIRE(default_chain(measured_rings()).value().text ==
          "axis:gap=30,turn=90,bezier:from=70,specular,clamp:over=theta_i");
  const auto whole = std::make_shared<const GridBrdf>(GridBrdf::make(grid_content({20}, smooth, 19)).value());
  REQUIRE(default_chain(whole).value().text == "clamp:over=theta_i");
  const auto model = make_model("ggx:alpha=0.3").value();
  REQUIRE(default_chain(model).value().brdf == model);
}

TEST_CASE(
    "Through the default chain every geometry above the horizon has a value that says where it is from") {
  for (const auto& data : {measured_grid(), measured_rings()}) {
    const Chain chain = default_chain(data).value();
    const Extent extent = extent_of(*data);
    std::mt19937 random(1);
    for (int k = 0; k < 2000; ++k) {
      const Direction i = random_direction(random);
      const Direction o = random_direction(random);
      const Value v = at(*chain.brdf, i, o);
      const bool known = theta_of(i) >= extent.theta_i.front() && theta_of(i) <= extent.theta_i.back() &&
                         theta_of(o) <= extent.theta_o_to;
      REQUIRE(v.origin >= Origin::kInterpolated);
      REQUIRE((known || v.origin == Origin::kExtrapolated));
    }
    REQUIRE(at(*chain.brdf, from_spherical(extent.theta_i[1], 0), deg(30, 40)).origin == Origin::kMeasured);
    REQUIRE(at(*chain.brdf, deg(20, 0), {0, 0, -1}).origin == Origin::kInvalid);
    REQUIRE(at(*chain.brdf, {0, 0, 0}, {0, 0, 1}).origin == Origin::kInvalid);
    REQUIRE(at(*chain.brdf, {0, 0, 1}, {0, 0, 0}).origin == Origin::kInvalid);
  }
}

TEST_CASE("Batches through a chain give what single questions give") {
  for (const char* text :
       {"linear,specular,clamp", "default", "none,plain", "bezier,distorted,gradient:over=theta_i",
        "constant,specular-spline,clamp", "grid:step=5,clamp"}) {
    CAPTURE(std::string(text));
    require_batches_agree(*make_chain(measured_grid(), text).value().brdf);
  }
  for (const char* text :
       {"axis", "neighbors,clamp", "default", "axis,grid:step=10,axis=specular,clamp:over=theta_i"}) {
    CAPTURE(std::string(text));
    require_batches_agree(*make_chain(measured_rings(), text).value().brdf);
  }
}

TEST_CASE("Uncertainties pass through a whole chain, and stay unknown where the data has none") {
  const auto chain = make_chain(measured_rings(), "axis,linear,specular,clamp:over=theta_i").value();
  double random = 0;
  double systematic = 0;
  const auto ask = [&](const Direction& i, const Direction& o) {
    return chain.brdf->uncertainty(i, o, std::span(&random, 1), std::span(&systematic, 1));
  };
  REQUIRE(ask(deg(30, 0), deg(35, 5)));
  REQUIRE(random == Approx(0.1));
  REQUIRE(ask(deg(30, 0), deg(80, 5)));
  REQUIRE(random == Approx(0.1 * 10 / 20));
  REQUIRE(ask(deg(20, 0), deg(35, 5)));
  REQUIRE(random == Approx(0.1 * std::sqrt(0.5)));
  REQUIRE(systematic == Approx(0.2));
  REQUIRE(ask(deg(85, 0), deg(35, 5)));
  REQUIRE_FALSE(ask(deg(20, 0), {0, 0, -1}));
  const auto silent = default_chain(measured_grid()).value();
  REQUIRE_FALSE(
      silent.brdf->uncertainty(deg(20, 0), deg(80, 5), std::span(&random, 1), std::span(&systematic, 1)));
}

TEST_CASE("A text that is no chain is refused, and the message says what would be one") {
  const auto grid = measured_grid();
  const auto says = [](const std::string& message, std::string_view part) {
    CAPTURE(message);
    return message.find(part) != std::string::npos;
  };
  CHECK(says(refusal(grid, "cubic"), "no link \"cubic\" | links: neighbors"));
  CHECK(says(refusal(grid, "linear,,clamp"), "empty part"));
  CHECK(says(refusal(grid, ","), "empty part"));
  CHECK(says(refusal(grid, "from=75"), "before any link"));
  CHECK(says(refusal(grid, ":from=75"), "no name"));
  CHECK(says(refusal(grid, "linear:from"), "expected key=value"));
  CHECK(says(refusal(grid, "linear:from="), "expected key=value"));
  CHECK(says(refusal(grid, "linear:from=high"), "\"high\", expected a number"));
  CHECK(says(refusal(grid, "linear:from=nan"), "expected a number"));
  CHECK(says(refusal(grid, "linear:from=75,from=70"), "twice"));
  CHECK(says(refusal(grid, "linear:to=75"), "no parameter to | linear has the parameters from"));
  CHECK(says(refusal(grid, "specular:from=75"), "no parameter from | give specular without parameters"));
  CHECK(says(refusal(grid, "guided:family=ggx"), "guided has no parameter family"));
  CHECK(says(refusal(grid, "linear:from=95"), "95 deg, expected between 1 and 90 deg"));
  CHECK(says(refusal(grid, "clamp:over=phi"), "\"phi\", expected one of both, theta_i, theta_o"));
  CHECK(says(refusal(grid, "clamp:over=theta_i,from=60"), "from goes with theta_o"));
  CHECK(says(refusal(grid, "gradient:l=2"), "l in 0..1"));
  CHECK(says(refusal(grid, "grid:step=7"), "360 a multiple"));
  CHECK(says(refusal(grid, "neighbors"), "which this data is not"));
  std::string many = "clamp";
  for (int k = 0; k < 16; ++k) {
    many += ",clamp";
  }
  CHECK(says(refusal(grid, many), "more than 16 links"));
  CHECK(says(refusal(grid, "default,clamp"), "no link \"default\""));
  CHECK(says(refusal(measured_rings(), "axis,neighbors"), "an earlier link hides | put neighbors first"));
  CHECK(says(refusal(measured_rings(), "neighbors:k=-1"), "whole number"));
  CHECK(says(refusal(measured_rings(), "neighbors:k=0"), "k in 1..1024"));
  const auto model = make_model("ggx:alpha=0.3").value();
  CHECK(says(refusal(model, "specular"), "0 incidences"));
  CHECK(says(refusal(model, "linear"), "reaches the horizon"));
  CHECK(says(refusal(model, "clamp:over=theta_i"), "names no incidences"));
  CHECK(make_chain(model, "linear:from=75").has_value());
}

TEST_CASE("The extent is that of measured nodes, found through a chain") {
  GridBrdf::Content content = grid_content({20, 0, 40}, smooth, 19);
  for (GridPart& part : content.parts) {
    std::fill(part.origin.begin() + 16 * 72, part.origin.begin() + 17 * 72, Origin::kExtrapolated);
    std::fill(part.origin.begin() + 17 * 72, part.origin.end(), Origin::kInvalid);
  }
  const auto grid = std::make_shared<const GridBrdf>(GridBrdf::make(std::move(content)).value());
  const auto chain = make_chain(grid, "linear,plain").value();
  const Extent extent = extent_of(*chain.brdf);
  REQUIRE(extent.theta_i.size() == 3);
  REQUIRE(extent.theta_i[1] == Approx(radians(20)));
  REQUIRE(extent.azimuth.value() == 0);
  REQUIRE(degrees(extent.theta_o_to) == Approx(75));
  REQUIRE(extent_of(*make_model("lambertian:0.5").value()).theta_i.empty());
}
