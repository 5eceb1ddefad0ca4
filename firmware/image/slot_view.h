// What a firmware slot holds: its header, checked and its signature verified, and its marks.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "firmware/image/marks.h"
#include "firmware/image/slot_layout.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware {

/// Text of a zero-padded field.
[[nodiscard]] std::string_view text_of(const protocol::ImageText& text) noexcept;

/// Which slot an image must have been made for.
struct SlotIdentity {
  std::string_view product;
  std::uint8_t index = 0;
  std::uint32_t address = 0;        ///< Of the slot, not of the body.
  std::uint32_t body_capacity = 0;  ///< [B]
};

enum class HeaderFault : std::uint8_t {
  kNone,
  kFormat,     ///< Magic, version, flags or padding.
  kProduct,    ///< Made for another product.
  kSignature,  ///< Not signed by a trusted key.
  kSlot,       ///< Linked for the other slot.
  kAddress,    ///< Linked for another address.
  kSize,       ///< Empty, or too long for the slot.
};

/// Checks an encoded header and decodes it into `header` (unspecified at kFormat). Cost: one signature check.
[[nodiscard]] HeaderFault check_header(std::span<const std::byte, protocol::kImageHeaderBytes> bytes,
                                       const SlotIdentity& slot, Verifier& verifier,
                                       protocol::ImageHeader& header) noexcept;

struct SlotView {
  SlotLayout layout;
  /// As far as it can be told without the body and the other slot: kEmpty, kUnreadable, kBadHeader,
  /// kWrongProduct, kReceiving, kReady, kTrial (tried, not confirmed), kReverted or kConfirmed.
  protocol::SlotVerdict verdict = protocol::SlotVerdict::kEmpty;
  bool header_good = false;
  protocol::ImageHeader header;  ///< Only when header_good.
  Marks marks;                   ///< Only when header_good.
};

/// Cost: one signature check.
[[nodiscard]] SlotView view_slot(ImageSlots& slots, std::uint8_t index, Verifier& verifier,
                                 std::string_view product) noexcept;

/// Images below this security counter are refused: the highest of the confirmed images, 0 without one. A
/// header counts though its body may be rotten.
[[nodiscard]] std::uint32_t lowest_counter(const std::array<SlotView, ImageSlots::kCount>& views) noexcept;
/// Number for the next confirmation.
[[nodiscard]] std::uint32_t next_confirmation(const std::array<SlotView, ImageSlots::kCount>& views) noexcept;

}  // namespace scatter::firmware
