// Hashes the body of an image in bounded pieces.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/ports/ports.h"

namespace scatter::firmware {

/// One at a time, as the Verifier hashes one thing at a time. RAM: about 600 B.
class BodyCheck {
 public:
  enum class Result : std::uint8_t { kMore, kGood, kBad, kUnreadable };
  static constexpr std::uint32_t kPieceBytes = 4096;  ///< Hashed by one step().

  void begin(Flash& slot, const protocol::ImageHeader& header, Verifier& verifier) noexcept;
  /// One piece. After a result other than kMore: begin again.
  [[nodiscard]] Result step() noexcept;
  [[nodiscard]] Result run() noexcept;

 private:
  static constexpr std::uint32_t kReadBytes = 512;

  Flash* slot_ = nullptr;
  Verifier* verifier_ = nullptr;
  std::uint32_t offset_ = 0;  // In the body.
  std::uint32_t bytes_ = 0;
  protocol::Sha512 expected_{};
  std::array<std::byte, kReadBytes> buffer_{};
};

}  // namespace scatter::firmware
