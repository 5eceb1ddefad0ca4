// Measured optical constants of metals.
#pragma once

#include <span>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::reflectance {

/// Complex refractive index n + ik (k >= 0 absorbs).
struct ComplexIndex {
  double n = 1;
  double k = 0;
};

/// One row of a table.
struct IndexSample {
  double wavelength_nm = 0;
  double n = 1;
  double k = 0;
};

/// Where it was measured is the head of data/NAME.inc.
struct Metal {
  std::string_view name;                 ///< "copper"
  std::span<const IndexSample> samples;  ///< By increasing wavelength; covers at least 400..700 nm.
  std::string_view source;               ///< "Johnson and Christy 1972"
};

/// All of them, by name.
[[nodiscard]] std::span<const Metal> metals() noexcept;

/// n and k, each linear between the rows of the table.
/// Errors  kNotFound: no such metal (the remedy lists them); kOutOfRange: wavelength outside its table.
[[nodiscard]] Result<ComplexIndex> metal_index(std::string_view name, double wavelength_nm);

}  // namespace scatter::reflectance
