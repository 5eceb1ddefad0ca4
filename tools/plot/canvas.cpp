#include "tools/plot/canvas.h"

#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <numeric>

namespace scatter::plot {
namespace {

constexpr const char* kFont = "DejaVu Sans";

cairo_status_t append(void* closure, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

void select_font(cairo_t* context, double size, bool bold) {
  cairo_select_font_face(context, kFont, CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context, size);
}

}  // namespace

Result<ImageKind> image_kind(std::string_view path) {
  const auto dot = path.rfind('.');
  std::string extension(dot == std::string_view::npos ? "" : path.substr(dot + 1));
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  if (extension == "png") {
    return ImageKind::kPng;
  }
  if (extension == "svg") {
    return ImageKind::kSvg;
  }
  return fail(ErrorCode::kInvalidArgument,
              fmt::format("'{}' has no picture format: the extension is '{}'", path, extension),
              "give the output a name that ends in .png or .svg");
}

const Palette& palette(Theme theme) noexcept {
  static constexpr Palette kLight{
      {1, 1, 1, 1}, {0.10, 0.12, 0.15, 1}, {0.40, 0.43, 0.48, 1}, {0.86, 0.87, 0.89, 1}};
  static constexpr Palette kDark{
      {0.067, 0.075, 0.090, 1}, {0.92, 0.93, 0.95, 1}, {0.60, 0.63, 0.68, 1}, {0.22, 0.24, 0.28, 1}};
  return theme == Theme::kLight ? kLight : kDark;
}

std::vector<Colour> channel_colours(std::span<const float> wavelengths_nm, std::size_t channels,
                                    Theme theme) {
  const bool dark = theme == Theme::kDark;
  if (channels == 1) {
    return {dark ? Colour{0.95, 0.80, 0.45} : Colour{0.25, 0.27, 0.33}};
  }
  const bool named = wavelengths_nm.size() == channels;
  if (channels <= 3) {
    const Colour primaries[] = {dark ? Colour{1.00, 0.42, 0.40} : Colour{0.80, 0.13, 0.15},
                                dark ? Colour{0.36, 0.84, 0.50} : Colour{0.05, 0.52, 0.25},
                                dark ? Colour{0.45, 0.65, 1.00} : Colour{0.10, 0.35, 0.82}};
    std::vector<std::size_t> primary;
    for (std::size_t k = 0; k < channels; ++k) {
      const float nm = named ? wavelengths_nm[k] : 0;
      primary.push_back(nm > 0 ? (nm >= 590 ? 0 : nm >= 490 ? 1 : 2) : k * 3 / channels);
    }
    auto sorted = primary;
    std::ranges::sort(sorted);
    if (std::ranges::adjacent_find(sorted) == sorted.end()) {
      std::vector<Colour> colours;
      for (const std::size_t k : primary) {
        colours.push_back(primaries[k]);
      }
      return colours;
    }
  }
  std::vector<std::size_t> order(channels);
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (named) {
    std::ranges::stable_sort(order, {}, [&](std::size_t k) { return wavelengths_nm[k]; });
  }
  std::vector<Colour> colours(channels);
  for (std::size_t rank = 0; rank < channels; ++rank) {
    const double hue = (305.0 - 280.0 * double(rank) / double(channels - 1)) * std::numbers::pi / 180;
    const double lightness = (dark ? 0.70 : 0.47) + (rank % 2 == 0 ? 0.0 : 0.15);
    constexpr double kChroma = 0.14;
    colours[order[rank]] = from_oklab({lightness, kChroma * std::cos(hue), kChroma * std::sin(hue)});
  }
  return colours;
}

std::string channel_name(double wavelength_nm, std::size_t channel, std::size_t channels) {
  static constexpr const char* kLetters[] = {"R", "G", "B"};
  if (wavelength_nm > 0) {
    const char* letter = channels == 3 ? kLetters[channel] : "";
    return fmt::format("{}{}{:g} nm", letter, *letter ? " " : "", wavelength_nm);
  }
  if (channels == 1) {
    return "luminance";
  }
  return channels == 3 ? std::string(kLetters[channel]) : fmt::format("channel {}", channel);
}

void Canvas::CloseContext::operator()(cairo_t* context) const noexcept {
  cairo_destroy(context);
}
void Canvas::CloseSurface::operator()(cairo_surface_t* surface) const noexcept {
  cairo_surface_destroy(surface);
}

Result<Canvas> Canvas::make(ImageKind kind, double width, double height, double scale) {
  const double wide = std::ceil(width * scale);
  const double high = std::ceil(height * scale);
  if (!(wide >= 1 && wide <= 20000 && high >= 1 && high <= 20000)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("a picture of {} x {} pixels, the limit is 20000", wide, high),
                "draw fewer incidences or channels, or a smaller picture");
  }
  Canvas canvas;
  canvas.kind_ = kind;
  canvas.width_ = width;
  canvas.height_ = height;
  canvas.bytes_ = std::make_unique<std::string>();
  canvas.surface_.reset(
      kind == ImageKind::kPng
          ? cairo_image_surface_create(CAIRO_FORMAT_ARGB32, int(wide), int(high))
          : cairo_svg_surface_create_for_stream(append, canvas.bytes_.get(), width, height));
  canvas.context_.reset(cairo_create(canvas.surface_.get()));
  if (const auto state = cairo_status(canvas.context_.get()); state != CAIRO_STATUS_SUCCESS) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("cannot start a picture: {}", cairo_status_to_string(state)),
                "free some memory and run again");
  }
  if (kind == ImageKind::kPng) {
    cairo_scale(canvas.context(), scale, scale);
  }
  return canvas;
}

void Canvas::set(const Colour& colour) const {
  cairo_set_source_rgba(context(), colour.r, colour.g, colour.b, colour.a);
}

void Canvas::fill_page(const Colour& colour) const {
  set(colour);
  cairo_rectangle(context(), 0, 0, width_, height_);
  cairo_fill(context());
}

double Canvas::text_width(const std::string& words, double size, bool bold) const {
  select_font(context(), size, bold);
  cairo_text_extents_t extents;
  cairo_text_extents(context(), words.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(double x, double y, const std::string& words, const Text& style) const {
  const double start = style.align == 0 ? x : x - style.align * text_width(words, style.size, style.bold);
  select_font(context(), style.size, style.bold);
  set(style.colour);
  cairo_move_to(context(), start, y);
  cairo_show_text(context(), words.c_str());
}

Result<std::string> Canvas::finish() && {
  cairo_status_t state = cairo_status(context());
  context_.reset();
  if (state == CAIRO_STATUS_SUCCESS && kind_ == ImageKind::kPng) {
    state = cairo_surface_write_to_png_stream(surface_.get(), append, bytes_.get());
  }
  cairo_surface_finish(surface_.get());
  if (state == CAIRO_STATUS_SUCCESS) {
    state = cairo_surface_status(surface_.get());
  }
  if (state != CAIRO_STATUS_SUCCESS) {
    return fail(ErrorCode::kInternal, fmt::format("drawing failed: {}", cairo_status_to_string(state)),
                "report this with the command that led to it");
  }
  return std::move(*bytes_);
}

}  // namespace scatter::plot
