// Treatments of copper from text: refused with words, or done so that layers stay layers.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "simulator/corrosion/patina/script.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace scatter::corrosion;
  const std::string_view text(reinterpret_cast<const char*>(data), std::min<std::size_t>(size, 400));
  const auto steps = script_from(text);
  if (!steps) {
    if (steps.error().what.empty() || steps.error().remedy.empty()) {
      std::abort();
    }
    return 0;
  }
  auto stack = LayerStack::bare(8, 0.4);
  if (!stack) {
    std::abort();
  }
  const auto done = apply(*stack, *steps, 1);
  if (!done && done.error().what.empty()) {
    std::abort();
  }
  for (const PatinaLayer& layer : stack->layers()) {
    if (!std::ranges::all_of(layer.thickness_um, [](float um) { return um >= 0 && std::isfinite(um); })) {
      std::abort();
    }
  }
  return 0;
}
