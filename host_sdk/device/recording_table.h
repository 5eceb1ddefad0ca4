// The records of a recording in memory: where they are, which are valid. Internal to this wing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/device/recording_format.h"
#include "host_sdk/device/recording_reader.h"
#include "protocol/frame.h"

namespace scatter::device::recording {

/// A file mapped for reading.
class MappedFile {
 public:
  MappedFile() = default;
  [[nodiscard]] static Result<MappedFile> open(const std::filesystem::path& path);
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&& other) noexcept;
  ~MappedFile();

  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }
  /// The pages of this range will not be needed soon: lets go of the memory, not of the contents.
  void forget(std::uint64_t begin, std::uint64_t end) const noexcept;

 private:
  std::span<const std::byte> bytes_;
};

struct RecordRef {
  std::uint64_t offset = 0;
  std::uint32_t length = 0;
  RecordType type = RecordType::kNote;
  std::uint16_t message = 0;
};

/// All records of a file in order, without index and end.
class RecordTable {
 public:
  /// Errors  kInvalidArgument: not a recording, or of a later version; kDataLoss: the file header is
  ///         cut or damaged.
  [[nodiscard]] static Result<RecordTable> read(std::span<const std::byte> bytes, const std::string& name);

  [[nodiscard]] const RecordingInfo& info() const noexcept { return info_; }
  [[nodiscard]] const RecordingIntegrity& integrity() const noexcept { return integrity_; }
  [[nodiscard]] std::span<const RecordRef> records() const noexcept { return records_; }

  /// The payload of a record, if the record is valid.
  [[nodiscard]] std::optional<std::span<const std::byte>> payload(std::size_t record) const noexcept;
  /// The frame of a wire record, if the record is valid.
  [[nodiscard]] std::optional<protocol::Frame> wire(std::size_t record) const noexcept;
  [[nodiscard]] std::uint64_t host_time_unix_ns(std::size_t record) const noexcept;

 private:
  [[nodiscard]] bool take_index();
  void scan();

  std::span<const std::byte> bytes_;
  RecordingInfo info_;
  RecordingIntegrity integrity_;
  std::vector<RecordRef> records_;
};

}  // namespace scatter::device::recording
