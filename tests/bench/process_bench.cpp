// Processing a recording: frames read, checked, merged, referenced, resampled, judged. The peer is
// memcpy of the same raw frames: what touching every byte once costs.
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "host_sdk/device/device.h"
#include "host_sdk/measurement/measure.h"
#include "tests/bench/bench.h"
#include "tools/sim_scheme/sim_scheme.h"

extern char** environ;

namespace scatter::bench {
namespace {

namespace fs = std::filesystem;

constexpr double kBytesPerMegabyte = 1e6;
constexpr double kMemoryLimit_MB = 300;
constexpr std::uint16_t kManySweeps = 16;

/// A folder that goes with the benchmark.
class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / "scatter-bench-process") { fs::create_directories(path_); }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] fs::path file(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

/// Records a simulated measurement with its calibration; 0 sweeps = the standard measurement.
bool record(const fs::path& file, std::uint16_t sweeps) {
  device::TransportRegistry registry;
  tools::register_sim_scheme(registry);
  device::OpenOptions open;
  open.registry = &registry;
  auto device = device::Device::open("sim:?sample=ggx:alpha=0.2,f0=0.04,albedo=0.3&seed=1", open);
  if (!device) {
    std::fprintf(stderr, "process.throughput: %s\n", device.error().what.c_str());
    return false;
  }
  measurement::MeasureOptions options;
  options.recording = file;
  options.use_library = false;
  options.repeats = sweeps;
  options.time_budget_ms = sweeps == 0 ? 0 : 60'000;
  const auto result = measurement::measure(*device, options);
  if (!result) {
    std::fprintf(stderr, "process.throughput: %s\n", result.error().what.c_str());
  }
  return result.has_value();
}

Figure throughput(const char* name, const fs::path& file) {
  const auto first = measurement::process(file, {});
  const std::size_t bytes = first ? first->raw_bytes : 0;
  const std::vector<std::byte> source(bytes, std::byte{1});
  std::vector<std::byte> copy(bytes);
  return run_contest(name, {.unit = "MB/s",
                            .work = static_cast<double>(bytes) / kBytesPerMegabyte,
                            .ours = [&] { keep(measurement::process(file, {}).has_value()); },
                            .peer = "memcpy",
                            .theirs =
                                [&] {
                                  std::memcpy(copy.data(), source.data(), bytes);
                                  keep(copy.data());
                                },
                            .round_seconds = 0.1});
}

/// VmHWM of a running process; 0 when it is gone.
double high_water_MB(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/status");
  std::string word;
  while (file >> word) {
    if (word == "VmHWM:") {
      double kib = 0;
      file >> kib;
      return kib * 1024 / kBytesPerMegabyte;
    }
  }
  return 0;
}

/// Peak memory of `scatter process` as a process of its own, pictures and report included.
double peak_memory_MB(const fs::path& file, const fs::path& results) {
  const std::string program = (fs::read_symlink("/proc/self/exe").parent_path() / "scatter").string();
  std::vector<std::string> words{program, "process", file.string(), "-o", results.string(), "--json"};
  std::vector<char*> arguments;
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", 1, 0);
  pid_t child = 0;
  const int failed = posix_spawn(&child, program.c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    return 0;
  }
  // Its own peak, read while it runs: the peak that wait4 tells includes the parent's from before exec.
  double peak_MB = 0;
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    peak_MB = std::max(peak_MB, high_water_MB(child));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return status == 0 ? peak_MB : 0;
}

std::vector<Figure> process_figures() {
  const Folder folder;
  std::vector<Figure> figures;
  if (!record(folder.file("many.scat"), kManySweeps) || !record(folder.file("standard.scat"), 0)) {
    return figures;
  }
  figures.push_back(throughput("process.throughput", folder.file("many.scat")));
  figures.push_back(throughput("process.throughput.standard", folder.file("standard.scat")));
  const double memory = peak_memory_MB(folder.file("many.scat"), folder.file("results"));
  if (memory > 0) {
    figures.push_back(make_figure("process.memory", memory, "MB", "limit", kMemoryLimit_MB, Better::kLower));
  }
  return figures;
}

const Benchmark kProcess{"process", process_figures};

}  // namespace
}  // namespace scatter::bench
