#include "simulator/corrosion/sheet.h"

#include <fmt/core.h>
#include <sodium.h>

#include <algorithm>
#include <array>
#include <bit>

namespace scatter::corrosion {

std::string hash(const Sheet& sheet) {
  static_assert(std::endian::native == std::endian::little, "heights are hashed as they lie in memory");
  std::array<unsigned char, 16> digest{};
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, digest.size());
  crypto_generichash_update(&state, reinterpret_cast<const unsigned char*>(sheet.height.data()),
                            sheet.height.size() * sizeof(float));
  crypto_generichash_update(&state, reinterpret_cast<const unsigned char*>(sheet.state.data()),
                            sheet.state.size());
  crypto_generichash_final(&state, digest.data(), digest.size());
  std::string text;
  for (const unsigned char byte : digest) {
    text += fmt::format("{:02x}", byte);
  }
  return text;
}

}  // namespace scatter::corrosion
