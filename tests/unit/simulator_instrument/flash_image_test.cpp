#include <catch2/catch.hpp>

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "simulator/instrument/flash_image.h"

using namespace scatter;
using scatter::simulator::FlashImage;

namespace {

std::vector<std::byte> filled(std::size_t size, int value) {
  return std::vector<std::byte>(size, static_cast<std::byte>(value));
}

struct TemporaryFile {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("scatter_flash_" + std::to_string(::getpid()));
  TemporaryFile() { std::filesystem::remove(path); }
  ~TemporaryFile() { std::filesystem::remove(path); }
};

}  // namespace

TEST_CASE("Flash is erased at first, keeps what is programmed, and erases by unit") {
  FlashImage flash;
  std::vector<std::byte> read(64);
  REQUIRE(flash.read(0, read));
  CHECK(read == filled(64, 0xFF));
  REQUIRE(flash.program(4096, filled(64, 0x12)));
  REQUIRE(flash.program(8192, filled(32, 0x34)));
  REQUIRE(flash.read(4096, read));
  CHECK(read == filled(64, 0x12));
  REQUIRE(flash.erase(1));
  REQUIRE(flash.read(4096, read));
  CHECK(read == filled(64, 0xFF));
  REQUIRE(flash.read(8192, std::span(read).first(32)));
  CHECK(std::ranges::equal(std::span(read).first(32), filled(32, 0x34)));
  CHECK(flash.violations() == 0);
}

TEST_CASE("Programming cells that are not erased is refused, changes nothing and counts as a violation") {
  FlashImage flash;
  REQUIRE(flash.program(0, filled(32, 0xF0)));
  CHECK_FALSE(flash.program(0, filled(64, 0x00)));
  std::vector<std::byte> read(64);
  REQUIRE(flash.read(0, read));
  CHECK(std::ranges::equal(std::span(read).first(32), filled(32, 0xF0)));
  CHECK(std::ranges::equal(std::span(read).last(32), filled(32, 0xFF)));
  CHECK(flash.violations() == 1);
}

TEST_CASE("Unaligned and outside ranges are violations") {
  FlashImage flash;
  const std::uint32_t size = FlashImage::kGeometry.unit_bytes * FlashImage::kGeometry.units;
  std::vector<std::byte> read(64);
  CHECK_FALSE(flash.program(1, filled(32, 0)));
  CHECK_FALSE(flash.program(0, filled(31, 0)));
  CHECK_FALSE(flash.program(size, filled(32, 0)));
  CHECK_FALSE(flash.read(size - 63, read));
  CHECK_FALSE(flash.erase(FlashImage::kGeometry.units));
  CHECK(flash.violations() == 5);
}

TEST_CASE("A flash file keeps its contents from one instrument to the next") {
  const TemporaryFile file;
  {
    auto flash = FlashImage::open(file.path);
    REQUIRE(flash.has_value());
    REQUIRE((*flash)->program(64, filled(32, 0x77)));
  }
  auto again = FlashImage::open(file.path);
  REQUIRE(again.has_value());
  CHECK((*again)->bytes()[64] == std::byte{0x77});
  CHECK((*again)->bytes()[0] == std::byte{0xFF});
}

TEST_CASE("A file that is no flash image is refused and left alone") {
  const TemporaryFile file;
  std::ofstream(file.path) << "letters to my aunt";
  const auto flash = FlashImage::open(file.path);
  REQUIRE_FALSE(flash.has_value());
  CHECK(flash.error().code == ErrorCode::kDataLoss);
  CHECK(std::filesystem::file_size(file.path) == 18);
}
