#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "host_sdk/formats/bird.h"
#include "host_sdk/formats/grid_to_write.h"
#include "host_sdk/formats/sample_list_brdf.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::degrees;
using reflectance::Direction;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;
using reflectance::ScatteredSamples;
using Json = nlohmann::ordered_json;

constexpr const char* kSchema =
    "https://raw.githubusercontent.com/BiRD-project/BiRD_view/master/BRDF_JSON_schema/"
    "brdf_json_schema_v1.0.json";

/// One row per value: where it stands, and what goes into the columns.
struct Row {
  std::size_t part = 0;    ///< Of the angles of incidence.
  std::size_t node = 0;    ///< Of the angles of reflection.
  std::size_t sample = 0;  ///< Index of value and uncertainty in their channel's plane.
  std::size_t channel = 0;
};

/// The data in one shape, whether grid or list.
struct Columns {
  std::vector<std::string> theta_i, phi_i, theta_r, phi_r;  ///< Texts [deg], by part or node.
  std::vector<float> wavelengths_nm;
  std::vector<Row> rows;
  std::function<float(const Row&)> f, random, systematic;  ///< Empty functions: unknown.
  std::function<Origin(const Row&)> origin;
  std::vector<std::string> rotation;  ///< Texts [deg], by part; empty: no rotation.
  bool numbered = false;  ///< Several channels without wavelengths: their numbers tell them apart.
  Metadata metadata;
};

/// An angle as text; azimuths in 0..<360, which rounding must not reach.
std::string angle_text(double angle_deg, bool azimuth) {
  if (azimuth) {
    angle_deg = std::fmod(angle_deg, 360.0);
    angle_deg = angle_deg < 0 ? angle_deg + 360 : angle_deg;
  }
  std::string text = fmt::format("{:.10g}", angle_deg);
  return (azimuth && text == "360") || text == "-0" ? "0" : text;
}

Columns columns_of(const GridBrdf& grid) {
  const GridBrdf::Content& content = grid.content();
  Columns out;
  out.wavelengths_nm = content.wavelengths_nm;
  out.metadata = content.metadata;
  const bool rotated =
      std::ranges::any_of(content.parts, [](const GridPart& part) { return part.rotation_rad != 0; });
  bool uncertain = true;
  for (const GridPart& part : content.parts) {
    out.theta_i.push_back(angle_text(degrees(part.theta_i), false));
    out.phi_i.push_back(angle_text(degrees(part.phi_i), true));
    if (rotated) {
      out.rotation.push_back(fmt::format("{:.9g}", degrees(part.rotation_rad)));
    }
    uncertain = uncertain && !part.random_per_sr.empty() && !part.systematic_per_sr.empty();
  }
  for (std::size_t n = 0; n < content.theta_count * content.phi_count; ++n) {
    out.theta_r.push_back(
        angle_text(degrees(static_cast<double>(n / content.phi_count) * content.theta_step), false));
    out.phi_r.push_back(
        angle_text(degrees(static_cast<double>(n % content.phi_count) * content.phi_step), true));
  }
  for (std::size_t p = 0; p < content.parts.size(); ++p) {
    for (std::size_t n = 0; n < content.parts[p].origin.size(); ++n) {
      for (std::size_t c = 0; c < content.channels && content.parts[p].origin[n] != Origin::kInvalid; ++c) {
        out.rows.push_back({.part = p, .node = n, .sample = n, .channel = c});
      }
    }
  }
  const auto plane = [&content](std::vector<std::vector<float>> GridPart::* planes) {
    return [&content, planes](const Row& row) {
      return (content.parts[row.part].*planes)[row.channel][row.sample];
    };
  };
  out.f = plane(&GridPart::f_per_sr);
  if (uncertain) {
    out.random = plane(&GridPart::random_per_sr);
    out.systematic = plane(&GridPart::systematic_per_sr);
  }
  out.origin = [&content](const Row& row) { return content.parts[row.part].origin[row.sample]; };
  return out;
}

Columns columns_of(const ScatteredSamples& samples) {
  Columns out;
  out.wavelengths_nm = samples.wavelengths_nm;
  out.metadata = samples.metadata;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const Direction& i = samples.omega_i[s];
    const Direction& o = samples.omega_o[s];
    out.theta_i.push_back(angle_text(degrees(theta_of(i)), false));
    out.phi_i.push_back(angle_text(degrees(phi_of(i)), true));
    out.theta_r.push_back(angle_text(degrees(std::min(theta_of(o), reflectance::kPi / 2)), false));
    out.phi_r.push_back(angle_text(degrees(phi_of(o)), true));
    for (std::size_t c = 0; c < samples.channels && samples.origin_of(s) != Origin::kInvalid; ++c) {
      out.rows.push_back({.part = s, .node = s, .sample = s, .channel = c});
    }
  }
  const auto values = [channels = samples.channels](const std::vector<float>& list) {
    return [&list, channels](const Row& row) { return list[row.sample * channels + row.channel]; };
  };
  out.f = values(samples.f_per_sr);
  if (!samples.random_per_sr.empty() && !samples.systematic_per_sr.empty()) {
    out.random = values(samples.random_per_sr);
    out.systematic = values(samples.systematic_per_sr);
  }
  out.origin = [&samples](const Row& row) { return samples.origin_of(row.sample); };
  return out;
}

std::string get(const Metadata& metadata, std::initializer_list<const char*> keys, const char* otherwise) {
  for (const char* key : keys) {
    if (const auto it = metadata.find(key); it != metadata.end() && !it->second.empty()) {
      return it->second;
    }
  }
  return otherwise;
}

/// YYYY-MM-DDThh:mm:ss+hh of a time stamp, as the schema wants it; ours end in Z.
std::string timestamp_of(const Metadata& metadata) {
  std::string text = get(metadata, {"bird.timestamp", "created"}, "1970-01-01T00:00:00Z");
  constexpr std::size_t kSeconds = 19;  // YYYY-MM-DDThh:mm:ss
  if (text.size() == kSeconds + 1 && text.back() == 'Z') {
    text.replace(kSeconds, 1, "+00");
  }
  const auto shape = [](char c) { return c >= '0' && c <= '9' ? '0' : c; };
  std::string pattern = text;
  std::ranges::transform(pattern, pattern.begin(), shape);
  return pattern == "0000-00-00T00:00:00+00" || pattern == "0000-00-00T00:00:00-00"
             ? text
             : "1970-01-01T00:00:00+00";
}

/// Everything of "bird.SECTION.KEY" with one level of keys, or what stands for what nobody stated.
Json section(const Metadata& metadata, const std::string& name, std::initializer_list<const char*> required) {
  Json out = Json::object();
  for (const char* key : required) {
    out[key] = "not stated";
  }
  const std::string prefix = "bird." + name + ".";
  for (auto it = metadata.lower_bound(prefix); it != metadata.end() && it->first.starts_with(prefix); ++it) {
    const std::string key = it->first.substr(prefix.size());
    if (key.find('.') == std::string::npos) {
      out[key] = it->second;
    }
  }
  return out;
}

Json metadata_json(const Metadata& metadata, bool measured) {
  Json out;
  out["schema"] = kSchema;
  const std::string recording = get(metadata, {"recording_id"}, "unnamed");
  std::string id = "urn:openscatter:";
  for (const char c : recording) {
    id += (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ? c : '-';
  }
  out["id"] = get(metadata, {"bird.id"}, id.c_str());
  out["type"] = "BRDF";
  out["timestamp"] = timestamp_of(metadata);
  Json provenance = section(metadata, "provenance", {"organization", "email", "contact_person"});
  provenance["location"] =
      section(metadata, "provenance.location", {"country", "city", "street", "building_nr", "postal_code"});
  out["provenance"] = std::move(provenance);
  out["description"] = get(metadata, {"bird.description"},
                           "BRDF converted by OpenScatter; see adhoc_section for its provenance.");
  out["method"] = measured ? "measurement" : "simulation";
  if (measured) {
    out["instrumentation"] = {
        {"name", get(metadata, {"bird.instrumentation.name", "instrument"}, "not stated")}};
  } else {
    out["instrumentation"] = "NA";
  }
  out["software"] = {{"name", "OpenScatter"}, {"version", get(metadata, {"software"}, "not stated")}};
  out["sample"] = {{"name", get(metadata, {"sample", "bird.sample.name"}, "not stated")}};
  out["environment"] = "NA";
  Json ours = Json::object();
  for (const auto& [key, value] : metadata) {
    ours[key] = value;
  }
  out["adhoc_section"] = {{"scatter", std::move(ours)}};
  return out;
}

class TextOfColumns {
 public:
  explicit TextOfColumns(const Columns& columns) : columns_(columns) {}

  std::string write(const std::string& metadata) {
    out_.reserve(columns_.rows.size() * 60 + metadata.size() + 4096);
    out_ += "{\"metadata\": ";
    out_ += metadata;
    out_ += ",\n\"data\": {";
    column("theta_i", "deg", [&](const Row& row) { out_ += columns_.theta_i[row.part]; });
    column("phi_i", "deg", [&](const Row& row) { out_ += columns_.phi_i[row.part]; });
    column("theta_r", "deg", [&](const Row& row) { out_ += columns_.theta_r[row.node]; });
    column("phi_r", "deg", [&](const Row& row) { out_ += columns_.phi_r[row.node]; });
    if (!columns_.wavelengths_nm.empty()) {
      column("wavelength_i", "nm", [&](const Row& row) { number(columns_.wavelengths_nm[row.channel]); });
    }
    if (const std::string p = get(columns_.metadata, {"polarization"}, "");
        p == "p" || p == "s" || p == "u") {
      out_ += "\n\"polarization_i\": {\"notation\": \"sp\", \"values\": [";
      list([&](const Row&) { out_ += fmt::format("\"{}\"", p); });
    }
    column("BRDF", "1/sr", [&](const Row& row) { number(columns_.f(row)); });
    if (columns_.random) {
      column("uBRDF", "1/sr",
             [&](const Row& row) { number(std::hypot(columns_.random(row), columns_.systematic(row))); });
    }
    adhoc();
    out_ += "}}\n";
    return std::move(out_);
  }

 private:
  void number(float value) { fmt::format_to(std::back_inserter(out_), "{}", value); }

  template <typename Append>
  void list(const Append& append) {
    for (std::size_t k = 0; k < columns_.rows.size(); ++k) {
      if (k > 0) {
        out_ += ',';
      }
      append(columns_.rows[k]);
    }
    out_ += "]},";
  }
  template <typename Append>
  void column(const char* name, const char* unit, const Append& append) {
    fmt::format_to(std::back_inserter(out_), "\n\"{}\": {{\"unit\": \"{}\", \"values\": [", name, unit);
    list(append);
  }
  template <typename Append>
  void variable(const char* name, const char* unit, const char* type, const char* description,
                const Append& append) {
    fmt::format_to(std::back_inserter(out_),
                   "\n\"{}\": {{\"description\": \"{}\", \"unit\": \"{}\", \"type\": \"{}\", \"values\": [",
                   name, description, unit, type);
    list(append);
  }

  void adhoc() {
    out_ += "\n\"adhoc_variables\": {";
    variable(
        "scatter_origin", "", "integer", "1 measured, 2 interpolated, 3 extrapolated",
        [&](const Row& row) { out_ += static_cast<char>('0' + static_cast<int>(columns_.origin(row))); });
    if (columns_.numbered) {
      variable("scatter_channel", "", "integer", "Number of the channel, from 0",
               [&](const Row& row) { out_ += std::to_string(row.channel); });
    }
    if (columns_.random) {
      variable("scatter_random", "1/sr", "number", "Standard uncertainty, random part",
               [&](const Row& row) { number(columns_.random(row)); });
      variable("scatter_systematic", "1/sr", "number", "Standard uncertainty, systematic part",
               [&](const Row& row) { number(columns_.systematic(row)); });
    }
    if (!columns_.rotation.empty()) {
      variable("scatter_rotation", "deg", "number", "Rotation of the sample during the measurement",
               [&](const Row& row) { out_ += columns_.rotation[row.part]; });
    }
    out_.back() = '}';  // In place of the last comma.
  }

  const Columns& columns_;
  std::string out_;
};

}  // namespace

Result<std::string> encode_bird(const Brdf& brdf, const EncodeOptions& options) {
  if (brdf.type() != reflectance::ScatterType::kBrdf) {
    return fail(ErrorCode::kInvalidArgument, "BiRD: transmission (BTDF), expected BRDF",
                "write EXR, Zemax or MiniDiff instead");
  }
  Columns columns;
  std::shared_ptr<const GridBrdf> grid;
  if (const auto* samples = dynamic_cast<const SampleListBrdf*>(&brdf)) {
    columns = columns_of(samples->samples());
  } else {
    auto made = normal_grid(brdf, options);
    if (!made) {
      return std::unexpected(made.error());
    }
    grid = std::move(*made);
    columns = columns_of(*grid);
  }
  columns.numbered = columns.wavelengths_nm.empty() && brdf.channels() > 1;
  columns.metadata = metadata_of(brdf, options);
  const std::string method =
      options.method.empty() ? get(columns.metadata, {"method"}, "measured") : options.method;
  const Json metadata = metadata_json(columns.metadata, method == "measured" || method == "measurement");
  return TextOfColumns(columns).write(metadata.dump(1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace scatter::formats
