// Runs the tests under QEMU when QEMU and the images are there. Without them: 77, which ctest calls skipped,
// unless $CI is set: then they must be there.
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>

#include "tests/emulator/rig.h"

int main(int argc, char** argv) {
  constexpr int kSkipped = 77;
  const auto files = scatter::emulator::firmware_files();
  const bool qemu = std::system("command -v qemu-system-arm > /dev/null") == 0;
  if (!files || !qemu) {
    const bool must = std::getenv("CI") != nullptr;
    std::fprintf(stderr, "%s: %s\n", must ? "error" : "skipped",
                 qemu ? (files.error().what + "; " + files.error().remedy).c_str()
                      : "qemu-system-arm is not installed (Debian: apt install qemu-system-arm)");
    return must ? 1 : kSkipped;
  }
  return Catch::Session().run(argc, argv);
}
