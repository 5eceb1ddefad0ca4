#include "simulator/corrosion/mass_clock.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

namespace scatter::corrosion {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// Bins are numbered by the leading bits of tau: 10 of its fraction make 1024 to each doubling.
constexpr unsigned kDroppedBits = 52 - 10;
/// The first bin ends here; the last one begins at the other.
constexpr double kFirstEdge = 0x1p-20;
constexpr double kLastEdge = 0x1p60;

constexpr std::uint64_t leading_bits(double tau) {
  return std::bit_cast<std::uint64_t>(tau) >> kDroppedBits;
}

}  // namespace

MassClock::MassClock(const DepthLaw& law, std::size_t metal_cells)
    : law_(law), cells_(static_cast<double>(metal_cells)) {}

std::size_t MassClock::bin_of(double tau) noexcept {
  if (tau < kFirstEdge) {
    return 0;
  }
  return static_cast<std::size_t>(leading_bits(std::min(tau, kLastEdge)) - leading_bits(kFirstEdge)) + 1;
}

double MassClock::upper_edge(std::size_t bin) noexcept {
  return std::bit_cast<double>((leading_bits(kFirstEdge) + bin) << kDroppedBits);
}

std::array<MassClock::Bend, 3> MassClock::bends(float birth, float rate) const noexcept {
  const double begin = birth;
  const double steep = law_.skin / law_.width + rate;
  if (steep * law_.width >= 1) {  // gone before the skin is complete
    return {Bend{begin, steep}, Bend{begin + 1 / steep, -steep}, Bend{kNever, 0}};
  }
  return {Bend{begin, steep}, Bend{begin + law_.width, rate - steep},
          Bend{rate > 0 ? begin + (1 - law_.skin) / rate : kNever, -static_cast<double>(rate)}};
}

void MassClock::add(float birth, float rate) {
  for (const Bend& bend : bends(birth, rate)) {
    if (bend.slope == 0 || bend.tau >= kLastEdge) {
      continue;
    }
    const std::size_t bin = std::max(bin_of(bend.tau), bins_.size());
    if (bin >= changes_.size()) {
      changes_.resize(bin + 1);
    }
    changes_[bin].slope += bend.slope;
    changes_[bin].moment += bend.slope * (upper_edge(bin) - bend.tau);
  }
}

double MassClock::close_bin() {
  const std::size_t bin = bins_.size();
  const double width = upper_edge(bin) - (bin == 0 ? 0 : upper_edge(bin - 1));
  double gained = slope_ * width;
  const double slope = slope_;
  if (bin < changes_.size()) {
    gained += changes_[bin].moment;
    slope_ += changes_[bin].slope;
  }
  // Sums of slopes that went back to nothing may leave a trace below it.
  bins_.push_back({.slope = slope, .loss = loss() + std::max(gained, 0.0) / cells_});
  return loss();
}

std::vector<MassClock::Point> MassClock::edges() const {
  std::vector<Point> points;
  points.reserve(bins_.size());
  for (std::size_t bin = 0; bin < bins_.size(); ++bin) {
    points.push_back({.tau = upper_edge(bin), .loss = bins_[bin].loss});
  }
  return points;
}

std::vector<double> MassClock::solve(std::span<const double> losses, std::span<const float> births,
                                     std::span<const float> rates) const {
  std::vector<double> taus(losses.size());
  std::vector<std::size_t> bin_of_loss(losses.size());
  // 1 + number of the list of bends for each bin that a loss is reached in.
  std::vector<std::uint32_t> wanted(bins_.size() + 1, 0);
  std::vector<std::vector<Bend>> lists;
  for (std::size_t i = 0; i < losses.size(); ++i) {
    const auto found = std::ranges::lower_bound(bins_, losses[i], {}, &Bin::loss);
    bin_of_loss[i] = static_cast<std::size_t>(found - bins_.begin());
    if (found != bins_.end() && wanted[bin_of_loss[i]] == 0) {
      lists.emplace_back();
      wanted[bin_of_loss[i]] = static_cast<std::uint32_t>(lists.size());
    }
  }
  for (std::size_t cell = 0; cell < births.size() && !lists.empty(); ++cell) {
    if (births[cell] == std::numeric_limits<float>::infinity()) {
      continue;
    }
    for (const Bend& bend : bends(births[cell], rates[cell])) {
      const std::size_t bin = std::min(bin_of(bend.tau), bins_.size());
      if (const std::uint32_t list = wanted[bin]; list != 0) {
        lists[list - 1].push_back(bend);
      }
    }
  }
  for (auto& list : lists) {
    std::ranges::sort(list, {}, &Bend::tau);
  }
  for (std::size_t i = 0; i < losses.size(); ++i) {
    const std::size_t bin = bin_of_loss[i];
    if (bin == bins_.size()) {
      taus[i] = bins_.empty() ? 0 : upper_edge(bins_.size() - 1);
      continue;
    }
    double tau = bin == 0 ? 0 : upper_edge(bin - 1);
    double slope = bins_[bin].slope;
    double missing = (losses[i] - (bin == 0 ? 0 : bins_[bin - 1].loss)) * cells_;
    for (const Bend& bend : lists[wanted[bin] - 1]) {
      const double gained = slope * (bend.tau - tau);
      if (gained >= missing) {
        break;
      }
      missing -= gained;
      tau = bend.tau;
      slope += bend.slope;
    }
    taus[i] = slope > 0 ? std::min(tau + missing / slope, upper_edge(bin)) : tau;
  }
  return taus;
}

}  // namespace scatter::corrosion
