#include "tools/scatter/nearest.h"

#include <catch2/catch.hpp>

using namespace scatter::cli;

TEST_CASE("Edit distance is that of Levenshtein") {
  CHECK(edit_distance("", "") == 0);
  CHECK(edit_distance("kitten", "sitting") == 3);
  CHECK(edit_distance("saturday", "sunday") == 3);
  CHECK(edit_distance("", "abc") == 3);
  CHECK(edit_distance("abc", "") == 3);
}

TEST_CASE("A mistyped verb is answered with the nearest one, a strange one with all") {
  const std::vector<std::string> names = {"list", "measure", "plot"};
  CHECK(nearest_or_all("mesure", names) == "'measure'");
  CHECK(nearest_or_all("lsit", names) == "'list'");
  CHECK(nearest_or_all("frobnicate", names) == "one of list measure plot");
}
