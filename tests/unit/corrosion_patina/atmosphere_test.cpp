// Atmospheres: how much copper goes, and what becomes of it.
#include "simulator/corrosion/patina/atmosphere.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "simulator/corrosion/patina/kubelka_munk.h"

namespace scatter::corrosion {
namespace {

TEST_CASE("Loss in the first year lies in a class of ISO 9223 for copper") {
  // C2 0.1..0.6, C3 0.6..1.3, C4 1.3..2.8 um.
  CHECK(copper_loss_um(Atmosphere::kRural, 1) == Approx(0.35).margin(0.25));
  CHECK(copper_loss_um(Atmosphere::kMarine, 1) == Approx(0.95).margin(0.35));
  CHECK(copper_loss_um(Atmosphere::kUrban, 1) == Approx(2.05).margin(0.75));
}

TEST_CASE("Loss follows ISO 9224: t^0.667 to 20 years, then straight on with the slope reached") {
  for (const Atmosphere atmosphere : kAtmospheres) {
    const double first = copper_loss_um(atmosphere, 1);
    CHECK(copper_loss_um(atmosphere, 0) == 0);
    CHECK(copper_loss_um(atmosphere, 10) == Approx(first * std::pow(10, 0.667)));
    CHECK(copper_loss_um(atmosphere, 20) == Approx(first * std::pow(20, 0.667)));
    const double slope = 0.667 * std::pow(20, 0.667 - 1);
    CHECK(copper_loss_um(atmosphere, 70) == Approx(first * (std::pow(20, 0.667) + 50 * slope)));
  }
}

TEST_CASE("Copper is neither made nor lost: film, patina and rain hold what the metal gave") {
  for (const Atmosphere atmosphere : kAtmospheres) {
    const LossBalance balance = balance_of(atmosphere);
    for (float loss = 0; loss < 40; loss += 0.1F) {
      const float film = balance.film_copper_um(loss);
      REQUIRE(film <= loss);
      REQUIRE(film <= balance.full_film_um);
      REQUIRE(balance.tarnish_um(loss) == Approx(film * 1.68));
      REQUIRE(film + balance.patina_um(loss, 0) / balance.patina_volume == Approx(loss).margin(1e-5));
      REQUIRE(balance.patina_um(loss, 2) >= 0);
      REQUIRE(balance.patina_um(loss, 2) <= balance.patina_um(loss, 0));
    }
  }
}

TEST_CASE(
    "Tarnish comes first; towns and coasts turn green, the country hardly; towns grow most, the country "
    "least") {
  const auto layers = [](Atmosphere atmosphere, double years) {
    const auto loss = static_cast<float>(copper_loss_um(atmosphere, years));
    const auto rain = static_cast<float>(data_of(atmosphere).runoff_um_per_year * years);
    const LossBalance balance = balance_of(atmosphere);
    return Layers{balance.tarnish_um(loss), balance.patina_um(loss, rain)};
  };
  for (const Atmosphere atmosphere : kAtmospheres) {
    CHECK(layers(atmosphere, 0.5).tarnish_um > 20 * layers(atmosphere, 0.5).patina_um);
  }
  // Brown within the first years, green after five to fourteen (a common rule of the trade; Leygraf et al.
  // 2019: the green is complete at 12 um), the country brown for decades.
  CHECK(layers(Atmosphere::kUrban, 2).patina_um < 2);
  CHECK(layers(Atmosphere::kUrban, 10).patina_um > 12);
  CHECK(layers(Atmosphere::kMarine, 2).patina_um < 1);
  CHECK(layers(Atmosphere::kMarine, 20).patina_um > 12);
  CHECK(layers(Atmosphere::kRural, 20).patina_um < 1);
  for (const double years : {1.0, 5.0, 20.0, 50.0, 100.0}) {
    const auto total = [&](Atmosphere atmosphere) {
      const Layers grown = layers(atmosphere, years);
      return grown.tarnish_um + grown.patina_um;
    };
    CHECK(total(Atmosphere::kUrban) > total(Atmosphere::kMarine));
    CHECK(total(Atmosphere::kMarine) > total(Atmosphere::kRural));
  }
  CHECK(data_of(Atmosphere::kUrban).patina == PatinaMaterial::kSulphate);
  CHECK(data_of(Atmosphere::kMarine).patina == PatinaMaterial::kChloride);
}

TEST_CASE("Layers hide what is below at the thickness measured, and not at a quarter of it") {
  // Leygraf et al. 2019: 0.8 um of cuprite, 12 um of patina.
  for (const PatinaMaterial material : kPatinaMaterials) {
    const PatinaMaterialData& data = data_of(material);
    double seen_through = 0;
    double seen_early = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double own = infinite_reflectance(data.absorption_per_um[c], data.scattering_per_um[c]);
      const auto over_copper = [&](double um) {
        return over(layer_optics(data.absorption_per_um[c], data.scattering_per_um[c], um),
                    {kCopperReflectance[c], 0})
            .reflectance;
      };
      seen_through = std::max(seen_through, over_copper(data.hiding_um) - own);
      seen_early = std::max(seen_early, over_copper(data.hiding_um / 4) - own);
    }
    INFO(data.name);
    CHECK(seen_through < 0.05);
    CHECK(seen_early > 0.05);
  }
}

TEST_CASE("Thick layers have the colours of their minerals: brown, green, green") {
  for (const PatinaMaterial material : kPatinaMaterials) {
    const PatinaMaterialData& data = data_of(material);
    std::array<double, 3> colour{};
    for (std::size_t c = 0; c < 3; ++c) {
      colour[c] = infinite_reflectance(data.absorption_per_um[c], data.scattering_per_um[c]);
    }
    if (material == PatinaMaterial::kTarnish) {
      CHECK(colour[0] > 1.5 * colour[1]);
      CHECK(colour[1] > colour[2]);
    } else {
      CHECK(colour[1] > 1.5 * colour[0]);
      CHECK(colour[1] > colour[2]);
      CHECK(colour[2] > colour[0]);
    }
  }
}

TEST_CASE("A layer's volume per copper follows from its mineral") {
  // Molar mass over density and copper atoms, relative to copper's 63.546 g/mol over 8.96 g/cm^3.
  const double copper = 63.546 / 8.96;
  CHECK(data_of(PatinaMaterial::kTarnish).volume_per_copper ==
        Approx(143.09 / 6.0 / 2 / copper).epsilon(0.005));
  CHECK(data_of(PatinaMaterial::kSulphate).volume_per_copper ==
        Approx(452.29 / 3.97 / 4 / copper).epsilon(0.005));
  CHECK(data_of(PatinaMaterial::kChloride).volume_per_copper ==
        Approx(213.57 / 3.76 / 2 / copper).epsilon(0.005));
}

TEST_CASE("Names of atmospheres and materials lead to them, others to an error that lists them") {
  for (const Atmosphere atmosphere : kAtmospheres) {
    CHECK(*atmosphere_named(name(atmosphere)) == atmosphere);
  }
  for (const PatinaMaterial material : kPatinaMaterials) {
    CHECK(*patina_material_named(data_of(material).name) == material);
  }
  CHECK(atmosphere_named("lunar").error().remedy == "use marine, urban or rural");
  CHECK(patina_material_named("gold").error().remedy == "use tarnish, sulphate or chloride");
}

}  // namespace
}  // namespace scatter::corrosion
