// Sheets of several seeds and ages, grown and written.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "simulator/corrosion/sheet.h"
#include "tools/plot/strip.h"
#include "tools/scatter/corrode_options.h"

namespace scatter::cli {

/// What there is to say of one sheet at one age.
struct SheetFigures {
  std::uint64_t seed = 0;
  double age_years = 0;
  double target_g_per_m2 = 0;
  double mass_loss_g_per_m2 = 0;
  double corroded_fraction = 0;
  double state3_fraction = 0;
  double hole_fraction = 0;
  std::uint64_t events = 0;
  bool exhausted = false;
  std::string hash;
  plot::StripTile tile;  ///< The preview, small; only when a strip is wanted.
};

struct GrownSheets {
  std::vector<SheetFigures> figures;  ///< By seed as asked, then by age.
  corrosion::GrowthOptions used;      ///< Of the first seed.
  std::vector<std::string> notes;
  double seconds = 0;  ///< Growing alone, summed over the seeds.
};

/// Grows all sheets of the plan and writes them under `folder`: straight into it, or into seed-N, age-A, or
/// seed-N/age-A. As many at a time as there are cores and as memory allows, each with the same bytes as
/// alone. `progress` gets the share done, 0..1, from one thread at a time. Errors    kResourceExhausted: one
/// sheet needs more memory than the machine has left; kAborted when stopped; of growth
///           and files. The first error ends the batch.
[[nodiscard]] Result<GrownSheets> grow_and_write(const CorrodePlan& plan, const std::filesystem::path& folder,
                                                 const std::function<void(double)>& progress,
                                                 const std::stop_token& stop);

/// "age-5", "age-2.5".
[[nodiscard]] std::string age_folder(double age_years);

}  // namespace scatter::cli
