// A target that fails on one kind of input: the replay driver must find it, starting from a seed
// that is good, and end with an error.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // The seed is this file's first line; only a cut or an edit of it reaches abort().
  constexpr char kBegin[] = "// A target that";
  constexpr std::size_t kLength = sizeof kBegin - 1;
  if (size > kLength && std::memcmp(data, kBegin, kLength) == 0 && data[kLength] != ' ') {
    std::abort();
  }
  return 0;
}
