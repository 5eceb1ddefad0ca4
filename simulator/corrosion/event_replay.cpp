#include "simulator/corrosion/event_replay.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

namespace scatter::corrosion {
namespace {

constexpr std::size_t kFetchAhead = 24;

}  // namespace

EventReplay::EventReplay(const GrowthOptions& options, const EventSetup& setup, const EventLog& log,
                         std::shared_ptr<const std::vector<float>> birth_years)
    : options_(&options), setup_(&setup), log_(&log), cells_(setup), metal_(setup) {
  sheet_.side = options.side;
  sheet_.extent_mm = options.extent_mm;
  sheet_.thickness_mm = options.thickness_mm;
  sheet_.toroidal = options.border == Border::kToroidal;
  sheet_.birth_years = std::move(birth_years);
  sheet_.state.resize(options.side * options.side, CellState::kUntouched);
  for (std::size_t i = 0; i < setup.opening.size(); ++i) {
    if (setup.opening[i] != 0) {
      sheet_.state[i] = CellState::kHole;
    }
  }
  counts_[0] = setup.metal_cells;
}

void EventReplay::set(std::uint32_t cell, CellState state) noexcept {
  --counts_[static_cast<std::size_t>(sheet_.state[cell])];
  ++counts_[static_cast<std::size_t>(state)];
  sheet_.state[cell] = state;
}

void EventReplay::take(std::uint32_t cell) {
  const std::int64_t units = metal_.hit(cell);
  removed_ += units;
  hits_[hit_count_++] = {cell, units};
}

void EventReplay::apply(std::uint32_t event) {
  const std::uint32_t cell = event & ~EventLog::kDepth;
  hit_count_ = 0;
  take(cell);
  if ((event & EventLog::kDepth) != 0) {
    if (metal_.gone(cell)) {
      set(cell, CellState::kHole);
    }
    return;
  }
  set(cell, metal_.gone(cell) ? CellState::kHole : CellState::kSpreading);
  cells_.corrode(
      cell, [this](std::uint32_t other) { set(other, CellState::kThreatened); },
      [this](std::uint32_t other) {
        if (setup_->conversion_removes) {
          take(other);
        }
        set(other, metal_.gone(other) ? CellState::kHole : CellState::kDeepening);
      });
}

void EventReplay::apply_late_seeds() {
  while (late_done_ < log_->late_seeds.size() && log_->late_seeds[late_done_].before_event <= done_) {
    const std::uint32_t cell = log_->late_seeds[late_done_++].cell;
    cells_.threaten(cell);
    set(cell, CellState::kThreatened);
  }
}

void EventReplay::show(double age_years, const std::function<void(const Sheet&)>& visit) {
  const std::int64_t target = target_units(*options_, *setup_, age_years);
  const std::vector<std::uint32_t>& events = log_->events;
  while (removed_ < target && done_ < events.size()) {
    const std::uint32_t soon = events[std::min(done_ + kFetchAhead, events.size() - 1)];
    const std::uint32_t cell = soon & ~EventLog::kDepth;
    metal_.fetch(cell);
    if ((soon & EventLog::kDepth) == 0) {
      cells_.fetch(cell);
      __builtin_prefetch(sheet_.state.data() + cell, 1);
    }
    apply_late_seeds();
    apply(events[done_++]);
  }

  std::array<Hit, 10> trimmed{};
  std::int64_t excess = std::max<std::int64_t>(removed_ - target, 0);
  sheet_.mass_loss_g_per_m2 = loss_of_units(*options_, *setup_, static_cast<double>(removed_ - excess));
  for (std::size_t i = hit_count_; i-- > 0 && excess > 0;) {
    trimmed[i] = {hits_[i].cell, std::min(hits_[i].units, excess)};
    excess -= trimmed[i].units;
    metal_.give_back(trimmed[i].cell, trimmed[i].units);
    if (sheet_.state[trimmed[i].cell] == CellState::kHole && trimmed[i].units > 0) {
      set(trimmed[i].cell, cells_.enclosed(trimmed[i].cell) ? CellState::kDeepening : CellState::kSpreading);
    }
  }

  const double share = 1 / static_cast<double>(std::max<std::size_t>(setup_->metal_cells, 1));
  const double wanted = mass_loss_g_per_m2(options_->corrosivity, options_->law, age_years);
  sheet_.age_years = age_years;
  sheet_.target_g_per_m2 = wanted;
  sheet_.corroded_fraction = static_cast<double>(counts_[2] + counts_[3] + counts_[4]) * share;
  sheet_.state3_fraction = static_cast<double>(counts_[3]) * share;
  sheet_.hole_fraction = static_cast<double>(counts_[4]) * share;
  sheet_.events = done_;
  sheet_.exhausted = removed_ < target || wanted > attainable_loss_g_per_m2(*options_, age_years);
  std::swap(sheet_.height, metal_.heights());
  visit(sheet_);
  std::swap(sheet_.height, metal_.heights());

  for (const Hit& hit : trimmed) {
    if (hit.units > 0) {
      metal_.give_back(hit.cell, -hit.units);
      if (metal_.gone(hit.cell)) {
        set(hit.cell, CellState::kHole);
      }
    }
  }
}

}  // namespace scatter::corrosion
