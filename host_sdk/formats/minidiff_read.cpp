#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/minidiff_content.h"
#include "host_sdk/formats/text_scanner.h"

namespace scatter::formats {
namespace {

using reflectance::GridBrdf;
using reflectance::ScatterType;

constexpr std::size_t kLongestAxis = 100'000;
constexpr double kSameAngleDeg = 1e-6;

class Decoder {
 public:
  Decoder(std::string_view text, std::string_view name) : scan_(text, name), name_(name) {}

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
  using Incidence = MiniDiffContent::Incidence;
  struct BlockHead {
    std::optional<double> aoi, poi, wavelength, total, tristimulus;
    std::optional<ScatterType> type;
    std::string_view side;
    std::size_t place = 0;
  };

  [[nodiscard]] std::unexpected<Error> unimplemented(std::size_t place, std::string_view what,
                                                     std::string_view remedy) const {
    auto error = scan_.error_at(place, what, remedy);
    error.error().code = ErrorCode::kUnimplemented;
    return error;
  }

  Status read_header() {
    std::array<bool, kKeys.size()> seen{};
    while (!scan_.take_if("DataBegin")) {
      const auto key = scan_.keyword(kKeys, seen, "DataBegin");
      if (!key) {
        return std::unexpected(key.error());
      }
      if (Status status = read_key(static_cast<Key>(*key)); !status) {
        return status;
      }
    }
    // Model names the sample and nothing else: files without it are whole.
    for (std::size_t key = kSource; key < kKeys.size(); ++key) {
      if (!seen[key]) {
        return scan_.error(fmt::format("{} is missing before DataBegin", kKeys[key]),
                           key == kSource ? "add the line 'Source  Measured' to the header"
                                          : "export the file again or add the keyword to the header");
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
        content_.metadata["source"] = scan_.take();
        return {};
      case kSymmetry:
        content_.plane_symmetric = scan_.take_if("PlaneSymmetrical") || scan_.take_if("PlaneSymmetric");
        if (!content_.plane_symmetric && !scan_.take_if("Asymmetric") && !scan_.take_if("Asymmetrical")) {
          return scan_.expected("PlaneSymmetrical or Asymmetric");
        }
        return {};
      case kSpectral:
        if (scan_.take_if("XYZ")) {
          content_.tristimulus = true;
          content_.metadata["spectral_content"] = "XYZ";
        } else if (!scan_.take_if("Monochrome")) {
          return scan_.expected("Monochrome or XYZ");
        }
        return {};
      case kAzimuth:
      case kRadial: {
        auto axis = scan_.angles(kKeys[key], kLongestAxis, 0, key == kAzimuth ? 360 : 90);
        if (!axis) {
          return std::unexpected(axis.error());
        }
        if (key == kAzimuth) {
          azimuth_ = std::move(axis->deg);
          azimuth_places_ = std::move(axis->places);
        } else {
          content_.radial_deg = std::move(axis->deg);
        }
        return {};
      }
    }
    return {};
  }

  /// The angles of the grid in memory: without 360, and without the half that a mirror gives.
  Status set_axes() {
    const auto beyond =
        static_cast<std::size_t>(std::ranges::upper_bound(azimuth_, 180 + kSameAngleDeg) - azimuth_.begin());
    if (content_.plane_symmetric && beyond < azimuth_.size()) {
      return scan_.error_at(
          azimuth_places_[beyond],
          fmt::format("ScatterAzimuth {} of {} is {:.10g} deg, expected 0..180 of PlaneSymmetrical",
                      beyond + 1, azimuth_.size(), azimuth_[beyond]),
          "state Symmetry Asymmetric, or keep the half 0..180 only");
    }
    content_.phi_deg = azimuth_;
    if (std::abs(content_.phi_deg.back() - 360) < kSameAngleDeg) {
      content_.phi_deg.pop_back();
    }
    for (std::size_t k = azimuth_.size(); k-- > 0 && content_.plane_symmetric;) {
      if (azimuth_[k] > kSameAngleDeg && azimuth_[k] < 180 - kSameAngleDeg) {
        content_.phi_deg.push_back(360 - azimuth_[k]);
      }
    }
    const auto layout = even_layout(content_.radial_deg, content_.phi_deg, 90, 360);
    if (!layout) {
      return unimplemented(azimuth_places_.front(),
                           "ScatterAzimuth and ScatterRadial make no even grid of a sensible size",
                           "export on angles that are multiples of one step");
    }
    content_.layout = *layout;
    return {};
  }

  Result<BlockHead> read_head() {
    BlockHead head;
    (void)scan_.peek();
    head.place = scan_.place();
    const auto number = [&](std::string_view word, std::optional<double>& slot) -> Status {
      if (slot) {
        return scan_.error(fmt::format("{} is there twice in one block", word));
      }
      const auto value = scan_.number(word);
      if (!value) {
        return std::unexpected(value.error());
      }
      slot = *value;
      return check(word, *value);
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
      } else if (scan_.take_if("TristimulusValue")) {
        status = read_tristimulus(head);
      } else if (scan_.take_if("Side")) {
        status = read_side(head);
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
    const char* channel = content_.tristimulus ? "TristimulusValue" : "Wavelength";
    const char* missing = !head.aoi                                                      ? "AOI"
                          : !head.poi                                                    ? "POI"
                          : head.side.empty()                                            ? "Side"
                          : !(content_.tristimulus ? head.tristimulus : head.wavelength) ? channel
                          : !head.type                                                   ? "ScatterType"
                          : !head.total                                                  ? "TIS"
                                                                                         : nullptr;
    if (missing != nullptr) {
      return scan_.expected(fmt::format("AOI, POI, Side, {}, ScatterType and TIS of a block ({} is missing)",
                                        channel, missing));
    }
    return head;
  }

  /// A number of a block's head that has just been read.
  Status check(std::string_view word, double value) {
    if (word == "AOI" && !(value >= 0 && value < 90)) {
      return scan_.error(fmt::format("AOI {} deg, expected 0 <= AOI < 90", value),
                         "state the angle of the light to the normal in degrees");
    }
    if (word == "POI" && !(std::abs(value) <= 360)) {
      return scan_.error(fmt::format("POI {} deg, expected POI within a turn", value),
                         "state the azimuth of the light in degrees -360..360");
    }
    // 0: not stated, as in files of one channel or of tristimulus values.
    if (word == "Wavelength" && value != 0 && !is_wavelength(value)) {
      return scan_.error(
          fmt::format("Wavelength {} nm, expected {}, or 0 where there is none", value, kWavelengthRange),
          kWavelengthRemedy);
    }
    if (word == "TIS" && (value < 0 || value > kLargestTotal)) {
      // Its line takes a pass over the text: only where it will be told.
      content_.warnings.add(
          content_.warnings.is_full()
              ? std::string()
              : fmt::format("line {}: TIS {:g}, expected 0..1 (the share of the light that is "
                            "scattered): not used",
                            scan_.line_at(scan_.place()), value));
    }
    return {};
  }

  Status read_side(BlockHead& head) {
    if (!head.side.empty()) {
      return scan_.error("Side is there twice in one block");
    }
    const std::string_view word = scan_.peek();
    if (!same_word(word, "Front") && !same_word(word, "Back")) {
      return scan_.expected("Side Front or Back");
    }
    head.side = scan_.take();
    return {};
  }

  Status read_tristimulus(BlockHead& head) {
    constexpr std::array<std::string_view, 3> kValues{"TrisX", "TrisY", "TrisZ"};
    if (!content_.tristimulus || head.tristimulus) {
      return scan_.error("TristimulusValue is there twice in one block, or the file is not XYZ");
    }
    for (std::size_t k = 0; k < kValues.size(); ++k) {
      if (scan_.take_if(kValues[k])) {
        head.tristimulus = static_cast<double>(k);
        return {};
      }
    }
    return scan_.expected("TrisX, TrisY or TrisZ");
  }

  Status read_block() {
    const auto head = read_head();
    if (!head) {
      return std::unexpected(head.error());
    }
    if (!content_.incidences.empty() && (*head->type != content_.type || !same_word(head->side, side_))) {
      return unimplemented(head->place, "several scatter types or sides in one file are not read yet",
                           "export one type and side per file");
    }
    content_.type = *head->type;
    side_ = head->side;
    const std::size_t values = azimuth_.size() * content_.radial_deg.size();
    if (values > (scan_.remaining() + 1) / 2) {
      return scan_.error(
          fmt::format("a block of {} values, but only {} bytes follow", values, scan_.remaining()));
    }
    std::vector<float> plane(content_.radial_deg.size() * content_.phi_deg.size());
    if (Status status = read_values(plane); !status) {
      return status;
    }
    const double key = content_.tristimulus ? *head->tristimulus : *head->wavelength;
    auto it = std::ranges::find_if(content_.incidences, [&](const Incidence& i) {
      return std::abs(i.aoi_deg - *head->aoi) < kSameAngleDeg &&
             std::abs(i.poi_deg - *head->poi) < kSameAngleDeg;
    });
    if (it == content_.incidences.end()) {
      it = content_.incidences.insert(it, {*head->aoi, *head->poi, {}, {}, {}, {}});
    }
    if (std::ranges::find(it->keys, key) != it->keys.end()) {
      return scan_.error_at(head->place, fmt::format("AOI {} POI {} {} is there twice", *head->aoi,
                                                     *head->poi, channel_name(key)));
    }
    it->keys.push_back(key);
    it->places.push_back(head->place);
    it->totals.push_back(*head->total);
    it->planes.push_back(std::move(plane));
    return {};
  }

  /// Rows are azimuths in the file, columns in memory.
  Status read_values(std::vector<float>& plane) {
    std::vector<float> row(content_.radial_deg.size());
    const std::size_t half = azimuth_.size();
    const std::size_t columns = content_.phi_deg.size();
    for (std::size_t azimuth = 0; azimuth < half; ++azimuth) {
      if (Status status = scan_.numbers("value", row); !status) {
        return status;
      }
      const bool repeats = azimuth >= columns;  // 360 deg repeats 0 deg
      // The mirror images follow the half in falling order; 0 and 180 are their own.
      const std::size_t first = azimuth_.front() > kSameAngleDeg ? 0 : 1;
      const std::size_t other = azimuth == 0 && first == 1 ? 0 : columns + first - 1 - azimuth;
      for (std::size_t radial = 0; radial < row.size() && !repeats; ++radial) {
        plane[radial * columns + azimuth] = row[radial];
        if (content_.plane_symmetric && other >= half) {
          plane[radial * columns + other] = row[radial];
        }
      }
    }
    return {};
  }

  [[nodiscard]] std::string channel_name(double key) const {
    constexpr std::array<std::string_view, 3> kValues{"TrisX", "TrisY", "TrisZ"};
    return content_.tristimulus ? fmt::format("TristimulusValue {}", kValues[static_cast<std::size_t>(key)])
                                : fmt::format("Wavelength {}", key);
  }

  /// Every incidence has the channels of the first, in its order.
  Status check_channels() const {
    constexpr std::string_view kRemedy = "export the file again, all incidences with the same channels";
    const auto& incidences = content_.incidences;
    const std::vector<double> expected =
        content_.tristimulus ? std::vector<double>{0, 1, 2} : incidences.front().keys;
    for (const Incidence& i : incidences) {
      const auto same = std::ranges::mismatch(i.keys, expected);
      const auto k = static_cast<std::size_t>(same.in1 - i.keys.begin());
      const std::string who = fmt::format("AOI {} POI {}", i.aoi_deg, i.poi_deg);
      if (k < i.keys.size()) {
        return scan_.error_at(
            i.places[k],
            fmt::format("{} has {} as channel {}, expected {}", who, channel_name(i.keys[k]), k + 1,
                        k < expected.size() ? channel_name(expected[k])
                                            : fmt::format("the {} of the first incidence", expected.size())),
            kRemedy);
      }
      if (k < expected.size()) {
        return scan_.error_at(i.places.back(),
                              fmt::format("{} has {} channels, expected {}: {} is missing", who, k,
                                          expected.size(), channel_name(expected[k])),
                              kRemedy);
      }
      // 0 is no wavelength, so no channel can be told from others by it.
      const auto none = std::ranges::find(i.keys, 0.0);
      if (!content_.tristimulus && i.keys.size() > 1 && none != i.keys.end()) {
        return scan_.error_at(i.places[static_cast<std::size_t>(none - i.keys.begin())],
                              fmt::format("{} has Wavelength 0 as one of {} channels, expected {}", who,
                                          i.keys.size(), kWavelengthRange),
                              kWavelengthRemedy);
      }
    }
    return {};
  }

  Result<GridBrdf> finish() {
    if (content_.incidences.empty()) {
      return scan_.expected("AOI of a first block");
    }
    if (Status status = check_channels(); !status) {
      return std::unexpected(status.error());
    }
    content_.metadata["side"] = side_;
    content_.comments = scan_.comments();
    auto grid = grid_of(std::move(content_));
    if (!grid) {
      return fail(grid.error().code, fmt::format("{}: {}", name_, grid.error().what), grid.error().remedy);
    }
    return grid;
  }

  TextScanner scan_;
  std::string_view name_;
  std::vector<double> azimuth_;  ///< As in the file; content_.phi_deg as in memory.
  std::vector<std::size_t> azimuth_places_;
  std::string_view side_;
  MiniDiffContent content_;
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
