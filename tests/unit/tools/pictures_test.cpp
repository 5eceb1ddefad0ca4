#include <cairo.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "host_sdk/reflectance/models/model_spec.h"
#include "tools/plot/curves.h"
#include "tools/plot/hemispheres.h"
#include "tools/plot/strip.h"

using namespace scatter;
using namespace scatter::plot;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;

namespace {

/// One incidence, one channel; value and origin given per node.
template <typename Value, typename Kind>
GridBrdf grid(Value value, Kind kind) {
  GridBrdf::Content content;
  content.channels = 1;
  content.wavelengths_nm = {525};
  GridPart part;
  part.theta_i = radians(40);
  part.f_per_sr.assign(1, std::vector<float>(content.theta_count * content.phi_count));
  part.origin.resize(content.theta_count * content.phi_count);
  for (std::size_t j = 0; j < content.theta_count; ++j) {
    for (std::size_t i = 0; i < content.phi_count; ++i) {
      part.f_per_sr[0][j * content.phi_count + i] = float(value(int(j), int(i)));
      part.origin[j * content.phi_count + i] = kind(int(j), int(i));
    }
  }
  content.parts.push_back(std::move(part));
  auto made = GridBrdf::make(std::move(content));
  REQUIRE(made);
  return std::move(*made);
}

struct Image {
  int width = 0;
  int height = 0;
  std::vector<std::uint32_t> pixels;
  [[nodiscard]] std::uint32_t at(double x, double y) const {
    return pixels[std::size_t(y) * std::size_t(width) + std::size_t(x)] & 0xffffffu;
  }
};

Image decoded(const std::string& png) {
  struct Source {
    const std::string& bytes;
    std::size_t at = 0;
  } source{png};
  const auto read = [](void* closure, unsigned char* out, unsigned int length) {
    auto& from = *static_cast<Source*>(closure);
    if (from.bytes.size() - from.at < length) {
      return CAIRO_STATUS_READ_ERROR;
    }
    std::memcpy(out, from.bytes.data() + from.at, length);
    from.at += length;
    return CAIRO_STATUS_SUCCESS;
  };
  cairo_surface_t* const surface = cairo_image_surface_create_from_png_stream(read, &source);
  REQUIRE(cairo_surface_status(surface) == CAIRO_STATUS_SUCCESS);
  Image image{cairo_image_surface_get_width(surface), cairo_image_surface_get_height(surface), {}};
  for (int y = 0; y < image.height; ++y) {
    const auto* row = reinterpret_cast<const std::uint32_t*>(
        cairo_image_surface_get_data(surface) + std::ptrdiff_t(y) * cairo_image_surface_get_stride(surface));
    image.pixels.insert(image.pixels.end(), row, row + image.width);
  }
  cairo_surface_destroy(surface);
  return image;
}

std::uint32_t rgb(const Colour& c) {
  const auto byte = [](double v) { return std::uint32_t(std::lround(v * 255)); };
  return byte(c.r) << 16 | byte(c.g) << 8 | byte(c.b);
}

constexpr double kDisc = 400;
HemisphereOptions bare() {
  HemisphereOptions options;
  options.scale = Scale::kLinear;
  options.disc_px = kDisc;
  return options;
}

/// Centre of the only disc of a picture without title: margins as drawn.
std::pair<double, double> centre(const Image& image) {
  return {0.5 * image.width, 28 + 30 + 24 + 0.5 * kDisc};
}

/// Colour at a direction, a little off the polar grid's lines.
std::uint32_t colour_at(const Image& image, double theta_deg, double phi_deg) {
  const auto [x, y] = centre(image);
  const double r = 0.5 * kDisc * theta_deg / 90;
  return image.at(x + r * std::cos(radians(phi_deg)), y - r * std::sin(radians(phi_deg)));
}

}  // namespace

TEST_CASE("A disc shows phi = 0 on the right, 90 deg on top, and each value in its colour") {
  const auto brdf = grid(
      [](int, int phi) {
        return phi < 90 ? 0.2 : phi < 180 ? 0.4 : phi < 270 ? 0.6 : 1.0;
      },
      [](int, int) { return Origin::kMeasured; });
  const auto png = hemispheres(brdf, bare());
  REQUIRE(png);
  const Image image = decoded(*png);
  CHECK(colour_at(image, 45, 45) == rgb(map_colour(0.2)));
  CHECK(colour_at(image, 45, 135) == rgb(map_colour(0.4)));
  CHECK(colour_at(image, 45, 225) == rgb(map_colour(0.6)));
  CHECK(colour_at(image, 45, 315) == rgb(map_colour(1.0)));
  // Between the last ring and the horizon there is no measurement: hatched, neither empty nor as measured.
  std::size_t page = 0;
  std::size_t as_measured = 0;
  for (double phi_deg = 20; phi_deg < 70; phi_deg += 0.5) {
    page += colour_at(image, 83, phi_deg) == rgb(palette(Theme::kDark).background);
    as_measured += colour_at(image, 83, phi_deg) == rgb(map_colour(0.2));
  }
  CHECK(page == 0);
  CHECK(as_measured == 0);
}

TEST_CASE("Values without a measurement never look like measured ones") {
  const auto brdf = grid([](int, int) { return 1.0; },
                         [](int, int phi) {
                           return phi < 90    ? Origin::kMeasured
                                  : phi < 180 ? Origin::kInterpolated
                                  : phi < 270 ? Origin::kExtrapolated
                                              : Origin::kInvalid;
                         });
  const auto png = hemispheres(brdf, bare());
  REQUIRE(png);
  const Image image = decoded(*png);
  const std::uint32_t measured = rgb(map_colour(1.0));
  CHECK(colour_at(image, 45, 45) == measured);
  for (const double phi_deg : {105.0, 135.0, 165.0, 195.0, 225.0, 255.0, 285.0, 315.0, 345.0}) {
    for (double theta_deg = 40; theta_deg < 55; theta_deg += 0.7) {
      REQUIRE(colour_at(image, theta_deg, phi_deg) != measured);
    }
  }
}

TEST_CASE("Hemispheres and curves refuse what cannot be drawn, with a remedy") {
  const auto brdf = grid([](int, int) { return 1.0; }, [](int, int) { return Origin::kMeasured; });
  HemisphereOptions options = bare();
  options.disc_px = 1e9;
  const auto large = hemispheres(brdf, options);
  REQUIRE_FALSE(large);
  CHECK_FALSE(large.error().remedy.empty());

  CHECK_FALSE(curves({}, {.incidences = {{0, 0}}}));
  const auto film = reflectance::make_model("film:transmittance=0.6,haze=0.3");
  REQUIRE(film);
  const NamedBrdf mixed[] = {{"a", &brdf}, {"b", film->get()}};
  const auto both = curves(mixed, {.incidences = {{0, 0}}});
  REQUIRE_FALSE(both);
  CHECK(both.error().what.find("BTDF") != std::string::npos);
  const NamedBrdf one[] = {{"a", &brdf}};
  CHECK_FALSE(curves(one, {.incidences = {}}));
}

TEST_CASE("Pictures can be drawn of values that are all zero, negative or huge") {
  for (const double value : {0.0, -1.0, 1e30}) {
    const auto brdf = grid([&](int, int phi) { return phi == 0 ? 0.0 : value; },
                           [](int, int) { return Origin::kMeasured; });
    for (const Scale scale : {Scale::kAuto, Scale::kLog, Scale::kLinear}) {
      HemisphereOptions options = bare();
      options.scale = scale;
      CHECK(hemispheres(brdf, options));
      const NamedBrdf one[] = {{"a", &brdf}};
      CHECK(curves(one, {.scale = scale, .incidences = incidences_of(brdf)}));
    }
  }
}

TEST_CASE("Every channel has a colour of its own") {
  for (const Theme theme : {Theme::kLight, Theme::kDark}) {
    for (std::size_t channels = 2; channels <= 12; ++channels) {
      std::vector<float> nm;
      for (std::size_t k = 0; k < channels; ++k) {
        nm.push_back(450 + 50 * float(k));
      }
      for (const auto& wavelengths : {nm, std::vector<float>(), std::vector<float>(channels, 600)}) {
        const auto colours = channel_colours(wavelengths, channels, theme);
        REQUIRE(colours.size() == channels);
        for (std::size_t a = 0; a < channels; ++a) {
          for (std::size_t b = 0; b < a; ++b) {
            const OkLab p = to_oklab(colours[a]);
            const OkLab q = to_oklab(colours[b]);
            // 0.02 is about what eyes just tell apart.
            CHECK(std::hypot(p.lightness - q.lightness, p.green_red - q.green_red,
                             p.blue_yellow - q.blue_yellow) > 0.06);
          }
        }
      }
    }
  }
}

TEST_CASE(
    "A picture tells what it cannot show: a mirror's share, values without a logarithm, no value at all") {
  const auto sentences_of = [](const reflectance::Brdf& brdf, CurveOptions options) {
    std::vector<std::string> told;
    const NamedBrdf one[] = {{"it", &brdf}};
    REQUIRE(curves(one, options, &told));
    std::string all;
    for (const auto& sentence : told) {
      all += sentence + "\n";
    }
    return all;
  };
  const auto mirror = reflectance::make_model("mirror:0.9");
  REQUIRE(mirror);
  CHECK(sentences_of(**mirror, {.incidences = {{0, 0}}}).find("it: 0.9 of the light") == 0);

  const auto measured = [](int, int) { return Origin::kMeasured; };
  // Half of the plane of incidence at -1: 150 of the 301 points to 75 deg, in steps of 0.5.
  const auto half = grid([](int theta, int phi) { return phi == 180 && theta > 0 ? 1.0 : -1.0; }, measured);
  const CurveOptions log{.scale = Scale::kLog, .incidences = {{radians(40), 0}}};
  const auto lost = sentences_of(half, log);
  CHECK(lost.find("at or below 0: 525 nm ") != std::string::npos);
  CHECK(lost.find(" of 301 points") != std::string::npos);
  CHECK(sentences_of(half, {.scale = Scale::kLinear, .incidences = {{radians(40), 0}}}).empty());
  // Nothing positive: only a linear scale shows it, and it is chosen.
  const auto negative = grid([](int, int) { return -1.0; }, measured);
  CHECK(sentences_of(negative, {.incidences = {{radians(40), 0}}}).empty());

  const auto nothing = grid([](int, int) { return 1.0; }, [](int, int) { return Origin::kInvalid; });
  CHECK(sentences_of(nothing, log).find("nothing to draw") == 0);
  std::vector<std::string> told;
  REQUIRE(hemispheres(nothing, bare(), &told));
  REQUIRE(told.size() == 1);
  CHECK(told.front().find("nothing to draw") == 0);
  const auto point = grid(
      [](int, int) { return 1.0; },
      [](int theta, int phi) { return theta == 10 && phi == 60 ? Origin::kMeasured : Origin::kInvalid; });
  told.clear();
  REQUIRE(hemispheres(point, bare(), &told));
  REQUIRE(told.size() == 1);
  CHECK(told.front().find("1 of 27360 directions") != std::string::npos);  // 76 x 360
}

TEST_CASE("Incidences that a picture leaves out are named, rotations told apart") {
  const auto brdf = reflectance::make_model("lambertian:0.5");
  REQUIRE(brdf);
  const NamedBrdf one[] = {{"it", brdf->get()}};
  CurveOptions options{.incidences = {}, .max_panels = 2};
  for (const double theta_deg : {0.0, 20.0, 40.0}) {
    options.incidences.push_back({radians(theta_deg), 0});
  }
  std::vector<std::string> told;
  REQUIRE(curves(one, options, &told));
  REQUIRE(told.size() == 1);
  CHECK(told.front() == "2 of 3 incidences drawn, left out: θᵢ = 20°");
  CHECK_FALSE(turned(options.incidences));
  CHECK(incidence_name({radians(20), radians(10)}, turned({{0, 0}, {0, radians(10)}})) ==
        "θᵢ = 20°, φᵢ = 10°");
}

TEST_CASE("The extension decides between PNG and SVG") {
  CHECK(image_kind("a/b.png") == ImageKind::kPng);
  CHECK(image_kind("X.SVG") == ImageKind::kSvg);
  const auto other = image_kind("curve.pdf");
  REQUIRE_FALSE(other);
  CHECK(other.error().remedy.find(".svg") != std::string::npos);

  const auto brdf = reflectance::make_model("ggx:alpha=0.2,f0=0.04,albedo=0.3");
  REQUIRE(brdf);
  const NamedBrdf one[] = {{"ggx", brdf->get()}};
  const auto svg = curves(one, {.kind = ImageKind::kSvg, .incidences = incidences_of(**brdf)});
  REQUIRE(svg);
  CHECK(svg->find("<svg") != std::string::npos);
  const auto png = curves(one, {.kind = ImageKind::kPng, .incidences = incidences_of(**brdf)});
  REQUIRE(png);
  CHECK(png->substr(1, 3) == "PNG");
}

TEST_CASE("A strip holds every tile as it is, ten in a row") {
  std::vector<StripTile> tiles;
  for (std::uint8_t n = 0; n < 12; ++n) {
    StripTile tile{.width = 20, .height = 10, .rgb = {}, .caption = std::to_string(n)};
    for (int k = 0; k < 200; ++k) {
      tile.rgb.insert(tile.rgb.end(), {std::uint8_t(10 * n), 200, std::uint8_t(255 - n)});
    }
    tiles.push_back(tile);
  }
  const auto png = strip(tiles, "");
  REQUIRE(png);
  const Image page = decoded(*png);
  std::size_t found = 0;
  for (std::uint32_t n = 0; n < 12; ++n) {
    const std::uint32_t colour = 10 * n << 16U | 200U << 8U | (255 - n);
    found += std::size_t(std::ranges::count(page.pixels, colour | 0xff000000U));
  }
  CHECK(found == 12 * 200);
  // Ten tiles across and two rows of them.
  CHECK(page.width >= 200);
  CHECK(page.width < 11 * 33);
  CHECK(page.height >= 2 * 10);
  tiles[3].rgb.pop_back();
  const auto refused = strip(tiles, "");
  REQUIRE_FALSE(refused);
  CHECK(refused.error().what.find("'3'") != std::string::npos);
  CHECK_FALSE(strip({}, "empty"));
}
