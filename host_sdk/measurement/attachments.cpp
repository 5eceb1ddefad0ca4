#include "host_sdk/measurement/attachments.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace scatter::measurement {

Status attach(device::RecordingWriter& writer, const ReferenceSet& references) {
  if (const Status named =
          writer.attach(kAttachmentCalibrationId, std::as_bytes(std::span(references.sha256())));
      !named) {
    return named;
  }
  return writer.attach(kAttachmentReferences, references.serialise());
}

Result<std::shared_ptr<const ReferenceSet>> attached_references(const device::RecordingReader& reader) {
  const std::vector<std::string> names = reader.attachment_names();
  if (std::ranges::find(names, kAttachmentReferences) == names.end()) {
    return std::shared_ptr<const ReferenceSet>();
  }
  const auto bytes = reader.attachment(kAttachmentReferences);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  std::optional<std::array<std::uint8_t, 32>> known;
  if (const auto id = reader.attachment(kAttachmentCalibrationId); id && id->size() == 32) {
    known.emplace();
    std::memcpy(known->data(), id->data(), known->size());
  }
  return ReferenceSet::parse(*bytes, known);
}

}  // namespace scatter::measurement
