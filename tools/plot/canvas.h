// A page to draw on, in memory, as PNG or SVG.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "tools/plot/colour_map.h"

using cairo_t = struct _cairo;
using cairo_surface_t = struct _cairo_surface;

namespace scatter::plot {

enum class ImageKind { kPng, kSvg };

/// By the extension, whatever its case. Errors: kInvalidArgument for any other extension.
[[nodiscard]] Result<ImageKind> image_kind(std::string_view path);

enum class Theme { kLight, kDark };

/// Colours of a theme.
struct Palette {
  Colour background;
  Colour text;
  Colour faint;  ///< Secondary text.
  Colour line;   ///< Grid lines, frames.
};
[[nodiscard]] const Palette& palette(Theme theme) noexcept;

/// One colour per channel: red, green and blue where these tell up to three channels apart, else a ramp
/// from violet (the shortest wavelength, or the first channel) to red with neighbours of unlike lightness.
/// `wavelengths_nm` has one per channel or is empty.
[[nodiscard]] std::vector<Colour> channel_colours(std::span<const float> wavelengths_nm, std::size_t channels,
                                                  Theme theme);
/// "R 630 nm", "channel 2", "luminance".
[[nodiscard]] std::string channel_name(double wavelength_nm, std::size_t channel, std::size_t channels);

/// One page. Not thread-safe itself; different pages may be drawn from different threads.
class Canvas {
 public:
  /// Size in user units (a pixel at scale 1; points in SVG). Errors: kInvalidArgument for a size
  /// outside 1..20000 pixels, kResourceExhausted without memory.
  [[nodiscard]] static Result<Canvas> make(ImageKind kind, double width, double height, double scale);

  [[nodiscard]] cairo_t* context() const noexcept { return context_.get(); }
  void set(const Colour& colour) const;
  void fill_page(const Colour& colour) const;

  /// Text with its baseline at y; align 0 starts at x, 0.5 is centred there, 1 ends there.
  struct Text {
    double size = 12;
    double align = 0;
    bool bold = false;
    Colour colour;
  };
  void text(double x, double y, const std::string& words, const Text& style) const;
  [[nodiscard]] double text_width(const std::string& words, double size, bool bold) const;

  /// The file's bytes. Errors: kInternal with the drawing library's words.
  [[nodiscard]] Result<std::string> finish() &&;

 private:
  struct CloseContext {
    void operator()(cairo_t* context) const noexcept;
  };
  struct CloseSurface {
    void operator()(cairo_surface_t* surface) const noexcept;
  };
  ImageKind kind_ = ImageKind::kPng;
  double width_ = 0;
  double height_ = 0;
  std::unique_ptr<std::string> bytes_;  // outlives the surface, which writes into it
  std::unique_ptr<cairo_surface_t, CloseSurface> surface_;
  std::unique_ptr<cairo_t, CloseContext> context_;
};

}  // namespace scatter::plot
