// The virtual board's firmware slots, and what its production put there.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/boot/boot_decision.h"
#include "firmware/crypto/sodium_verifier.h"
#include "firmware/ports/ports.h"
#include "simulator/instrument/flash_image.h"

namespace scatter::simulator {

/// Firmware that a simulated instrument has when it is new.
inline constexpr std::string_view kProducedVersion = "0.1.0";

/// Where the slots are mapped: as on the mps2_an500 board, so that one image fits both.
inline constexpr std::uint32_t kSlotAddress[firmware::ImageSlots::kCount] = {0x6080'0000, 0x6088'0000};

/// The images' bodies are kept, hashed and chosen between as on a real board, but not executed: the host runs
/// the firmware's core itself. What an image changes is the version that HELLO reports. Threads: one.
class VirtualSlots final : public firmware::ImageSlots {
 public:
  /// Puts the produced image into blank slots. `flash` must outlive this.
  VirtualSlots(FlashImage& flash, std::string_view product);

  [[nodiscard]] firmware::Flash& slot(std::uint8_t index) noexcept override { return flash_.slot(index); }
  [[nodiscard]] std::uint32_t address(std::uint8_t index) noexcept override { return kSlotAddress[index]; }
  [[nodiscard]] std::uint8_t running() noexcept override { return decision_.slot; }

  /// What the bootloader does at each start.
  void boot(protocol::ResetReason reason) noexcept;
  /// Of the last boot.
  [[nodiscard]] const firmware::BootDecision& decision() const noexcept { return decision_; }
  [[nodiscard]] firmware::Verifier& verifier() noexcept { return verifier_; }
  /// "openscatter VERSION" of the running image, or the bootloader's name in rescue mode.
  [[nodiscard]] std::string_view build_id() const noexcept { return build_id_; }

 private:
  FlashImage& flash_;
  std::string product_;
  std::vector<firmware::TrustedKey>
      keys_;  ///< Of this build, and the test key that signs the produced image.
  firmware::SodiumVerifier verifier_;
  firmware::BootDecision decision_;
  std::string build_id_;
};

}  // namespace scatter::simulator
