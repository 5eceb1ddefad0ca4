// What the mock has seen: figures, and everything that a correct host program never does.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace scatter::mock_bus {

struct Tally {
  std::uint64_t submitted = 0;  ///< Transfers that programs handed in.
  std::uint64_t reaped = 0;
  std::uint64_t discarded = 0;  ///< Cancelled by DISCARDURB.
  std::uint64_t bytes_in = 0;   ///< Bulk, to the host.
  std::uint64_t bytes_out = 0;
  std::uint64_t empty_reaps = 0;     ///< Nothing was there: a program that spins makes many.
  std::uint64_t opened = 0;          ///< Device files.
  std::uint64_t abandoned = 0;       ///< Transfers under way when their file was closed.
  std::size_t most_under_way = 0;    ///< Of one device, bulk to the host.
  std::uint64_t refused_memory = 0;  ///< ENOMEM.
  std::vector<std::string> violations;

  void violate(std::string what) {
    // One bad loop would fill the memory; the first ones tell what is wrong.
    if (violations.size() < 50) {
      violations.push_back(std::move(what));
    }
  }
};

}  // namespace scatter::mock_bus
