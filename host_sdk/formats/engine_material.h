// What game engines and renderers exchange of a material instead of its BRDF.
#pragma once

#include <array>
#include <string>

namespace scatter::formats {

/// Metallic-roughness parameters; colours are linear with BT.709 primaries.
struct EngineMaterial {
  std::string name = "material";
  std::array<double, 3> base_color{0.5, 0.5, 0.5};  ///< 0..1
  double metallic = 0;                              ///< 0..1
  double roughness = 0.5;                           ///< 0..1; GGX alpha is its square.
  double specular_factor = 1;  ///< 0..1: scales the dielectric's reflectance at every angle (glTF only).
  double ior = 1.5;            ///< 1..3, of the dielectric.
  /// Sentences for the reader of the file: what was measured, how far the material is from it.
  std::string comment = {};
};

/// Index of a dielectric with reflectance f0 at normal incidence, 0 <= f0 < 1.
[[nodiscard]] double ior_of_f0(double f0) noexcept;

/// A glTF 2.0 asset that holds this one material: core parameters, KHR_materials_ior and
/// KHR_materials_specular. Other scenes refer to it or copy it; it holds no mesh.
/// Source  glTF 2.0 specification 3.9, 5.22; the two extensions' documents.
[[nodiscard]] std::string gltf_material(const EngineMaterial& material);

/// A MaterialX 1.39 document with an open_pbr_surface and its surfacematerial. specular_factor has no
/// counterpart there and must be 1 for the material to look the same.
/// Source  MaterialX 1.39 specification; OpenPBR surface 1.1 parameter reference.
[[nodiscard]] std::string materialx_material(const EngineMaterial& material);

}  // namespace scatter::formats
