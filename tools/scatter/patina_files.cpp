#include "tools/scatter/patina_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "host_sdk/images/exr_image.h"
#include "host_sdk/images/png_image.h"
#include "tools/scatter/files.h"
#include "tools/scatter/picture_light.h"
#include "tools/scatter/square_image.h"

namespace scatter::cli {
namespace {

using corrosion::LayerStack;
using corrosion::PatinaMaterial;
using images::Image;

/// Thickness of tarnish, or of all that is not.
std::vector<float> thickness(const LayerStack& layers, bool tarnish) {
  std::vector<float> sum(layers.cells(), 0.0F);
  for (const auto& layer : layers.layers()) {
    if ((layer.material == PatinaMaterial::kTarnish) == tarnish) {
      std::ranges::transform(sum, layer.thickness_um, sum.begin(), std::plus<>());
    }
  }
  return sum;
}

}  // namespace

Image patina_picture(const corrosion::Appearance& look, const corrosion::Rgb& metal) {
  Image picture{.width = look.side, .height = look.side, .channels = 3, .values = {}};
  picture.values.resize(look.side * look.side * 3);
  for (std::size_t i = 0; i < look.normal.size(); ++i) {
    const auto& flat = look.normal[i];
    const float x = flat[0] * kReliefInPreview;
    const float y = flat[1] * kReliefInPreview;
    const float length = std::sqrt(x * x + y * y + flat[2] * flat[2]);
    const float towards_sun = (x * kSun[0] + y * kSun[1] + flat[2] * kSun[2]) / length;
    const float diffuse =
        kSunLight * std::max(0.0F, towards_sun) + kSkyLight * (0.5F + 0.5F * flat[2] / length);
    for (std::size_t c = 0; c < 3; ++c) {
      picture.values[3 * i + c] =
          look.metalness[i] * metal[c] * kMirroredSky + (1 - look.metalness[i]) * look.albedo[i][c] * diffuse;
    }
  }
  return picture;
}

Result<Image> write_patina(const LayerStack& layers, const corrosion::PatinaLookOptions& options,
                           const std::filesystem::path& folder, const std::stop_token& stop) {
  const corrosion::Appearance look = corrosion::appearance(layers, options);
  const std::size_t side = layers.side();
  Status done;
  const auto put = [&](const char* name, const auto& encode) {
    if (done && stop.stop_requested()) {
      done = fail(ErrorCode::kAborted, "stopped before the piece was finished; nothing was written",
                  "run it again");
    }
    if (done) {
      const Result<std::string> bytes = encode();
      done = bytes ? write_file(folder / name, *bytes) : Status(std::unexpected(bytes.error()));
    }
  };
  using images::encode_exr_image;
  using images::encode_png_image;
  using images::ExrPixel;
  put("height.exr",
      [&] { return encode_exr_image(grey_image(side, layers.surface_um()), ExrPixel::kFloat); });
  put("tarnish.exr",
      [&] { return encode_exr_image(grey_image(side, thickness(layers, true)), ExrPixel::kFloat); });
  put("patina.exr",
      [&] { return encode_exr_image(grey_image(side, thickness(layers, false)), ExrPixel::kFloat); });
  put("albedo.exr", [&] {
    return encode_exr_image(triple_image(side, corrosion::reflectance(layers, options)), ExrPixel::kHalf);
  });
  put("metalness.exr", [&] { return encode_exr_image(grey_image(side, look.metalness), ExrPixel::kHalf); });
  put("roughness.exr", [&] { return encode_exr_image(grey_image(side, look.roughness), ExrPixel::kHalf); });
  put("normal.png", [&] {
    Image normals = triple_image(side, look.normal);
    for (float& component : normals.values) {
      component = 0.5F + 0.5F * component;
    }
    return encode_png_image(normals, {.bits = 16, .encoding = images::Encoding::kLinear});
  });
  Image preview = patina_picture(look, options.metal);
  put("preview.png",
      [&] { return encode_png_image(preview, {.bits = 8, .encoding = images::Encoding::kSrgb}); });
  if (!done) {
    return std::unexpected(done.error());
  }
  return preview;
}

}  // namespace scatter::cli
