// Chains of estimators from text, as users write them: "bezier,specular,clamp".
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// A chain and what it is made of.
struct Chain {
  std::shared_ptr<const Brdf> brdf;
  std::string text;  ///< All links with all their parameters; makes the same chain again. Empty: no links.
  /// What links chose by themselves and how well that did, for the files written from here: see
  /// GuidedBrdf::metadata.
  std::map<std::string, std::string> metadata;
};

/// The links that a text names, wrapped around the data from left to right.
///
/// Text      links separated by commas; a link is a name, and parameters as "name:key=value,key=value". A
/// part
///           with "=" belongs to the link before it. Angles are in degrees. "" gives the data itself.
///   neighbors  k=10 d_max=0.2 k_min=3 epsilon=1e-6   scattered samples only, first link only
///   axis       gap=30 turn=90                         likewise
///   grid       axis=up|specular step=1
///   plain | specular | specular-spline | specular-spline-zero | distorted | guided    between incidences
///   none | linear | constant | bezier   from=ANGLE    beyond theta_o = ANGLE
///   clamp      over=both|theta_i|theta_o from=ANGLE
///   gradient   over=both|theta_i|theta_o from=ANGLE p=0 m=15 l=0.5
///   default    what default_chain makes; alone only
///   best       the same with `guided` between incidences; alone only
///           `from` is where the data ends unless given (needed when it reaches the horizon); with
///           over=theta_i the incidences say where.
/// Errors    kInvalidArgument: unknown link or key, key twice, not a number, value out of range; names
///           the part and what was expected. kFailedPrecondition: the data does not suit the link.
[[nodiscard]] Result<Chain> make_chain(std::shared_ptr<const Brdf> data, std::string_view text);

/// What suits the data.
///
/// Scattered samples: axis when they lie on common incidences, else neighbors. Then, as for grids about the
/// normal: bezier where the data ends before the horizon; specular between two or more incidences; clamp over
/// theta_i outside them. Grids about the mirror direction (which extrapolate themselves) and everything that
/// knows all directions: the data itself.
[[nodiscard]] Result<Chain> default_chain(std::shared_ptr<const Brdf> data);

/// The same with `guided` between incidences, also of grids about the mirror direction: the smallest error,
/// for about a second of preparation. Errors    kFailedPrecondition also where an incidence has no positive
/// value.
[[nodiscard]] Result<Chain> best_chain(std::shared_ptr<const Brdf> data);

}  // namespace scatter::reflectance
