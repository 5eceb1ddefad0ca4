// Reads descriptors as a host does, by their own lengths alone; knows nothing of how the device makes them.
#pragma once

#include <catch2/catch.hpp>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/unit/firmware_usb/fake_usb.h"

namespace scatter::firmware::fake {

inline std::uint8_t u8(const Bytes& b, std::size_t at) {
  REQUIRE(at < b.size());
  return std::to_integer<std::uint8_t>(b[at]);
}
inline std::uint16_t u16(const Bytes& b, std::size_t at) {
  return static_cast<std::uint16_t>(u8(b, at) | u8(b, at + 1) << 8);
}
inline std::uint32_t u32(const Bytes& b, std::size_t at) {
  return u16(b, at) | static_cast<std::uint32_t>(u16(b, at + 2)) << 16U;
}
inline Bytes part(const Bytes& b, std::size_t at, std::size_t size) {
  REQUIRE(at + size <= b.size());
  return {b.begin() + static_cast<std::ptrdiff_t>(at), b.begin() + static_cast<std::ptrdiff_t>(at + size)};
}
inline Bytes bytes(std::initializer_list<unsigned> values) {
  Bytes out;
  for (const unsigned v : values) {
    out.push_back(static_cast<std::byte>(v));
  }
  return out;
}

/// bLength, bDescriptorType chains, USB 2.0 section 9.5. The lengths add up or the test fails.
inline std::vector<Bytes> split(const Bytes& all) {
  std::vector<Bytes> parts;
  for (std::size_t at = 0; at < all.size();) {
    const std::size_t size = u8(all, at);
    REQUIRE(size >= 2);
    parts.push_back(part(all, at, size));
    at += size;
  }
  return parts;
}

struct WalkedSetting {
  Bytes interface;
  std::vector<Bytes> endpoints;
  std::vector<Bytes> others;  ///< HID, DFU functional.
};
struct WalkedConfiguration {
  Bytes head;
  std::vector<WalkedSetting> settings;  ///< In the order of the bytes.
};

/// USB 2.0, sections 9.6.3 to 9.6.6.
inline WalkedConfiguration walk_configuration(const Bytes& all, std::uint8_t type = 2) {
  WalkedConfiguration found;
  const auto parts = split(all);
  REQUIRE_FALSE(parts.empty());
  found.head = parts[0];
  REQUIRE(u8(found.head, 0) == 9);
  CHECK(u8(found.head, 1) == type);
  CHECK(u16(found.head, 2) == all.size());  // wTotalLength
  CHECK(u8(found.head, 5) == 1);            // bConfigurationValue
  CHECK((u8(found.head, 7) & 0x80U) != 0);  // bmAttributes, bit 7 is reserved and one.
  CHECK((u8(found.head, 7) & 0x1FU) == 0);
  CHECK(u8(found.head, 8) <= 250);  // bMaxPower, 2 mA each.
  std::vector<std::uint8_t> numbers;
  std::vector<std::pair<std::uint8_t, std::uint8_t>> owners;  // Endpoint address, interface.
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const Bytes& one = parts[i];
    if (u8(one, 1) == 4) {
      REQUIRE(one.size() == 9);
      if (u8(one, 3) == 0) {
        CHECK(u8(one, 2) == numbers.size());  // bInterfaceNumber: from 0, rising.
        numbers.push_back(u8(one, 2));
      } else {
        REQUIRE_FALSE(found.settings.empty());
        CHECK(u8(found.settings.back().interface, 2) == u8(one, 2));
        CHECK(u8(one, 3) == u8(found.settings.back().interface, 3) + 1);
      }
      found.settings.push_back({one, {}, {}});
      continue;
    }
    REQUIRE_FALSE(found.settings.empty());
    WalkedSetting& setting = found.settings.back();
    if (u8(one, 1) != 5) {
      setting.others.push_back(one);
      continue;
    }
    REQUIRE(one.size() == 7);
    CHECK((u8(one, 2) & 0x70U) == 0);
    CHECK((u8(one, 2) & 0x0FU) != 0);  // Never the control endpoint.
    for (const auto& [address, interface] : owners) {
      const bool shared = address == u8(one, 2) && interface != u8(setting.interface, 2);
      CHECK_FALSE(shared);  // 9.6.6: an endpoint belongs to one interface, but for alternate settings.
    }
    owners.emplace_back(u8(one, 2), u8(setting.interface, 2));
    setting.endpoints.push_back(one);
  }
  CHECK(u8(found.head, 4) == numbers.size());  // bNumInterfaces
  for (const WalkedSetting& setting : found.settings) {
    CHECK(u8(setting.interface, 4) == setting.endpoints.size());  // bNumEndpoints
  }
  return found;
}

/// USB 2.0, table 9-15: what a string says.
inline std::u16string text_of(const Bytes& string) {
  REQUIRE(string.size() >= 2);
  CHECK(u8(string, 0) == string.size());
  CHECK(u8(string, 1) == 3);
  REQUIRE(string.size() % 2 == 0);
  std::u16string text;
  for (std::size_t at = 2; at < string.size(); at += 2) {
    text.push_back(static_cast<char16_t>(u16(string, at)));
  }
  return text;
}

}  // namespace scatter::firmware::fake
