// What layered copper looks like: colour after Kubelka and Munk, and the maps that scattering is made from.
#pragma once

#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/patina/layer_stack.h"

namespace scatter::corrosion {

/// Share of the surface that shows each kind, 0..1, summing to 1: a layer's share is what it keeps from
/// passing through it (1 - its diffuse transmittance, mean of the colours), the rest shows what lies below.
struct Coverage {
  double bare = 1;
  double tarnish = 0;
  double patina = 0;
};

struct PatinaLookOptions {
  Rgb metal = kCopperReflectance;  ///< Reflectance of the bare metal at normal incidence.
  float metal_roughness = 0.15F;   ///< GGX alpha of bare metal, 0.01..1.
};

/// Maps of the piece, as corroded sheets have them; one mixture of metal and diffuse layer serves both.
///
/// metalness   share of light that goes through all layers twice, T^2 (mean of the colours): 1 on bare
/// copper. albedo      Kubelka-Munk reflectance of layers over metal, less what the metal's share already
/// sends back:
///             metalness metal + (1 - metalness) albedo is the whole reflectance R where that leaves 0..1.
/// regime      kMetal where bare (metalness above 1 - 1e-6; albedo is the metal's reflectance there), kRust,
/// a diffuse
///             layer, wherever something lies on the metal, however thin; never kHole.
/// roughness   GGX alpha: the metal's and the layers' by their shares; an estimate, as are the layers'.
/// porosity    the layers' by their shares.
/// normal      of the surface's profile by central differences.
/// Cost        one pass; two exponentials per layer, cell and colour.
[[nodiscard]] Appearance appearance(const LayerStack& stack, const PatinaLookOptions& options = {});

/// Kubelka-Munk reflectance of layers over metal, all of it, per cell: the colour of a picture.
[[nodiscard]] std::vector<Rgb> reflectance(const LayerStack& stack, const PatinaLookOptions& options = {});

/// Mean over the piece.
[[nodiscard]] Coverage coverage(const LayerStack& stack);

}  // namespace scatter::corrosion
