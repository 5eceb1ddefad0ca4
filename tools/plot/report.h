// The page that a measurement hands over: one HTML file, nothing fetched from anywhere.
#pragma once

#include <string>
#include <vector>

namespace scatter::plot {

enum class Mark { kOk, kWarn, kFail, kCannotTell };

/// What the page shows. Texts are plain (they are escaped here); empty lists leave their section out.
struct ReportContent {
  struct Fact {
    std::string name = {};
    std::string value = {};
  };
  struct QualityRow {
    std::string name = {};
    std::string value = {};
    std::string limit = {};
    Mark mark = Mark::kOk;
    std::string advice = {};
  };
  struct AlbedoCell {
    double albedo = 0;
    double standard_uncertainty = 0;
  };
  struct AlbedoRow {
    std::string incidence = {};
    std::vector<AlbedoCell> channels = {};
  };

  std::string title = {};     ///< "gold leaf", "sim:?sample=lambertian:0.5".
  std::string subtitle = {};  ///< Instrument, date.
  std::string quantity = {};  ///< "BRDF" or "BTDF".
  Mark verdict = Mark::kOk;
  std::string verdict_text = {};  ///< One sentence under the verdict.
  std::vector<Fact> facts = {};   ///< Figures at the top: at most six read well.
  std::vector<QualityRow> quality = {};
  std::vector<std::string> albedo_channels = {};
  std::vector<AlbedoRow> albedo = {};
  std::vector<Fact> ledger = {};
  std::vector<Fact> provenance = {};
  std::string hemispheres_png = {};   ///< Bytes of the file.
  std::string curves_light_svg = {};  ///< The file's text, for light pages.
  std::string curves_dark_svg = {};   ///< The same for dark pages.
};

/// The page as UTF-8 text: inline style and pictures, no scripts, light and dark, made for phones too.
/// The same content gives the same bytes. Thread-safe.
[[nodiscard]] std::string report(const ReportContent& content);

}  // namespace scatter::plot
