// Geometries of many outgoing directions at one incidence, one array per quantity.
#pragma once

#include <array>
#include <cstddef>

#include "host_sdk/reflectance/models/formulas/geometry.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance {

/// A multiple of every vector width; with its results a block stays in the first-level cache.
inline constexpr std::size_t kBlockSize = 64;

using BlockArray = std::array<double, kBlockSize>;

/// Every lane holds a valid reflection geometry: unused ones that of o = the normal.
struct alignas(64) GeometryBlock {
  BlockArray o_x;
  BlockArray o_y;
  BlockArray o_z;
  BlockArray h_x;
  BlockArray h_y;
  BlockArray h_z;
  BlockArray cos_d;
  BlockArray cos_mirror;
  BlockArray tangent_dot;
  Direction i;

  /// One lane, as the formulas take it.
  [[nodiscard]] formulas::Geometry at(std::size_t k) const noexcept {
    return {.i = i,
            .o = {o_x[k], o_y[k], o_z[k]},
            .h = {h_x[k], h_y[k], h_z[k]},
            .cos_i = i.z,
            .cos_o = o_z[k],
            .cos_h = h_z[k],
            .sin2_h = h_x[k] * h_x[k] + h_y[k] * h_y[k],
            .cos_d = cos_d[k],
            .cos_mirror = cos_mirror[k],
            .tangent_dot = tangent_dot[k]};
  }
};

/// Per channel.
struct alignas(64) BlockValues {
  std::array<BlockArray, kModelChannels> f_per_sr;
};

}  // namespace scatter::reflectance
