#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <vector>

#include "host_sdk/firmware_files/dfu_suffix.h"
#include "tests/unit/firmware_files/made_release.h"

namespace scatter::firmware_files::test {
namespace {

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto view = std::as_bytes(std::span(text));
  return {view.begin(), view.end()};
}

std::vector<std::byte> with_suffix(std::vector<std::byte> contents) {
  const DfuSuffix suffix = dfu_suffix(contents);
  contents.insert(contents.end(), suffix.begin(), suffix.end());
  return contents;
}

bool have_dfu_suffix() {
  return std::system("command -v dfu-suffix > /dev/null 2>&1") == 0;
}

}  // namespace

// PROVES: DFU 1.1, appendix B. The checksum was computed by zlib: 0xFFFFFFFF ^ crc32("123456789" + the first
// 12 bytes of the suffix).
TEST_CASE("A DFU suffix has the bytes of the DFU 1.1 specification") {
  const std::vector<std::uint8_t> expected = {0xFF, 0xFF, 0xFF, 0xFF, 0x09, 0x12, 0x00, 0x01,
                                              'U',  'F',  'D',  16,   0x0C, 0x91, 0x16, 0x54};
  const DfuSuffix suffix = dfu_suffix(bytes_of("123456789"));
  CHECK(std::memcmp(suffix.data(), expected.data(), suffix.size()) == 0);
}

TEST_CASE("What stands before a suffix comes back, even nothing") {
  for (const std::string_view text : {"", "1", "123456789"}) {
    const auto file = with_suffix(bytes_of(text));
    const auto contents = strip_dfu_suffix(file, "f.dfu");
    REQUIRE(contents);
    CHECK(std::vector(contents->begin(), contents->end()) == bytes_of(text));
  }
}

TEST_CASE("A DFU file with any single bit flipped is refused") {
  const auto good = with_suffix(bytes_of("123456789"));
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    auto bad = good;
    bad[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    CAPTURE(bit);
    const auto contents = strip_dfu_suffix(bad, "f.dfu");
    REQUIRE_FALSE(contents);
    CHECK_THAT(contents.error().what, Catch::StartsWith("f.dfu: "));
  }
  for (std::size_t size = 0; size < good.size(); ++size) {
    CHECK_FALSE(strip_dfu_suffix(std::span(good).first(size), "f.dfu"));
  }
}

TEST_CASE("The distribution's dfu-suffix accepts our suffix, and we accept its") {
  if (!have_dfu_suffix()) {
    WARN("dfu-suffix (package dfu-util) is not installed");
    return;
  }
  std::string name = (std::filesystem::temp_directory_path() / "scatter-dfu-XXXXXX").string();
  const std::filesystem::path folder = mkdtemp(name.data());
  const auto write = [](const std::filesystem::path& file, const std::vector<std::byte>& bytes) {
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  };
  const auto body = made_body(kAddress0, 5000);
  write(folder / "ours.dfu", with_suffix(body));
  CHECK(std::system(("dfu-suffix -c " + (folder / "ours.dfu").string() + " > /dev/null 2>&1").c_str()) == 0);
  write(folder / "theirs.dfu", body);
  CHECK(std::system(
            ("dfu-suffix -v 1209 -a " + (folder / "theirs.dfu").string() + " > /dev/null 2>&1").c_str()) ==
        0);
  std::ifstream stream(folder / "theirs.dfu", std::ios::binary);
  const std::string theirs{std::istreambuf_iterator<char>(stream), {}};
  CHECK(bytes_of(theirs) == with_suffix(body));
  std::filesystem::remove_all(folder);
}

}  // namespace scatter::firmware_files::test
