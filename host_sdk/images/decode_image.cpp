#include "host_sdk/images/decode_image.h"

#include <fmt/format.h>

#include "host_sdk/images/exr_image.h"
#include "host_sdk/images/png_image.h"

namespace scatter::images {

Result<Image> decode_image(std::string_view bytes, std::string_view name, Encoding png_encoding) {
  using namespace std::string_view_literals;
  if (bytes.starts_with("\x76\x2f\x31\x01"sv)) {
    return decode_exr_image(bytes, name);
  }
  if (bytes.starts_with("\x89PNG\r\n\x1a\n"sv)) {
    return decode_png_image(bytes, name, png_encoding);
  }
  return fail(ErrorCode::kInvalidArgument,
              fmt::format("{}: is {}, expected an OpenEXR or a PNG image", name,
                          bytes.empty() ? "empty" : "neither by its first bytes"),
              "save it as .exr or .png");
}

}  // namespace scatter::images
