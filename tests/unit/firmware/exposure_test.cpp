#include <catch2/catch.hpp>

#include <numbers>
#include <set>

#include "firmware/core/shot_sequence.h"
#include "tests/unit/firmware/fake_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

constexpr float kFullScale = 1023 - 16;
/// White reference (albedo 0.99): 80 % of full scale in 2.5 ms at the centre [DN/us].
constexpr float kWhiteRate = 0.8F * kFullScale / 2'500.F;

/// Share of the centre's light that reaches the edge: 1 to 0.3, as the instrument's vignetting.
float vignetting(float radius) {
  return 1.F - 0.7F * radius * radius;
}

/// Signal of a sample: diffuse albedo and a lobe `peak` times brighter than the diffuse part, over
/// pixels spread evenly over the image circle.
struct SampleScene {
  float albedo = 0.5F;
  float peak = 0;
  float colour_step = 1.F;           ///< Each further colour of a head is brighter by this factor.
  std::uint8_t first_with_lobe = 0;  ///< Illuminations before this one see no lobe.

  [[nodiscard]] float rate(std::uint8_t illumination, float x, float y) const {
    const float radius = std::hypot(x, y);
    const float head = static_cast<float>(illumination / 3U) * 0.2F;
    const float d2 = (x - head) * (x - head) + y * y;
    const float lobe = (illumination < first_with_lobe ? 0.F : peak) * std::exp(-d2 / (2 * 0.05F * 0.05F));
    float colour = 1;
    for (int c = illumination % 3; c > 0; --c) {
      colour *= colour_step;
    }
    return colour * kWhiteRate * albedo / 0.99F * vignetting(std::min(radius, 1.F)) * (1 + lobe);
  }
  [[nodiscard]] SceneBrightness at(std::uint8_t illumination, std::uint32_t exposure_us) const {
    std::vector<std::uint16_t> dn;
    SceneBrightness scene;
    for (float y = -1; y <= 1; y += 0.04F) {
      for (float x = -1; x <= 1; x += 0.04F) {
        if (std::hypot(x, y) <= 1) {
          const float signal = 16 + rate(illumination, x, y) * static_cast<float>(exposure_us);
          dn.push_back(static_cast<std::uint16_t>(std::min(std::round(signal), 1023.F)));
          scene.saturated_pixels += dn.back() >= 1023 ? 1U : 0U;
          scene.max_dn = std::max(scene.max_dn, dn.back() >= 1023 ? std::uint16_t{0} : dn.back());
        }
      }
    }
    std::nth_element(dn.begin(), dn.begin() + static_cast<std::ptrdiff_t>(dn.size() / 2), dn.end());
    scene.median_dn = dn[dn.size() / 2];
    return scene;
  }
};

struct RunOutcome {
  std::uint64_t duration_us = 0;
  std::vector<Shot> shots;
  [[nodiscard]] std::vector<std::uint32_t> exposures(std::uint8_t illumination, std::uint16_t sweep) const {
    std::vector<std::uint32_t> found;
    for (const Shot& shot : shots) {
      if (shot.illumination == illumination && shot.sweep == sweep) {
        found.push_back(shot.exposure_us);
      }
    }
    std::sort(found.begin(), found.end());
    return found;
  }
};

Recipe auto_recipe(std::uint32_t budget_us, std::uint16_t repeats = 2, std::uint8_t off_frames = 1) {
  Recipe recipe;
  for (std::uint8_t i = 0; i < 12; ++i) {
    recipe.illuminations.push_back(i);
  }
  recipe.exposure_mode = ExposureMode::kAuto;
  recipe.exposures_us.push_back(2'500);
  recipe.max_brackets = 4;
  recipe.repeats = repeats;
  recipe.off_frames = off_frames;
  recipe.time_budget_us = budget_us;
  return recipe;
}

/// The sequence and planner alone; every `lose`-th exposure is lost (0 = none).
RunOutcome simulate(const Recipe& recipe, const SampleScene& sample, std::size_t lose = 0) {
  FakeFactory factory;
  std::string_view reason;
  const auto plan = ScanPlan::make(recipe, factory.data, reason);
  INFO(reason);
  REQUIRE(plan);
  ShotSequence sequence;
  sequence.begin(*plan, factory.data);
  RunOutcome outcome;
  while (const auto shot = sequence.next()) {
    outcome.shots.push_back(*shot);
    const std::uint32_t took = shot->exposure_us + plan->readout_us();
    outcome.duration_us += took;
    CHECK(shot->exposure_us >= 10);
    CHECK(shot->exposure_us <= 200'000);
    if (lose != 0 && outcome.shots.size() % lose == 0) {
      sequence.record_lost(took);
    } else if (shot->illumination == Illuminator::kNone) {
      sequence.record({}, took);
    } else {
      sequence.record(sample.at(shot->illumination, shot->exposure_us), took);
    }
    REQUIRE(outcome.shots.size() < 2'000);
  }
  return outcome;
}

float median_share(const SampleScene& sample, std::uint8_t illumination, std::uint32_t exposure_us) {
  return (static_cast<float>(sample.at(illumination, exposure_us).median_dn) - 16) / kFullScale;
}

}  // namespace

TEST_CASE(
    "Samples of albedo 0.3 and above need less than 3 s; their exposures fill the range without saturating") {
  for (const float albedo : {0.3F, 0.5F, 0.99F}) {
    for (const float peak : {0.F, 5.F, 30.F, 120.F}) {
      const SampleScene sample{.albedo = albedo, .peak = peak};
      const RunOutcome run = simulate(auto_recipe(4'900'000), sample);
      INFO("albedo " << albedo << ", peak " << peak << ", took " << run.duration_us << " us, frames "
                     << run.shots.size());
      CHECK(run.duration_us < 3'000'000);
      for (std::uint8_t led = 0; led < 12; ++led) {
        for (const std::uint16_t sweep : {std::uint16_t{0}, std::uint16_t{1}}) {
          const auto exposures = run.exposures(led, sweep);
          REQUIRE(!exposures.empty());
          CHECK(sample.at(led, exposures.front()).saturated_pixels == 0);
          CHECK(median_share(sample, led, exposures.back()) > 0.49F);
          for (std::size_t i = 1; i < exposures.size(); ++i) {
            CHECK(static_cast<float>(exposures[i]) / static_cast<float>(exposures[i - 1]) < 8.5F);
          }
        }
        CHECK(median_share(sample, led, run.exposures(led, 1).back()) < 0.90F);
      }
    }
  }
}

TEST_CASE("Dark samples use the budget for long exposures and end within 5 s") {
  for (const float peak : {0.F, 5.F, 100.F}) {
    const SampleScene sample{.albedo = 0.02F, .peak = peak};
    const RunOutcome run = simulate(auto_recipe(5'000'000), sample);
    INFO("peak " << peak << ", took " << run.duration_us << " us");
    CHECK(run.duration_us <= 5'000'000);
    CHECK(run.duration_us > 3'500'000);
    for (std::uint8_t led = 0; led < 12; ++led) {
      const auto exposures = run.exposures(led, 1);
      CHECK(exposures.back() >= 100'000);
      CHECK(sample.at(led, exposures.front()).saturated_pixels == 0);
    }
  }
}

TEST_CASE("The budget holds for any sample, budget, number of sweeps and of LED-off frames") {
  for (const std::uint32_t budget : {1'000'000U, 2'000'000U, 5'000'000U, 20'000'000U}) {
    for (const std::uint16_t repeats : {std::uint16_t{1}, std::uint16_t{2}, std::uint16_t{3}}) {
      for (const std::uint8_t off : {std::uint8_t{0}, std::uint8_t{2}}) {
        for (const float albedo : {0.001F, 0.02F, 0.3F, 1.F}) {
          for (const float peak : {0.F, 50.F, 5'000.F}) {
            FakeFactory factory;
            std::string_view reason;
            const Recipe recipe = auto_recipe(budget, repeats, off);
            if (!ScanPlan::make(recipe, factory.data, reason)) {
              CHECK(budget < 1'500'000);  // Only the tightest is refused, and told why.
              continue;
            }
            const RunOutcome run = simulate(recipe, {.albedo = albedo, .peak = peak});
            INFO("budget " << budget << " sweeps " << repeats << " off " << +off << " albedo " << albedo
                           << " peak " << peak);
            CHECK(run.duration_us <= budget);
            for (std::uint16_t sweep = 0; sweep < repeats; ++sweep) {
              for (std::uint8_t led = 0; led < 12; ++led) {
                CHECK(!run.exposures(led, sweep).empty());
                CHECK(run.exposures(led, sweep).size() <= 4);
              }
            }
          }
        }
      }
    }
  }
}

TEST_CASE("Later sweeps repeat exposures of the first, so that repeats can be compared") {
  const RunOutcome run =
      simulate(auto_recipe(5'000'000, 3), {.albedo = 0.2F, .peak = 40.F, .colour_step = 1.7F});
  for (std::uint8_t led = 0; led < 12; ++led) {
    const auto first = run.exposures(led, 0);
    CHECK(run.exposures(led, 1) == run.exposures(led, 2));
    for (const std::uint32_t exposure : run.exposures(led, 1)) {
      CHECK(std::find(first.begin(), first.end(), exposure) != first.end());
    }
  }
}

TEST_CASE("A colour that resembles the one before needs no search: its exposures are the same in number") {
  const SampleScene sample{.albedo = 0.4F, .peak = 20.F, .colour_step = 1.05F};
  const RunOutcome run = simulate(auto_recipe(5'000'000), sample);
  for (std::uint8_t led = 1; led < 12; ++led) {
    CHECK(run.exposures(led, 0).size() == run.exposures(led, 1).size());
  }
}

TEST_CASE("LED-off frames of later sweeps have the longest exposure used") {
  const RunOutcome run = simulate(auto_recipe(4'900'000), {.albedo = 0.5F});
  std::uint32_t longest = 0;
  for (const Shot& shot : run.shots) {
    if (shot.illumination != Illuminator::kNone) {
      longest = std::max(longest, shot.exposure_us);
    }
  }
  for (const Shot& shot : run.shots) {
    if (shot.illumination == Illuminator::kNone) {
      CHECK(shot.exposure_us == (shot.sweep == 0 ? 49'000U : longest));
    }
  }
}

TEST_CASE("A lobe that only the last illuminations show does not burst the budget") {
  for (const std::uint8_t first : {std::uint8_t{6}, std::uint8_t{9}, std::uint8_t{11}}) {
    for (const std::uint32_t budget : {1'000'000U, 3'000'000U, 5'000'000U}) {
      const RunOutcome run =
          simulate(auto_recipe(budget, 2, 0), {.albedo = 0.02F, .peak = 3'000.F, .first_with_lobe = first});
      CHECK(run.duration_us <= budget);
    }
  }
}

TEST_CASE("Lost frames cost time but never the budget, and no illumination is forgotten") {
  for (const std::size_t lose : {2U, 3U, 7U}) {
    const RunOutcome run = simulate(auto_recipe(5'000'000), {.albedo = 0.02F, .peak = 10.F}, lose);
    CHECK(run.duration_us <= 5'000'000);
    for (std::uint8_t led = 0; led < 12; ++led) {
      CHECK(!run.exposures(led, 1).empty());
    }
  }
}

TEST_CASE("On the instrument: an auto run ends within its budget on the device's clock and loses nothing") {
  FakeBoard board;
  const SampleScene sample{.albedo = 0.5F, .peak = 30.F};
  board.factory.data.optics = {
      .center_x_px = 32, .center_y_px = 24, .radius_px = 20, .a1 = 1, .theta_max_rad = 1};
  board.optics.scene = [&](std::uint8_t led, std::uint32_t x, std::uint32_t y) {
    const float u = (static_cast<float>(x) + 0.5F - 32) / 20;
    const float v = (static_cast<float>(y) + 0.5F - 24) / 20;
    return led == Illuminator::kNone || std::hypot(u, v) > 1.1F ? 0.F : sample.rate(led, u, v);
  };
  // A known hot pixel that is always saturated must not drive the exposures down.
  board.factory.add_hot_pixel(30, 20);
  const Scene clean = board.optics.scene;
  board.optics.scene = [clean](std::uint8_t led, std::uint32_t x, std::uint32_t y) {
    return x == 30 && y == 20 ? 1'000.F : clean(led, x, y);
  };
  FakeHost host(board);
  host.hello();
  const RunFinished finished = host.measure(auto_recipe(4'900'000));
  CHECK(finished.reason == static_cast<std::uint8_t>(RunEnd::kCompleted));
  CHECK(finished.ended_us - finished.started_us < 3'000'000);
  CHECK(finished.ledger.exposed == host.frames.size());
  CHECK(finished.frames_sent == host.frames.size());
  for (std::uint8_t led = 0; led < 12; ++led) {
    std::uint32_t fewest_saturated = 1'000'000;
    for (const HostFrame& frame : host.frames) {
      if (frame.begin.illumination == led && frame.begin.sweep == 1) {
        fewest_saturated = std::min(fewest_saturated, frame.end->saturated_pixels);
      }
    }
    CHECK(fewest_saturated == 1);  // The hot pixel only.
  }
}
