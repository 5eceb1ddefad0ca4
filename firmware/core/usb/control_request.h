// A control request, and what becomes of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace scatter::firmware {

/// USB 2.0, table 9-2.
struct ControlRequest {
  enum class Kind : std::uint8_t { kStandard = 0, kClass = 1, kVendor = 2, kReserved = 3 };
  enum class Recipient : std::uint8_t { kDevice = 0, kInterface = 1, kEndpoint = 2 };

  std::uint8_t type = 0;     ///< bmRequestType.
  std::uint8_t request = 0;  ///< bRequest.
  std::uint16_t value = 0;   ///< wValue.
  std::uint16_t index = 0;   ///< wIndex.
  std::uint16_t length = 0;  ///< wLength.

  [[nodiscard]] static constexpr ControlRequest parse(const std::array<std::uint8_t, 8>& setup) noexcept {
    const auto word = [&](std::size_t at) {
      return static_cast<std::uint16_t>(setup[at] | static_cast<unsigned>(setup[at + 1]) << 8U);
    };
    return {.type = setup[0], .request = setup[1], .value = word(2), .index = word(4), .length = word(6)};
  }
  [[nodiscard]] constexpr bool to_host() const noexcept { return (type & 0x80U) != 0; }
  [[nodiscard]] constexpr Kind kind() const noexcept { return static_cast<Kind>(type >> 5U & 3U); }
  /// May be none of the enumerators.
  [[nodiscard]] constexpr Recipient recipient() const noexcept {
    return static_cast<Recipient>(type & 0x1FU);
  }
};

struct ControlAnswer {
  enum class Kind : std::uint8_t {
    kStall,
    kAccept,   ///< Status stage.
    kSend,     ///< `data`, cut to wLength, then the status stage.
    kReceive,  ///< wLength bytes first, then ask again with them.
  };
  Kind kind = Kind::kStall;
  std::span<const std::byte> data{};

  [[nodiscard]] static constexpr ControlAnswer stall() noexcept { return {}; }
  [[nodiscard]] static constexpr ControlAnswer accept() noexcept { return {.kind = Kind::kAccept}; }
  [[nodiscard]] static constexpr ControlAnswer receive() noexcept { return {.kind = Kind::kReceive}; }
  /// Nothing to send is a request for what does not exist.
  [[nodiscard]] static constexpr ControlAnswer send(std::span<const std::byte> data) noexcept {
    return data.empty() ? stall() : ControlAnswer{.kind = Kind::kSend, .data = data};
  }
};

}  // namespace scatter::firmware
