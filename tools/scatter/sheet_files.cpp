#include "tools/scatter/sheet_files.h"

#include <cmath>

#include "host_sdk/images/exr_image.h"
#include "host_sdk/images/png_image.h"
#include "tools/scatter/files.h"
#include "tools/scatter/sheet_map_set.h"
#include "tools/scatter/sheet_picture.h"
#include "tools/scatter/square_image.h"

namespace scatter::cli {
namespace {

using corrosion::Appearance;
using corrosion::Sheet;
using images::Image;

Image normals(const Appearance& look) {
  Image image = triple_image(look.side, look.normal);
  for (float& component : image.values) {
    component = 0.5F + 0.5F * component;
  }
  return image;
}

/// Years of rust so far; 0 where there is none.
Image years_of_rust(const Sheet& sheet) {
  std::vector<float> years;
  years.reserve(sheet.cells());
  for (const float birth : *sheet.birth_years) {
    const float age = static_cast<float>(sheet.age_years) - birth;
    years.push_back(age > 0 ? age : 0.0F);
  }
  return grey_image(sheet.side, std::move(years));
}

}  // namespace

std::unexpected<Error> stopped() {
  return fail(ErrorCode::kAborted, "stopped before the sheet was finished; nothing was written",
              "run it again");
}

Result<Image> write_sheet(const Sheet& sheet, const corrosion::AppearanceOptions& options, MapSet set,
                          const std::filesystem::path& folder, const std::stop_token& stop) {
  const Appearance look = corrosion::appearance(sheet, options);
  Status done;
  const auto put = [&](const char* name, const auto& encode) {
    if (done && stop.stop_requested()) {
      done = stopped();
    }
    if (done) {
      const Result<std::string> bytes = encode();
      done = bytes ? write_file(folder / name, *bytes) : Status(std::unexpected(bytes.error()));
    }
  };
  using images::encode_exr_image;
  using images::encode_png_image;
  using images::ExrPixel;
  put("height.exr", [&] { return encode_exr_image(grey_image(sheet.side, sheet.height), ExrPixel::kFloat); });
  put("albedo.exr", [&] { return encode_exr_image(triple_image(look.side, look.albedo), ExrPixel::kHalf); });
  put("roughness.exr",
      [&] { return encode_exr_image(grey_image(sheet.side, look.roughness), ExrPixel::kHalf); });
  if (sheet.birth_years) {
    put("age.exr", [&] { return encode_exr_image(years_of_rust(sheet), ExrPixel::kHalf); });
  }
  put("regime.png", [&] { return encode_png_image(regime_picture(look)); });
  put("normal.png", [&] { return encode_png_image(normals(look)); });
  put("opacity.png", [&] { return encode_png_image(grey_image(sheet.side, look.opacity)); });
  Image preview = lit_picture(sheet, look);
  put("preview.png",
      [&] { return encode_png_image(preview, {.bits = 8, .encoding = images::Encoding::kSrgb}); });
  if (done) {
    done = write_map_set(set, sheet, look, folder);
  }
  if (!done) {
    return std::unexpected(done.error());
  }
  return preview;
}

}  // namespace scatter::cli
