// Reads recordings (.scat), whole or damaged; the format is specified in RECORDING.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/device/frame.h"
#include "host_sdk/device/recording_writer.h"
#include "host_sdk/error/error.h"
#include "protocol/descriptor.h"
#include "protocol/messages.h"

namespace scatter::device {

/// What is wrong with a file, if anything.
struct RecordingIntegrity {
  bool truncated = false;               ///< No end mark: the writer was killed or the disk was full.
  std::uint64_t bytes_lost = 0;         ///< After the last whole record, and between damaged ones.
  std::uint64_t corrupted_records = 0;  ///< Whole, but a checksum is wrong; skipped.
  [[nodiscard]] bool perfect() const noexcept {
    return !truncated && bytes_lost == 0 && corrupted_records == 0;
  }
  /// One sentence for people, "" when perfect.
  [[nodiscard]] std::string text() const;
};

/// One run of a recording. A calibration recording has several.
struct RecordedRun {
  protocol::Configuration configuration;
  protocol::Started started;
  std::optional<protocol::RunReport> report;  ///< The device's half of the ledger; absent when cut off.
  std::size_t first_record = 0;               ///< Internal positions.
  std::size_t end_record = 0;
};

/// What the reader saw of one run after its last frame was handed out.
struct RecordedRunSummary {
  /// The device's half completed from the recording: `delivered` = complete frames in the file.
  /// Without a report, `exposed` counts the frames that the file knows of.
  protocol::Ledger ledger;
  RecordingIntegrity integrity;  ///< Of the records read for this run.
};

class RunCursor;

/// A recording mapped into memory. Opening reads the index (or scans the record headers of a file
/// without one); checksums of pixel data are checked as they are read.
/// Threads  const functions may be called from several threads; each RunCursor belongs to one.
class RecordingReader {
 public:
  /// Errors  kNotFound, kPermissionDenied, kInvalidArgument (not a recording, or of a later version),
  ///         kDataLoss (too short to hold anything). A file cut anywhere behind its header opens.
  [[nodiscard]] static Result<RecordingReader> open(const std::filesystem::path& path);
  /// The same over bytes in memory, which must outlive the reader.
  [[nodiscard]] static Result<RecordingReader> from_bytes(std::span<const std::byte> bytes,
                                                          std::string_view name = "recording");
  RecordingReader(RecordingReader&&) noexcept;
  RecordingReader& operator=(RecordingReader&&) noexcept;
  ~RecordingReader();

  [[nodiscard]] const RecordingInfo& info() const noexcept;
  /// As known after open(); damaged pixel data show in the cursors' summaries and in verify().
  [[nodiscard]] const RecordingIntegrity& integrity() const noexcept;
  /// Reads everything and checks every checksum.
  [[nodiscard]] RecordingIntegrity verify() const;
  [[nodiscard]] std::uint64_t size_bytes() const noexcept;

  [[nodiscard]] std::vector<std::string> attachment_names() const;
  /// A view into the file, checksum checked at open(); the newest of that name.
  /// Errors  kNotFound (the message lists the names).
  [[nodiscard]] Result<std::span<const std::byte>> attachment(std::string_view name) const;
  /// Errors  kNotFound, kDataLoss.
  [[nodiscard]] Result<protocol::Descriptor> descriptor() const;
  [[nodiscard]] Result<protocol::HelloReply> hello() const;
  [[nodiscard]] std::vector<std::string> notes() const;
  [[nodiscard]] std::span<const RecordedRun> runs() const noexcept;

  /// The frames of one run, as the live stream would have delivered them.
  /// Errors  kOutOfRange: no such run.
  [[nodiscard]] Result<RunCursor> frames(std::size_t run) const;

  /// All frames of all runs in order; a failed Status from the visitor ends the walk and is returned.
  using FrameVisitor = std::function<Status(std::size_t run, const Frame& frame)>;
  [[nodiscard]] Status for_each_frame(const FrameVisitor& visitor) const;

  struct Impl;

 private:
  friend class RunCursor;
  friend class ReplayTransport;
  explicit RecordingReader(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Hands out the frames of one run. The reader outlives it; frames outlive both (pooled buffers,
/// reused when the caller drops them).
class RunCursor {
 public:
  RunCursor(RunCursor&&) noexcept;
  RunCursor& operator=(RunCursor&&) noexcept;
  ~RunCursor();

  /// nullopt = no more frames; then summary() is final. Damage never fails a read: it shows in the
  /// frames' status and in the summary.
  [[nodiscard]] Result<std::optional<Frame>> next();
  [[nodiscard]] RecordedRunSummary summary() const;

  struct State;

 private:
  friend class RecordingReader;
  explicit RunCursor(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

}  // namespace scatter::device
