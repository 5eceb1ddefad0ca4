// Runs an event log again, up to any age.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "simulator/corrosion/event_cells.h"
#include "simulator/corrosion/event_log.h"
#include "simulator/corrosion/event_metal.h"
#include "simulator/corrosion/event_setup.h"
#include "simulator/corrosion/growth_options.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::corrosion {

/// Goes forwards only. States, heights and fractions are kept up event by event, so that showing an age costs
/// nothing that grows with the sheet.
class EventReplay {
 public:
  /// All must outlive this. `birth_years` is what sheets will point to.
  EventReplay(const GrowthOptions& options, const EventSetup& setup, const EventLog& log,
              std::shared_ptr<const std::vector<float>> birth_years);

  /// Applies events until the loss at this age is reached, and shows the sheet with the last one trimmed.
  void show(double age_years, const std::function<void(const Sheet&)>& visit);

 private:
  struct Hit {
    std::uint32_t cell;
    std::int64_t units;
  };

  void apply(std::uint32_t event);
  void apply_late_seeds();
  void take(std::uint32_t cell);
  void set(std::uint32_t cell, CellState state) noexcept;

  const GrowthOptions* options_;
  const EventSetup* setup_;
  const EventLog* log_;
  EventCells cells_;
  MetalHeights metal_;
  Sheet sheet_;
  std::size_t done_ = 0;        ///< Events.
  std::size_t late_done_ = 0;   ///< Late seeds.
  std::int64_t removed_ = 0;    ///< Units, with all of the last event.
  std::array<Hit, 10> hits_{};  ///< Of the last event: a cell, and those that its corrosion converted.
  std::size_t hit_count_ = 0;
  std::array<std::size_t, 5> counts_{};  ///< Cells in each state; openings in none.
};

}  // namespace scatter::corrosion
