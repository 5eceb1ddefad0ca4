#include "host_sdk/reflectance/models/film.h"

#include <algorithm>

#include "host_sdk/reflectance/models/warp.h"

namespace scatter::reflectance {

Origin Film::eval(const Direction& omega_i, const Direction& omega_o,
                  std::span<double> f_per_sr) const noexcept {
  if (!(omega_i.z > 0 && omega_o.z < 0)) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    f_per_sr[c] = parameters_.transmittance[c] * parameters_.haze[c] / kPi;
  }
  return Origin::kMeasured;
}

bool Film::dirac(const Direction& omega_i, std::span<double> weight) const noexcept {
  if (!(omega_i.z > 0)) {
    return false;
  }
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    weight[c] = parameters_.transmittance[c] * (1.0 - parameters_.haze[c]);
  }
  return true;
}

double Film::straight_share() const noexcept {
  double all = 0;
  double straight = 0;
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    all += parameters_.transmittance[c];
    straight += parameters_.transmittance[c] * (1.0 - parameters_.haze[c]);
  }
  return all > 0 ? straight / all : 0.0;
}

DrawnDirection Film::sample(const Direction& omega_i, const SampleInput& u,
                            std::span<double> throughput) const noexcept {
  std::ranges::fill(throughput, 0.0);
  DrawnDirection out{.omega_o = {-omega_i.x, -omega_i.y, -omega_i.z}};
  if (!(omega_i.z > 0) || parameters_.transmittance == ChannelValues{}) {
    return out;
  }
  const double straight = straight_share();
  if (u[2] < straight) {
    out.density = straight;
    out.is_dirac = true;
    (void)Film::dirac(omega_i, throughput);
    for (double& t : throughput) {
      t /= straight;
    }
    return out;
  }
  const Direction up = warp::cosine(u[0], u[1]);
  out.omega_o = {up.x, up.y, -up.z};
  out.density = Film::pdf(omega_i, out.omega_o);
  if (out.density > 0) {
    (void)Film::eval(omega_i, out.omega_o, throughput);
    for (double& t : throughput) {
      t *= up.z / out.density;
    }
  }
  return out;
}

double Film::pdf(const Direction& omega_i, const Direction& omega_o) const noexcept {
  if (!(omega_i.z > 0 && omega_o.z < 0) || parameters_.transmittance == ChannelValues{}) {
    return 0;
  }
  return (1 - straight_share()) * -omega_o.z / kPi;
}

}  // namespace scatter::reflectance
