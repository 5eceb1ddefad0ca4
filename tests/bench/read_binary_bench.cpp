// Reading binary files, from disk to a BRDF that answers. The peer reads the file's bytes and does
// nothing with them; for EXR tiles it is OpenEXR, which unpacks them.
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/merl.h"
#include "host_sdk/formats/native_exr.h"
#include "host_sdk/formats/rgl.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_folder.h"
#include "tests/bench/exr_peer.h"

namespace scatter::bench {
namespace {

constexpr double kBytesPerMegabyte = 1e6;
constexpr double kRoundSeconds = 0.1;
constexpr const char* kSpec = "ggx:alpha=0.2/0.25/0.3,f0=0.04,albedo=0.3";

/// read: path -> Result of something.
template <typename Read>
Figure against_bare_read(const char* name, const std::string& bytes, const Read& read) {
  const BenchFolder folder(std::string("scatter-bench-") + name);
  const auto path = folder.file("data");
  if (!formats::write_file(path, bytes)) {
    std::fprintf(stderr, "%s: cannot write %s\n", name, path.c_str());
  }
  return run_contest(name, {.unit = "MB/s",
                            .work = static_cast<double>(bytes.size()) / kBytesPerMegabyte,
                            .ours = [&] { keep(read(path).has_value()); },
                            .peer = "bare read of the file",
                            .theirs = [&] { keep(formats::read_file(path)->size()); },
                            .round_seconds = kRoundSeconds});
}

std::vector<Figure> merl_figures() {
  const std::string bytes = formats::encode_merl(*reflectance::make_model(kSpec).value()).value();
  return {against_bare_read("read.merl", bytes, [](const auto& path) { return formats::read_merl(path); })};
}

std::vector<Figure> rgl_figures() {
  reflectance::AdaptOptions options;
  // As many incidences as the files of the RGL database have.
  for (const double deg : {0, 28, 40, 51, 60, 70, 79, 89}) {
    options.theta_i.push_back(reflectance::radians(deg));
  }
  const std::string bytes = formats::encode_rgl(*reflectance::make_model(kSpec).value(), options).value();
  return {against_bare_read("read.rgl", bytes, [](const auto& path) { return formats::read_rgl(path); })};
}

std::vector<Figure> native_exr_figures() {
  const auto model = reflectance::make_model(kSpec).value();
  const auto grid = reflectance::sample_on_grid(*model, {}).value();
  return {against_bare_read("read.native_exr", formats::encode_native_exr(grid).value(),
                            [](const auto& path) { return formats::read_native_exr(path); })};
}

std::vector<Figure> exr_tiles_figures() {
  const auto model = reflectance::make_model(kSpec).value();
  formats::ExrTilesOptions options;
  for (int k = 0; k < 7; ++k) {
    options.theta_i.push_back(reflectance::radians(10.0 * k));
  }
  const std::string bytes = formats::encode_exr_tiles(*model, options).value();
  ExrImage image(bytes);
  return {run_contest("read.exr_tiles",
                      {.unit = "images/s",
                       .work = 1,
                       .ours = [&] { keep(formats::decode_exr_tiles(bytes, "tiles").has_value()); },
                       .peer = "OpenEXR alone",
                       .theirs = [&] { image.read(bytes); },
                       .round_seconds = kRoundSeconds})};
}

const Benchmark kMerl{"read.merl", merl_figures};
const Benchmark kRgl{"read.rgl", rgl_figures};
const Benchmark kNativeExr{"read.native_exr", native_exr_figures};
const Benchmark kExrTiles{"read.exr_tiles", exr_tiles_figures};

}  // namespace
}  // namespace scatter::bench
