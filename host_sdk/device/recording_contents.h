// What RecordingReader holds. Internal to this wing: its cursors and the replay carrier read it, too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/device/pixel_pool.h"
#include "host_sdk/device/recording_reader.h"
#include "host_sdk/device/recording_table.h"

namespace scatter::device {

struct RecordingReader::Impl {
  std::string name;
  recording::MappedFile file;  ///< Empty when the bytes are the caller's.
  std::span<const std::byte> bytes;
  recording::RecordTable table;
  RecordingIntegrity integrity;
  std::map<std::string, std::span<const std::byte>, std::less<>> attachments;
  std::vector<std::string> notes;
  std::vector<RecordedRun> runs;
  std::vector<std::optional<std::uint32_t>> run_ids;  ///< As Started or the report says, per run.
  std::shared_ptr<PixelPool> pool = std::make_shared<PixelPool>();

  /// Finds attachments, notes and runs.
  void survey();

 private:
  void take_attachment(std::size_t record);
  void take_message(std::size_t record);
};

}  // namespace scatter::device
