#include "host_sdk/reflectance/estimators/chain.h"

#include <fmt/format.h>

#include <array>
#include <vector>

#include "host_sdk/reflectance/estimators/chain_text.h"
#include "host_sdk/reflectance/estimators/edge_extrapolator.h"
#include "host_sdk/reflectance/estimators/extent.h"
#include "host_sdk/reflectance/estimators/grid_interpolator.h"
#include "host_sdk/reflectance/estimators/guided_brdf.h"
#include "host_sdk/reflectance/estimators/horizon_extrapolator.h"
#include "host_sdk/reflectance/estimators/incidence_interpolator.h"
#include "host_sdk/reflectance/estimators/linear_axis_interpolator.h"
#include "host_sdk/reflectance/estimators/neighbors_interpolator.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

constexpr std::array kIncidenceModes{IncidenceMode::kPlain, IncidenceMode::kSpecular,
                                     IncidenceMode::kSpecularSpline, IncidenceMode::kSpecularSplineZero,
                                     IncidenceMode::kDistorted};
constexpr std::array kHorizonModes{HorizonMode::kNone, HorizonMode::kLinear, HorizonMode::kConstant,
                                   HorizonMode::kBezier};
constexpr const char* kAllLinks =
    "links: neighbors, axis, grid, plain, specular, specular-spline, specular-spline-zero, distorted, "
    "guided, none, "
    "linear, constant, bezier, clamp, gradient; or default or best alone";

/// As the person wrote it, or as measured; to the digits that make the same link again.
std::string from_text(const std::optional<double>& from_deg, double end) {
  return from_deg ? fmt::format("{}", *from_deg) : fmt::format("{:.9g}", degrees(end));
}

/// Wraps link after link and writes down what it did.
class Builder {
 public:
  explicit Builder(std::shared_ptr<const Brdf> data)
      : extent_(extent_of(*data)), chain_{std::move(data), {}, {}} {}

  [[nodiscard]] Status add(LinkText& link);
  [[nodiscard]] const Extent& extent() const noexcept { return extent_; }
  [[nodiscard]] Chain take() && { return std::move(chain_); }

 private:
  [[nodiscard]] Status add_neighbors(LinkText& link);
  [[nodiscard]] Status add_axis(LinkText& link);
  [[nodiscard]] Status add_grid(LinkText& link);
  [[nodiscard]] Status add_horizon(LinkText& link, HorizonMode mode);
  [[nodiscard]] Status add_edges(LinkText& link, bool gradient);
  [[nodiscard]] Result<std::shared_ptr<const ScatteredBrdf>> samples(const LinkText& link) const;
  /// End of the data in theta_o, as asked or as measured.
  [[nodiscard]] Result<double> theta_o_end(const LinkText& link, const std::optional<double>& from_deg) const;
  /// Refuses leftovers, then wraps.
  template <typename Made>
  [[nodiscard]] Status wrap(const LinkText& link, Made made, const std::string& text) {
    if (Status status = link.done(); !status) {
      return status;
    }
    if (!made) {
      return std::unexpected(made.error());
    }
    chain_.brdf = *made;
    chain_.text += (chain_.text.empty() ? "" : ",") + text;
    return {};
  }

  Extent extent_;
  Chain chain_;
};

Result<std::shared_ptr<const ScatteredBrdf>> Builder::samples(const LinkText& link) const {
  auto found = std::dynamic_pointer_cast<const ScatteredBrdf>(chain_.brdf);
  if (!found) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("chain: {} works on scattered samples, which {}", link.name(),
                            chain_.text.empty() ? "this data is not" : "an earlier link hides"),
                chain_.text.empty() ? "leave it out: a grid needs no search"
                                    : fmt::format("put {} first", link.name()));
  }
  return found;
}

Status Builder::add_neighbors(LinkText& link) {
  const auto data = samples(link);
  if (!data) {
    return std::unexpected(data.error());
  }
  NeighborsInterpolator::Options options;
  const auto k = link.count("k", options.k);
  const auto d_max = link.number("d_max", options.d_max);
  const auto k_min = link.count("k_min", k ? std::min(options.k_min, *k) : 0);
  const auto epsilon = link.number("epsilon", options.epsilon);
  if (!k || !d_max || !k_min || !epsilon) {
    return std::unexpected(!k       ? k.error()
                           : !d_max ? d_max.error()
                           : !k_min ? k_min.error()
                                    : epsilon.error());
  }
  options.k = *k;
  options.d_max = *d_max;
  options.k_min = *k_min;
  options.epsilon = *epsilon;
  return wrap(link, NeighborsInterpolator::make(*data, options),
              fmt::format("neighbors:k={},d_max={},k_min={},epsilon={}", *k, *d_max, *k_min, *epsilon));
}

Status Builder::add_axis(LinkText& link) {
  const auto data = samples(link);
  if (!data) {
    return std::unexpected(data.error());
  }
  const auto gap = link.number("gap", 30);
  const auto turn = link.number("turn", 90);
  if (!gap || !turn) {
    return std::unexpected(!gap ? gap.error() : turn.error());
  }
  return wrap(link,
              LinearAxisInterpolator::make(
                  *data, {.widest_gap = radians(*gap), .widest_turn = radians(*turn), .region = {}}),
              fmt::format("axis:gap={},turn={}", *gap, *turn));
}

Status Builder::add_grid(LinkText& link) {
  const auto axis = link.word("axis", {"up", "specular"});
  const auto step = link.number("step", 1);
  if (!axis || !step) {
    return std::unexpected(!axis ? axis.error() : step.error());
  }
  const GridInterpolator::Options options{.axis = *axis == "up" ? GridAxis::kUp : GridAxis::kSpecular,
                                          .step = radians(*step)};
  if (Status status = link.done(); !status) {
    return status;
  }
  return wrap(link, GridInterpolator::make(chain_.brdf, options, extent_),
              fmt::format("grid:axis={},step={}", *axis, *step));
}

Result<double> Builder::theta_o_end(const LinkText& link, const std::optional<double>& from_deg) const {
  if (from_deg) {
    return radians(*from_deg);
  }
  if (extent_.theta_o_to >= kPi / 2 - kSameAngle) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("chain: {}: the data reaches the horizon, nothing lies beyond it", link.name()),
                fmt::format("leave it out, or say up to where the data is good: {}:from=75", link.name()));
  }
  return extent_.theta_o_to;
}

Status Builder::add_horizon(LinkText& link, HorizonMode mode) {
  const auto from = link.number("from");
  if (!from) {
    return std::unexpected(from.error());
  }
  const auto end = theta_o_end(link, *from);
  if (!end) {
    return std::unexpected(end.error());
  }
  return wrap(link, HorizonExtrapolator::make(chain_.brdf, mode, *end),
              fmt::format("{}:from={}", name(mode), from_text(*from, *end)));
}

Status Builder::add_edges(LinkText& link, bool gradient) {
  const auto over = link.word("over", {"both", "theta_i", "theta_o"});
  const auto from = link.number("from");
  GradientExtrapolator::Options options;
  const auto p = gradient ? link.number("p", options.p) : Result<double>(0);
  const auto m = gradient ? link.number("m", degrees(options.m)) : Result<double>(0);
  const auto l = gradient ? link.number("l", options.l) : Result<double>(0);
  if (!over || !from || !p || !m || !l) {
    return std::unexpected(!over   ? over.error()
                           : !from ? from.error()
                           : !p    ? p.error()
                           : !m    ? m.error()
                                   : l.error());
  }
  options = {.p = *p, .m = radians(*m), .l = *l};
  if (*over == "theta_i" && *from) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("chain: {}: from goes with theta_o, not with over=theta_i", link.name()),
                "leave from out: the incidences say where the data ends");
  }
  std::vector<Edge> edges;
  std::string text = fmt::format("{}:over={}", link.name(), *over);
  if (*over != "theta_i") {
    const auto end = theta_o_end(link, *from);
    if (end) {
      edges.push_back({.axis = Edge::Axis::kThetaO, .at = *end});
      text += fmt::format(",from={}", from_text(*from, *end));
    } else if (*over == "theta_o") {
      return std::unexpected(end.error());
    }
  }
  if (*over != "theta_o") {
    if (extent_.theta_i.empty()) {
      return fail(ErrorCode::kFailedPrecondition,
                  fmt::format("chain: {}: the data names no incidences", link.name()),
                  fmt::format("leave it out, or write {}:over=theta_o", link.name()));
    }
    if (const double last = extent_.theta_i.back(); last > kSameAngle) {
      edges.push_back({.axis = Edge::Axis::kThetaI, .at = last});
    }
    if (const double first = extent_.theta_i.front(); first > kSameAngle) {
      edges.push_back(
          {.axis = Edge::Axis::kThetaI, .at = first, .upper = false, .azimuth = extent_.azimuth.value_or(0)});
    }
  }
  if (gradient) {
    text += fmt::format(",p={},m={},l={}", *p, *m, *l);
  }
  if (Status status = link.done(); !status) {
    return status;
  }
  std::shared_ptr<const Brdf> wrapped = chain_.brdf;
  for (const Edge& edge : edges) {
    if (gradient) {
      auto made = GradientExtrapolator::make(wrapped, edge, options);
      if (!made) {
        return std::unexpected(made.error());
      }
      wrapped = *made;
    } else {
      auto made = ClampExtrapolator::make(wrapped, edge);
      if (!made) {
        return std::unexpected(made.error());
      }
      wrapped = *made;
    }
  }
  return wrap(link, Result<std::shared_ptr<const Brdf>>(wrapped), text);
}

Status Builder::add(LinkText& link) {
  for (const IncidenceMode mode : kIncidenceModes) {
    if (link.name() == name(mode)) {
      return wrap(link, IncidenceInterpolator::make(chain_.brdf, mode, extent_), std::string(name(mode)));
    }
  }
  for (const HorizonMode mode : kHorizonModes) {
    if (link.name() == name(mode)) {
      return add_horizon(link, mode);
    }
  }
  if (link.name() == "neighbors") {
    return add_neighbors(link);
  }
  if (link.name() == "axis") {
    return add_axis(link);
  }
  if (link.name() == "grid") {
    return add_grid(link);
  }
  if (link.name() == "guided") {
    // Choosing takes up to a second: not before the parameters are known to be right.
    if (Status status = link.done(); !status) {
      return status;
    }
    const auto guided = GuidedBrdf::make(chain_.brdf, extent_);
    if (guided) {
      chain_.metadata = (*guided)->metadata();
    }
    return wrap(link, guided, "guided");
  }
  if (link.name() == "clamp" || link.name() == "gradient") {
    return add_edges(link, link.name() == "gradient");
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("chain: there is no link \"{}\"", link.name()),
              kAllLinks);
}

}  // namespace

Result<Chain> make_chain(std::shared_ptr<const Brdf> data, std::string_view text) {
  if (text == "default") {
    return default_chain(std::move(data));
  }
  if (text == "best") {
    return best_chain(std::move(data));
  }
  Result<std::vector<LinkText>> links = parse_chain_text(text);
  if (!links) {
    return std::unexpected(links.error());
  }
  Builder builder(std::move(data));
  for (LinkText& link : *links) {
    if (Status status = builder.add(link); !status) {
      return std::unexpected(status.error());
    }
  }
  return std::move(builder).take();
}

namespace {

/// between: the link between incidences.
Result<Chain> chain_with(std::shared_ptr<const Brdf> data, std::string_view between) {
  const Extent extent = extent_of(*data);
  std::string text;
  const auto then = [&](std::string_view link) {
    text += fmt::format("{}{}", text.empty() ? "" : ",", link);
  };
  const bool scattered = dynamic_cast<const ScatteredBrdf*>(data.get()) != nullptr;
  if (scattered) {
    then(extent.theta_i.empty() ? "neighbors" : "axis");
  }
  if (scattered || dynamic_cast<const GridBrdf*>(data.get()) != nullptr) {
    if (extent.theta_o_to < kPi / 2 - kSameAngle && extent.theta_o_to > radians(1) + kSameAngle) {
      then("bezier");
    }
    if (extent.theta_i.size() > 1) {
      then(between);
    }
    if (!extent.theta_i.empty()) {
      then("clamp:over=theta_i");
    }
  } else if (between == "guided" && extent.theta_i.size() > 1) {
    then(between);
  }
  return make_chain(std::move(data), text);
}

}  // namespace

Result<Chain> default_chain(std::shared_ptr<const Brdf> data) {
  return chain_with(std::move(data), "specular");
}

Result<Chain> best_chain(std::shared_ptr<const Brdf> data) {
  return chain_with(std::move(data), "guided");
}

}  // namespace scatter::reflectance
