// The frames of a calibration session, averaged as they come.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/measurement/calibrate.h"
#include "host_sdk/measurement/references.h"
#include "protocol/types.h"

namespace scatter::measurement {

/// Takes dark, reference and black frames, in this order, and makes a ReferenceSet of them.
class ReferenceRun {
 public:
  ReferenceRun(device::Device& device, Geometry geometry, std::stop_token stop) noexcept;

  /// One step; the target lies under the instrument already.
  /// Errors  kFailedPrecondition: the reference is saturated or gives no signal (wrong target placed).
  [[nodiscard]] Status take(protocol::Target target, const std::function<void(double fraction)>& progress);

  [[nodiscard]] Result<std::shared_ptr<const ReferenceSet>> finish();

 private:
  [[nodiscard]] Status take_dark(const std::function<void(double)>& progress);
  [[nodiscard]] Status take_reference(protocol::Target target, const std::function<void(double)>& progress);

  device::Device* device_;
  Geometry geometry_;
  std::stop_token stop_;
  ReferenceSet::Content content_;
};

}  // namespace scatter::measurement
