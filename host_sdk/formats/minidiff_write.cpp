#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "host_sdk/formats/comment_fields.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/text_scanner.h"
#include "host_sdk/formats/tristimulus.h"

namespace scatter::formats {
namespace {

using reflectance::degrees;
using reflectance::Direction;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::ScatterType;

constexpr int kUsualDigits = 7;
constexpr double kSameStep = 1e-9;
constexpr std::array<const char*, 3> kTristimulus{"TristimulusValue TrisX\n", "TristimulusValue TrisY\n",
                                                  "TristimulusValue TrisZ\n"};

/// Axes of the file: the grid's own, theta_o on towards the horizon in the same steps.
struct Axes {
  std::size_t azimuths = 0;  ///< Without the one that repeats at 360.
  std::size_t radials = 0;
  double azimuth_step = 0;  ///< [rad]
  double radial_step = 0;   ///< [rad]
};

Axes axes_of(const GridBrdf::Content& content) {
  const double radials = std::floor(kPi / 2 / content.theta_step + kSameStep);
  return {.azimuths = content.phi_count,
          .radials = static_cast<std::size_t>(radials) + 1,
          .azimuth_step = content.phi_step,
          .radial_step = content.theta_step};
}

/// Metadata become comment lines and names: nothing in them may begin a new line.
std::string one_line(std::string text) {
  std::ranges::replace_if(text, [](char c) { return c >= 0 && c < ' '; }, ' ');
  return text;
}

std::string metadata_or(const GridBrdf::Content& content, const char* key, const char* otherwise) {
  const auto it = content.metadata.find(key);
  return one_line(it == content.metadata.end() ? otherwise : it->second);
}

/// Values of one part.
struct Block {
  std::vector<std::vector<double>> value;  ///< [channel][azimuth * radials + radial]
  std::vector<Origin> origin;              ///< [radial * azimuths + azimuth], as in memory.
  std::size_t filled = 0;                  ///< Directions that had no value of their own.
};

Block sample(const GridBrdf& grid, std::size_t part, const Axes& axes) {
  const std::size_t channels = grid.channels();
  const double side = grid.type() == ScatterType::kBtdf ? -1 : 1;
  Block block;
  block.value.assign(channels, std::vector<double>(axes.azimuths * axes.radials, 0.0));
  block.origin.resize(axes.azimuths * axes.radials);
  std::vector<Direction> omega_o(axes.radials);
  std::vector<double> f(axes.radials * channels);
  std::vector<Origin> origin(axes.radials);
  const GridBrdf::Content& content = grid.content();
  const std::vector<Origin>& own = content.parts[part].origin;
  for (std::size_t azimuth = 0; azimuth < axes.azimuths; ++azimuth) {
    for (std::size_t radial = 0; radial < axes.radials; ++radial) {
      omega_o[radial] = reflectance::from_spherical(static_cast<double>(radial) * axes.radial_step,
                                                    static_cast<double>(azimuth) * axes.azimuth_step);
      omega_o[radial].z *= side;
    }
    grid.eval_batch(grid.omega_i(part), omega_o, f, origin);
    // The grid's own nodes as they are: directions would join those at the pole.
    for (std::size_t radial = 0; radial < content.theta_count; ++radial) {
      const std::size_t node = radial * axes.azimuths + azimuth;
      origin[radial] = own[node];
      for (std::size_t c = 0; c < channels && own[node] != Origin::kInvalid; ++c) {
        f[radial * channels + c] = static_cast<double>(content.parts[part].f_per_sr[c][node]);
      }
    }
    // First towards the horizon, then the invalid start towards the pole.
    std::size_t first_valid = 0;
    while (first_valid < axes.radials && origin[first_valid] == Origin::kInvalid) {
      ++first_valid;
    }
    std::size_t last_valid = first_valid;
    for (std::size_t radial = 0; radial < axes.radials; ++radial) {
      block.origin[radial * axes.azimuths + azimuth] = origin[radial];
      if (first_valid == axes.radials) {
        continue;
      }
      if (origin[radial] != Origin::kInvalid) {
        last_valid = radial;
      } else {
        ++block.filled;
      }
      for (std::size_t c = 0; c < channels; ++c) {
        block.value[c][azimuth * axes.radials + radial] = f[last_valid * channels + c];
      }
    }
    block.filled += first_valid == axes.radials ? axes.radials : 0;
  }
  return block;
}

/// Whether origins are what the line "#Extrapolated beyond radial" says already.
bool plain(const Block& block, const Axes& axes, std::size_t measured_radials) {
  for (std::size_t n = 0; n < block.origin.size(); ++n) {
    const bool measured = n < measured_radials * axes.azimuths;
    if (block.origin[n] != (measured ? Origin::kMeasured : Origin::kExtrapolated)) {
      return false;
    }
  }
  return true;
}

/// Directional-hemispherical total of a block: cells end half-way to their neighbours.
double total_of(const std::vector<double>& value, const Axes& axes) {
  double total = 0;
  for (std::size_t radial = 0; radial < axes.radials; ++radial) {
    const double theta = static_cast<double>(radial) * axes.radial_step;
    const double low = std::max(0.0, theta - axes.radial_step / 2);
    const double high = std::min(kPi / 2, theta + axes.radial_step / 2);
    const double share = axes.azimuth_step * (std::pow(std::sin(high), 2) - std::pow(std::sin(low), 2)) / 2;
    for (std::size_t azimuth = 0; azimuth < axes.azimuths; ++azimuth) {
      total += share * value[azimuth * axes.radials + radial];
    }
  }
  return total;
}

void write_axis(std::string& out, std::string_view name, std::size_t count, double step) {
  fmt::format_to(std::back_inserter(out), "{}\t{}\n", name, count);
  for (std::size_t k = 0; k < count; ++k) {
    fmt::format_to(std::back_inserter(out), "{}{:.10g}", k == 0 ? "" : "\t",
                   degrees(static_cast<double>(k) * step));
  }
  out += '\n';
}

void write_values(std::string& out, const std::vector<double>& value, const Axes& axes, int digits) {
  for (std::size_t azimuth = 0; azimuth <= axes.azimuths; ++azimuth) {
    const double* row = value.data() + azimuth % axes.azimuths * axes.radials;
    for (std::size_t radial = 0; radial < axes.radials; ++radial) {
      fmt::format_to(std::back_inserter(out), "{:.{}E}", row[radial], digits - 1);
      out += radial + 1 == axes.radials ? '\n' : '\t';
    }
  }
}

/// Fields of the whole file, before its values: origins where they are not plain.
void write_fields(const GridBrdf::Content& content, const std::vector<Block>& blocks, const Axes& axes,
                  bool converts, std::string& out) {
  std::map<std::string, std::string> own;
  if (!std::ranges::all_of(blocks, [&](const Block& b) { return plain(b, axes, content.theta_count); })) {
    std::vector<Origin> origin;
    for (const Block& block : blocks) {
      origin.insert(origin.end(), block.origin.begin(), block.origin.end());
    }
    own["origin"] = origin_runs(origin);
  }
  if (std::ranges::any_of(content.parts, [](const GridPart& part) { return part.rotation_rad != 0; })) {
    std::vector<float> rotation;
    for (const GridPart& part : content.parts) {
      rotation.push_back(static_cast<float>(degrees(part.rotation_rad)));
    }
    own["rotation_deg"] = float_list(rotation);
  }
  if (converts) {
    own["tristimulus_of"] = "bt709";
  }
  write_comment_fields(content.metadata, own, out);
}

}  // namespace

Result<std::string> encode_minidiff(const GridBrdf& grid, int digits) {
  const GridBrdf::Content& content = grid.content();
  const bool tristimulus = content.wavelengths_nm.empty() && content.channels == 3;
  if (content.wavelengths_nm.empty() && content.channels != 1 && !tristimulus) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("MiniDiff: {} channels without wavelengths, which name the blocks", content.channels),
        "keep one channel, or write EXR");
  }
  const bool converts = tristimulus && !same_word(metadata_or(content, "spectral_content", ""), "XYZ");
  if (digits < 0 || digits > 17) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{} digits, expected 1..17", digits),
                "choose 4 to 9");
  }
  digits = digits == 0 ? kUsualDigits : digits;
  const Axes axes = axes_of(content);
  std::vector<Block> blocks;
  for (std::size_t p = 0; p < content.parts.size(); ++p) {
    blocks.push_back(sample(grid, p, axes));
    if (converts) {
      auto& value = blocks.back().value;
      transform(kXyzFromRgb, value[0], value[1], value[2]);
    }
  }
  std::string out;
  out.reserve(blocks.size() * content.channels * (axes.azimuths + 1) * axes.radials *
                  (static_cast<std::size_t>(digits) + 7) +
              65536);
  out += "#Data Generated by OpenScatter in the layout of MiniDiff Software\n";
  const double last = degrees(static_cast<double>(content.theta_count - 1) * content.theta_step);
  if (axes.radials > content.theta_count) {
    fmt::format_to(std::back_inserter(out), "#Extrapolated beyond radial {:.6g} (constant)\n", last);
  }
  std::size_t filled = 0;
  for (const Block& block : blocks) {
    filled += block.filled;
  }
  if (filled > 0) {
    fmt::format_to(std::back_inserter(out), "#{} directions without a value hold the nearest one\n", filled);
  }
  write_fields(content, blocks, axes, converts, out);
  fmt::format_to(std::back_inserter(out), "Model #: {}\n", metadata_or(content, "sample", "sample"));
  fmt::format_to(std::back_inserter(out), "Source\tMeasured\nSymmetry\tAsymmetric\nSpectralContent\t{}\n",
                 tristimulus ? "XYZ" : "Monochrome");
  write_axis(out, "ScatterAzimuth", axes.azimuths + 1, axes.azimuth_step);
  write_axis(out, "ScatterRadial", axes.radials, axes.radial_step);
  out += "DataBegin\n";
  for (std::size_t p = 0; p < content.parts.size(); ++p) {
    const GridPart& part = content.parts[p];
    for (std::size_t c = 0; c < content.channels; ++c) {
      const std::vector<double>& value = blocks[p].value[c];
      fmt::format_to(
          std::back_inserter(out),
          "AOI {:.10g}\nPOI {:.10g}\nSide Front\nWavelength {:.9g}\nScatterType {}\n{}TIS {:.6g}\n",
          degrees(part.theta_i), degrees(part.phi_i),
          content.wavelengths_nm.empty() ? 0.0F : content.wavelengths_nm[c],
          content.type == ScatterType::kBtdf ? "BTDF" : "BRDF", tristimulus ? kTristimulus[c] : "",
          total_of(value, axes));
      write_values(out, value, axes, digits);
    }
  }
  return out;
}

Status write_minidiff(const GridBrdf& grid, const std::filesystem::path& path, int digits) {
  const auto text = encode_minidiff(grid, digits);
  return text ? write_file(path, *text) : std::unexpected(text.error());
}

}  // namespace scatter::formats
