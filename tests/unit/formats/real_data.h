// Files that nobody here wrote, where they are present.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>

namespace scatter::formats::test {

/// Path of a real file, or nothing, said aloud.
inline std::optional<std::filesystem::path> real_data(const char* name) {
  const char* folder = std::getenv("SCATTER_REAL_DATA");
  const std::filesystem::path path =
      std::filesystem::path(folder != nullptr ? folder : "../shared/data") / name;
  if (!std::filesystem::exists(path)) {
    std::cout << "skipped: no real data (" << name << ")\n";
    return std::nullopt;
  }
  return path;
}

}  // namespace scatter::formats::test
