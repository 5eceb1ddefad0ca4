// The memory that a board without a camera shares with the simulated bench: the board sees it at
// kSharedMemoryAddress, the bench as a file of kSharedMemoryBytes.
#pragma once

#include <cstdint>

namespace scatter::firmware::backplane {

inline constexpr std::uint32_t kSharedMemoryAddress = 0x6000'0000;
inline constexpr std::uint32_t kSharedMemoryBytes = 16U << 20U;

/// The frame that the last Ready announced: u16 per pixel of the window, row major, little endian. Stands in
/// for camera DMA.
inline constexpr std::uint32_t kFrameOffset = 0;
inline constexpr std::uint32_t kFrameBytes = 4U << 20U;

/// The factory set (firmware/core/factory_set.h), written once at production; read-only to the firmware.
inline constexpr std::uint32_t kFactoryOffset = 4U << 20U;
inline constexpr std::uint32_t kFactoryBytes = 2U << 20U;

/// Two firmware slots, executed in place (protocol/image_header.h).
inline constexpr std::uint32_t kSlotBytes = 512U << 10U;
inline constexpr std::uint32_t kSlotUnitBytes = 4096;
inline constexpr std::uint32_t kSlotGranuleBytes = 32;
inline constexpr std::uint32_t kSlotOffset[2] = {8U << 20U, (8U << 20U) + kSlotBytes};

}  // namespace scatter::firmware::backplane
