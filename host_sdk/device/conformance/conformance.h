// What a device must do to be an OpenScatter instrument, as checks that anybody can run: on hardware, on a
// simulator, on an emulated board. Only the wire is used, so all of them are judged alike.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/device/transport.h"
#include "host_sdk/error/error.h"

namespace scatter::conformance {

enum class Verdict : std::uint8_t {
  kPassed,
  kFailed,
  kMeasured,  ///< A figure without a limit, or one whose limit does not hold for this link.
  kSkipped,   ///< Could not be asked of this device, or not without --write.
};

[[nodiscard]] std::string_view name(Verdict verdict) noexcept;

/// One promise of a device.
struct CheckInfo {
  std::string_view name;     ///< Lower case with hyphens.
  std::string_view promise;  ///< One sentence.
  std::string_view rule;     ///< Where it is written: rules of SPEC.md, ports of firmware/ports/ports.h.
  std::string_view look_at;  ///< Where to look when it fails.
  bool writes = false;       ///< Changes what the device remembers, and puts back what it found.
};

/// All checks, in the order in which they run.
[[nodiscard]] std::span<const CheckInfo> checks() noexcept;

struct Finding {
  CheckInfo check;
  Verdict verdict = Verdict::kPassed;
  std::string measured;  ///< Figures; may be empty.
  std::string trouble;   ///< What was expected and what was found; kSkipped: why. "" when passed.
};

struct Options {
  /// Opens the carrier to the device anew; asked before every check and after every reboot. A simulator in
  /// this process must give the same instrument each time.
  std::function<Result<std::unique_ptr<device::Transport>>(const device::Wait&)> open;
  std::vector<std::string> only;  ///< Names of checks; empty = all.
  bool write = false;             ///< Run the checks that write, too.
  std::stop_token stop;
  std::function<void(double fraction, std::string_view check)> progress;  ///< May be empty.
};

struct Report {
  std::vector<Finding> findings;
  [[nodiscard]] std::size_t count(Verdict verdict) const noexcept;
  [[nodiscard]] bool passed() const noexcept { return count(Verdict::kFailed) == 0; }
};

/// Runs the checks one after the other; a failed one does not keep the others from running.
///
/// Leaves   what a device keeps without power is unchanged by a device that passes, and by any device in
///          checks that send nothing to be stored; checks with `writes` run with Options::write only. What
///          it forgets anyway (the recipe in force, the settings epoch, run numbers) changes.
/// Time     bounded: each check ends by itself after 60 s of the transport's clock at the latest.
/// Errors   kInvalidArgument: an unknown name in `only`; kAborted: stopped on request; whatever
///          Options::open gives when the device cannot be reached at all.
[[nodiscard]] Result<Report> run(const Options& options);

}  // namespace scatter::conformance
