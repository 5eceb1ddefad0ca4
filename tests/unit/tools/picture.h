// Pictures that the program reads and writes. Knows nothing of namespace scatter, whose name command.h gives
// to a function.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

struct Picture {
  std::size_t width = 0;
  std::size_t height = 0;
  std::size_t channels = 1;
  std::vector<float> values;

  [[nodiscard]] std::size_t pixels() const { return width * height; }
};

enum class Numbers { kAsStored, kSrgb };

/// OpenEXR or PNG; fails the test when it is neither.
[[nodiscard]] Picture picture(const std::filesystem::path& file, Numbers numbers = Numbers::kAsStored);
void save_png(const std::filesystem::path& file, const Picture& picture);
void save_exr(const std::filesystem::path& file, const Picture& picture);
