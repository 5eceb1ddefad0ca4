#include "simulator/corrosion/patina/script.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "simulator/corrosion/patina/draws.h"

namespace scatter::corrosion {
namespace {

using Operator = ScriptStep::Operator;

/// On one cell in one step: more would take hours.
constexpr double kMostParticles = 10000;

struct Grammar {
  std::string_view name;
  Operator operation;
  bool has_material;
  std::string_view form;
};
constexpr std::array<Grammar, 5> kGrammar{
    Grammar{"coat", Operator::kCoat, true,
            "coat:MATERIAL,rate=UM_PER_YEAR,years=N[,deposition=...][,particle=UM]"},
    Grammar{"erode", Operator::kErode, false, "erode:rate=UM_PER_YEAR,years=N"},
    Grammar{"fill", Operator::kFill, true, "fill:MATERIAL,level=UM"},
    Grammar{"polish", Operator::kPolish, false, "polish:level=UM"},
    Grammar{"offset", Operator::kOffset, true, "offset:MATERIAL,radius=UM"},
};

std::unexpected<Error> wrong(std::size_t step, std::string_view what, std::string_view remedy) {
  return fail(ErrorCode::kInvalidArgument, fmt::format("script: step {}: {}", step + 1, what),
              std::string(remedy));
}

Status in_range(std::size_t step, std::string_view parameter, double value, double lowest, double highest) {
  if (value >= lowest && value <= highest) {
    return {};
  }
  return wrong(step, fmt::format("{} is {}, expected {}..{}", parameter, value, lowest, highest),
               fmt::format("choose {} within the range", parameter));
}

/// Thickness [um] that falls in the step's time.
std::vector<float> rained(const LayerStack& stack, const ScriptStep& step, std::uint64_t seed,
                          std::size_t number) {
  std::vector<float> thickness = on_grid(step.rate, stack.side());
  double sum = 0;
  for (float& um : thickness) {
    um *= static_cast<float>(step.years);
    sum += um;
  }
  if (step.deposition == Deposition::kSteady || !(sum > 0)) {
    return thickness;
  }
  const Result<FallPlaces> places = FallPlaces::make(thickness);
  simulator::RandomStream stream(patina_key(seed, PatinaDraw::kScript, 0, number));
  Deposit deposit(stack.side(), stack.side(), step.deposition);
  const auto volume = static_cast<std::uint64_t>(std::llround(sum / step.particle_um));
  while (deposit.volume() < volume) {
    deposit.drop(places->draw(stream), stream);
  }
  std::ranges::transform(deposit.heights(), thickness.begin(),
                         [&](std::uint32_t h) { return static_cast<float>(h * step.particle_um); });
  return thickness;
}

Status check_rate(std::size_t number, const ScriptStep& step) {
  if (const Status status = check(step.rate, "rate", 0, 1000); !status) {
    return wrong(number, status.error().what, status.error().remedy);
  }
  if (const Status status = in_range(number, "years", step.years, 0, 1000); !status) {
    return status;
  }
  if (step.operation != Operator::kCoat || step.deposition == Deposition::kSteady) {
    return {};
  }
  if (const Status status = in_range(number, "particle", step.particle_um, 0.01, 20); !status) {
    return status;
  }
  const double particles =
      static_cast<double>(*std::ranges::max_element(step.rate.values)) * step.years / step.particle_um;
  if (particles > kMostParticles) {
    return wrong(
        number,
        fmt::format("{:g} particles would fall on a cell, expected at most {:g}", particles, kMostParticles),
        "choose a larger particle");
  }
  return {};
}

std::optional<double> number_of(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

std::string_view next_part(std::string_view& rest, char separator) {
  const std::size_t end = std::min(rest.find(separator), rest.size());
  const std::string_view part = rest.substr(0, end);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return part;
}

/// Sets what "key=value" says; false: the operator has no such key, or the value is none.
bool set(ScriptStep& step, std::string_view key, std::string_view value) {
  const bool grows = step.operation == Operator::kCoat || step.operation == Operator::kErode;
  if (key == "deposition" && step.operation == Operator::kCoat) {
    const auto named = deposition_named(value);
    step.deposition = named ? *named : step.deposition;
    return named.has_value();
  }
  const std::optional<double> number = number_of(value);
  if (!number) {
    return false;
  }
  if (key == "rate" && grows) {
    step.rate = {1, 1, {static_cast<float>(*number)}};
  } else if (key == "years" && grows) {
    step.years = *number;
  } else if (key == "particle" && step.operation == Operator::kCoat) {
    step.particle_um = *number;
  } else if ((key == "level" && (step.operation == Operator::kFill || step.operation == Operator::kPolish)) ||
             (key == "radius" && step.operation == Operator::kOffset)) {
    step.level_um = *number;
  } else {
    return false;
  }
  return true;
}

Result<ScriptStep> step_from(std::string_view text, std::size_t number) {
  std::string_view rest = text;
  const std::string_view name = next_part(rest, ':');
  const auto grammar = std::ranges::find(kGrammar, name, &Grammar::name);
  if (grammar == kGrammar.end()) {
    return wrong(number, fmt::format("\"{}\" is no operator", name),
                 "use coat, erode, fill, polish or offset");
  }
  ScriptStep step{.operation = grammar->operation};
  if (grammar->has_material) {
    const Result<PatinaMaterial> material = patina_material_named(next_part(rest, ','));
    if (!material) {
      return wrong(number, material.error().what, material.error().remedy);
    }
    step.material = *material;
  }
  const bool grows = step.operation == Operator::kCoat || step.operation == Operator::kErode;
  std::size_t needed = 0;
  while (!rest.empty()) {
    const std::string_view part = next_part(rest, ',');
    const std::size_t equals = part.find('=');
    const std::string_view key = part.substr(0, equals);
    if (equals == std::string_view::npos || !set(step, key, part.substr(equals + 1))) {
      return wrong(number, fmt::format("\"{}\" is not understood", part),
                   fmt::format("write {}", grammar->form));
    }
    needed += key == "rate" || key == "years" || key == "level" || key == "radius" ? 1 : 0;
  }
  if (needed != (grows ? 2 : 1)) {
    return wrong(number, fmt::format("\"{}\" lacks a value or has one twice", text),
                 fmt::format("write {}", grammar->form));
  }
  return step;
}

}  // namespace

Status apply(LayerStack& stack, std::span<const ScriptStep> steps, std::uint64_t seed) {
  for (std::size_t number = 0; number < steps.size(); ++number) {
    const ScriptStep& step = steps[number];
    Result<double> moved = 0.0;
    switch (step.operation) {
      case Operator::kCoat:
      case Operator::kErode:
        if (const Status status = check_rate(number, step); !status) {
          return status;
        }
        moved = step.operation == Operator::kCoat
                    ? stack.coat(step.material, rained(stack, step, seed, number))
                    : stack.erode(rained(stack, step, seed, number));
        break;
      case Operator::kFill:
        moved = stack.fill(step.material, step.level_um);
        break;
      case Operator::kPolish:
        moved = stack.polish(step.level_um);
        break;
      case Operator::kOffset:
        moved = stack.offset(step.material, step.level_um);
        break;
    }
    if (!moved) {
      return wrong(number, moved.error().what, moved.error().remedy);
    }
  }
  return {};
}

Result<std::vector<ScriptStep>> script_from(std::string_view text) {
  std::vector<ScriptStep> steps;
  while (!text.empty()) {
    const Result<ScriptStep> step = step_from(next_part(text, ';'), steps.size());
    if (!step) {
      return std::unexpected(step.error());
    }
    steps.push_back(*step);
  }
  return steps;
}

}  // namespace scatter::corrosion
