#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "host_sdk/formats/engine_material.h"

namespace scatter::formats {
namespace {

/// MaterialX names: letters, digits and underscores, no digit first.
std::string element_name(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
    const bool digit = c >= '0' && c <= '9';
    if (digit && out.empty()) {
      out = "m_";
    }
    out += letter || digit ? c : '_';
  }
  return out.empty() ? "material" : out;
}

/// Text of an attribute. XML 1.0 has no way to write most control characters, and a document is UTF-8:
/// anything that is not printable ASCII becomes a question mark.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c >= ' ' && c <= '~' ? c : '?';
    }
  }
  return out;
}

}  // namespace

std::string materialx_material(const EngineMaterial& material) {
  const std::string name = element_name(material.name);
  const auto& [r, g, b] = material.base_color;
  std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  text += "<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n";
  text += fmt::format("  <open_pbr_surface name=\"{}_surface\" type=\"surfaceshader\"", name);
  if (!material.comment.empty()) {
    text += fmt::format(" doc=\"{}\"", escaped(material.comment));
  }
  text += ">\n";
  text += fmt::format("    <input name=\"base_color\" type=\"color3\" value=\"{:.9g}, {:.9g}, {:.9g}\" />\n",
                      r, g, b);
  for (const auto& [key, value] :
       {std::pair{"base_metalness", material.metallic}, std::pair{"specular_weight", 1.0},
        std::pair{"specular_roughness", material.roughness}, std::pair{"specular_ior", material.ior}}) {
    text += fmt::format("    <input name=\"{}\" type=\"float\" value=\"{:.9g}\" />\n", key, value);
  }
  text += "  </open_pbr_surface>\n";
  text += fmt::format("  <surfacematerial name=\"{}\" type=\"material\">\n", name);
  text += fmt::format("    <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"{}_surface\" />\n",
                      name);
  text += "  </surfacematerial>\n</materialx>\n";
  return text;
}

}  // namespace scatter::formats
