// What is done to scattering data before it is written or drawn: averaging, filling, estimating.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace CLI {  // NOLINT(readability-identifier-naming): theirs
class App;
}

namespace scatter::cli {

/// As the person gives them.
struct PreparationOptions {
  std::optional<std::string>
      chain;                ///< Links of reflectance/estimators/chain.h; nothing: the caller's choice.
  bool mirror = false;      ///< Average the halves beside the plane of incidence.
  bool reciprocal = false;  ///< Average with exchanged directions.
  bool fill = false;        ///< Fill blind spots.
};

void add_preparation_options(CLI::App& app, PreparationOptions& options);

struct Prepared {
  std::shared_ptr<const reflectance::Brdf> brdf;
  /// Of the data, with what was done to it; a chain's Brdf does not carry them itself.
  std::map<std::string, std::string> metadata;
  std::vector<double> theta_i;     ///< The data's own incidences [rad], ascending; empty for a model.
  std::vector<std::string> notes;  ///< What was done, one sentence each.
};

/// What a user names: a file, a model, or a sheet of metal such as corroded:age=5,spot=0.3/0.7
/// (docs/spots.md). Errors    those of formats::open_brdf and simulator::SampleBrdf::make.
[[nodiscard]] Result<std::shared_ptr<const reflectance::Brdf>> open_subject(const std::string& path_or_spec);

/// The same, with lists of samples ready for estimators.
[[nodiscard]] Result<std::shared_ptr<const reflectance::Brdf>> open_data(const std::string& path_or_spec);

/// For titles and legends: a file's name without its folders, a model's spec as it is.
[[nodiscard]] std::string shown_name(const std::string& path_or_spec);

/// Averages and fills (on a grid about the normal, onto which other data are put first), then wraps the
/// chain around the result.
/// default_chain: what stands for `options.chain` when the person said nothing; "" for no chain.
/// Errors   of the steps.
[[nodiscard]] Result<Prepared> prepare(std::shared_ptr<const reflectance::Brdf> data,
                                       const PreparationOptions& options, const std::string& default_chain);

}  // namespace scatter::cli
