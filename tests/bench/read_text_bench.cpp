// Text formats, from memory and from disk. The peer reads the file's bytes and does nothing with
// them: what the disk cache allows. libbsdf, for orientation: 45 MB/s on the same kind of file.
#include <cstdio>
#include <string>
#include <vector>

#include "host_sdk/formats/bird.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/formats/zemax.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_folder.h"

namespace scatter::bench {
namespace {

using reflectance::radians;
using reflectance::SpecularGridBrdf;

constexpr double kBytesPerMegabyte = 1e6;
constexpr double kRoundSeconds = 0.1;
constexpr const char* kSpec = "ggx:alpha=0.2/0.25/0.3,f0=0.04,albedo=0.3";

/// 4 incidences x 361 azimuths x 91 radials x 3 channels, four digits: what IS-SA exports.
std::string zemax_text() {
  SpecularGridBrdf::Content content;
  content.rotation = {0};
  for (const double deg : {0, 20, 40, 60}) {
    content.theta_i.push_back(radians(deg));
  }
  for (int deg = 0; deg <= 360; ++deg) {
    content.azimuth.push_back(radians(deg));
  }
  for (int deg = 0; deg <= 90; ++deg) {
    content.radial.push_back(radians(deg));
  }
  const std::size_t nodes = 4 * content.azimuth.size() * content.radial.size();
  // Values of every size, no two rows alike, so that no half repeats the other.
  for (std::size_t c = 0; c < 3; ++c) {
    auto& plane = content.f_per_sr.emplace_back(nodes);
    for (std::size_t n = 0; n < nodes; ++n) {
      plane[n] = 1e-4F * static_cast<float>((n * 2654435761U + c) % 1000003U);
    }
  }
  const auto grid = SpecularGridBrdf::make(std::move(content));
  return formats::encode_zemax(*grid, {.rgb_sections = true}).value();
}

/// decode: bytes -> Result of something; read: path -> Result of something.
template <typename Decode, typename Read>
std::vector<Figure> figures_of(const std::string& name, const std::string& text, const Decode& decode,
                               const Read& read) {
  const BenchFolder folder("scatter-bench-" + name);
  const auto path = folder.file("data");
  if (!formats::write_file(path, text)) {
    std::fprintf(stderr, "%s: cannot write %s\n", name.c_str(), path.c_str());
    return {};
  }
  const auto contest = [&](const char* where, const std::function<void()>& ours) {
    return run_contest(name + where, {.unit = "MB/s",
                                      .work = static_cast<double>(text.size()) / kBytesPerMegabyte,
                                      .ours = ours,
                                      .peer = "bare read of the file",
                                      .theirs = [&] { keep(formats::read_file(path)->size()); },
                                      .round_seconds = kRoundSeconds});
  };
  return {contest(".memory", [&] { keep(decode(text).has_value()); }),
          contest(".disk", [&] { keep(read(path).has_value()); })};
}

std::vector<Figure> zemax_figures() {
  return figures_of(
      "read.zemax", zemax_text(), [](const auto& text) { return formats::decode_zemax(text, "bench"); },
      [](const auto& path) { return formats::read_zemax(path); });
}

std::vector<Figure> minidiff_figures() {
  const auto grid = reflectance::sample_on_grid(*reflectance::make_model(kSpec).value(), {}).value();
  return figures_of(
      "read.minidiff", formats::encode_minidiff(grid).value(),
      [](const auto& text) { return formats::decode_minidiff(text, "bench"); },
      [](const auto& path) { return formats::read_minidiff(path); });
}

std::vector<Figure> bird_figures() {
  const auto grid = reflectance::sample_on_grid(*reflectance::make_model(kSpec).value(), {}).value();
  return figures_of(
      "read.bird", formats::encode_bird(grid).value(),
      [](const auto& text) { return formats::decode_bird(text, "bench"); },
      [](const auto& path) { return formats::open_brdf(path.string()); });
}

const Benchmark kZemax{"read.zemax", zemax_figures};
const Benchmark kMiniDiff{"read.minidiff", minidiff_figures};
const Benchmark kBird{"read.bird", bird_figures};

}  // namespace
}  // namespace scatter::bench
