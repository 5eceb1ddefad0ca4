// What the program answers with --json, as a value.
#pragma once

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/unit/tools/command.h"

/// The test fails when the program does.
[[nodiscard]] inline nlohmann::json answer(const std::vector<std::string>& arguments) {
  const auto run = scatter(arguments);
  INFO(run.err);
  REQUIRE(run.status == 0);
  return nlohmann::json::parse(run.out);
}
