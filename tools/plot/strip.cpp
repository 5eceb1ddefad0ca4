#include "tools/plot/strip.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "tools/plot/canvas.h"

namespace scatter::plot {
namespace {

constexpr std::size_t kMostInRow = 10;
constexpr double kMargin = 12;
constexpr double kCaption = 26;
constexpr double kTitle = 30;

struct FreeSurface {
  void operator()(cairo_surface_t* surface) const noexcept { cairo_surface_destroy(surface); }
};

void paint(const Canvas& canvas, const StripTile& tile, double x, double y) {
  const int stride = cairo_format_stride_for_width(CAIRO_FORMAT_RGB24, static_cast<int>(tile.width));
  std::vector<std::uint32_t> pixels(static_cast<std::size_t>(stride) / 4 * tile.height);
  for (std::size_t n = 0; n < tile.width * tile.height; ++n) {
    const std::uint8_t* const rgb = &tile.rgb[3 * n];
    pixels[n / tile.width * (static_cast<std::size_t>(stride) / 4) + n % tile.width] =
        std::uint32_t{rgb[0]} << 16U | std::uint32_t{rgb[1]} << 8U | rgb[2];
  }
  const std::unique_ptr<cairo_surface_t, FreeSurface> surface(cairo_image_surface_create_for_data(
      reinterpret_cast<unsigned char*>(pixels.data()), CAIRO_FORMAT_RGB24, static_cast<int>(tile.width),
      static_cast<int>(tile.height), stride));
  cairo_set_source_surface(canvas.context(), surface.get(), x, y);
  cairo_paint(canvas.context());
  // The page keeps no reference to the pixels.
  cairo_set_source_rgb(canvas.context(), 0, 0, 0);
}

}  // namespace

Result<std::string> strip(std::span<const StripTile> tiles, const std::string& title) {
  std::size_t width = 0;
  std::size_t height = 0;
  for (const StripTile& tile : tiles) {
    if (tile.width < 1 || tile.height < 1 || tile.rgb.size() != tile.width * tile.height * 3) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("'{}': {} x {} pixels in {} bytes", tile.caption, tile.width, tile.height,
                              tile.rgb.size()),
                  "give three bytes per pixel");
    }
    width = std::max(width, tile.width);
    height = std::max(height, tile.height);
  }
  if (tiles.empty()) {
    return fail(ErrorCode::kInvalidArgument, "no pictures for a strip", "give at least one");
  }
  const std::size_t columns = std::min(tiles.size(), kMostInRow);
  const std::size_t rows = (tiles.size() + columns - 1) / columns;
  const double step_x = static_cast<double>(width) + kMargin;
  const double step_y = static_cast<double>(height) + kCaption + kMargin;
  const double top = title.empty() ? kMargin : kTitle + kMargin / 2;
  auto canvas = Canvas::make(ImageKind::kPng, kMargin + static_cast<double>(columns) * step_x,
                             top + static_cast<double>(rows) * step_y, 1);
  if (!canvas) {
    return std::unexpected(canvas.error());
  }
  const Palette& colours = palette(Theme::kLight);
  canvas->fill_page(colours.background);
  if (!title.empty()) {
    canvas->text(kMargin, kTitle - 8, title, {.size = 15, .align = 0, .bold = true, .colour = colours.text});
  }
  for (std::size_t n = 0; n < tiles.size(); ++n) {
    const double x = kMargin + static_cast<double>(n % columns) * step_x;
    const double y = top + static_cast<double>(n / columns) * step_y;
    paint(*canvas, tiles[n], x, y);
    canvas->text(x + static_cast<double>(tiles[n].width) / 2, y + static_cast<double>(tiles[n].height) + 18,
                 tiles[n].caption, {.size = 14, .align = 0.5, .bold = false, .colour = colours.text});
  }
  return std::move(*canvas).finish();
}

}  // namespace scatter::plot
