// Writes recordings (.scat); the format is specified in RECORDING.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "protocol/messages.h"

namespace scatter::device {

/// Written at the front of the file.
struct RecordingInfo {
  std::uint64_t creation_unix_ns = 0;  ///< Device::system_time_unix_ns(): virtual for simulators.
  std::string tool;                    ///< Program and version, at most 48 bytes.
};

/// Names of attachments that this wing writes itself; others are the caller's ("calibration/white").
inline constexpr std::string_view kAttachmentHello = "hello";            ///< Encoded HelloReply.
inline constexpr std::string_view kAttachmentDescriptor = "descriptor";  ///< Encoded Descriptor.
inline constexpr std::string_view kAttachmentHotPixels = "hot_pixels";   ///< Object kHotPixels.
inline constexpr std::string_view kAttachmentPrnuMap = "prnu_map";       ///< Object kPrnuMap.

/// One recording being written. The file is valid at every moment: after kill -9 or on a full disk
/// it opens up to its last whole record. One thread.
///
/// Errors are sticky: after a failed write every later call returns the same error and the file is
/// left as it is, cut back to its last whole record.
class RecordingWriter {
 public:
  /// Creates or replaces `path`.
  /// Errors  kPermissionDenied, kNotFound (folder), kResourceExhausted (disk full), kUnavailable (other I/O).
  [[nodiscard]] static Result<RecordingWriter> create(const std::filesystem::path& path,
                                                      const RecordingInfo& info);
  RecordingWriter(RecordingWriter&&) noexcept;
  RecordingWriter& operator=(RecordingWriter&&) noexcept;
  /// Finishes as well as it can; call finish() to learn of errors.
  ~RecordingWriter();

  /// Adds a named blob of any contents. Best before the first run. A later one of the same name
  /// replaces it for readers. Names: 1..255 bytes.
  [[nodiscard]] Status attach(std::string_view name, std::span<const std::byte> bytes);
  [[nodiscard]] bool has_attachment(std::string_view name) const;

  /// Adds the configuration of the runs that follow.
  [[nodiscard]] Status configuration(const protocol::Configuration& configuration,
                                     std::uint64_t host_time_unix_ns);

  /// Adds a whole, checked wire frame exactly as received.
  [[nodiscard]] Status wire(std::span<const std::byte> frame_bytes, std::uint64_t host_time_unix_ns);

  /// Adds a line of UTF-8 text for people.
  [[nodiscard]] Status note(std::string_view text, std::uint64_t host_time_unix_ns);

  /// Writes index and end mark, flushes to the disk, closes. Idempotent.
  [[nodiscard]] Status finish();

  [[nodiscard]] std::uint64_t bytes_written() const noexcept;
  [[nodiscard]] const std::filesystem::path& path() const noexcept;

  struct Impl;

 private:
  explicit RecordingWriter(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scatter::device
