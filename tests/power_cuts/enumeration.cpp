#include "tests/power_cuts/enumeration.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <thread>

#include <fmt/format.h>

namespace scatter::power_cuts {
namespace {

using simulator::CutKind;
using simulator::kCutKinds;
using simulator::PowerCut;

constexpr std::array<std::string_view, kCutKinds> kKindNames{"before", "torn",     "half",
                                                             "after",  "unstable", "trap"};
// Kept per scenario; the count goes on.
constexpr std::size_t kKeptFailures = 5;

std::uint32_t draws_of(CutKind kind, const Thoroughness& thoroughness) {
  switch (kind) {
    case CutKind::kBefore:
    case CutKind::kAfter:
    case CutKind::kTrap:
      return 1;
    case CutKind::kTornPrefix:
    case CutKind::kHalfErased:
      return thoroughness.details;
    case CutKind::kUnstable:
      return thoroughness.unstable == 0 ? 2 * thoroughness.details : thoroughness.unstable;
  }
  return 1;
}

/// Every cut of a session of so many operations.
Cuts cuts_of(std::uint64_t operations, const Thoroughness& thoroughness, std::uint32_t first_detail) {
  Cuts cuts;
  for (std::uint64_t operation = 0; operation < operations; ++operation) {
    for (std::uint8_t kind = 0; kind < kCutKinds; ++kind) {
      const std::uint32_t draws = draws_of(static_cast<CutKind>(kind), thoroughness);
      for (std::uint32_t i = 0; i < draws; ++i) {
        cuts.push_back({.operation = operation,
                        .kind = static_cast<CutKind>(kind),
                        .detail = first_detail + static_cast<std::uint32_t>(operation) * 97 + i});
      }
    }
  }
  return cuts;
}

void power_on(Trial& trial) {
  trial.supply().power_on();
}

void power_on_until(Trial& trial, const PowerCut& cut) {
  trial.supply().power_on();
  trial.supply().arm(cut);
}

/// The device after the first cut, power off; null when the cut never came.
std::unique_ptr<Trial> cut_once(const Scenario& scenario, const PowerCut& cut) {
  std::unique_ptr<Trial> trial = scenario.begin();
  power_on_until(*trial, cut);
  trial->act();
  return trial->supply().lost() ? std::move(trial) : nullptr;
}

std::string judge(Trial& trial) {
  power_on(trial);
  return trial.judge();
}

bool cut_again(Trial& trial, const PowerCut& cut) {
  power_on_until(trial, cut);
  trial.recover();
  return trial.supply().lost();
}

/// The points that begin with one first cut, judged.
Outcome points_after(const Scenario& scenario, const PowerCut& first, std::uint64_t number,
                     const Thoroughness& thoroughness) {
  Outcome outcome;
  const auto count = [&](Cuts cuts, std::string promise) {
    if (!promise.empty()) {
      if (outcome.failed++ < kKeptFailures) {
        outcome.failures.push_back(
            {.replay = scenario.name() + ":" + text_of(cuts), .promise = std::move(promise)});
      }
    }
  };
  const std::unique_ptr<Trial> cut = cut_once(scenario, first);
  ++outcome.single_points;
  if (!cut) {
    count({first}, "the same session had fewer flash operations than before: it is not repeatable");
    return outcome;
  }
  count({first}, judge(*cut->clone()));
  if (thoroughness.double_share == 0) {
    return outcome;
  }
  const std::unique_ptr<Trial> whole = cut->clone();
  power_on(*whole);
  whole->recover();
  const Cuts seconds = cuts_of(whole->supply().operations(), thoroughness, 7);
  for (std::size_t i = 0; i < seconds.size(); ++i) {
    if ((number * seconds.size() + i) % thoroughness.double_share != 0) {
      continue;
    }
    const std::unique_ptr<Trial> trial = cut->clone();
    ++outcome.double_points;
    count({first, seconds[i]},
          cut_again(*trial, seconds[i])
              ? judge(*trial)
              : "the same recovery had fewer flash operations than before: it is not repeatable");
  }
  return outcome;
}

void add(Outcome& total, Outcome part) {
  total.single_points += part.single_points;
  total.double_points += part.double_points;
  total.failed += part.failed;
  for (Failure& failure : part.failures) {
    if (total.failures.size() < kKeptFailures) {
      total.failures.push_back(std::move(failure));
    }
  }
}

bool take_number(std::string_view& text, char end, std::uint64_t& value) {
  const std::size_t length = std::min(text.find(end), text.size());
  const auto [stop, error] = std::from_chars(text.data(), text.data() + length, value);
  if (error != std::errc() || stop != text.data() + length || length == 0) {
    return false;
  }
  text.remove_prefix(std::min(length + 1, text.size()));
  return true;
}

}  // namespace

std::string text_of(const Cuts& cuts) {
  std::string text;
  for (const PowerCut& cut : cuts) {
    text += fmt::format("{}{},{},{}", text.empty() ? "" : ":", cut.operation,
                        kKindNames[static_cast<std::size_t>(cut.kind)], cut.detail);
  }
  return text;
}

bool parse_cuts(std::string_view text, Cuts& cuts) {
  cuts.clear();
  while (!text.empty()) {
    PowerCut cut;
    if (!take_number(text, ',', cut.operation)) {
      return false;
    }
    const std::string_view name = text.substr(0, text.find(','));
    const auto* const kind = std::ranges::find(kKindNames, name);
    if (kind == kKindNames.end() || name.size() == text.size()) {
      return false;
    }
    cut.kind = static_cast<CutKind>(kind - kKindNames.begin());
    text.remove_prefix(name.size() + 1);
    std::uint64_t detail = 0;
    if (!take_number(text, ':', detail) || detail > 0xFFFF'FFFF) {
      return false;
    }
    cut.detail = static_cast<std::uint32_t>(detail);
    cuts.push_back(cut);
  }
  return !cuts.empty();
}

std::string try_point(const Scenario& scenario, const Cuts& cuts) {
  const std::unique_ptr<Trial> trial = cut_once(scenario, cuts.at(0));
  if (!trial) {
    return "the first cut never came: the session has fewer flash operations";
  }
  for (std::size_t i = 1; i < cuts.size(); ++i) {
    if (!cut_again(*trial, cuts[i])) {
      return fmt::format("cut {} never came: the recovery has fewer flash operations", i + 1);
    }
  }
  return judge(*trial);
}

Outcome enumerate(const Scenario& scenario, bool quick, unsigned threads) {
  const Thoroughness thoroughness = scenario.thoroughness(quick);
  const std::unique_ptr<Trial> whole = scenario.begin();
  power_on(*whole);
  whole->act();
  const Cuts firsts = cuts_of(whole->supply().operations(), thoroughness, 1);
  std::vector<Outcome> outcomes(firsts.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < firsts.size(); i = next++) {
      outcomes[i] = points_after(scenario, firsts[i], i, thoroughness);
    }
  };
  std::vector<std::jthread> workers;
  for (unsigned i = 1; i < threads; ++i) {
    workers.emplace_back(work);
  }
  work();
  workers.clear();
  Outcome total;
  if (const std::string promise = judge(*whole); !promise.empty()) {
    total.failed = 1;
    total.failures.push_back({.replay = scenario.name() + " (without any cut)", .promise = promise});
  }
  for (Outcome& outcome : outcomes) {
    add(total, std::move(outcome));
  }
  return total;
}

}  // namespace scatter::power_cuts
