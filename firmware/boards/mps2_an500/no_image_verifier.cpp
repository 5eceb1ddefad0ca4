#include "firmware/boards/mps2_an500/image_verifier.h"

namespace scatter::firmware::mps2_an500 {

Verifier* image_verifier() noexcept {
  return nullptr;
}

}  // namespace scatter::firmware::mps2_an500
