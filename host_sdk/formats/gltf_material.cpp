#include <cmath>
#include <nlohmann/json.hpp>

#include "host_sdk/formats/engine_material.h"

namespace scatter::formats {

double ior_of_f0(double f0) noexcept {
  const double r = std::sqrt(f0);
  return (1 + r) / (1 - r);
}

std::string gltf_material(const EngineMaterial& material) {
  using nlohmann::ordered_json;
  const auto& [r, g, b] = material.base_color;
  ordered_json content = {{"name", material.name},
                          {"pbrMetallicRoughness",
                           {{"baseColorFactor", {r, g, b, 1.0}},
                            {"metallicFactor", material.metallic},
                            {"roughnessFactor", material.roughness}}},
                          {"extensions",
                           {{"KHR_materials_ior", {{"ior", material.ior}}},
                            {"KHR_materials_specular", {{"specularFactor", material.specular_factor}}}}}};
  if (!material.comment.empty()) {
    content["extras"] = {{"comment", material.comment}};
  }
  const ordered_json document = {{"asset", {{"version", "2.0"}, {"generator", "OpenScatter"}}},
                                 {"extensionsUsed", {"KHR_materials_ior", "KHR_materials_specular"}},
                                 {"materials", ordered_json::array({content})}};
  // Names come from file names, which need not be UTF-8.
  return document.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace scatter::formats
