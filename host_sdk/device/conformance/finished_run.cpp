#include "host_sdk/device/conformance/finished_run.h"

#include <utility>

namespace scatter::conformance {

Result<FinishedRun> run_to_end(device::Device& device, const protocol::Recipe& recipe, const Subject& subject,
                               const device::StartOptions& options) {
  FinishedRun out;
  const auto configured = device.configure(recipe, subject.wait());
  if (!configured) {
    return std::unexpected(configured.error());
  }
  out.configured = *configured;
  auto stream = device.start(options, subject.wait());
  if (!stream) {
    return std::unexpected(stream.error());
  }
  const device::TimePoint end = device.now() + std::chrono::seconds(50);
  while (true) {
    auto frame = stream->next(subject.wait());
    if (!frame) {
      return std::unexpected(frame.error());
    }
    if (!*frame) {
      break;
    }
    out.frames.push_back(std::move(**frame));
    if (device.now() > end) {
      return fail(ErrorCode::kDeadlineExceeded, "the run was not over after 50 s",
                  "look at the device's link");
    }
  }
  out.summary = stream->summary();
  return out;
}

}  // namespace scatter::conformance
