#include <catch2/catch.hpp>

#include <vector>

#include "firmware/core/factory_set.h"
#include "protocol/codec.h"
#include "protocol/crc.h"
#include "protocol/endian.h"
#include "tests/unit/firmware/fake_board.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

struct Production {
  Production() {
    factory.add_hot_pixel(3, 0);
    factory.add_hot_pixel(63, 47);
    prnu.resize(std::size_t{kWidth} * kHeight, std::byte{5});
    encode_descriptor();
  }
  void encode_descriptor() {
    descriptor.resize(encoded_size(factory.data));
    REQUIRE(encode(factory.data, descriptor) == descriptor.size());
  }
  [[nodiscard]] FactoryObjects objects() const {
    return {.descriptor = descriptor, .hot_pixels = factory.hot_pixels, .prnu_map = prnu};
  }
  [[nodiscard]] std::vector<std::byte> composed() const {
    std::vector<std::byte> bytes(factory_set_bytes(objects()));
    REQUIRE(compose_factory_set(objects(), bytes) == bytes.size());
    return bytes;
  }

  FakeFactory factory;
  std::vector<std::byte> prnu;
  std::vector<std::byte> descriptor;
};

FactoryVerdict verdict_of(std::span<const std::byte> memory) {
  Descriptor descriptor;
  return read_factory_set(memory, descriptor).verdict;
}

bool same(std::span<const std::byte> a, std::span<const std::byte> b) {
  return std::ranges::equal(a, b);
}

}  // namespace

TEST_CASE("A factory set gives back its descriptor and both maps, bit for bit") {
  const Production production;
  std::vector<std::byte> memory = production.composed();
  memory.resize(memory.size() + 4096, std::byte{0x5A});  // What lies behind it does not matter.
  Descriptor descriptor;
  const FactorySet set = read_factory_set(memory, descriptor);
  REQUIRE(set.verdict == FactoryVerdict::kWhole);
  CHECK(set.why.empty());
  CHECK(descriptor == production.factory.data);
  CHECK(same(set.objects.descriptor, production.descriptor));
  CHECK(same(set.objects.hot_pixels, production.factory.hot_pixels));
  CHECK(same(set.objects.prnu_map, production.prnu));
}

TEST_CASE("A factory set without maps is whole") {
  Production production;
  production.factory.hot_pixels.clear();
  production.prnu.clear();
  CHECK(verdict_of(production.composed()) == FactoryVerdict::kWhole);
}

TEST_CASE("The layout of a factory set is the documented one") {
  const Production production;
  const std::vector<std::byte> set = production.composed();
  const std::byte* const at = set.data();
  CHECK(std::string_view(reinterpret_cast<const char*>(at), 4) == "OSFS");
  CHECK(load_le<std::uint16_t>(at + 4) == 1);
  CHECK(load_le<std::uint32_t>(at + 8) == production.descriptor.size());
  CHECK(load_le<std::uint32_t>(at + 12) == crc32c(production.descriptor));
  CHECK(load_le<std::uint32_t>(at + 16) == 8);
  CHECK(load_le<std::uint32_t>(at + 24) == 64 * 48);
  CHECK(load_le<std::uint32_t>(at + 60) == crc32c(std::span(set).first(60)));
  const std::size_t hot = 64 + (production.descriptor.size() + 63) / 64 * 64;
  CHECK(same(std::span(set).subspan(hot, 8), production.factory.hot_pixels));
  CHECK(same(std::span(set).subspan(hot + 64, 64 * 48), production.prnu));
  const std::size_t commit = hot + 64 + 64 * 48;
  CHECK(set.size() == commit + 64);
  CHECK(std::string_view(reinterpret_cast<const char*>(at + commit), 4) == "OSFC");
  CHECK(load_le<std::uint32_t>(at + commit + 4) == crc32c(std::span(set).first(commit)));
}

TEST_CASE("No flipped bit and no cut of a factory set goes unnoticed") {
  const Production production;
  const std::vector<std::byte> good = production.composed();
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::vector<std::byte> bad = good;
    bad[i] ^= static_cast<std::byte>(1U << (i % 8));
    const FactoryVerdict verdict = verdict_of(bad);
    INFO("byte " << i);
    REQUIRE(verdict != FactoryVerdict::kWhole);
    REQUIRE(verdict != FactoryVerdict::kAbsent);
  }
  for (std::size_t length = 0; length < good.size(); length += 13) {
    REQUIRE(verdict_of(std::span(good).first(length)) != FactoryVerdict::kWhole);
  }
}

TEST_CASE("Erased memory holds no set; a set without its commit granule is unfinished") {
  CHECK(verdict_of(std::vector<std::byte>(4096, std::byte{0xFF})) == FactoryVerdict::kAbsent);
  std::vector<std::byte> set = Production().composed();
  std::fill(set.end() - 64, set.end(), std::byte{0xFF});
  CHECK(verdict_of(set) == FactoryVerdict::kUnfinished);
}

TEST_CASE("A set for a later firmware is named as such") {
  std::vector<std::byte> set = Production().composed();
  store_le(set.data() + 4, std::uint16_t{2});
  store_le(set.data() + 60, crc32c(std::span(set).first(60)));
  CHECK(verdict_of(set) == FactoryVerdict::kLaterVersion);
}

TEST_CASE("Lengths that lie are refused, however large") {
  for (const std::uint32_t length : {0xFFFF'FFFFU, 0xFFFF'FFC0U, 0x8000'0000U, 100'000U}) {
    for (const std::size_t field : {8U, 16U, 24U}) {
      std::vector<std::byte> set = Production().composed();
      store_le(set.data() + field, length);
      store_le(set.data() + 60, crc32c(std::span(set).first(60)));
      CHECK(verdict_of(set) == FactoryVerdict::kDamaged);
    }
  }
}

TEST_CASE("Contents that contradict the descriptor are refused with the reason") {
  const auto why = [](const Production& production) {
    Descriptor descriptor;
    const FactorySet set = read_factory_set(production.composed(), descriptor);
    CHECK(set.verdict == FactoryVerdict::kDamaged);
    CHECK(set.objects.prnu_map.empty());
    return std::string(set.why);
  };
  Production production;
  production.prnu.pop_back();
  CHECK(why(production) == "the factory set's PRNU map has another size than the sensor");
  production = {};
  production.factory.add_hot_pixel(63, 47);  // Twice.
  CHECK(why(production) == "the factory set's hot pixels are not ascending within the sensor");
  production = {};
  production.factory.add_hot_pixel(0, 48);  // Below the last row.
  CHECK(why(production) == "the factory set's hot pixels are not ascending within the sensor");
  production = {};
  production.factory.hot_pixels.pop_back();
  CHECK(why(production) == "the factory set's list of hot pixels ends inside an entry");
  production = {};
  production.descriptor.resize(40);
  CHECK(why(production) == "the factory descriptor ends inside a field or a list is too long");
  production = {};
  production.factory.data.serial.clear();
  production.encode_descriptor();
  CHECK(why(production) == "the factory descriptor names no product or no serial number");
  production = {};
  production.factory.data.sensor.height_px = 0;
  production.encode_descriptor();
  CHECK(why(production) == "the factory descriptor names a sensor without pixels");
}

TEST_CASE("Production writes a factory set once; nothing writes it again") {
  const Production production;
  const std::vector<std::byte> set = production.composed();
  FakeFlash flash;
  REQUIRE(write_factory_set(flash, set) == StatusCode::kOk);
  CHECK(same(std::span(flash.cells).first(set.size()), set));
  CHECK(verdict_of(flash.cells) == FactoryVerdict::kWhole);
  const std::uint32_t operations = flash.operations;
  CHECK(write_factory_set(flash, set) == StatusCode::kFailedPrecondition);
  CHECK(flash.operations == operations);
  CHECK(flash.violations == 0);

  FakeFlash used;
  used.cells[set.size() - 1] = std::byte{0x7F};  // Somebody was here: at the very end.
  CHECK(write_factory_set(used, set) == StatusCode::kFailedPrecondition);
  CHECK(used.operations == 0);
}

TEST_CASE("A factory set is whole only when its last granule is there: a write cut anywhere before is not") {
  const std::vector<std::byte> set = Production().composed();
  for (std::uint32_t fail = 0; fail < 2; ++fail) {
    FakeFlash flash;
    flash.fail_after = fail;
    CHECK(write_factory_set(flash, set) == StatusCode::kDataLoss);
    CHECK(verdict_of(flash.cells) == (fail == 0 ? FactoryVerdict::kAbsent : FactoryVerdict::kUnfinished));
  }
}

TEST_CASE("A factory set that is damaged or too long for its flash is not written") {
  std::vector<std::byte> set = Production().composed();
  FakeFlash flash;
  set[100] ^= std::byte{1};
  CHECK(write_factory_set(flash, set) == StatusCode::kInvalidArgument);
  set[100] ^= std::byte{1};
  Production large;
  large.prnu.resize(40'000);
  CHECK(write_factory_set(flash, large.composed()) == StatusCode::kOutOfRange);
  CHECK(flash.operations == 0);
  std::vector<std::byte> small(set.size() - 1);
  CHECK(compose_factory_set(Production().objects(), small) == 0);
}
