// Writing files. EXR tiles: 7 tiles of 360 x 180, from a grid of four incidences through the default
// chain of estimators; the peer writes the finished image with OpenEXR, on as many threads. Others:
// the peer writes the same bytes to a file.
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/merl.h"
#include "host_sdk/formats/native_exr.h"
#include "host_sdk/formats/rgl.h"
#include "host_sdk/reflectance/estimators/chain.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_folder.h"
#include "tests/bench/exr_peer.h"

namespace scatter::bench {
namespace {

using reflectance::Brdf;
using reflectance::radians;

constexpr double kBytesPerMegabyte = 1e6;
constexpr double kRoundSeconds = 0.2;

/// What the instrument gives: four incidences, 1 deg, theta_o up to 75 deg.
std::shared_ptr<const reflectance::GridBrdf> measured() {
  reflectance::GridLayout layout;
  layout.theta_count = 76;
  const auto model = reflectance::make_model("ggx:alpha=0.2/0.25/0.3,f0=0.04,albedo=0.3").value();
  return std::make_shared<const reflectance::GridBrdf>(reflectance::sample_on_grid(*model, layout).value());
}

std::vector<Figure> exr_tiles_figures() {
  const auto chain = reflectance::default_chain(measured());
  if (!chain) {
    std::fprintf(stderr, "write.exr_tiles: %s\n", chain.error().what.c_str());
    return {};
  }
  formats::ExrTilesOptions options;
  for (const double deg : {0, 10, 20, 30, 40, 50, 60}) {
    options.theta_i.push_back(radians(deg));
  }
  ExrImage image(formats::encode_exr_tiles(*chain->brdf, options).value());
  return {run_contest("write.exr_tiles",
                      {.unit = "images/s",
                       .work = 1,
                       .ours = [&] { keep(formats::encode_exr_tiles(*chain->brdf, options)->size()); },
                       .peer = "OpenEXR alone",
                       .theirs = [&] { keep(image.write().size()); },
                       .round_seconds = kRoundSeconds})};
}

/// ours: writes its file; the same bytes are the peer's.
template <typename Ours>
Figure against_bare_write(const char* name, const BenchFolder& folder, const std::string& bytes,
                          const Ours& ours) {
  return run_contest(name,
                     {.unit = "MB/s",
                      .work = static_cast<double>(bytes.size()) / kBytesPerMegabyte,
                      .ours = [&] { keep(ours(folder.file("ours")).has_value()); },
                      .peer = "bare write of the file",
                      .theirs = [&] { keep(formats::write_file(folder.file("peer"), bytes).has_value()); },
                      .round_seconds = kRoundSeconds});
}

std::vector<Figure> native_exr_figures() {
  const BenchFolder folder("scatter-bench-write-native");
  const auto grid = measured();
  return {against_bare_write("write.native_exr", folder, formats::encode_native_exr(*grid).value(),
                             [&](const auto& path) { return formats::write_native_exr(*grid, path); })};
}

std::vector<Figure> merl_figures() {
  const BenchFolder folder("scatter-bench-write-merl");
  const auto grid = measured();
  const std::string bytes = formats::encode_merl(*grid).value();
  const auto table = formats::decode_merl(bytes, "table").value();
  return {against_bare_write("write.merl", folder, bytes,
                             [&](const auto& path) { return formats::write_merl(table, path); }),
          against_bare_write("write.merl.from_grid", folder, bytes,
                             [&](const auto& path) { return formats::write_merl(*grid, path); })};
}

std::vector<Figure> rgl_figures() {
  const BenchFolder folder("scatter-bench-write-rgl");
  const auto grid = measured();
  const std::string bytes = formats::encode_rgl(*grid).value();
  const auto material = formats::decode_rgl(bytes, "material").value();
  return {against_bare_write("write.rgl", folder, bytes,
                             [&](const auto& path) { return formats::write_rgl(material, path); }),
          against_bare_write("write.rgl.from_grid", folder, bytes,
                             [&](const auto& path) { return formats::write_rgl(*grid, path); })};
}

const Benchmark kExrTiles{"write.exr_tiles", exr_tiles_figures};
const Benchmark kNativeExr{"write.native_exr", native_exr_figures};
const Benchmark kMerl{"write.merl", merl_figures};
const Benchmark kRgl{"write.rgl", rgl_figures};

}  // namespace
}  // namespace scatter::bench
