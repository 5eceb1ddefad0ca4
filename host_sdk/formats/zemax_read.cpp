#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "host_sdk/formats/comment_fields.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/reader_warnings.h"
#include "host_sdk/formats/text_scanner.h"
#include "host_sdk/formats/tristimulus.h"
#include "host_sdk/formats/zemax.h"

namespace scatter::formats {
namespace {

using reflectance::ScatterType;
using reflectance::SpecularGridBrdf;

constexpr std::size_t kLongestAxis = 100'000;
/// Larger disagreement of TIS and integral is told.
constexpr double kToldMismatch = 0.05;
/// Agreement that lets one tell the integral with cosine from that without: measured data cut at
/// 80 deg miss up to 17 %, the two differ by 50 % and more.
constexpr double kRoughly = 0.25;
constexpr std::size_t kToldBlocks = 20;
constexpr double kLargestIncidenceDeg = 89.9999;
constexpr double kSameAngleDeg = 5e-7;

struct Section {
  std::string_view word;
  std::size_t channel;
};
constexpr std::array<Section, 10> kSections{{{"Monochrome", 0},
                                             {"TristimulusX", 0},
                                             {"TristimulusY", 1},
                                             {"TristimulusZ", 2},
                                             {"TristimulusR", 0},
                                             {"TristimulusG", 1},
                                             {"TristimulusB", 2},
                                             {"Red", 0},
                                             {"Green", 1},
                                             {"Blue", 2}}};

const Section* section_of(std::string_view word) {
  const auto it = std::ranges::find_if(kSections, [&](const Section& s) { return same_word(s.word, word); });
  return it == kSections.end() ? nullptr : &*it;
}

std::vector<double> in_radians(std::vector<double> angles_deg) {
  for (double& angle : angles_deg) {
    angle = reflectance::radians(angle);
  }
  return angles_deg;
}

class Decoder {
 public:
  Decoder(std::string_view text, std::string_view name) : scan_(text, name), name_(name) {}

  Result<SpecularGridBrdf> decode() {
    Status status = read_header();
    if (status) {
      status = read_sections();
    }
    if (status) {
      status = read_fields();
    }
    if (!status) {
      return std::unexpected(std::move(status.error()));
    }
    auto grid = SpecularGridBrdf::make(std::move(content_));
    if (!grid) {
      return in_file(grid.error());
    }
    return with_notes(std::move(*grid));
  }

 private:
  enum Key : std::size_t { kSource, kSymmetry, kSpectral, kType, kRotation, kIncidence, kAzimuth, kRadial };
  static constexpr std::array<std::string_view, 8> kKeys{
      "Source",         "Symmetry",         "SpectralContent", "ScatterType",
      "SampleRotation", "AngleOfIncidence", "ScatterAzimuth",  "ScatterRadial"};

  [[nodiscard]] std::unexpected<Error> in_file(const Error& error) const {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name_, error.what), error.remedy);
  }

  Status read_header() {
    std::array<bool, kKeys.size()> seen{};
    while (section_of(scan_.peek()) == nullptr) {
      const auto key = scan_.keyword(kKeys, seen, "Monochrome, TristimulusX, ...");
      if (!key) {
        return std::unexpected(key.error());
      }
      if (Status status = read_key(static_cast<Key>(*key)); !status) {
        return status;
      }
    }
    for (std::size_t key = 0; key < kKeys.size(); ++key) {
      if (!seen[key]) {
        return scan_.error(fmt::format("{} is missing before the data", kKeys[key]),
                           key == kSource ? "add the line 'Source  Measured' to the header"
                                          : "export the file again or add the keyword to the header");
      }
    }
    // Symmetry may come after the azimuths that it bounds.
    const auto& azimuth = azimuth_.deg;
    const auto beyond =
        static_cast<std::size_t>(std::ranges::upper_bound(azimuth, 180 + kSameAngleDeg) - azimuth.begin());
    if (content_.plane_symmetric && beyond < azimuth.size()) {
      return scan_.error_at(azimuth_.places[beyond],
                            fmt::format("ScatterAzimuth {} of {} is {:.10g} deg, expected 0..180 of "
                                        "PlaneSymmetrical",
                                        beyond + 1, azimuth.size(), azimuth[beyond]),
                            "state Symmetry Asymmetrical, or keep the half 0..180 only");
    }
    content_.azimuth = in_radians(std::move(azimuth_.deg));
    return {};
  }

  Status read_key(Key key) {
    switch (key) {
      case kSource:
        content_.metadata["source"] = scan_.take();
        return {};
      case kSymmetry:
        return read_symmetry();
      case kSpectral:
        return read_spectral();
      case kType:
        if (scan_.take_if("BTDF")) {
          content_.type = ScatterType::kBtdf;
        } else if (!scan_.take_if("BRDF")) {
          return scan_.expected("BRDF or BTDF");
        }
        return {};
      case kRotation:
        return read_axis(key, 360, content_.rotation);
      case kIncidence:
        return read_axis(key, kLargestIncidenceDeg, content_.theta_i);
      case kAzimuth: {
        auto angles = scan_.angles(kKeys[key], kLongestAxis, 0, 360);
        if (!angles) {
          return std::unexpected(angles.error());
        }
        azimuth_ = std::move(*angles);
        return {};
      }
      case kRadial:
        return read_axis(key, 180, content_.radial);
    }
    return {};
  }

  Status read_symmetry() {
    if (scan_.take_if("PlaneSymmetrical") || scan_.take_if("PlaneSymmetric")) {
      content_.plane_symmetric = true;
    } else if (!scan_.take_if("Asymmetrical") && !scan_.take_if("Asymmetric") &&
               !scan_.take_if("Asymmetrical4D") && !scan_.take_if("Asymmetric4D")) {
      return scan_.expected("PlaneSymmetrical, Asymmetrical or Asymmetrical4D");
    }
    return {};
  }

  Status read_spectral() {
    const std::string_view word = scan_.peek();
    if (same_word(word, "Monochrome")) {
      channels_ = 1;
    } else if (same_word(word, "XYZ") || same_word(word, "RGB")) {
      channels_ = 3;
    } else {
      return scan_.expected("Monochrome, XYZ or RGB");
    }
    content_.metadata["spectral_content"] = scan_.take();
    return {};
  }

  Status read_axis(Key key, double highest_deg, std::vector<double>& axis) {
    auto angles = scan_.angles(kKeys[key], kLongestAxis, 0, highest_deg);
    if (!angles) {
      return std::unexpected(angles.error());
    }
    axis = in_radians(std::move(angles->deg));
    return {};
  }

  Status read_sections() {
    const std::size_t blocks = content_.rotation.size() * content_.theta_i.size();
    const std::size_t block = content_.azimuth.size() * content_.radial.size();
    const double values =
        static_cast<double>(blocks) * static_cast<double>(block) * static_cast<double>(channels_);
    if (2 * values > static_cast<double>(scan_.remaining()) + 2) {
      return scan_.error(
          fmt::format("{} values announced, but only {} bytes follow", values, scan_.remaining()));
    }
    content_.f_per_sr.resize(channels_);
    content_.stated_total.resize(channels_);
    for (std::size_t k = 0; k < channels_; ++k) {
      const Section* section = section_of(scan_.peek());
      if (section == nullptr || section->channel >= channels_) {
        return scan_.expected(
            fmt::format("data section {} of {} (Monochrome, TristimulusX, ...)", k + 1, channels_));
      }
      auto& plane = content_.f_per_sr[section->channel];
      if (!plane.empty()) {
        return scan_.error(fmt::format("{} is there twice", section->word));
      }
      (void)scan_.take();
      (void)scan_.take_if("DataBegin");
      plane.resize(blocks * block);
      for (std::size_t b = 0; b < blocks; ++b) {
        if (!scan_.take_if("TIS")) {
          return scan_.expected(fmt::format("TIS of block {} of {}", b + 1, blocks));
        }
        const auto total = scan_.number("TIS");
        if (!total) {
          return std::unexpected(total.error());
        }
        if (*total < 0 || *total > kLargestTotal) {
          warn_of_total(*total);
        }
        content_.stated_total[section->channel].push_back(*total);
        if (Status status = scan_.numbers("value", std::span(plane).subspan(b * block, block)); !status) {
          return status;
        }
      }
      (void)scan_.take_if("DataEnd");
    }
    if (!scan_.at_end()) {
      return scan_.expected("the end of the file");
    }
    return {};
  }

  void warn_of_total(double total) {
    // Its line takes a walk over the text: only where it will be told.
    warnings_.add(warnings_.is_full()
                      ? std::string()
                      : fmt::format("line {}: TIS {:g}, expected 0..1 (the share of the light that is "
                                    "scattered): not used",
                                    scan_.line_at(scan_.place()), total));
  }

  /// What our own writer left in the comments; of others, the comments themselves.
  Status read_fields() {
    auto fields = read_comment_fields(scan_.comments());
    if (!fields) {
      return in_file(fields.error());
    }
    const auto& own = fields->own;
    if (const auto it = own.find("origin"); it != own.end()) {
      auto origin = read_origin_runs(it->second, content_.f_per_sr[0].size());
      if (!origin) {
        return in_file(origin.error());
      }
      content_.origin = std::move(*origin);
    }
    if (const auto it = own.find("wavelengths_nm"); it != own.end()) {
      auto wavelengths = read_float_list(it->second, channels_);
      if (!wavelengths) {
        return in_file(wavelengths.error());
      }
      for (const float nm : *wavelengths) {
        if (!is_wavelength(nm)) {
          return fail(
              ErrorCode::kDataLoss,
              fmt::format("{}: # scatter.@wavelengths_nm: {:g} nm, expected {}", name_, nm, kWavelengthRange),
              std::string(kWavelengthRemedy));
        }
      }
      content_.wavelengths_nm = std::move(*wavelengths);
    }
    if (const auto it = own.find("tristimulus_of"); it != own.end() && channels_ == 3) {
      if (it->second != "bt709") {
        return scan_.error("tristimulus values of colours that this version does not know");
      }
      auto& f = content_.f_per_sr;
      transform(kRgbFromXyz, f[0], f[1], f[2]);
      auto& total = content_.stated_total;
      transform(kRgbFromXyz, total[0], total[1], total[2]);
      content_.metadata["spectral_content"] = "RGB";
    }
    if (!fields->foreign.empty()) {
      content_.metadata["comments"] = fields->foreign;
    }
    for (auto& [key, value] : fields->metadata) {
      content_.metadata.insert_or_assign(key, std::move(value));
    }
    warnings_.put_into(content_.metadata);
    return {};
  }

  /// Every axis ends where it would in radians; in degrees these would be a spot of the hemisphere.
  static bool looks_like_radians(const SpecularGridBrdf::Content& content) {
    constexpr double kRounding = 0.01;
    const auto up_to = [](const std::vector<double>& axis, double highest) {
      return reflectance::degrees(axis.back()) <= highest + kRounding;
    };
    return content.azimuth.size() > 1 && up_to(content.rotation, 2 * reflectance::kPi) &&
           up_to(content.theta_i, reflectance::kPi / 2) && up_to(content.azimuth, 2 * reflectance::kPi) &&
           up_to(content.radial, reflectance::kPi);
  }

  /// TIS is advisory (formats.md 1): recomputed, and told where it disagrees.
  static SpecularGridBrdf with_notes(SpecularGridBrdf grid) {
    const SpecularGridBrdf::Content& content = grid.content();
    std::string notes;
    std::size_t told = 0;
    std::size_t plain_agrees = 0;
    std::size_t cosine_agrees = 0;
    const auto differ = [](double stated, double found) {
      return std::abs(found - stated) / std::abs(stated);
    };
    for (std::size_t channel = 0; channel < content.f_per_sr.size(); ++channel) {
      for (std::size_t q = 0; q < content.rotation.size(); ++q) {
        for (std::size_t a = 0; a < content.theta_i.size(); ++a) {
          const double stated = content.stated_total[channel][q * content.theta_i.size() + a];
          const double found = grid.integral(channel, q, a);
          if (differ(stated, found) <= kToldMismatch || (stated == 0 && found == 0)) {
            ++cosine_agrees;
            continue;
          }
          cosine_agrees += differ(stated, found) <= kRoughly ? 1 : 0;
          plain_agrees += differ(stated, grid.integral(channel, q, a, false, false)) <= kRoughly ? 1 : 0;
          if (++told <= kToldBlocks) {
            notes += fmt::format(
                "channel {}, rotation {:g} deg, incidence {:g} deg: TIS {:g}, integral {:.4g}, ratio {:.3f}, "
                "{:.3f} if the last radial goes on\n",
                channel, reflectance::degrees(content.rotation[q]), reflectance::degrees(content.theta_i[a]),
                stated, found, found / stated, grid.integral(channel, q, a, true) / stated);
          }
        }
      }
    }
    if (told == 0) {
      return grid;
    }
    if (told > kToldBlocks) {
      notes +=
          fmt::format("{} more blocks whose TIS and integral differ by more than 5 %\n", told - kToldBlocks);
    }
    const std::size_t blocks = content.f_per_sr.size() * content.rotation.size() * content.theta_i.size();
    if (2 * plain_agrees > blocks && plain_agrees > 2 * cosine_agrees) {
      notes += "TIS fits the integral without cosine: the values may be cosine-weighted\n";
    }
    SpecularGridBrdf::Content noted = content;
    if (looks_like_radians(content)) {
      ReaderWarnings warning;
      warning.add(fmt::format(
          "the angles look like radians: AngleOfIncidence up to {:.4g}, ScatterAzimuth up to {:.4g} and "
          "ScatterRadial up to {:.4g} are read as degrees, and TIS does not fit; if so, write them in "
          "degrees",
          reflectance::degrees(content.theta_i.back()), reflectance::degrees(content.azimuth.back()),
          reflectance::degrees(content.radial.back())));
      warning.put_into(noted.metadata);
    }
    // Notes that came along in the comments are about the data that this file was made from.
    if (std::string& earlier = noted.metadata["notes"]; earlier.find(notes) == std::string::npos) {
      earlier += notes;
    }
    return SpecularGridBrdf::make(std::move(noted)).value_or(std::move(grid));
  }

  TextScanner scan_;
  std::string_view name_;
  std::size_t channels_ = 1;
  TextScanner::Angles azimuth_;
  ReaderWarnings warnings_;
  SpecularGridBrdf::Content content_;
};

}  // namespace

Result<SpecularGridBrdf> decode_zemax(std::string_view text, std::string_view name) {
  return Decoder(text, name).decode();
}

Result<SpecularGridBrdf> read_zemax(const std::filesystem::path& path) {
  const auto text = read_file(path);
  if (!text) {
    return std::unexpected(text.error());
  }
  return decode_zemax(*text, path.string());
}

}  // namespace scatter::formats
