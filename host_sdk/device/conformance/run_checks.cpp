// Runs: every exposure is accounted for, however the run ends.
#include <algorithm>

#include "host_sdk/device/conformance/check_functions.h"
#include "host_sdk/device/conformance/finished_run.h"
#include "host_sdk/device/conformance/wire_probe.h"

namespace scatter::conformance {

using protocol::RunEnd;

namespace {

/// A run long enough to be interrupted: 2000 frames.
protocol::Recipe long_recipe(const protocol::Descriptor& descriptor) {
  protocol::Recipe recipe = small_recipe(descriptor);
  recipe.repeats = 2000;
  return recipe;
}

void judge_ledger(const device::RunSummary& run, RunEnd reason, Judgement& judge) {
  const protocol::Ledger& ledger = run.ledger;
  judge.require(run.device_reported, "the device gave no report of the run");
  judge.equal("the reason of the run's end", static_cast<int>(reason), static_cast<int>(run.reason));
  judge.require(
      ledger.balances(),
      fmt::format("the ledger does not balance: {} exposed, {} delivered, {} lost by the sensor, {} by the "
                  "firmware, {} by the link, {} by the host, {} corrupt",
                  ledger.exposed, ledger.delivered, ledger.lost_sensor, ledger.lost_firmware,
                  ledger.lost_link, ledger.lost_host, ledger.corrupt));
  judge.equal("exposed = lost_sensor + lost_firmware + frames_sent", ledger.exposed,
              ledger.lost_sensor + ledger.lost_firmware + run.frames_sent);
  judge.equal("the number of corrupt frames", std::uint64_t{0}, ledger.corrupt);
  if (run.link.bad_frames == 0 && run.link.skipped_bytes == 0) {
    judge.equal("the number of frames lost on a link without damage", std::uint64_t{0}, ledger.lost_link);
  }
  judge.require(run.ended_us >= run.started_us, "the run ended before it started");
  judge.measured(fmt::format("{} exposed, {} delivered, {} dropped by the device", ledger.exposed,
                             ledger.delivered, ledger.lost_firmware + ledger.lost_sensor));
}

}  // namespace

void check_run_completed(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  protocol::Recipe recipe = small_recipe(device->descriptor());
  recipe.repeats = 5;
  recipe.off_frames = 1;
  const auto run = run_to_end(*device, recipe, subject);
  if (!run) {
    return judge.broken("a run of ten frames", run.error());
  }
  judge_ledger(run->summary, RunEnd::kCompleted, judge);
  judge.equal("the planned frames", 10U, run->configured.planned_frames);
  judge.equal("the exposures lost by the sensor", std::uint64_t{0}, run->summary.ledger.lost_sensor);
  judge.equal("the exposures", std::uint64_t{10}, run->summary.ledger.exposed);
  judge.equal("the delivered frames", std::uint64_t{10}, run->summary.ledger.delivered);
  for (std::size_t i = 0; i < run->frames.size(); ++i) {
    judge.equal("a frame's id", std::uint32_t(i), run->frames[i].begin.frame_id);
    judge.equal("a frame's settings epoch", run->configured.epoch, run->frames[i].begin.epoch);
  }
}

void check_run_stopped(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const auto configured = device->configure(long_recipe(device->descriptor()), subject.wait());
  if (!configured) {
    return judge.broken("set_configuration", configured.error());
  }
  auto stream = device->start({}, subject.wait());
  if (!stream) {
    return judge.broken("start", stream.error());
  }
  for (int i = 0; i < 3; ++i) {
    if (const auto frame = stream->next(subject.wait()); !frame || !*frame) {
      return judge.complain("the run gave no three frames");
    }
  }
  if (const Status stopped = stream->stop(subject.wait()); !stopped) {
    return judge.broken("stop", stopped.error());
  }
  while (true) {
    const auto frame = stream->next(subject.wait());
    if (!frame) {
      return judge.broken("the frames on the way", frame.error());
    }
    if (!*frame) {
      break;
    }
  }
  judge_ledger(stream->summary(), RunEnd::kStopped, judge);
  judge.require(stream->summary().ledger.exposed < configured->planned_frames, "stop did not end the run");
  const auto status = device->status(subject.wait());
  judge.require(status && status->run_state == 0, "the device is not idle after stop");
}

void check_run_aborted(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const auto configured = device->configure(long_recipe(device->descriptor()), subject.wait());
  if (!configured) {
    return judge.broken("set_configuration", configured.error());
  }
  auto stream = device->start({}, subject.wait());
  if (!stream) {
    return judge.broken("start", stream.error());
  }
  if (const auto frame = stream->next(subject.wait()); !frame || !*frame) {
    return judge.complain("the run gave no frame");
  }
  const auto summary = stream->abort(subject.wait());
  if (!summary) {
    return judge.broken("abort", summary.error());
  }
  judge_ledger(*summary, RunEnd::kAborted, judge);
  const auto status = device->status(subject.wait());
  judge.require(status && status->run_state == 0, "the device is not idle after abort");
}

void check_run_order(Subject& subject, Judgement& judge) {
  const auto descriptor = subject.descriptor();
  if (!descriptor) {
    return judge.broken("open", descriptor.error());
  }
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  const protocol::SetConfiguration configuration{.recipe = long_recipe(*descriptor)};
  const auto accepted = probe->ask<protocol::ConfigurationAccepted>(configuration);
  if (!accepted) {
    return judge.broken("set_configuration", accepted.error());
  }
  judge.refused(
      "start with another settings epoch",
      probe->ask<protocol::Started>(protocol::Start{.epoch = accepted->epoch + 1, .may_send_until = 0}),
      ErrorCode::kFailedPrecondition);
  const protocol::Start start{.epoch = accepted->epoch, .may_send_until = 0};
  const auto first = probe->ask<protocol::Started>(start);
  if (!first) {
    return judge.broken("start", first.error());
  }
  judge.refused("start while a run is on", probe->ask<protocol::Started>(start),
                ErrorCode::kFailedPrecondition);
  judge.refused("set_configuration while a run is on",
                probe->ask<protocol::ConfigurationAccepted>(configuration), ErrorCode::kFailedPrecondition);
  const auto aborted = probe->ask<protocol::RunReport>(protocol::Abort{});
  if (!aborted) {
    return judge.broken("abort", aborted.error());
  }
  judge.equal("the exposures of a run without credit", std::uint64_t{0}, aborted->ledger.exposed);
  const auto again = probe->ask<protocol::RunReport>(protocol::Stop{});
  if (!again) {
    return judge.broken("stop without a run", again.error());
  }
  judge.equal("the run that stop without a run reports", first->run_id, again->run_id);
  const auto second = probe->ask<protocol::Started>(start);
  if (!second) {
    return judge.broken("start after abort", second.error());
  }
  judge.equal("the id of the next run", first->run_id + 1, second->run_id);
  (void)probe->ask<protocol::RunReport>(protocol::Abort{});
}

void check_credit_hold(Subject& subject, Judgement& judge) {
  const auto descriptor = subject.descriptor();
  if (!descriptor) {
    return judge.broken("open", descriptor.error());
  }
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  protocol::Recipe recipe = small_recipe(*descriptor);
  recipe.repeats = 6;
  const auto accepted =
      probe->ask<protocol::ConfigurationAccepted>(protocol::SetConfiguration{.recipe = recipe});
  if (!accepted) {
    return judge.broken("set_configuration", accepted.error());
  }
  const auto started =
      probe->ask<protocol::Started>(protocol::Start{.epoch = accepted->epoch, .may_send_until = 2});
  if (!started) {
    return judge.broken("start", started.error());
  }
  const auto ends = [](const std::vector<Received>& frames) {
    return std::ranges::count_if(
        frames, [](const Received& frame) { return frame.as<protocol::FrameEnd>().has_value(); });
  };
  const auto first = probe->collect(std::chrono::milliseconds(400));
  if (!first) {
    return judge.broken("two frames", first.error());
  }
  judge.equal("the number of frames sent with credit for two", std::ptrdiff_t{2}, ends(*first));
  const auto held = probe->status();
  judge.require(held && held->run_state == static_cast<std::uint8_t>(protocol::RunState::kHolding),
                "the device does not report that it holds for credit");
  const auto grant = [&](std::uint32_t run, std::uint32_t until) {
    return probe->write(probe->frame_of(protocol::Credit{.run_id = run, .may_send_until = until}, 0,
                                        protocol::Channel::kEvent));
  };
  // A grant for another run and a lower one change nothing.
  if (!grant(started->run_id + 1, 6) || !grant(started->run_id, 1)) {
    return judge.complain("a grant could not be sent");
  }
  const auto nothing = probe->collect();
  judge.require(nothing && ends(*nothing) == 0,
                "a grant for another run, or a lower one, let frames through");
  if (const Status granted = grant(started->run_id, 6); !granted) {
    return judge.broken("a grant", granted.error());
  }
  std::vector<Received> rest;
  std::optional<protocol::RunFinished> finished;
  const device::TimePoint end = probe->now() + std::chrono::seconds(20);
  while (!finished) {
    auto frame = probe->next(end);
    if (!frame) {
      return judge.broken("the rest of the run", frame.error());
    }
    finished = frame->as<protocol::RunFinished>();
    rest.push_back(std::move(*frame));
  }
  judge.equal("the number of frames after the grant", std::ptrdiff_t{4}, ends(rest));
  judge.equal("the exposures lost by the sensor", std::uint64_t{0}, finished->ledger.lost_sensor);
  judge.equal("the exposures", std::uint64_t{6}, finished->ledger.exposed);
  judge.equal("the frames sent", 6U, finished->frames_sent);
  judge.require(finished->held_us > 0, "the time held is not reported");
  const bool flagged = std::ranges::any_of(rest, [](const Received& frame) {
    const auto frame_end = frame.as<protocol::FrameEnd>();
    return frame_end && (frame_end->flags & protocol::kFrameHeldForCredit) != 0;
  });
  judge.require(flagged, "the frame that waited for credit is not flagged");
  judge.measured(fmt::format("held {:.0f} ms", static_cast<double>(finished->held_us) / 1000));
}

void check_live_preview(Subject& subject, Judgement& judge) {
  const auto descriptor = subject.descriptor();
  if (!descriptor) {
    return judge.broken("open", descriptor.error());
  }
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  protocol::Recipe recipe = small_recipe(*descriptor);
  recipe.repeats = 8;
  recipe.live_preview = 1;
  const auto accepted =
      probe->ask<protocol::ConfigurationAccepted>(protocol::SetConfiguration{.recipe = recipe});
  if (!accepted) {
    return judge.broken("set_configuration", accepted.error());
  }
  const auto started =
      probe->ask<protocol::Started>(protocol::Start{.epoch = accepted->epoch, .may_send_until = 3});
  if (!started) {
    return judge.broken("start", started.error());
  }
  std::uint32_t ends = 0;
  std::optional<protocol::RunFinished> finished;
  const device::TimePoint end = probe->now() + std::chrono::seconds(20);
  while (!finished) {
    const auto frame = probe->next(end);
    if (!frame) {
      return judge.broken("a live preview without credit", frame.error());
    }
    ends += frame->as<protocol::FrameEnd>() ? 1U : 0U;
    finished = frame->as<protocol::RunFinished>();
  }
  judge.equal("the exposures lost by the sensor", std::uint64_t{0}, finished->ledger.lost_sensor);
  judge.equal("the exposures", std::uint64_t{8}, finished->ledger.exposed);
  judge.equal("the frames that came with credit for three", 3U, ends);
  judge.equal("the frames dropped by the firmware", std::uint64_t{5}, finished->ledger.lost_firmware);
  judge.equal("the time held", std::uint64_t{0}, finished->held_us);
  judge.measured(fmt::format("{} of 8 frames dropped at the source", finished->ledger.lost_firmware));
}

}  // namespace scatter::conformance
