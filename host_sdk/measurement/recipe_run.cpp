#include "host_sdk/measurement/recipe_run.h"

#include <algorithm>

namespace scatter::measurement {

Result<device::RunSummary> run_recipe(device::Device& device, const protocol::Recipe& recipe,
                                      device::RecordingWriter* recorder, const std::stop_token& stop,
                                      const FrameSink& sink) {
  const device::Wait wait{std::chrono::seconds(10), stop};
  const auto configured = device.configure(recipe, wait);
  if (!configured) {
    return std::unexpected(configured.error());
  }
  device::StartOptions start;
  start.recorder = recorder;
  auto stream = device.start(start, wait);
  if (!stream) {
    return std::unexpected(stream.error());
  }
  const double planned = std::max<double>(1.0, configured->planned_frames);
  double seen = 0;
  while (true) {
    auto frame = stream->next(wait);
    Status failed;
    if (!frame) {
      failed = std::unexpected(frame.error());
    } else if (!*frame) {
      return stream->summary();
    } else {
      seen += 1;
      failed = sink(**frame, std::min(1.0, seen / planned));
    }
    if (!failed) {
      // The first error is the one to tell; that of the abort, if any, follows from it.
      (void)stream->abort({std::chrono::seconds(1), {}});
      return std::unexpected(failed.error());
    }
  }
}

}  // namespace scatter::measurement
