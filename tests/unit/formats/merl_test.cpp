#include "host_sdk/formats/merl.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/reflectance/compare.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/unit/formats/sample_grid.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

constexpr std::size_t kStandardSize = 34'992'012;

/// File image with counts and a value for each plane and cell.
template <typename F>
std::string merl_file(std::int32_t h, std::int32_t d, std::int32_t p, const F& value) {
  std::string bytes(12, '\0');
  const std::array<std::int32_t, 3> counts{h, d, p};
  std::memcpy(bytes.data(), counts.data(), 12);
  const std::size_t cells =
      static_cast<std::size_t>(h) * static_cast<std::size_t>(d) * static_cast<std::size_t>(p);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t k = 0; k < cells; ++k) {
      const double v = value(c, k);
      bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
    }
  }
  return bytes;
}

/// 3 x 4 x 8 cells, every one another value.
std::string small_file() {
  return merl_file(3, 4, 8, [](std::size_t c, std::size_t k) { return static_cast<double>(100 * c + k); });
}

double double_at(const std::string& bytes, std::size_t index) {
  double value = 0;
  std::memcpy(&value, bytes.data() + 12 + 8 * index, 8);
  return value;
}

}  // namespace

TEST_CASE("A MERL cell is found at the angles that the format says") {
  // PROVES: formats.md 3: index phi_d + n_phi (theta_d + n_theta_d theta_h), planes, scales, pi added to
  // negative phi_d.
  HalfDifferenceBrdf brdf = decode_merl(small_file(), "small").value();
  brdf.set_lookup(HalfDifferenceBrdf::Lookup::kNearest);
  std::array<double, 3> f{};
  std::size_t seen = 0;
  for (std::size_t h = 0; h < 3; ++h) {
    for (std::size_t d = 0; d < 4; ++d) {
      for (std::size_t p = 0; p < 8; ++p) {
        // Own geometry: h in the plane y = 0, the light turned by theta_d about it from phi_d.
        const double theta_h = std::pow((static_cast<double>(h) + 0.4) / 3, 2) * kPi / 2;
        const double theta_d = (static_cast<double>(d) + 0.6) / 4 * kPi / 2;
        for (const double half_turn : {0.0, kPi}) {
          const double phi_d = (static_cast<double>(p) + 0.3) / 8 * kPi - half_turn;
          const Direction half{std::sin(theta_h), 0, std::cos(theta_h)};
          const Direction along{std::cos(theta_h), 0, -std::sin(theta_h)};
          const double s = std::sin(theta_d);
          const double c = std::cos(theta_d);
          const auto at = [&](double sign) {
            return Direction{c * half.x + sign * s * std::cos(phi_d) * along.x, sign * s * std::sin(phi_d),
                             c * half.z + sign * s * std::cos(phi_d) * along.z};
          };
          const Direction i = at(1);
          const Direction o = at(-1);
          if (i.z <= 0.001 || o.z <= 0.001) {
            continue;
          }
          const auto index = static_cast<double>(p + 8 * (d + 4 * h));
          REQUIRE(brdf.eval(i, o, f) == Origin::kMeasured);
          CHECK(f[0] == Approx(index / 1500));
          CHECK(f[1] == Approx((index + 100) * 1.15 / 1500));
          CHECK(f[2] == Approx((index + 200) * 1.66 / 1500));
          ++seen;
        }
      }
    }
  }
  REQUIRE(seen > 60);
}

TEST_CASE("Standard MERL files have the size and counts of the format, -1 below the horizon") {
  const auto model = make_model("ggx:alpha=0.3/0.4/0.5,f0=0.04,albedo=0.2").value();
  const std::string bytes = encode_merl(*model).value();
  REQUIRE(bytes.size() == kStandardSize);
  std::array<std::int32_t, 3> counts{};
  std::memcpy(counts.data(), bytes.data(), 12);
  REQUIRE(counts == std::array<std::int32_t, 3>{90, 90, 180});
  // theta_h about 89 deg, theta_d about 45 deg, phi_d about 0: one of both is below the horizon.
  REQUIRE(double_at(bytes, 0 + 180 * (45 + 90 * 89)) == -1);
  // The centre of cell (0, 0, 90): both directions at the normal but for half a degree.
  std::array<double, 3> f{};
  const auto pair = directions_of({kPi / 2 * std::pow(0.5 / 90, 2), kPi / 2 * 0.5 / 90, kPi * 90.5 / 180});
  REQUIRE(model->eval(pair.omega_i, pair.omega_o, f) == Origin::kMeasured);
  REQUIRE(double_at(bytes, 90) == Approx(f[0] * 1500));
  REQUIRE(double_at(bytes, 90 + 2 * 1'458'000) == Approx(f[2] * 1500 / 1.66));
  const HalfDifferenceBrdf brdf = decode_merl(bytes, "model.binary").value();
  // Not one value more than float rounding: written again it is the same but for that.
  const std::string again = encode_merl(brdf).value();
  REQUIRE(again.size() == kStandardSize);
  double worst = 0;
  for (std::size_t k = 0; k < 3 * 1'458'000; k += 97) {
    worst =
        std::max(worst, std::abs(double_at(again, k) - double_at(bytes, k)) / std::abs(double_at(bytes, k)));
  }
  REQUIRE(worst < 1.2e-7);
  // The model comes back: cells of 1 deg, interpolated.
  const auto comparison = compare(brdf, *model).value();
  CHECK(comparison.mean_relative_error < 0.002);
  CHECK(comparison.p99_relative_error < 0.02);
}

TEST_CASE("360 cells of phi_d keep a model that is not reciprocal") {
  const std::string small =
      merl_file(2, 3, 12, [](std::size_t, std::size_t k) { return static_cast<double>(k % 12); });
  HalfDifferenceBrdf brdf = decode_merl(small, "liris").value();
  REQUIRE_FALSE(brdf.content().reciprocal);
  brdf.set_lookup(HalfDifferenceBrdf::Lookup::kNearest);
  std::array<double, 3> f{};
  for (std::size_t p = 0; p < 12; ++p) {
    const auto pair = directions_of({0.1, 0.4, (static_cast<double>(p) + 0.5) / 12 * 2 * kPi});
    REQUIRE(brdf.eval(pair.omega_i, pair.omega_o, f) != Origin::kInvalid);
    CHECK(f[0] == Approx(static_cast<double>(p) / 1500));
  }
  const auto model = make_model("lambertian:0.5").value();
  const std::string bytes = encode_merl(*model, {.reciprocal = false}).value();
  REQUIRE(bytes.size() == 2 * (kStandardSize - 12) + 12);
}

TEST_CASE("Cells without a value stay without, and their neighbours answer by themselves") {
  const std::string bytes =
      merl_file(3, 4, 8, [](std::size_t, std::size_t k) { return k / 8 % 4 == 2 ? -1.0 : 1500.0; });
  const HalfDifferenceBrdf brdf = decode_merl(bytes, "holes").value();
  std::array<double, 3> f{};
  const auto at = [&](double theta_d) {
    const auto pair = directions_of({0.01, theta_d, 1.5});
    return brdf.eval(pair.omega_i, pair.omega_o, f);
  };
  CHECK(at(kPi / 2 * 2.5 / 4) == Origin::kInvalid);
  CHECK(f[0] == 0);
  CHECK(at(kPi / 2 * 1.9 / 4) == Origin::kExtrapolated);
  CHECK(f[0] == Approx(1));
  CHECK(at(kPi / 2 * 1.2 / 4) == Origin::kMeasured);
  CHECK(f[0] == Approx(1));
  CHECK(brdf.eval({0, 0, 1}, {0, 0, -1}, f) == Origin::kInvalid);
  CHECK(brdf.eval({0, 0, 0}, {0, 0, 0}, f) == Origin::kInvalid);
}

TEST_CASE("A MERL file read from disk equals the one in memory") {
  const auto path = std::filesystem::temp_directory_path() / "scatter_merl_test.binary";
  // More values than the reader's buffer holds.
  const std::string bytes = merl_file(
      10, 30, 60, [](std::size_t c, std::size_t k) { return static_cast<double>(k * (c + 1) % 977); });
  REQUIRE(write_file(path, bytes).has_value());
  const HalfDifferenceBrdf a = read_merl(path).value();
  const HalfDifferenceBrdf b = decode_merl(bytes, "memory").value();
  REQUIRE(a.content().f_per_sr == b.content().f_per_sr);
  std::filesystem::resize_file(path, bytes.size() - 1);
  REQUIRE(read_merl(path).error().code == ErrorCode::kDataLoss);
  std::filesystem::resize_file(path, 0);
  REQUIRE_FALSE(read_merl(path).has_value());
  std::filesystem::remove(path);
  REQUIRE(read_merl(path).error().code == ErrorCode::kNotFound);
  REQUIRE(read_merl("/").error().code == ErrorCode::kInvalidArgument);
}

TEST_CASE("A MERL file cut anywhere or with other counts is refused with the byte") {
  const std::string bytes = small_file();
  for (std::size_t percent = 0; percent < 100; ++percent) {
    const auto brdf =
        decode_merl(std::string_view(bytes).substr(0, bytes.size() * percent / 100), "cut.binary");
    REQUIRE_FALSE(brdf.has_value());
    REQUIRE(brdf.error().what.starts_with("cut.binary: byte "));
  }
  REQUIRE_FALSE(decode_merl(bytes + '\0', "long").has_value());
  for (const std::int32_t wrong : {0, -1, 5, 100'000, 2'147'483'647, -2'147'483'647}) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::string other = bytes;
      std::memcpy(other.data() + 4 * k, &wrong, 4);
      const auto brdf = decode_merl(other, "counts.binary");
      REQUIRE_FALSE(brdf.has_value());
      REQUIRE(brdf.error().what.find("counts.binary: byte ") == 0);
    }
  }
  for (const double wrong : {std::nan(""), HUGE_VAL, -HUGE_VAL, 1e300}) {
    std::string other = bytes;
    std::memcpy(other.data() + 12 + 8 * 7, &wrong, 8);
    const std::string what = decode_merl(other, "nan").error().what;
    // 12 bytes of counts, 8 per double; as it stands in the file, not as a float.
    CHECK(what.starts_with(fmt::format("nan: byte 68: value 7 is {}, expected", wrong)));
  }
  std::string turned = bytes;
  for (std::size_t k = 0; k < 3; ++k) {
    std::reverse(turned.begin() + static_cast<long>(4 * k), turned.begin() + static_cast<long>(4 * k + 4));
  }
  CHECK(decode_merl(turned, "b").error().what.find("3 x 4 x 8 in big-endian order") != std::string::npos);
}

TEST_CASE("MERL takes one channel for three and refuses transmission") {
  const auto grid = test::sample_grid(80, 36, 1);
  const HalfDifferenceBrdf brdf = decode_merl(encode_merl(grid).value(), "mono").value();
  const auto& f = brdf.content().f_per_sr;
  const std::size_t cells = brdf.content().cells();
  for (std::size_t k = 0; k < cells; k += 11) {
    REQUIRE((f[k] < 0) == (f[k + 2 * cells] < 0));
    REQUIRE((f[k] < 0 || f[k] == Approx(f[k + 2 * cells]).epsilon(1e-6)));
  }
  REQUIRE(encode_merl(*make_model("film:transmittance=0.6,haze=0.3").value()).error().code ==
          ErrorCode::kInvalidArgument);
  REQUIRE(encode_merl(test::sample_grid(16, 24, 2)).error().code == ErrorCode::kInvalidArgument);
}
