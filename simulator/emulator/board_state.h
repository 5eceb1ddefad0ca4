// What an emulated board keeps without power: the shared memory with factory set and firmware slots, and the
// EEPROM. Two files in a folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "host_sdk/error/error.h"
#include "protocol/descriptor.h"
#include "simulator/instrument/listener.h"

namespace scatter::simulator {

class VirtualBoard;

/// Holds the folder for itself; a temporary one goes with the object. Threads: one.
class BoardState {
 public:
  /// The memory's and the EEPROM's file in `folder`, made (erased) when absent. Empty `folder`: a fresh
  /// temporary one. Errors    kPermissionDenied, kNotFound: the folder; kDataLoss: a file of another size;
  /// kBusy: another
  ///           board runs on it.
  [[nodiscard]] static Result<BoardState> open(const std::filesystem::path& folder);
  BoardState(BoardState&& other) noexcept;
  BoardState& operator=(BoardState&&) = delete;
  ~BoardState();

  [[nodiscard]] std::filesystem::path shared_memory_file() const;
  [[nodiscard]] std::filesystem::path eeprom_file() const;
  /// The shared memory, as the board sees it.
  [[nodiscard]] std::span<std::byte> shared_memory() noexcept { return {memory_, bytes_}; }
  /// True when production has not been here: open() made the memory.
  [[nodiscard]] bool fresh() const noexcept { return fresh_; }
  /// QEMU has opened the files: those of a temporary folder are unlinked, so that nothing is left whatever
  /// happens.
  void let_go() noexcept;

 private:
  BoardState() = default;

  std::filesystem::path folder_;
  bool temporary_ = false;
  bool fresh_ = false;
  FileDescriptor file_;
  std::byte* memory_ = nullptr;
  std::size_t bytes_ = 0;
};

/// Writes the factory set of `board`; in a state that is not fresh, compares it.
/// Errors    kFailedPrecondition: the state is another instrument's.
[[nodiscard]] Status provide_factory_set(BoardState& state, VirtualBoard& board);

/// Puts the image of `package` (.scfw) for slot 0 there, confirmed. As a programmer at production would: the
/// signature is for the board to judge.
/// Errors    of Package::load; kInvalidArgument: linked for another address, or longer than a slot.
[[nodiscard]] Status install_firmware(BoardState& state, const std::filesystem::path& package);

}  // namespace scatter::simulator
