// Reading binary files, from disk to a BRDF that answers. The peer reads the file's bytes and does
// nothing with them; for EXR tiles it is OpenEXR, which unpacks them.
#include <fcntl.h>
#include <unistd.h>
#if __has_include(<malloc.h>)
#include <malloc.h>
#endif

#include <cstdio>
#include <filesystem>
#include <fstream>
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

/// Whoever reads a file and keeps what came of it needs memory that the system has yet to give, and that
/// costs more than copying a file's bytes from the system's cache. malloc hands the memory of one round
/// to the next one, which hides this, unless it is told to return it.
void return_memory() {
#if defined(__GLIBC__)
  ::malloc_trim(0);
#endif
}

/// The system forgets the file's contents, so that the next read comes from the disk.
void forget_file(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file >= 0) {
    (void)::fdatasync(file);
    (void)::posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED);
    ::close(file);
  }
}

/// Three readings of "the speed of a bare read": `name` reads files and keeps what came of them, both
/// sides in memory new to the program, but for the 4 MiB that shared_block.h keeps for the next reader;
/// `name.disk` the same for one file that the system has not cached; `name.one_buffer` lets the bare read
/// fill the same warm buffer again and again, which no reader that gives anything away can, and ours reuse
/// what malloc has. read: path -> Result of something.
template <typename Read>
std::vector<Figure> against_bare_read(const std::string& name, const std::string& bytes, std::size_t kept,
                                      const Read& read) {
  const BenchFolder folder("scatter-bench-" + name);
  const auto path = folder.file("data");
  if (!formats::write_file(path, bytes)) {
    std::fprintf(stderr, "%s: cannot write %s\n", name.c_str(), path.c_str());
  }
  const auto keep_all = [kept, &path](const auto& read_one) {
    {
      std::vector<decltype(read_one(path))> all;
      for (std::size_t k = 0; k < kept; ++k) {
        all.push_back(read_one(path));
        keep(all.back().has_value());
      }
    }
    return_memory();
  };
  const auto bare = [](const auto& file) { return formats::read_file(file); };
  std::vector<char> buffer(bytes.size());
  const double megabytes = static_cast<double>(bytes.size()) / kBytesPerMegabyte;
  return {run_contest(name, {.unit = "MB/s",
                             .work = megabytes * static_cast<double>(kept),
                             .ours = [&] { keep_all(read); },
                             .peer = "bare read into new memory",
                             .theirs = [&] { keep_all(bare); },
                             .round_seconds = kRoundSeconds}),
          run_contest(name + ".disk", {.unit = "MB/s",
                                       .work = megabytes,
                                       .ours =
                                           [&] {
                                             forget_file(path);
                                             keep(read(path).has_value());
                                           },
                                       .peer = "bare read from the disk",
                                       .theirs =
                                           [&] {
                                             forget_file(path);
                                             keep(bare(path).has_value());
                                           },
                                       .round_seconds = kRoundSeconds}),
          run_contest(name + ".one_buffer", {.unit = "MB/s",
                                             .work = megabytes,
                                             .ours = [&] { keep(read(path).has_value()); },
                                             .peer = "bare read into one buffer",
                                             .theirs =
                                                 [&] {
                                                   std::ifstream in;
                                                   in.rdbuf()->pubsetbuf(nullptr, 0);
                                                   in.open(path, std::ios::binary);
                                                   in.read(buffer.data(),
                                                           static_cast<std::streamsize>(buffer.size()));
                                                   keep(in.gcount());
                                                 },
                                             .round_seconds = kRoundSeconds})};
}

std::vector<Figure> merl_figures() {
  const std::string bytes = formats::encode_merl(*reflectance::make_model(kSpec).value()).value();
  return against_bare_read("read.merl", bytes, 1, [](const auto& path) { return formats::read_merl(path); });
}

std::vector<Figure> rgl_figures() {
  reflectance::AdaptOptions options;
  // As many incidences as the files of the RGL database have.
  for (const double deg : {0, 28, 40, 51, 60, 70, 79, 89}) {
    options.theta_i.push_back(reflectance::radians(deg));
  }
  const std::string bytes = formats::encode_rgl(*reflectance::make_model(kSpec).value(), options).value();
  return against_bare_read("read.rgl", bytes, 128, [](const auto& path) { return formats::read_rgl(path); });
}

std::vector<Figure> native_exr_figures() {
  const auto model = reflectance::make_model(kSpec).value();
  const auto grid = reflectance::sample_on_grid(*model, {}).value();
  return against_bare_read("read.native_exr", formats::encode_native_exr(grid).value(), 1,
                           [](const auto& path) { return formats::read_native_exr(path); });
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
