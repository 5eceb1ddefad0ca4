#include "firmware/boards/mps2_an500/image_verifier.h"

#include <cstddef>
#include <new>

#include "firmware/crypto/sodium_verifier.h"

namespace scatter::firmware::mps2_an500 {

Verifier* image_verifier() noexcept {
  // Made here and not at start-up: its keys are known to the linker only.
  alignas(SodiumVerifier) static constinit std::byte memory[sizeof(SodiumVerifier)]{};
  static constinit SodiumVerifier* made = nullptr;
  if (made == nullptr) {
    made = new (memory) SodiumVerifier();
  }
  return made;
}

}  // namespace scatter::firmware::mps2_an500
