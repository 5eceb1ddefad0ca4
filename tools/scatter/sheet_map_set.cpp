#include "tools/scatter/sheet_map_set.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "host_sdk/images/png_image.h"
#include "tools/plot/html.h"
#include "tools/scatter/files.h"
#include "tools/scatter/sheet_picture.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;
using corrosion::Appearance;
using corrosion::Sheet;
using images::Image;

Status put(const fs::path& path, const Image& image, images::Encoding encoding) {
  const auto bytes = images::encode_png_image(image, {.bits = 8, .encoding = encoding});
  return bytes ? write_file(path, *bytes) : Status(std::unexpected(bytes.error()));
}

Image base_colour(const Appearance& look) {
  Image image{.width = look.side, .height = look.side, .channels = 4, .values = {}};
  image.values.reserve(look.albedo.size() * 4);
  for (std::size_t n = 0; n < look.albedo.size(); ++n) {
    image.values.insert(image.values.end(), look.albedo[n].begin(), look.albedo[n].end());
    image.values.push_back(look.opacity[n]);
  }
  return image;
}

Image metallic_roughness(const Appearance& look) {
  Image image{.width = look.side, .height = look.side, .channels = 3, .values = {}};
  image.values.reserve(look.albedo.size() * 3);
  for (std::size_t n = 0; n < look.albedo.size(); ++n) {
    image.values.insert(image.values.end(), {1.0F, std::sqrt(look.roughness[n]), look.metalness[n]});
  }
  return image;
}

/// Four corners with normal, tangent and texture place, and two triangles.
std::string quad(float half_metres) {
  std::string bytes;
  const auto append = [&bytes](const auto& numbers) {
    bytes.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(numbers[0]));
  };
  const float h = half_metres;
  append(std::array<float, 12>{-h, h, 0, h, h, 0, -h, -h, 0, h, -h, 0});
  append(std::array<float, 12>{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  append(std::array<float, 16>{1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1});
  append(std::array<float, 8>{0, 0, 1, 0, 0, 1, 1, 1});
  append(std::array<std::uint16_t, 6>{0, 2, 1, 1, 2, 3});
  return bytes;
}

std::string gltf_text(const Sheet& sheet) {
  using nlohmann::ordered_json;
  const auto half = static_cast<float>(sheet.extent_mm / 2000);
  const std::string bytes = quad(half);
  const auto view = [](int offset, int length, int target) {
    return ordered_json{{"buffer", 0}, {"byteOffset", offset}, {"byteLength", length}, {"target", target}};
  };
  constexpr int kVertices = 34962;
  constexpr int kIndices = 34963;
  constexpr int kFloat = 5126;
  constexpr int kUnsignedShort = 5123;
  const auto accessor = [](int of, int component, int count, const char* type) {
    return ordered_json{{"bufferView", of}, {"componentType", component}, {"count", count}, {"type", type}};
  };
  ordered_json positions = accessor(0, kFloat, 4, "VEC3");
  positions["min"] = {-half, -half, 0.0F};
  positions["max"] = {half, half, 0.0F};
  const auto texture = [](int index) { return ordered_json{{"index", index}}; };
  const ordered_json document = {
      {"asset", {{"version", "2.0"}, {"generator", "OpenScatter"}}},
      {"scene", 0},
      {"scenes", ordered_json::array({{{"nodes", {0}}}})},
      {"nodes", ordered_json::array({{{"name", "corroded sheet"}, {"mesh", 0}}})},
      {"meshes",
       ordered_json::array(
           {{{"primitives",
              ordered_json::array(
                  {{{"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TANGENT", 2}, {"TEXCOORD_0", 3}}},
                    {"indices", 4},
                    {"material", 0}}})}}})},
      {"materials",
       ordered_json::array({{{"name", "corroded metal"},
                             {"pbrMetallicRoughness",
                              {{"baseColorTexture", texture(0)}, {"metallicRoughnessTexture", texture(1)}}},
                             {"normalTexture", texture(2)},
                             {"occlusionTexture", texture(3)},
                             {"alphaMode", "MASK"},
                             {"alphaCutoff", 0.5},
                             {"doubleSided", true}}})},
      {"textures", ordered_json::array({{{"source", 0}, {"sampler", 0}},
                                        {{"source", 1}, {"sampler", 0}},
                                        {{"source", 2}, {"sampler", 0}},
                                        {{"source", 3}, {"sampler", 0}}})},
      {"images", ordered_json::array({{{"uri", "base_color.png"}},
                                      {{"uri", "metallic_roughness.png"}},
                                      {{"uri", "normal.png"}},
                                      {{"uri", "occlusion.png"}}})},
      {"samplers", ordered_json::array({{{"wrapS", 10497}, {"wrapT", 10497}}})},
      {"accessors",
       ordered_json::array({positions, accessor(1, kFloat, 4, "VEC3"), accessor(2, kFloat, 4, "VEC4"),
                            accessor(3, kFloat, 4, "VEC2"), accessor(4, kUnsignedShort, 6, "SCALAR")})},
      {"bufferViews",
       ordered_json::array({view(0, 48, kVertices), view(48, 48, kVertices), view(96, 64, kVertices),
                            view(160, 32, kVertices), view(192, 12, kIndices)})},
      {"buffers",
       ordered_json::array({{{"byteLength", bytes.size()},
                             {"uri", "data:application/octet-stream;base64," + plot::base64(bytes)}}})}};
  return document.dump(2) + "\n";
}

std::string pbrt_text(const Sheet& sheet) {
  const double half = sheet.extent_mm / 2;
  return fmt::format(
      R"(# A corroded sheet of {extent} mm, lengths in millimetres. For pbrt-v4.
Scale -1 1 1
LookAt 0 {back} {up}  0 0 0  0 0 1
Camera "perspective" "float fov" [ 30 ]
Sampler "halton" "integer pixelsamples" [ 64 ]
Integrator "volpath"
Film "rgb" "string filename" [ "corroded_render.exr" ] "integer xresolution" [ 800 ] "integer yresolution" [ 800 ]

WorldBegin

LightSource "infinite" "rgb L" [ 0.8 0.9 1.0 ]
LightSource "distant" "rgb L" [ 2.2 2.1 1.9 ] "point3 from" [ -0.5 0.55 0.67 ] "point3 to" [ 0 0 0 ]

Texture "albedo" "spectrum" "imagemap" "string filename" [ "albedo.exr" ]
Texture "roughness" "float" "imagemap" "string filename" [ "roughness.exr" ]
Texture "rust" "float" "imagemap" "string filename" [ "metal.png" ] "string encoding" [ "linear" ] "bool invert" [ true ]
Texture "opacity" "float" "imagemap" "string filename" [ "opacity.png" ] "string encoding" [ "linear" ]

MakeNamedMaterial "metal" "string type" [ "conductor" ] "texture reflectance" [ "albedo" ]
  "texture roughness" [ "roughness" ] "bool remaproughness" [ false ] "string normalmap" [ "normal.png" ]
MakeNamedMaterial "rusty" "string type" [ "coateddiffuse" ] "texture reflectance" [ "albedo" ]
  "texture roughness" [ "roughness" ] "bool remaproughness" [ false ] "string normalmap" [ "normal.png" ]
MakeNamedMaterial "corroded" "string type" [ "mix" ] "string materials" [ "metal" "rusty" ] "texture amount" [ "rust" ]

NamedMaterial "corroded"
Shape "trianglemesh" "texture alpha" [ "opacity" ]
  "point3 P" [ -{half} -{half} 0  {half} -{half} 0  -{half} {half} 0  {half} {half} 0 ]
  "point2 uv" [ 0 0  1 0  0 1  1 1 ]
  "integer indices" [ 0 1 2  1 3 2 ]
)",
      fmt::arg("extent", sheet.extent_mm), fmt::arg("half", half), fmt::arg("back", -sheet.extent_mm * 1.2),
      fmt::arg("up", sheet.extent_mm * 1.6));
}

/// The first error, or nothing.
template <typename... Step>
Status one_after_another(const Step&... steps) {
  Status done;
  ((done = done ? steps() : done), ...);
  return done;
}

}  // namespace

Status write_map_set(MapSet set, const Sheet& sheet, const Appearance& look, const fs::path& folder) {
  using images::Encoding;
  if (set == MapSet::kGltf) {
    return one_after_another(
        [&] { return put(folder / "base_color.png", base_colour(look), Encoding::kSrgb); },
        [&] { return put(folder / "metallic_roughness.png", metallic_roughness(look), Encoding::kLinear); },
        [&] { return put(folder / "occlusion.png", sky_share(sheet), Encoding::kLinear); },
        [&] { return write_file(folder / "corroded.gltf", gltf_text(sheet)); });
  }
  if (set == MapSet::kPbrt) {
    const Image metal{.width = look.side, .height = look.side, .channels = 1, .values = look.metalness};
    return one_after_another([&] { return put(folder / "metal.png", metal, Encoding::kLinear); },
                             [&] { return write_file(folder / "corroded.pbrt", pbrt_text(sheet)); });
  }
  return {};
}

}  // namespace scatter::cli
