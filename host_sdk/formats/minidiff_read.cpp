#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/text_scanner.h"

namespace scatter::formats {
namespace {

using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;

constexpr std::size_t kLongestAxis = 100'000;
constexpr double kSameAngleDeg = 1e-6;
constexpr std::string_view kExtrapolated = "#Extrapolated beyond radial ";

/// Even steps from 0; the step [deg], or nothing.
std::optional<double> even_step(const std::vector<double>& axis) {
  if (axis.size() < 2 || axis[0] != 0 || !(axis.back() > 0)) {
    return std::nullopt;
  }
  const double step = axis.back() / static_cast<double>(axis.size() - 1);
  for (std::size_t k = 0; k < axis.size(); ++k) {
    if (std::abs(axis[k] - step * static_cast<double>(k)) > kSameAngleDeg) {
      return std::nullopt;
    }
  }
  return step;
}

class Decoder {
 public:
  Decoder(std::string_view text, std::string_view name) : scan_(text, name), text_(text), name_(name) {}

  Result<GridBrdf> decode() {
    if (Status status = read_header(); !status) {
      return std::unexpected(status.error());
    }
    if (Status status = set_axes(); !status) {
      return std::unexpected(status.error());
    }
    while (!scan_.at_end() && !scan_.take_if("DataEnd")) {
      if (Status status = read_block(); !status) {
        return std::unexpected(status.error());
      }
    }
    if (!scan_.at_end()) {
      return scan_.expected("the end of the file");
    }
    return finish();
  }

 private:
  enum Key : std::size_t { kModel, kSource, kSymmetry, kSpectral, kAzimuth, kRadial };
  static constexpr std::array<std::string_view, 6> kKeys{
      "Model", "Source", "Symmetry", "SpectralContent", "ScatterAzimuth", "ScatterRadial"};
  /// Values of one incidence, in the order in which wavelengths came.
  struct Incidence {
    double aoi_deg, poi_deg;
    std::vector<double> wavelengths_nm;
    std::vector<std::vector<float>> planes;
  };
  struct BlockHead {
    std::optional<double> aoi, poi, wavelength, total;
    std::optional<ScatterType> type;
    std::string_view side;
  };

  [[nodiscard]] std::unexpected<Error> unimplemented(std::string_view what) const {
    return fail(ErrorCode::kUnimplemented, fmt::format("{}: {}", name_, what),
                "export it as an even grid, monochrome, one type and side per file");
  }

  Status read_header() {
    std::array<bool, kKeys.size()> seen{};
    while (!scan_.take_if("DataBegin")) {
      std::size_t key = 0;
      while (key < kKeys.size() && !same_word(kKeys[key], scan_.peek())) {
        ++key;
      }
      if (key == kKeys.size()) {
        return scan_.expected("a keyword of the header or DataBegin");
      }
      if (seen[key]) {
        return scan_.error(fmt::format("{} is there twice", kKeys[key]));
      }
      seen[key] = true;
      (void)scan_.take();
      if (Status status = read_key(static_cast<Key>(key)); !status) {
        return status;
      }
    }
    for (std::size_t key = kSymmetry; key < kKeys.size(); ++key) {
      if (!seen[key]) {
        return scan_.error(fmt::format("{} is missing before DataBegin", kKeys[key]));
      }
    }
    return {};
  }

  Status read_key(Key key) {
    switch (key) {
      case kModel: {
        std::string_view line = scan_.take_line();
        if (line.starts_with("#:")) {
          line.remove_prefix(2);
        }
        line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
        content_.metadata["sample"] = line;
        return {};
      }
      case kSource:
        (void)scan_.take();
        return {};
      case kSymmetry:
        mirrored_ = scan_.take_if("PlaneSymmetrical") || scan_.take_if("PlaneSymmetric");
        if (!mirrored_ && !scan_.take_if("Asymmetric") && !scan_.take_if("Asymmetrical")) {
          return scan_.expected("PlaneSymmetrical or Asymmetric");
        }
        return {};
      case kSpectral:
        if (same_word(scan_.peek(), "XYZ")) {
          return unimplemented("SpectralContent XYZ is not read yet");
        }
        if (!scan_.take_if("Monochrome")) {
          return scan_.expected("Monochrome or XYZ");
        }
        return {};
      case kAzimuth:
      case kRadial: {
        auto axis = scan_.list(kKeys[key], kLongestAxis);
        if (!axis) {
          return std::unexpected(axis.error());
        }
        (key == kAzimuth ? azimuth_ : radial_) = std::move(*axis);
        return {};
      }
    }
    return {};
  }

  Status set_axes() {
    const auto radial_step = even_step(radial_);
    const auto azimuth_step = even_step(azimuth_);
    if (!radial_step || radial_.back() > 90 + kSameAngleDeg) {
      return unimplemented("ScatterRadial is not evenly spaced from 0 to at most 90");
    }
    const double range = mirrored_ ? 180 : 360;
    const bool closed = azimuth_step && std::abs(azimuth_.back() - range) < kSameAngleDeg;
    const bool open =
        azimuth_step && !mirrored_ && std::abs(azimuth_.back() + *azimuth_step - range) < kSameAngleDeg;
    if (!closed && !open) {
      return unimplemented(fmt::format("ScatterAzimuth is not evenly spaced from 0 to {}", range));
    }
    content_.theta_count = radial_.size();
    content_.theta_step = radians(*radial_step);
    content_.phi_count = mirrored_ ? 2 * (azimuth_.size() - 1) : azimuth_.size() - (closed ? 1 : 0);
    content_.phi_step = 2 * kPi / static_cast<double>(content_.phi_count);
    return {};
  }

  Result<BlockHead> read_head() {
    BlockHead head;
    const auto number = [&](std::string_view word, std::optional<double>& slot) -> Status {
      if (slot) {
        return scan_.error(fmt::format("{} is there twice in one block", word));
      }
      const auto value = scan_.number(word);
      if (!value) {
        return std::unexpected(value.error());
      }
      slot = *value;
      return {};
    };
    for (bool more = true; more;) {
      Status status;
      if (scan_.take_if("AOI")) {
        status = number("AOI", head.aoi);
      } else if (scan_.take_if("POI")) {
        status = number("POI", head.poi);
      } else if (scan_.take_if("Wavelength")) {
        status = number("Wavelength", head.wavelength);
      } else if (scan_.take_if("TIS")) {
        status = number("TIS", head.total);
      } else if (scan_.take_if("Side")) {
        head.side = scan_.take();
        status = same_word(head.side, "Front") || same_word(head.side, "Back")
                     ? Status{}
                     : scan_.error("Side is neither Front nor Back");
      } else if (scan_.take_if("ScatterType")) {
        if (head.type) {
          status = scan_.error("ScatterType is there twice in one block");
        } else if (scan_.take_if("BTDF")) {
          head.type = ScatterType::kBtdf;
        } else if (scan_.take_if("BRDF")) {
          head.type = ScatterType::kBrdf;
        } else {
          status = scan_.expected("BRDF or BTDF");
        }
      } else {
        more = false;
      }
      if (!status) {
        return std::unexpected(status.error());
      }
    }
    if (!head.aoi || !head.poi || !head.wavelength || !head.type || !head.total) {
      return scan_.expected("AOI, POI, Side, Wavelength, ScatterType and TIS of a block");
    }
    return head;
  }

  Status read_block() {
    const auto head = read_head();
    if (!head) {
      return std::unexpected(head.error());
    }
    if (!(*head->aoi >= 0 && *head->aoi < 90) || !(std::abs(*head->poi) <= 360)) {
      return scan_.error(
          fmt::format("AOI {} POI {}, expected 0 <= AOI < 90 and POI within a turn", *head->aoi, *head->poi));
    }
    if (!incidences_.empty() && (*head->type != content_.type || !same_word(head->side, side_))) {
      return unimplemented("several scatter types or sides in one file are not read yet");
    }
    content_.type = *head->type;
    side_ = head->side;
    const std::size_t values = azimuth_.size() * radial_.size();
    if (values > (scan_.remaining() + 1) / 2) {
      return scan_.error(
          fmt::format("a block of {} values, but only {} bytes follow", values, scan_.remaining()));
    }
    std::vector<float> plane(content_.theta_count * content_.phi_count);
    if (Status status = read_values(*head->poi, plane); !status) {
      return status;
    }
    auto it = std::ranges::find_if(incidences_, [&](const Incidence& i) {
      return std::abs(i.aoi_deg - *head->aoi) < kSameAngleDeg &&
             std::abs(i.poi_deg - *head->poi) < kSameAngleDeg;
    });
    if (it == incidences_.end()) {
      it = incidences_.insert(it, {*head->aoi, *head->poi, {}, {}});
    }
    if (std::ranges::find(it->wavelengths_nm, *head->wavelength) != it->wavelengths_nm.end()) {
      return scan_.error(fmt::format("AOI {} POI {} Wavelength {} is there twice", *head->aoi, *head->poi,
                                     *head->wavelength));
    }
    it->wavelengths_nm.push_back(*head->wavelength);
    it->planes.push_back(std::move(plane));
    return {};
  }

  /// Rows are azimuths in the file, columns in memory.
  Status read_values(double poi_deg, std::vector<float>& plane) {
    // Plane-symmetric azimuths count from the plane of incidence, so it must lie on a column.
    const double shift = poi_deg / reflectance::degrees(content_.phi_step);
    if (mirrored_ && std::abs(shift - std::round(shift)) > 1e-6) {
      return unimplemented("plane-symmetric data whose POI is off the azimuth grid");
    }
    const auto count = static_cast<std::ptrdiff_t>(content_.phi_count);
    const auto turn = static_cast<std::ptrdiff_t>(std::llround(shift));
    std::vector<float> row(radial_.size());
    for (std::size_t azimuth = 0; azimuth < azimuth_.size(); ++azimuth) {
      if (Status status = scan_.numbers("value", row); !status) {
        return status;
      }
      if (azimuth >= content_.phi_count) {
        continue;  // 360 deg repeats 0 deg
      }
      const auto offset = static_cast<std::ptrdiff_t>(azimuth);
      const auto column = mirrored_ ? turn + offset : offset;
      const auto other = mirrored_ ? turn - offset : offset;
      const auto wrap = [count](std::ptrdiff_t k) {
        return static_cast<std::size_t>(((k % count) + count) % count);
      };
      for (std::size_t radial = 0; radial < row.size(); ++radial) {
        plane[radial * content_.phi_count + wrap(column)] = row[radial];
        plane[radial * content_.phi_count + wrap(other)] = row[radial];
      }
    }
    return {};
  }

  /// Our own remark; in files of others everything counts as measured.
  [[nodiscard]] double measured_to() const {
    const std::size_t at = text_.substr(0, 4096).find(kExtrapolated);
    double radial_deg = 90;
    if (at != std::string_view::npos && (at == 0 || text_[at - 1] == '\n')) {
      const char* start = text_.data() + at + kExtrapolated.size();
      (void)std::from_chars(start, text_.data() + text_.size(), radial_deg);
    }
    return radians(radial_deg);
  }

  Result<GridBrdf> finish() {
    if (incidences_.empty()) {
      return scan_.expected("AOI of a first block");
    }
    const std::vector<double>& wavelengths = incidences_.front().wavelengths_nm;
    content_.channels = wavelengths.size();
    if (wavelengths.size() > 1 || wavelengths.front() > 0) {
      content_.wavelengths_nm.assign(wavelengths.begin(), wavelengths.end());
    }
    const bool rotated = std::ranges::any_of(incidences_, [&](const Incidence& a) {
      return std::ranges::count_if(incidences_, [&](const Incidence& b) {
               return std::abs(a.aoi_deg - b.aoi_deg) < kSameAngleDeg;
             }) > 1;
    });
    const double limit = measured_to() + content_.theta_step * 1e-3;
    for (Incidence& incidence : incidences_) {
      if (incidence.wavelengths_nm != wavelengths) {
        return scan_.error(
            fmt::format("AOI {} has {} wavelengths, expected the {} of the first incidence in the same order",
                        incidence.aoi_deg, incidence.wavelengths_nm.size(), wavelengths.size()));
      }
      GridPart part;
      part.theta_i = radians(incidence.aoi_deg);
      part.phi_i = radians(incidence.poi_deg);
      part.rotation_rad = rotated ? part.phi_i : 0;
      part.f_per_sr = std::move(incidence.planes);
      for (std::size_t n = 0; n < content_.theta_count * content_.phi_count; ++n) {
        const double theta = static_cast<double>(n / content_.phi_count) * content_.theta_step;
        part.origin.push_back(theta > limit ? Origin::kExtrapolated : Origin::kMeasured);
      }
      content_.parts.push_back(std::move(part));
    }
    content_.metadata["side"] = side_.empty() ? "Front" : side_;
    auto grid = GridBrdf::make(std::move(content_));
    if (!grid) {
      return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name_, grid.error().what), grid.error().remedy);
    }
    return grid;
  }

  TextScanner scan_;
  std::string_view text_;
  std::string_view name_;
  bool mirrored_ = false;
  std::vector<double> azimuth_;
  std::vector<double> radial_;
  std::string_view side_;
  std::vector<Incidence> incidences_;
  GridBrdf::Content content_;
};

}  // namespace

Result<GridBrdf> decode_minidiff(std::string_view text, std::string_view name) {
  return Decoder(text, name).decode();
}

Result<GridBrdf> read_minidiff(const std::filesystem::path& path) {
  const auto text = read_file(path);
  if (!text) {
    return std::unexpected(text.error());
  }
  return decode_minidiff(*text, path.string());
}

}  // namespace scatter::formats
