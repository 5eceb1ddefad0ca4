// One run of corrosion, from which a sheet of any age can be had.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/growth_options.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::corrosion {

/// The history of a sheet: when rust reached each cell and how deep it went since.
///
/// Ages are nested by construction: what is corroded at one age is corroded at every later one, and no cell
/// grows back. Metal is trimmed at the last event, so the loss is the law's to 1e-6.
/// Threads   const functions may be called from any number of threads; the same options give the same history
///           for any number of threads.
class Growth {
 public:
  /// Share done, 0..1; called from the thread that runs.
  using Progress = std::function<void(double)>;

  /// Lets a sheet corrode up to options.age_years.
  /// Errors  kInvalidArgument names the parameter, what it is and its range; kResourceExhausted when memory
  ///         does not suffice; kAborted when stopped.
  /// Cost    docs/corrosion.md; one thread.
  [[nodiscard]] static Result<std::shared_ptr<const Growth>> run(GrowthOptions options,
                                                                 const Progress& progress = {},
                                                                 const std::stop_token& stop = {});
  /// One run per entry, on all cores: the same results as one after the other. Progress counts finished runs.
  [[nodiscard]] static std::vector<Result<std::shared_ptr<const Growth>>> run_all(
      std::span<const GrowthOptions> options, const Progress& progress = {},
      const std::stop_token& stop = {});

  virtual ~Growth() = default;
  Growth(const Growth&) = delete;
  Growth& operator=(const Growth&) = delete;

  /// As used: ages and maps clamped.
  [[nodiscard]] const GrowthOptions& options() const noexcept { return options_; }
  /// What was changed or should be known, one sentence each: "age 150 is taken as 100 years".
  [[nodiscard]] std::span<const std::string> notes() const noexcept { return notes_; }

  /// The sheet at `age_years`, which is clamped to 0..options().age_years.
  /// Errors  kInvalidArgument when it is not finite.
  [[nodiscard]] Result<Sheet> at(double age_years) const;

  /// Shows the sheet at each of `ages_years` (rising) in turn; the next one overwrites it. Much cheaper than
  /// `at` for each. Errors: kInvalidArgument when ages fall or are not finite.
  [[nodiscard]] Status each(std::span<const double> ages_years,
                            const std::function<void(const Sheet&)>& visit) const;

 protected:
  Growth(GrowthOptions options, std::vector<std::string> notes)
      : options_(std::move(options)), notes_(std::move(notes)) {}
  /// Ages are checked, clamped and rising.
  virtual void replay(std::span<const double> ages_years,
                      const std::function<void(const Sheet&)>& visit) const = 0;

 private:
  GrowthOptions options_;
  std::vector<std::string> notes_;
};

}  // namespace scatter::corrosion
