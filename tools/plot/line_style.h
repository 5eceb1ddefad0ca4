// How the lines of a picture of curves are told apart, and the key that says so.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "tools/plot/canvas.h"
#include "tools/plot/incidence.h"

namespace scatter::plot {

struct LineStyle {
  Colour colour;
  std::size_t dash = 0;  ///< 0 is an unbroken line; there are kDashes kinds.
  double width = 1.5;
};
inline constexpr std::size_t kDashes = 8;

/// Opacity of a line where nothing was measured.
inline constexpr double kPaleOpacity = 0.42;

void set_dash(const Canvas& canvas, std::size_t dash);
/// A triangle with its tip at (x, y): a share of the light in this direction alone.
void draw_dirac_mark(const Canvas& canvas, double x, double y, const Colour& colour);

/// "630 nm"; with the BRDF's name in front where `several`.
[[nodiscard]] std::string line_name(const NamedBrdf& named, std::size_t channel, bool several);

/// One per line, styles[brdf][channel]. Channels differ by colour, BRDFs by the kind of line; more than three
/// channels of a single BRDF differ by the kind of line too.
[[nodiscard]] std::vector<std::vector<LineStyle>> line_styles(std::span<const NamedBrdf> brdfs,
                                                              std::span<const std::vector<std::size_t>> drawn,
                                                              Theme theme);

/// The key under the curves.
class LineKey {
 public:
  struct Entry {
    enum class Kind { kLine, kBand, kPale, kDirac };
    std::string words;
    LineStyle style;
    Kind kind = Kind::kLine;
  };
  /// Entries side by side in lines of at most `width`.
  LineKey(const Canvas& canvas, std::vector<Entry> entries, double width);

  [[nodiscard]] double height() const noexcept;
  void draw(const Canvas& canvas, double x, double y, const Colour& text) const;

 private:
  std::vector<std::vector<Entry>> rows_;
  std::vector<std::vector<double>> starts_;
};

/// Entries for the lines: channels and BRDFs apart where all BRDFs have the same channels, else every line.
[[nodiscard]] std::vector<LineKey::Entry> line_entries(std::span<const NamedBrdf> brdfs,
                                                       std::span<const std::vector<std::size_t>> drawn,
                                                       std::span<const std::vector<LineStyle>> styles,
                                                       const Colour& text);

}  // namespace scatter::plot
