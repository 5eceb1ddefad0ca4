#include <catch2/catch.hpp>

#include "tests/unit/firmware/fake_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

TEST_CASE("Start needs a configuration, its epoch, and no other run") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  CHECK(host.status_of(Start{.epoch = 0, .may_send_until = 1}) == StatusCode::kFailedPrecondition);
  const std::uint32_t epoch = host.configure(fixed_recipe());
  CHECK(host.status_of(Start{.epoch = epoch + 1, .may_send_until = 1}) == StatusCode::kFailedPrecondition);
  host.start(epoch, 1);
  CHECK(host.status_of(Start{.epoch = epoch, .may_send_until = 1}) == StatusCode::kFailedPrecondition);
  CHECK(host.status_of(SetConfiguration{.recipe = fixed_recipe()}) == StatusCode::kFailedPrecondition);
}

TEST_CASE("Each wrong field of a recipe is refused and changes nothing") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const std::uint32_t epoch = host.configure(fixed_recipe());
  const std::vector<std::function<void(Recipe&)>> mistakes{
      [](Recipe& r) { r.illuminations.push_back(12); },
      [](Recipe& r) { r.exposures_us.clear(); },
      [](Recipe& r) { r.exposures_us.push_back(9); },
      [](Recipe& r) { r.exposures_us.push_back(200'001); },
      [](Recipe& r) { r.off_exposure_us = 5; },
      [](Recipe& r) { r.repeats = 0; },
      [](Recipe& r) {
        r.region_x = 1;
        r.region_width = kWidth;
      },
      [](Recipe& r) { r.region_y = kHeight; },
      [](Recipe& r) { r.region_height = kHeight + 1; },
      [](Recipe& r) { r.pixel_format = static_cast<PixelFormat>(3); },
      [](Recipe& r) { r.target = static_cast<Target>(5); },
      [](Recipe& r) { r.exposure_mode = static_cast<ExposureMode>(2); },
      [](Recipe& r) {
        r.illuminations.clear();
        r.off_frames = 0;
      },
      [](Recipe& r) {
        r.exposure_mode = ExposureMode::kAuto;
        r.time_budget_us = 100'000;
      },
      [](Recipe& r) {
        r.exposure_mode = ExposureMode::kAuto;
        r.time_budget_us = 5'000'000;
        r.max_brackets = 0;
      },
      [](Recipe& r) {
        r.exposure_mode = ExposureMode::kAuto;
        r.time_budget_us = 5'000'000;
        r.live_preview = 1;
      },
  };
  for (std::size_t i = 0; i < mistakes.size(); ++i) {
    Recipe recipe = fixed_recipe();
    mistakes[i](recipe);
    INFO("mistake " << i);
    const StatusReply reply = host.ask(SetConfiguration{.recipe = recipe}).as<StatusReply>();
    CHECK(reply.status == StatusCode::kInvalidArgument);
    CHECK(!reply.text.empty());
  }
  const auto kept = host.ask(GetConfiguration{}).as<Configuration>();
  CHECK(kept.epoch == epoch);
  CHECK(kept.recipe == fixed_recipe());
}

TEST_CASE("With a stage, Start brings the target first and says PENDING") {
  FakeBoard board;
  board.with_stage = true;
  FakeHost host(board);
  CHECK((host.hello().capabilities & kCapabilityReferenceStage) != 0);
  const std::uint32_t epoch = host.configure(fixed_recipe());
  const std::uint64_t began = board.clock.time_us;
  const std::uint16_t start = host.send(Start{.epoch = epoch, .may_send_until = 100});
  REQUIRE(host.run(1'000'000, [&] { return host.final_reply(start).has_value(); }));
  CHECK(FakeHost::is_pending(host.replies(start)[0]));
  CHECK(host.final_reply(start)->as<Started>().device_time_us >= began + 300'000);
  CHECK(board.stage.at == Target::kSample);
  REQUIRE(host.run(10'000'000, [&] { return !host.all<RunFinished>().empty(); }));
  host.start(epoch);
  CHECK(board.stage.moves == 1);  // Already there.
}

TEST_CASE("Abort while the stage moves for Start answers both") {
  FakeBoard board;
  board.with_stage = true;
  FakeHost host(board);
  host.hello();
  const std::uint32_t epoch = host.configure(fixed_recipe());
  const std::uint16_t start = host.send(Start{.epoch = epoch, .may_send_until = 100});
  host.settle();
  CHECK(host.ask(Abort{}).as<RunReport>().run_id == 0);
  CHECK(host.final_reply(start)->as<StatusReply>().status == StatusCode::kAborted);
  host.run_for(1'000'000);
  CHECK(host.instrument().run_state() == RunState::kIdle);
}
