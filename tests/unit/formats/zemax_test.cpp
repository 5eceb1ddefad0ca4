#include "host_sdk/formats/zemax.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "host_sdk/formats/file_bytes.h"
#include "tests/unit/formats/real_data.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

const std::string kSmall =
    "# comment\n"
    "Source  Measured\n"
    "Symmetry  Asymmetrical\n"
    "SpectralContent  Monochrome\n"
    "ScatterType  BRDF\n"
    "SampleRotation  1\n0\n"
    "AngleOfIncidence  2\n10\t50\t\n"
    "ScatterAzimuth 4\n0 90 180 270\n"
    "ScatterRadial 3\n0 20 40\n"
    "\n"
    "Monochrome\nDataBegin\n"
    "TIS 0.1\n"
    "1 2 3\n1 4 5\n1 6 7\n1 8 9\n"
    "TIS 0.2\n"
    "11 12 13\n11 14 15\n11 16 17\n11 18 19\n"
    "DataEnd\n";

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

void require_small(const SpecularGridBrdf& grid) {
  const auto& content = grid.content();
  REQUIRE(content.theta_i.size() == 2);
  REQUIRE(degrees(content.theta_i[1]) == Approx(50));
  REQUIRE(degrees(content.azimuth[3]) == Approx(270));
  REQUIRE(degrees(content.radial[2]) == Approx(40));
  REQUIRE_FALSE(content.plane_symmetric);
  REQUIRE(content.type == ScatterType::kBrdf);
  REQUIRE(content.f_per_sr.size() == 1);
  REQUIRE(content.f_per_sr[0] == std::vector<float>{1,  2,  3,  1,  4,  5,  1,  6,  7,  1,  8,  9,
                                                    11, 12, 13, 11, 14, 15, 11, 16, 17, 11, 18, 19});
  REQUIRE(content.stated_total[0] == std::vector<double>{0.1, 0.2});
}

}  // namespace

TEST_CASE("Zemax values nest as rotation, incidence, azimuth, radial") {
  // PROVES: formats.md 1, nesting.
  require_small(decode_zemax(kSmall, "small.bsdf").value());
}

TEST_CASE("Zemax variants of the wild read the same") {
  std::string crlf;
  for (const char c : kSmall) {
    if (c == '\n') {
      crlf += '\r';
    }
    crlf += c;
  }
  for (const std::string& text :
       {crlf, "\xEF\xBB\xBF" + kSmall, replaced(kSmall, "Asymmetrical", "ASymmetrical4D"),
        replaced(kSmall, "Asymmetrical", "asymmetric"), replaced(kSmall, "DataBegin\n", ""),
        replaced(kSmall, "DataEnd\n", ""), replaced(kSmall, "1 2 3\n1 4 5", "1\n2\t\t\n 3 1\t4 5\t"),
        replaced(kSmall, "1 8 9\n", "1 8 9\n# a remark in the data\n"),
        replaced(kSmall, "1 2 3", "+1 2.0E+00 3.000e0"),
        replaced(kSmall, "ScatterType  BRDF", "scattertype brdf")}) {
    const auto grid = decode_zemax(text, "variant.bsdf");
    CAPTURE(text);
    REQUIRE(grid.has_value());
    require_small(*grid);
  }
}

TEST_CASE("Zemax XYZ has three channels, with or without DataBegin per section") {
  const std::string block = "TIS 0\n1 2 3\n1 4 5\n1 6 7\n1 8 9\nTIS 0\n1 2 3\n1 4 5\n1 6 7\n1 8 9\n";
  const std::string head = replaced(kSmall, "SpectralContent  Monochrome", "SpectralContent XYZ");
  const std::string start = head.substr(0, head.find("Monochrome"));
  const std::string flat =
      start + "TristimulusX\n" + block + "TristimulusY\n" + block + "TristimulusZ\n" + block;
  const std::string framed = start + "TristimulusX\nDataBegin\n" + block +
                             "DataEnd\nTristimulusY\nDataBegin\n" + block +
                             "DataEnd\nTristimulusZ\nDataBegin\n" + block + "DataEnd\n";
  REQUIRE(decode_zemax(flat, "flat").value().channels() == 3);
  REQUIRE(decode_zemax(framed, "framed").value().channels() == 3);
  const std::string doubled =
      start + "TristimulusX\n" + block + "TristimulusX\n" + block + "TristimulusZ\n" + block;
  REQUIRE(decode_zemax(doubled, "doubled").error().what.find("TristimulusX is there twice") !=
          std::string::npos);
}

TEST_CASE("A Zemax file with a fault names the line and what was expected") {
  struct Case {
    std::string text;
    const char* says;
  };
  for (const auto& [text, says] :
       {Case{replaced(kSmall, "1 4 5", "1 x 5"),
             "bad.bsdf: line 19: expected value 5 of 12 (a number), found 'x'"},
        Case{replaced(kSmall, "1 4 5", "1 nan 5"), "found 'nan'"},
        Case{replaced(kSmall, "1 4 5", "1 inf 5"), "found 'inf'"},
        Case{replaced(kSmall, "1 4 5", "1 1e300 5"), "too large for a 32-bit float"},
        Case{replaced(kSmall, "1 4 5", "1 4,5 5"), "found '4,5'"},
        Case{replaced(kSmall, "1 4 5", "1 4"), "value 12 of 12"},
        Case{replaced(kSmall, "1 4 5", "1 4 5 6"), "expected TIS of block 2 of 2"},
        Case{kSmall + "7\n", "expected the end of the file, found '7'"},
        Case{replaced(kSmall, "ScatterRadial 3", "ScatterRadial 99999"), "ScatterRadial is 99999, but only"},
        Case{replaced(kSmall, "ScatterRadial 3", "ScatterRadial 4000000000"), "a count 1..100000"},
        Case{replaced(kSmall, "ScatterRadial 3", "ScatterRadial -3"), "found '-3'"},
        Case{replaced(kSmall, "ScatterRadial 3", "ScatterRadial 0"), "found '0'"},
        Case{replaced(kSmall, "ScatterRadial 3\n0 20 40\n", ""), "ScatterRadial is missing"},
        Case{replaced(kSmall, "ScatterType  BRDF\n", ""), "ScatterType is missing"},
        Case{replaced(kSmall, "Symmetry  Asymmetrical\n", ""), "Symmetry is missing"},
        Case{replaced(kSmall, "ScatterType  BRDF\n", "ScatterType BRDF\nScatterType BRDF\n"),
             "ScatterType is there twice"},
        Case{replaced(kSmall, "Asymmetrical", "Round"), "expected PlaneSymmetrical"},
        Case{replaced(kSmall, "Source  Measured\n", ""), "line 14: Source is missing"},
        Case{replaced(kSmall, "0 20 40", "0 40\n20"),
             "line 14: ScatterRadial 3 of 3 is 20 deg after 40, expected ascending angles"},
        Case{replaced(kSmall, "0 20 40", "0 20 200"),
             "line 13: ScatterRadial 3 of 3 is 200 deg, expected 0..180"},
        Case{replaced(kSmall, "10\t50", "10\t95"),
             "line 9: AngleOfIncidence 2 of 2 is 95 deg, expected 0..89.9999"},
        Case{replaced(kSmall, "10\t50", "-15\t50"), "line 9: AngleOfIncidence 1 of 2 is -15 deg"},
        Case{replaced(kSmall, "10\t50", "50\t10"), "line 9: AngleOfIncidence 2 of 2 is 10 deg after 50"},
        Case{replaced(kSmall, "Asymmetrical", "PlaneSymmetrical"),
             "line 11: ScatterAzimuth 4 of 4 is 270 deg, expected 0..180 of PlaneSymmetrical"},
        Case{"# scatter.@wavelengths_nm: 0.55\n" + kSmall, "0.55 nm, expected 100..1000000 nm"},
        Case{"", "found the end of the file"},
        Case{std::string("\0\1\2", 3), "expected a keyword"}}) {
    const auto grid = decode_zemax(text, "bad.bsdf");
    CAPTURE(text, says);
    REQUIRE_FALSE(grid.has_value());
    CAPTURE(grid.error().what);
    REQUIRE(grid.error().what.starts_with("bad.bsdf: "));
    REQUIRE(grid.error().what.find(says) != std::string::npos);
    REQUIRE_FALSE(grid.error().remedy.empty());
  }
}

TEST_CASE("Zemax angles out of range and out of order have remedies of their own") {
  REQUIRE(decode_zemax(replaced(kSmall, "10\t50", "10\t95"), "x").error().remedy ==
          "state AngleOfIncidence in degrees 0..89.9999");
  REQUIRE(decode_zemax(replaced(kSmall, "10\t50", "50\t10"), "x").error().remedy.find("ascending order") !=
          std::string::npos);
}

TEST_CASE("A stated Zemax total that no surface has is warned of, with its line") {
  const auto warnings = [](const std::string& text) {
    return decode_zemax(text, "x").value().content().metadata.at("warnings");
  };
  const std::string told =
      "line 17: TIS -1, expected 0..1 (the share of the light that is scattered): not used\n";
  REQUIRE(warnings(replaced(kSmall, "TIS 0.1", "TIS -1")) == told);
  REQUIRE(warnings(replaced(kSmall, "TIS 0.2", "TIS 20")).starts_with("line 22: TIS 20, expected 0..1"));
  REQUIRE_FALSE(decode_zemax(kSmall, "x").value().content().metadata.contains("warnings"));
  // What an earlier file said of the data stays before it, and nothing is there twice.
  const std::string again = replaced(replaced(kSmall, "TIS 0.1", "TIS -1"), "# comment\n",
                                     "# scatter.warnings: from before\\x0a\n");
  REQUIRE(warnings(again) == "from before\n" + told);
}

TEST_CASE("Zemax angles in radians are suspected as such") {
  const std::string radian = replaced(
      replaced(replaced(kSmall, "10\t50", "0.1745\t0.8727"), "0 90 180 270", "0 1.5708 3.1416 4.7124"),
      "0 20 40", "0 0.349 0.698");
  const std::string said = decode_zemax(radian, "x").value().content().metadata.at("warnings");
  REQUIRE(said.find("look like radians: AngleOfIncidence up to 0.8727, ScatterAzimuth up to 4.712") !=
          std::string::npos);
}

TEST_CASE("A Zemax file cut anywhere before its last value is refused") {
  const std::size_t end = kSmall.rfind("19");
  for (std::size_t size = 0; size <= end; ++size) {
    CAPTURE(size);
    REQUIRE_FALSE(decode_zemax(std::string_view(kSmall).substr(0, size), "cut").has_value());
  }
}

TEST_CASE("Real BrownVinyl: the integrals stand to TIS as the study found") {
  // PROVES: formats.md 1, "integral/TIS = 0.966 -> 0.837 with data cut at radial 80; 1.010 -> 1.073
  // when the last radial value is held to the horizon; no cosine 1.5-2.4x".
  const auto path = test::real_data("zemax/brown_vinyl_measured_brdf.bsdf");
  if (!path) {
    return;
  }
  const SpecularGridBrdf grid = read_zemax(*path).value();
  const auto& content = grid.content();
  REQUIRE(content.plane_symmetric);
  REQUIRE(content.theta_i.size() == 13);
  REQUIRE(degrees(content.theta_i.front()) == Approx(15));
  REQUIRE(degrees(content.theta_i.back()) == Approx(75));
  REQUIRE(content.azimuth.size() == 19);
  REQUIRE(content.radial.size() == 11);
  REQUIRE(content.f_per_sr[0][0] == 6.375E-02F);
  std::array<double, 13> cut{};
  std::array<double, 13> held{};
  std::array<double, 13> plain{};
  for (std::size_t a = 0; a < 13; ++a) {
    const double stated = content.stated_total[0][a];
    cut[a] = grid.integral(0, 0, a) / stated;
    held[a] = grid.integral(0, 0, a, true) / stated;
    plain[a] = grid.integral(0, 0, a, false, false) / stated;
  }
  const auto require_range = [](const std::array<double, 13>& ratio, double lowest, double highest,
                                double digit) {
    REQUIRE(*std::ranges::min_element(ratio) == Approx(lowest).margin(digit));
    REQUIRE(*std::ranges::max_element(ratio) == Approx(highest).margin(digit));
  };
  // To the last digit that the study states.
  require_range(cut, 0.837, 0.966, 0.001);
  require_range(held, 1.010, 1.073, 0.001);
  require_range(plain, 1.5, 2.4, 0.05);
  // Beyond 5 % it is told, with the ratio of what is there and of what goes on to the horizon.
  const std::string& notes = content.metadata.at("notes");
  REQUIRE(notes.find("ratio 0.837") != std::string::npos);
  REQUIRE(notes.find("ratio 0.966") == std::string::npos);
  REQUIRE(notes.find("cosine-weighted") == std::string::npos);
  double f = 0;
  const Direction i = from_spherical(radians(40), 0);
  REQUIRE(grid.eval(i, mirrored(i), std::span(&f, 1)) == Origin::kMeasured);
  REQUIRE(f == static_cast<double>(content.f_per_sr[0][5 * 19 * 11]));
}

TEST_CASE("Real FDTD file: a TIS that contradicts the values is told") {
  // PROVES: formats.md 1, "TIS 0.023/0.019/0.137/0.183 against integrals 0.0007/0.0004/0.033/0.116".
  const auto path = test::real_data("zemax/fdtd_4aoi_361x181_brdf.bsdf");
  if (!path) {
    return;
  }
  const SpecularGridBrdf grid = read_zemax(*path).value();
  REQUIRE(grid.content().stated_total[0] == std::vector<double>{0.023, 0.019, 0.137, 0.183});
  const std::array<double, 4> expected{0.0007, 0.0004, 0.033, 0.116};
  for (std::size_t a = 0; a < 4; ++a) {
    // Stated to the last digit shown.
    REQUIRE(grid.integral(0, 0, a) == Approx(expected[a]).margin(a < 2 ? 5e-5 : 5e-4));
  }
  REQUIRE(grid.content().metadata.at("notes").find("cosine-weighted") == std::string::npos);
  const std::string notes = grid.content().metadata.at("notes");
  REQUIRE(notes.find("incidence 22.5 deg: TIS 0.019, integral 0.0004") != std::string::npos);
}

TEST_CASE("Cosine-weighted values under a true TIS are suspected as such") {
  // Lambert 0.5 exported as f cos: the TIS fits only the integral without cosine.
  std::string text =
      "Source Measured Symmetry PlaneSymmetrical SpectralContent Monochrome ScatterType BRDF SampleRotation "
      "1 0 "
      "AngleOfIncidence 1 0 ScatterAzimuth 2 0 180 ScatterRadial 91";
  for (int rho = 0; rho <= 90; ++rho) {
    text += ' ';
    text += std::to_string(rho);
  }
  text += " Monochrome TIS 0.5";
  for (int row = 0; row < 2; ++row) {
    for (int rho = 0; rho <= 90; ++rho) {
      text += ' ';
      text += std::to_string(0.5 / kPi * std::cos(radians(rho)));
    }
  }
  const auto weighted = decode_zemax(text, "weighted");
  REQUIRE(weighted.value().content().metadata.at("notes").find("cosine-weighted") != std::string::npos);
}

TEST_CASE("Real files cut at every percent are refused without a crash") {
  const auto path = test::real_data("zemax/brown_vinyl_measured_brdf.bsdf");
  if (!path) {
    return;
  }
  const std::string text = read_file(*path).value();
  for (std::size_t percent = 0; percent < 100; ++percent) {
    CAPTURE(percent);
    REQUIRE_FALSE(
        decode_zemax(std::string_view(text).substr(0, text.size() * percent / 100), "cut").has_value());
  }
}
