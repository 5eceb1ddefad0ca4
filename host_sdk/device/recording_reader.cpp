#include "host_sdk/device/recording_reader.h"

#include <utility>

#include "host_sdk/device/recording_contents.h"
#include "protocol/codec.h"

namespace scatter::device {

using recording::RecordType;

std::string RecordingIntegrity::text() const {
  std::string out;
  if (truncated) {
    out = "the recording was cut off: it ends with its last whole record";
  }
  if (corrupted_records != 0) {
    out += (out.empty() ? "" : "; ") + std::to_string(corrupted_records) + " damaged record" +
           (corrupted_records == 1 ? " was" : "s were") + " passed over";
  }
  if (bytes_lost != 0) {
    out += (out.empty() ? "" : "; ") + std::to_string(bytes_lost) + " bytes are lost";
  }
  return out;
}

void RecordingReader::Impl::take_attachment(std::size_t record) {
  const auto payload = table.payload(record);
  if (!payload || payload->size() < 2) {
    ++integrity.corrupted_records;
    return;
  }
  const auto length = protocol::load_le<std::uint16_t>(payload->data());
  const std::uint64_t begin = recording::padded(2 + std::uint64_t{length});
  if (length == 0 || length > 255 || begin > payload->size()) {
    ++integrity.corrupted_records;
    return;
  }
  const std::string key(reinterpret_cast<const char*>(payload->data() + 2), length);
  attachments[key] = payload->subspan(begin);
}

void RecordingReader::Impl::take_message(std::size_t record) {
  const auto id = static_cast<protocol::MessageId>(table.records()[record].message);
  const bool stream = id == protocol::MessageId::kFrameBegin || id == protocol::MessageId::kFrameData ||
                      id == protocol::MessageId::kFrameEnd;
  const bool told = id == protocol::MessageId::kStarted || id == protocol::MessageId::kRunReport ||
                    id == protocol::MessageId::kRunFinished;
  if (runs.empty() && (stream || told)) {
    runs.emplace_back().first_record = record;  // Its configuration record is damaged.
    run_ids.emplace_back();
  }
  if (!told) {
    return;
  }
  const auto frame = table.wire(record);
  if (!frame) {
    return;  // Counted when the run is read.
  }
  RecordedRun& run = runs.back();
  std::optional<std::uint32_t>& run_id = run_ids.back();
  if (const auto started = frame->as<protocol::Started>(); started && !run_id) {
    run.started = *started;
    run_id = started->run_id;
    return;
  }
  std::optional<protocol::RunReport> report = frame->as<protocol::RunReport>();
  if (const auto event = frame->as<protocol::RunFinished>()) {
    report = protocol::RunReport{.run_id = event->run_id,
                                 .reason = event->reason,
                                 .ledger = event->ledger,
                                 .frames_sent = event->frames_sent,
                                 .started_us = event->started_us,
                                 .ended_us = event->ended_us,
                                 .held_us = event->held_us};
  }
  if (report && !run.report && run_id.value_or(report->run_id) == report->run_id) {
    run.report = report;
    run_id = report->run_id;
  }
}

void RecordingReader::Impl::survey() {
  integrity = table.integrity();
  const std::span<const recording::RecordRef> records = table.records();
  for (std::size_t i = 0; i < records.size(); ++i) {
    switch (records[i].type) {
      case RecordType::kAttachment:
        take_attachment(i);
        break;
      case RecordType::kConfiguration: {
        const auto payload = table.payload(i);
        const auto configuration =
            payload ? protocol::decode<protocol::Configuration>(*payload) : std::nullopt;
        if (!configuration) {
          ++integrity.corrupted_records;
          break;
        }
        if (!runs.empty()) {
          runs.back().end_record = i;
        }
        RecordedRun& run = runs.emplace_back();
        run.configuration = *configuration;
        run.first_record = i;
        run_ids.emplace_back();
        break;
      }
      case RecordType::kWire:
        take_message(i);
        break;
      case RecordType::kNote:
        if (const auto payload = table.payload(i)) {
          notes.emplace_back(reinterpret_cast<const char*>(payload->data()), payload->size());
        } else {
          ++integrity.corrupted_records;
        }
        break;
      case RecordType::kIndex:
      case RecordType::kEnd:
        break;
    }
  }
  if (!runs.empty()) {
    runs.back().end_record = records.size();
  }
}

Result<RecordingReader> RecordingReader::open(const std::filesystem::path& path) {
  Result<recording::MappedFile> file = recording::MappedFile::open(path);
  if (!file) {
    return std::unexpected(std::move(file.error()));
  }
  Result<RecordingReader> reader = from_bytes(file->bytes(), path.string());
  if (reader) {
    reader->impl_->file = std::move(*file);
  }
  return reader;
}

Result<RecordingReader> RecordingReader::from_bytes(std::span<const std::byte> bytes, std::string_view name) {
  auto impl = std::make_unique<Impl>();
  impl->name = std::string(name);
  impl->bytes = bytes;
  Result<recording::RecordTable> table = recording::RecordTable::read(bytes, impl->name);
  if (!table) {
    return std::unexpected(std::move(table.error()));
  }
  impl->table = std::move(*table);
  impl->survey();
  return RecordingReader(std::move(impl));
}

RecordingReader::RecordingReader(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
RecordingReader::RecordingReader(RecordingReader&&) noexcept = default;
RecordingReader& RecordingReader::operator=(RecordingReader&&) noexcept = default;
RecordingReader::~RecordingReader() = default;

const RecordingInfo& RecordingReader::info() const noexcept {
  return impl_->table.info();
}
const RecordingIntegrity& RecordingReader::integrity() const noexcept {
  return impl_->integrity;
}
std::uint64_t RecordingReader::size_bytes() const noexcept {
  return impl_->bytes.size();
}
std::vector<std::string> RecordingReader::notes() const {
  return impl_->notes;
}
std::span<const RecordedRun> RecordingReader::runs() const noexcept {
  return impl_->runs;
}

RecordingIntegrity RecordingReader::verify() const {
  RecordingIntegrity out = impl_->table.integrity();
  const std::span<const recording::RecordRef> records = impl_->table.records();
  for (std::size_t i = 0; i < records.size(); ++i) {
    const bool valid = records[i].type == RecordType::kWire ? impl_->table.wire(i).has_value()
                                                            : impl_->table.payload(i).has_value();
    out.corrupted_records += valid ? 0U : 1U;
  }
  return out;
}

std::vector<std::string> RecordingReader::attachment_names() const {
  std::vector<std::string> out;
  out.reserve(impl_->attachments.size());
  for (const auto& [key, bytes] : impl_->attachments) {
    out.push_back(key);
  }
  return out;
}

Result<std::span<const std::byte>> RecordingReader::attachment(std::string_view name) const {
  const auto found = impl_->attachments.find(name);
  if (found != impl_->attachments.end()) {
    return found->second;
  }
  std::string known;
  for (const auto& [key, bytes] : impl_->attachments) {
    known += (known.empty() ? "" : ", ") + key;
  }
  return fail(
      ErrorCode::kNotFound,
      impl_->name + ": no attachment '" + std::string(name) + "'; it has " + (known.empty() ? "none" : known),
      "use a recording that has it");
}

Result<protocol::Descriptor> RecordingReader::descriptor() const {
  const auto bytes = attachment(kAttachmentDescriptor);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  const auto descriptor = protocol::decode<protocol::Descriptor>(*bytes);
  if (!descriptor) {
    return fail(ErrorCode::kDataLoss, impl_->name + ": the descriptor cannot be read",
                "use another copy of the file");
  }
  return *descriptor;
}

Result<protocol::HelloReply> RecordingReader::hello() const {
  const auto bytes = attachment(kAttachmentHello);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  const auto hello = protocol::decode<protocol::HelloReply>(*bytes);
  if (!hello) {
    return fail(ErrorCode::kDataLoss, impl_->name + ": the hello reply cannot be read",
                "use another copy of the file");
  }
  return *hello;
}

Status RecordingReader::for_each_frame(const FrameVisitor& visitor) const {
  for (std::size_t run = 0; run < impl_->runs.size(); ++run) {
    Result<RunCursor> cursor = frames(run);
    if (!cursor) {
      return std::unexpected(cursor.error());
    }
    for (;;) {
      const Result<std::optional<Frame>> frame = cursor->next();
      if (!frame) {
        return std::unexpected(frame.error());
      }
      if (!*frame) {
        break;
      }
      if (const Status seen = visitor(run, **frame); !seen) {
        return seen;
      }
    }
  }
  return {};
}

}  // namespace scatter::device
