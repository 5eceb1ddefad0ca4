// Feeds a fuzz target without libFuzzer: its seeds, truncations and mutations of them, random bytes.
// The inputs are the same on every run; a failing one is left in a file named in the message.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kRandomInputs = 1000;
constexpr std::size_t kMutations = 2000;
constexpr std::size_t kLongestRandom = 4096;
constexpr std::size_t kLongestSeed = 1 << 20;  // Longer files say nothing new and take long.

// What the signal handler needs; it may touch nothing that allocates.
const std::uint8_t* current_data = nullptr;
std::size_t current_size = 0;
char failure_path[512] = "fuzz_failure.bin";

void write_all(int file, const void* data, std::size_t size) {
  const auto* bytes = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = ::write(file, bytes, size);
    if (written <= 0) {
      return;
    }
    bytes += written;
    size -= static_cast<std::size_t>(written);
  }
}

extern "C" void keep_failing_input(int signal_number) {
  const int file = ::open(failure_path, O_CREAT | O_TRUNC | O_WRONLY, 0644);
  if (file >= 0) {
    write_all(file, current_data, current_size);
    ::close(file);
  }
  constexpr char kMessage[] = "\nthe input that failed is in ";
  write_all(STDERR_FILENO, kMessage, sizeof kMessage - 1);
  write_all(STDERR_FILENO, failure_path, std::char_traits<char>::length(failure_path));
  write_all(STDERR_FILENO, "\n", 1);
  std::signal(signal_number, SIG_DFL);
  std::raise(signal_number);
}

void run_one(const Bytes& input) {
  // A buffer of exactly this size, so that a sanitizer sees a read of one byte too many.
  const Bytes exact(input.begin(), input.end());
  current_data = exact.data();
  current_size = exact.size();
  LLVMFuzzerTestOneInput(exact.data(), exact.size());
  current_size = 0;
}

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  Bytes bytes(std::istreambuf_iterator<char>(file), {});
  bytes.resize(std::min(bytes.size(), kLongestSeed));
  return bytes;
}

// Files named, and files in folders named, sorted: the order decides the mutations.
std::vector<Bytes> read_seeds(int count, char** names) {
  std::vector<std::filesystem::path> paths;
  for (int i = 1; i < count; ++i) {
    std::error_code ignored;
    if (std::filesystem::is_directory(names[i], ignored)) {
      for (const auto& entry : std::filesystem::directory_iterator(names[i])) {
        paths.push_back(entry.path());
      }
    } else if (std::filesystem::is_regular_file(names[i], ignored)) {
      paths.emplace_back(names[i]);
    }
  }
  std::sort(paths.begin(), paths.end());
  std::vector<Bytes> seeds;
  for (const auto& path : paths) {
    seeds.push_back(read_file(path));
  }
  return seeds;
}

class Mutator {
 public:
  std::size_t below(std::size_t bound) {
    return bound == 0 ? 0 : static_cast<std::size_t>(engine_() % bound);
  }
  std::uint8_t byte() { return static_cast<std::uint8_t>(engine_()); }

  Bytes random(std::size_t longest) {
    Bytes bytes(below(longest + 1));
    std::generate(bytes.begin(), bytes.end(), [this] { return byte(); });
    return bytes;
  }

  // One to four edits: flip a bit, set a byte to a boundary value, cut, insert, repeat a piece.
  Bytes mutate(Bytes bytes) {
    for (std::size_t edits = 1 + below(4); edits > 0; --edits) {
      const std::size_t at = below(bytes.size());
      switch (below(6)) {
        case 0:
          if (!bytes.empty()) {
            bytes[at] ^= static_cast<std::uint8_t>(1U << below(8));
          }
          break;
        case 1:
          if (!bytes.empty()) {
            constexpr std::uint8_t kBoundaries[] = {0, 1, 0x7F, 0x80, 0xFE, 0xFF, '\n', '-'};
            bytes[at] = kBoundaries[below(std::size(kBoundaries))];
          }
          break;
        case 2:
          bytes.resize(at);
          break;
        case 3:
          bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), byte());
          break;
        case 4:
          if (!bytes.empty()) {
            bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
          }
          break;
        default: {
          const std::size_t length = below(std::min<std::size_t>(bytes.size() - at, 64) + 1);
          const Bytes piece(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                            bytes.begin() + static_cast<std::ptrdiff_t>(at + length));
          bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), piece.begin(), piece.end());
        }
      }
    }
    return bytes;
  }

 private:
  std::mt19937_64 engine_{20260101};
};

}  // namespace

int main(int argc, char** argv) {
  const std::string own_name = std::filesystem::path(argv[0]).filename().string();
  std::snprintf(failure_path, sizeof failure_path, "%s_failure.bin", own_name.c_str());
  for (const int signal_number : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL}) {
    std::signal(signal_number, keep_failing_input);
  }
  const std::vector<Bytes> seeds = read_seeds(argc, argv);
  Mutator mutator;
  std::size_t inputs = 0;
  const auto run = [&](const Bytes& input) {
    run_one(input);
    ++inputs;
  };
  run({});
  for (const Bytes& seed : seeds) {
    run(seed);
    // Cut at evenly spaced places, and one byte short: where readers forget to look.
    for (std::size_t cut = 1; cut <= 64 && !seed.empty(); ++cut) {
      run(Bytes(seed.begin(), seed.begin() + static_cast<std::ptrdiff_t>(seed.size() * cut / 65)));
    }
    if (!seed.empty()) {
      run(Bytes(seed.begin(), seed.end() - 1));
    }
  }
  for (std::size_t i = 0; i < kRandomInputs; ++i) {
    run(mutator.random(i < kRandomInputs / 2 ? 64 : kLongestRandom));
  }
  // Long seeds get fewer mutations, so that a program stays within seconds.
  std::size_t budget_bytes = std::size_t{64} << 20;
  for (std::size_t i = 0; i < kMutations && !seeds.empty(); ++i) {
    const Bytes& seed = seeds[mutator.below(seeds.size())];
    if (seed.size() > budget_bytes) {
      break;
    }
    budget_bytes -= seed.size();
    run(mutator.mutate(seed));
  }
  std::printf("%s: %zu inputs, %zu of them seeds\n", own_name.c_str(), inputs, seeds.size());
  return 0;
}
