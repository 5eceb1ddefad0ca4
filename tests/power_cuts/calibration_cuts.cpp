// Cuts in the calibration store: at every flash operation of starting, saving, undoing, restoring, setting,
// of moving on to the next erase unit and of repairing a lost copy. Promises after each:
// - the device holds the old or the new set, bit for bit, never a mixture, and its settings with it;
// - what it said once it says again after every further power-on, even when one copy is lost by then;
// - its boot count never repeats;
// - it can store again;
// - no cell is programmed that is not erased.
#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "firmware/core/persistent_state.h"
#include "simulator/faults/cut_flash.h"
#include "tests/power_cuts/held_set.h"
#include "tests/power_cuts/scenario.h"

namespace scatter::power_cuts {
namespace {

using firmware::Flash;
using firmware::PersistentState;
using protocol::CalibrationManifest;
using protocol::StatusCode;
using protocol::Target;
using simulator::CutFlash;
using simulator::Supply;

constexpr std::string_view kCertificate = "WR-2026-0417 issued by a laboratory far away, 48";

struct Commit {
  Target kind;
  std::uint8_t number;
};
struct Undo {
  Target kind;
};
struct Restore {};
struct Set {
  std::string key;
  std::string value;
};
struct Restart {};  ///< Only before the scenario: it disarms a cut.
using Step = std::variant<Commit, Undo, Restore, Set, Restart>;
using Steps = std::vector<Step>;

CalibrationManifest manifest_of(const Commit& commit) {
  CalibrationManifest manifest;
  manifest.kind = commit.kind;
  manifest.id.fill(commit.number);
  manifest.unix_time_s = 1'700'000'000U + commit.number;
  manifest.certificate_id = kCertificate.substr(0, commit.number * 7U % 49U);
  for (std::uint8_t i = 0; i < commit.number % 7; ++i) {
    manifest.scalars.push_back(static_cast<float>(commit.number) * 100 + static_cast<float>(i));
  }
  return manifest;
}

const protocol::Descriptor& descriptor() {
  static const protocol::Descriptor made;
  return made;
}

/// The firmware's store in one power-on, and the expectations that outlive it.
class StoreTrial final : public Trial {
 public:
  StoreTrial(Flash::Geometry geometry, const Steps& act, const Steps& recover)
      : flash_(geometry, supply_), act_(&act), recover_(&recover) {}
  StoreTrial(const StoreTrial& other)
      : supply_(other.supply_),
        flash_(other.flash_, supply_),
        act_(other.act_),
        recover_(other.recover_),
        held_(other.held_),
        in_flight_(other.in_flight_),
        boots_(other.boots_),
        broken_(other.broken_) {}

  [[nodiscard]] std::unique_ptr<Trial> clone() const override { return std::make_unique<StoreTrial>(*this); }
  [[nodiscard]] Supply& supply() override { return supply_; }
  [[nodiscard]] CutFlash& flash() { return flash_; }
  void act() override { session(*act_); }
  void recover() override { session(*recover_); }

  void session(const Steps& steps) {
    std::optional<PersistentState> state;
    if (!start(state)) {
      return;
    }
    for (const Step& step : steps) {
      if (std::holds_alternative<Restart>(step)) {
        supply_.power_on();
        if (!start(state)) {
          return;
        }
      } else if (!perform(*state, step)) {
        return;
      }
    }
  }

  [[nodiscard]] std::string judge() override {
    session({});
    lose_a_copy(0);
    lose_a_copy(1);
    supply_.power_on();
    session({Commit{Target::kWhiteReference, 251}, Set{"location", "somewhere else"}});
    supply_.power_on();
    session({});
    if (flash_.violations() > 0) {
      broke("cells programmed that are not erased: " + flash_.violation());
    }
    return broken_;
  }

 private:
  void broke(std::string promise) {
    if (broken_.empty()) {
      broken_ = std::move(promise);
    }
  }

  /// One copy alone must say the same.
  void lose_a_copy(std::uint32_t copy) {
    if (!broken_.empty()) {
      return;
    }
    StoreTrial alone(*this);
    const Flash::Geometry geometry = flash_.geometry();
    const std::uint32_t bytes = geometry.units / 2 * geometry.unit_bytes;
    alone.flash_.trap(copy * bytes, bytes);
    alone.supply_.power_on();
    alone.session({});
    if (!alone.broken_.empty()) {
      broke(fmt::format("without copy {}: {}", copy + 1, alone.broken_));
    }
  }

  /// Mounts; what the device holds must be what it held, or the change that was under way.
  bool start(std::optional<PersistentState>& state) {
    state.emplace(flash_, descriptor());
    state->mount();
    if (supply_.lost()) {
      return false;
    }
    if (!state->mounted()) {
      broke("the store cannot be used after power-on");
      return false;
    }
    const Answer found = answer_of(*state);
    if (in_flight_ && found == in_flight_->answer()) {
      held_ = *in_flight_;
    } else if (found != held_.answer()) {
      broke(
          fmt::format("the device holds {} manifests, current {}, name '{}': neither the old nor the new set",
                      found.manifests.size(), fmt::join(found.current, " "), found.name));
      return false;
    }
    in_flight_.reset();
    if (state->boot_count() <= boots_) {
      broke(fmt::format("boot count {} after {}", state->boot_count(), boots_));
      return false;
    }
    boots_ = state->boot_count();
    return true;
  }

  /// One change; false: the power went, or a promise was broken.
  bool perform(PersistentState& state, const Step& step) {
    in_flight_ = held_;
    StatusCode status = StatusCode::kOk;
    if (const auto* const commit = std::get_if<Commit>(&step)) {
      in_flight_->commit(manifest_of(*commit));
      status = state.commit(manifest_of(*commit));
    } else if (const auto* const undo = std::get_if<Undo>(&step)) {
      in_flight_->undo(undo->kind);
      status = state.undo(undo->kind);
    } else if (std::holds_alternative<Restore>(step)) {
      in_flight_->restore();
      status = state.restore_factory();
    } else if (const auto* const set = std::get_if<Set>(&step)) {
      in_flight_->set(set->key, set->value);
      status = state.set({.key = std::string_view(set->key), .value = std::string_view(set->value)});
    }
    if (supply_.lost()) {
      return false;
    }
    if (status != StatusCode::kOk) {
      broke(fmt::format("a change was refused with status {}", static_cast<int>(status)));
      return false;
    }
    held_ = *std::exchange(in_flight_, std::nullopt);
    if (answer_of(state) != held_.answer()) {
      broke("the device says otherwise than what it just stored");
      return false;
    }
    return true;
  }

  Supply supply_;
  CutFlash flash_;
  const Steps* act_;
  const Steps* recover_;
  HeldSet held_;
  std::optional<HeldSet> in_flight_;
  std::uint32_t boots_ = 0;
  std::string broken_;
};

struct Geometry {
  std::string_view name;
  Flash::Geometry flash;
  bool large = false;  ///< Many records fit an erase unit.
};

/// What the flash went through before the scenario begins.
enum class Damage : std::uint8_t { kNone, kFirstCopyLost, kSecondCopyLost, kWornUnits, kWeakUnits };

struct Plan {
  std::string_view name;
  Steps before;
  Steps act;
  Steps recover{Commit{Target::kBlackReference, 77}, Set{"name", "after the cut"}};
  Damage damage = Damage::kNone;
  std::uint32_t double_share = 1;
};

class StoreScenario final : public Scenario {
 public:
  StoreScenario(const Geometry& geometry, Plan plan)
      : geometry_(geometry), plan_(std::move(plan)), start_(geometry.flash, plan_.act, plan_.recover) {
    if (!plan_.before.empty()) {
      start_.session(plan_.before);
    }
    const std::uint32_t half = geometry.flash.units / 2;
    const std::uint32_t half_bytes = half * geometry.flash.unit_bytes;
    switch (plan_.damage) {
      case Damage::kNone:
        break;
      case Damage::kFirstCopyLost:
        start_.flash().trap(0, half_bytes);
        break;
      case Damage::kSecondCopyLost:
        start_.flash().trap(half_bytes, half_bytes);
        break;
      case Damage::kWornUnits:
        start_.flash().wear_out(1);
        start_.flash().wear_out(half + 2 % half);
        break;
      case Damage::kWeakUnits:
        // Every other place or more of both copies.
        for (std::uint32_t unit = 0; unit < geometry.flash.units; ++unit) {
          if (unit * geometry.flash.unit_bytes / std::max(2048U, geometry.flash.unit_bytes) % 2 == 1) {
            start_.flash().weaken(unit);
          }
        }
        break;
    }
  }
  [[nodiscard]] std::string name() const override {
    return fmt::format("calibration:{}:{}", geometry_.name, plan_.name);
  }
  [[nodiscard]] std::unique_ptr<Trial> begin() const override { return start_.clone(); }
  [[nodiscard]] Thoroughness thoroughness(bool quick) const override {
    return quick ? Thoroughness{.details = 1, .unstable = 4, .double_share = plan_.double_share * 97}
                 : Thoroughness{.details = 2, .unstable = 4, .double_share = plan_.double_share};
  }

 private:
  Geometry geometry_;
  Plan plan_;
  StoreTrial start_;
};

Steps commits(std::uint32_t count) {
  Steps steps;
  for (std::uint32_t i = 0; i < count; ++i) {
    steps.push_back(Commit{static_cast<Target>(1 + i % 4), static_cast<std::uint8_t>(101 + i % 100)});
  }
  return steps;
}

Steps restarts(std::uint32_t count) {
  return Steps(count, Restart{});
}

Steps joined(Steps first, const Steps& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

std::vector<Plan> plans_for(const Geometry& geometry) {
  const Steps calibrated{Set{"name", "left bench"}, Commit{Target::kDarkCap, 1},
                         Commit{Target::kWhiteReference, 12}, Commit{Target::kBlackReference, 3},
                         Commit{Target::kWhiteReference, 24}};
  const Commit white{Target::kWhiteReference, 45};
  // Everything at its longest: the largest record there is.
  Steps full = commits(8);
  full.push_back(Set{"name", std::string(64, 'n')});
  full.push_back(Set{"location", std::string(64, 'l')});
  std::vector<Plan> plans{
      {.name = "first_start", .before = {}, .act = {}},
      {.name = "commit", .before = calibrated, .act = {white}},
      {.name = "undo", .before = calibrated, .act = {Undo{Target::kWhiteReference}}},
      {.name = "restore", .before = calibrated, .act = {Restore{}}},
      {.name = "setting", .before = calibrated, .act = {Set{"name", "right bench"}}},
      {.name = "full", .before = full, .act = {white}},
      {.name = "wrap",
       .before = joined(calibrated, restarts(geometry.flash.units / 2 - 1)),
       .act = {white},
       .recover = {white}},
      {.name = "first_copy_lost", .before = calibrated, .act = {white}, .damage = Damage::kFirstCopyLost},
      {.name = "second_copy_lost", .before = calibrated, .act = {white}, .damage = Damage::kSecondCopyLost},
  };
  // A record more than an erase unit holds, so that the session moves on to the next one.
  plans.push_back({.name = "turnover",
                   .before = calibrated,
                   .act = commits(geometry.large ? 100 : 4),
                   .double_share = geometry.large ? 499U : 3U});
  plans.push_back({.name = "weak_units", .before = calibrated, .act = {white}, .damage = Damage::kWeakUnits});
  if (geometry.flash.units >= 8) {
    plans.push_back(
        {.name = "worn_units", .before = calibrated, .act = {white}, .damage = Damage::kWornUnits});
  }
  return plans;
}

}  // namespace

void add_calibration_cuts(Scenarios& scenarios) {
  // Flash of the STM32H7 class in small and in large sectors, an AT24C EEPROM by pages, a small NOR flash.
  static constexpr std::array<Geometry, 4> kGeometries{{
      {.name = "4096x64/32", .flash = {.unit_bytes = 4096, .units = 64, .program_bytes = 32}},
      {.name = "1024x32/64", .flash = {.unit_bytes = 1024, .units = 32, .program_bytes = 64}},
      {.name = "2048x16/8", .flash = {.unit_bytes = 2048, .units = 16, .program_bytes = 8}},
      {.name = "131072x4/32",
       .flash = {.unit_bytes = 131072, .units = 4, .program_bytes = 32},
       .large = true},
  }};
  for (const Geometry& geometry : kGeometries) {
    for (Plan& plan : plans_for(geometry)) {
      scenarios.push_back(std::make_unique<StoreScenario>(geometry, std::move(plan)));
    }
  }
}

}  // namespace scatter::power_cuts
