#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <vector>

#include "host_sdk/formats/comment_fields.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/text_scanner.h"
#include "host_sdk/formats/tristimulus.h"
#include "host_sdk/formats/zemax.h"

namespace scatter::formats {
namespace {

using reflectance::degrees;
using reflectance::kPi;
using reflectance::SpecularGridBrdf;

constexpr int kUsualDigits = 4;
constexpr int kTristimulusDigits = 7;  // The way back to RGB magnifies rounding up to sixfold.
constexpr double kSameAngle = 1e-8;
constexpr std::array<const char*, 3> kXyzSections{"TristimulusX", "TristimulusY", "TristimulusZ"};
constexpr std::array<const char*, 3> kRgbSections{"TristimulusR", "TristimulusG", "TristimulusB"};

/// The azimuths 0..180, if the others repeat them.
std::optional<std::size_t> half_of(const std::vector<double>& azimuth) {
  const auto split = std::ranges::find_if(azimuth, [](double a) { return a > kPi + kSameAngle; });
  const auto half = static_cast<std::size_t>(split - azimuth.begin());
  if (half < 2 || azimuth[0] > kSameAngle || std::abs(azimuth[half - 1] - kPi) > kSameAngle) {
    return std::nullopt;
  }
  const bool closed = std::abs(azimuth.back() - 2 * kPi) < kSameAngle;
  if (azimuth.size() != 2 * half - (closed ? 1 : 2)) {
    return std::nullopt;
  }
  for (std::size_t k = half; k < azimuth.size(); ++k) {
    if (std::abs(2 * kPi - azimuth[k] - azimuth[2 * half - 2 - k]) > kSameAngle) {
      return std::nullopt;
    }
  }
  return half;
}

/// Content with one half of the azimuths, or nothing where the halves differ.
std::optional<SpecularGridBrdf::Content> halved(const SpecularGridBrdf::Content& content, int digits) {
  const auto half = half_of(content.azimuth);
  if (!half) {
    return std::nullopt;
  }
  const std::size_t radials = content.radial.size();
  const std::size_t rows = content.azimuth.size();
  const std::size_t blocks = content.rotation.size() * content.theta_i.size();
  const float tolerance = std::max(0.5F * std::pow(10.0F, static_cast<float>(1 - digits)), 1e-6F);
  for (std::size_t b = 0; b < blocks; ++b) {
    for (std::size_t row = *half; row < rows; ++row) {
      const std::size_t other = 2 * *half - 2 - row;
      for (std::size_t r = 0; r < radials; ++r) {
        const std::size_t p = (b * rows + row) * radials + r;
        const std::size_t q = (b * rows + other) * radials + r;
        if (!content.origin.empty() && content.origin[p] != content.origin[q]) {
          return std::nullopt;
        }
        for (const auto& plane : content.f_per_sr) {
          if (std::abs(plane[p] - plane[q]) > tolerance * std::max(std::abs(plane[p]), std::abs(plane[q]))) {
            return std::nullopt;
          }
        }
      }
    }
  }
  SpecularGridBrdf::Content out = content;
  out.plane_symmetric = true;
  out.sigma_per_sr.clear();
  out.azimuth.resize(*half);
  out.azimuth.back() = kPi;
  const auto keep = [&](auto& plane) {
    for (std::size_t b = 0; b < blocks; ++b) {
      std::copy_n(plane.begin() + static_cast<std::ptrdiff_t>(b * rows * radials), *half * radials,
                  plane.begin() + static_cast<std::ptrdiff_t>(b * *half * radials));
    }
    plane.resize(blocks * *half * radials);
  };
  for (auto& plane : out.f_per_sr) {
    keep(plane);
  }
  if (!out.origin.empty()) {
    keep(out.origin);
  }
  return out;
}

void write_axis(std::string& out, std::string_view name, const std::vector<double>& axis) {
  fmt::format_to(std::back_inserter(out), "{}  {}\n", name, axis.size());
  for (const double angle : axis) {
    fmt::format_to(std::back_inserter(out), "{:.10g}\t", degrees(angle));
  }
  out += '\n';
}

std::string_view symmetry_of(const SpecularGridBrdf::Content& content) {
  if (content.plane_symmetric) {
    return "PlaneSymmetrical";
  }
  return content.rotation.size() > 1 ? "Asymmetrical4D" : "Asymmetrical";
}

void write_sections(const SpecularGridBrdf& grid, std::span<const char* const> names, int digits,
                    std::string& out) {
  const SpecularGridBrdf::Content& content = grid.content();
  const std::size_t radials = content.radial.size();
  for (std::size_t c = 0; c < content.f_per_sr.size(); ++c) {
    fmt::format_to(std::back_inserter(out), "\n{}\nDataBegin\n", names[c]);
    const float* value = content.f_per_sr[c].data();
    for (std::size_t q = 0; q < content.rotation.size(); ++q) {
      for (std::size_t a = 0; a < content.theta_i.size(); ++a) {
        fmt::format_to(std::back_inserter(out), "TIS {:.6g}\n", grid.integral(c, q, a));
        for (std::size_t row = 0; row < content.azimuth.size(); ++row) {
          for (std::size_t r = 0; r < radials; ++r) {
            fmt::format_to(std::back_inserter(out), "{:.{}E}", *value++, digits - 1);
            out += r + 1 == radials ? '\n' : '\t';
          }
        }
      }
    }
    out += "DataEnd\n";
  }
}

bool says_xyz(const SpecularGridBrdf::Content& content) {
  const auto it = content.metadata.find("spectral_content");
  return it != content.metadata.end() && same_word(it->second, "XYZ");
}

}  // namespace

Result<std::string> encode_zemax(const SpecularGridBrdf& grid, const ZemaxOptions& options) {
  const std::size_t channels = grid.channels();
  if (channels != 1 && channels != 3) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("Zemax: {} channels, expected 1 or 3", channels),
                "choose one channel");
  }
  if (options.digits < 0 || options.digits > 17) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{} digits, expected 1..17", options.digits),
                "choose 4 to 9");
  }
  const bool is_xyz = channels == 3 && says_xyz(grid.content());
  const bool converts = channels == 3 && !is_xyz && !options.rgb_sections;
  const int digits = options.digits > 0 ? options.digits : converts ? kTristimulusDigits : kUsualDigits;
  std::optional<SpecularGridBrdf::Content> content;
  if (!grid.content().plane_symmetric) {
    content = halved(grid.content(), digits);
  }
  if (converts) {
    content = content ? std::move(content) : grid.content();
    content->sigma_per_sr.clear();
    transform(kXyzFromRgb, content->f_per_sr[0], content->f_per_sr[1], content->f_per_sr[2]);
  }
  std::optional<SpecularGridBrdf> changed;
  if (content) {
    auto made = SpecularGridBrdf::make(std::move(*content));
    if (!made) {
      return std::unexpected(made.error());
    }
    changed = std::move(*made);
  }
  const SpecularGridBrdf& written = changed ? *changed : grid;
  const SpecularGridBrdf::Content& c = written.content();

  std::string out;
  out.reserve(c.f_per_sr.size() * c.f_per_sr[0].size() * (static_cast<std::size_t>(digits) + 7) + 65536);
  out += "#Data written by OpenScatter\n";
  std::map<std::string, std::string> own;
  if (!c.origin.empty()) {
    own["origin"] = origin_runs(c.origin);
  }
  if (!c.wavelengths_nm.empty()) {
    own["wavelengths_nm"] = float_list(c.wavelengths_nm);
  }
  if (converts) {
    own["tristimulus_of"] = "bt709";
  }
  write_comment_fields(c.metadata, own, out);
  const char* spectral = channels == 1 ? "Monochrome" : converts || is_xyz ? "XYZ" : "RGB";
  fmt::format_to(std::back_inserter(out),
                 "Source  Measured\nSymmetry  {}\nSpectralContent  {}\nScatterType  {}\n", symmetry_of(c),
                 spectral, c.type == reflectance::ScatterType::kBtdf ? "BTDF" : "BRDF");
  write_axis(out, "SampleRotation", c.rotation);
  write_axis(out, "AngleOfIncidence", c.theta_i);
  write_axis(out, "ScatterAzimuth", c.azimuth);
  write_axis(out, "ScatterRadial", c.radial);
  if (channels == 1) {
    constexpr std::array<const char*, 1> kMonochrome{"Monochrome"};
    write_sections(written, kMonochrome, digits, out);
  } else {
    write_sections(written, converts || is_xyz ? kXyzSections : kRgbSections, digits, out);
  }
  return out;
}

Status write_zemax(const SpecularGridBrdf& grid, const std::filesystem::path& path,
                   const ZemaxOptions& options) {
  const auto text = encode_zemax(grid, options);
  return text ? write_file(path, *text) : std::unexpected(text.error());
}

}  // namespace scatter::formats
