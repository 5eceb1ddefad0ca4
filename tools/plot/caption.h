// Sentences of a picture: what it cannot show and what was left out, in the picture and for the answer.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "tools/plot/canvas.h"
#include "tools/plot/incidence.h"

namespace scatter::plot {

/// "12 of 13 incidences drawn; left out: θᵢ = 70°"; empty when all were drawn.
[[nodiscard]] std::string left_out(const std::string& what, std::span<const std::string> names,
                                   std::span<const std::size_t> drawn);

/// What leaves in one direction alone, which no value of f can show; empty without such a share at these
/// incidences.
[[nodiscard]] std::string dirac_note(const NamedBrdf& named, std::span<const Incidence> incidences);

/// Lines of small text, broken between words so that none is wider than `width` where its words allow it.
class Caption {
 public:
  Caption(const Canvas& canvas, std::span<const std::string> sentences, double width);

  [[nodiscard]] double height() const noexcept { return kLine * double(lines_.size()); }
  /// The first line's baseline lies at y.
  void draw(const Canvas& canvas, double x, double y, const Colour& colour) const;

 private:
  static constexpr double kLine = 16;
  std::vector<std::string> lines_;
};

}  // namespace scatter::plot
