#include <algorithm>

#include "host_sdk/reflectance/estimators/merge_kinds.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"

namespace scatter::reflectance {
namespace {

/// One channel at one place.
struct Value {
  float f = 0;
  float random = 0;
  float systematic = 0;
  Origin origin = Origin::kInvalid;
  bool has_uncertainty = false;
  bool estimated = false;
};

Value value_at(const MergeInput& input, const Direction& omega_i, const Direction& omega_o) {
  const std::size_t n = input.brdf->channels();
  std::vector<double> f(n);
  std::vector<double> random(n);
  std::vector<double> systematic(n);
  Value value;
  value.origin = input.brdf->eval(omega_i, omega_o, f);
  const Brdf* from = input.brdf;
  if (value.origin == Origin::kInvalid) {
    from = input.estimate.get();
    value.origin = combined(from->eval(omega_i, omega_o, f), Origin::kInterpolated);
    value.estimated = true;
  }
  value.has_uncertainty = from->uncertainty(omega_i, omega_o, random, systematic);
  value.f = static_cast<float>(f[input.channel]);
  value.random = static_cast<float>(random[input.channel]);
  value.systematic = static_cast<float>(systematic[input.channel]);
  return value;
}

}  // namespace

Result<Merged> merge_samples(std::span<const MergeInput> inputs, MergeLabels labels) {
  ScatteredSamples out;
  out.type = inputs.front().brdf->type();
  out.channels = inputs.size();
  out.wavelengths_nm = std::move(labels.wavelengths_nm);
  out.metadata = std::move(labels.metadata);
  Merged merged;
  bool has_uncertainty = true;
  std::vector<double> seen(1);
  for (std::size_t source = 0; source < inputs.size(); ++source) {
    for (const ScatteredBrdf::Site& site : static_cast<const ScatteredBrdf*>(inputs[source].brdf)->sites()) {
      // A place that an earlier source has too is in the result already.
      const bool known =
          site.held == 0 || std::ranges::any_of(inputs.first(source), [&](const MergeInput& earlier) {
            seen.resize(earlier.brdf->channels());
            return earlier.brdf->eval(site.omega_i, site.omega_o, seen) != Origin::kInvalid;
          });
      if (known) {
        continue;
      }
      std::vector<Value> values;
      Origin origin = Origin::kMeasured;
      for (const MergeInput& input : inputs) {
        values.push_back(value_at(input, site.omega_i, site.omega_o));
        origin = combined(origin, values.back().origin);
      }
      if (origin == Origin::kInvalid) {
        merged.dropped += 1;
        continue;
      }
      out.omega_i.push_back(site.omega_i);
      out.omega_o.push_back(site.omega_o);
      out.origin.push_back(origin);
      for (const Value& value : values) {
        out.f_per_sr.push_back(value.f);
        out.random_per_sr.push_back(value.random);
        out.systematic_per_sr.push_back(value.systematic);
        has_uncertainty = has_uncertainty && value.has_uncertainty;
        merged.estimated += value.estimated ? 1U : 0U;
      }
    }
  }
  merged.points = out.size();
  if (out.size() == 0) {
    return fail(ErrorCode::kFailedPrecondition,
                "merge: at no place do all sources have a value or an estimate",
                "merge files that measured the same geometries");
  }
  if (!has_uncertainty) {
    out.random_per_sr.clear();
    out.systematic_per_sr.clear();
  }
  Result<std::shared_ptr<ScatteredBrdf>> made = ScatteredBrdf::make(std::move(out));
  if (!made) {
    return std::unexpected(made.error());
  }
  merged.brdf = std::move(*made);
  return merged;
}

}  // namespace scatter::reflectance
