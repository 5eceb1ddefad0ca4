#include "host_sdk/device/recording_writer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <limits>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "host_sdk/device/recording_format.h"
#include "protocol/codec.h"
#include "protocol/frame.h"

namespace scatter::device {

namespace {

using recording::RecordHeader;
using recording::RecordType;

// What a killed writer can lose, and few enough system calls for fast streams.
constexpr std::size_t kBufferBytes = 512 * 1024;

std::unexpected<Error> file_error(int number, const std::filesystem::path& path, std::string_view doing) {
  const std::string what = path.string() + ": " + std::string(doing) + ": " + std::strerror(number);
  switch (number) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return fail(
          ErrorCode::kResourceExhausted, what,
          "free some space or choose another folder, then record again; what was written so far opens");
    case EACCES:
    case EPERM:
    case EROFS:
      return fail(ErrorCode::kPermissionDenied, what, "choose a folder that you may write to");
    case ENOENT:
    case ENOTDIR:
      return fail(ErrorCode::kNotFound, what, "create the folder first");
    case EISDIR:
      return fail(ErrorCode::kInvalidArgument, what, "name a file, for example run.scat");
    default:
      return fail(ErrorCode::kUnavailable, what, "check the disk, then record again");
  }
}

}  // namespace

struct RecordingWriter::Impl {
  struct Entry {
    std::uint64_t offset = 0;
    std::uint32_t length = 0;
    RecordType type = RecordType::kNote;
    std::uint16_t message = 0;
  };

  std::filesystem::path path;
  int file = -1;
  std::vector<std::byte> buffer;
  std::uint64_t flushed = 0;  ///< Bytes in the file.
  std::uint64_t end = 0;      ///< Bytes in file and buffer.
  std::vector<Entry> entries;
  std::set<std::string, std::less<>> attachments;
  std::optional<Error> error;
  bool finished = false;

  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (file >= 0) {
      ::close(file);
    }
  }

  Status broken(std::unexpected<Error> failure) {
    error = failure.error();
    // Cut the torn record off: the file stays valid up to its last whole record.
    const auto whole = std::ranges::partition_point(entries, [this](const Entry& one) {
      return one.offset + recording::kRecordHeaderBytes + recording::padded(one.length) <= flushed;
    });
    const std::uint64_t keep = whole == entries.begin()
                                   ? std::min<std::uint64_t>(flushed, recording::kFileHeaderBytes)
                                   : std::prev(whole)->offset + recording::kRecordHeaderBytes +
                                         recording::padded(std::prev(whole)->length);
    (void)!::ftruncate(file, static_cast<off_t>(keep));
    ::close(std::exchange(file, -1));
    return std::unexpected(*error);
  }

  Status flush() {
    std::span<const std::byte> rest(buffer);
    while (!rest.empty()) {
      const ssize_t wrote = ::write(file, rest.data(), rest.size());
      if (wrote < 0) {
        if (errno == EINTR) {
          continue;
        }
        return broken(file_error(errno, path, "write"));
      }
      flushed += static_cast<std::uint64_t>(wrote);
      rest = rest.subspan(static_cast<std::size_t>(wrote));
    }
    buffer.clear();
    return {};
  }

  void put(std::span<const std::byte> bytes) {
    buffer.insert(buffer.end(), bytes.begin(), bytes.end());
    end += bytes.size();
  }

  /// One record whose payload is `first` followed by `second`.
  Status append(RecordHeader header, std::span<const std::byte> first,
                std::span<const std::byte> second = {}) {
    if (error) {
      return std::unexpected(*error);
    }
    if (finished) {
      return fail(ErrorCode::kFailedPrecondition, path.string() + ": the recording is finished",
                  "create another recording");
    }
    const std::uint64_t length = first.size() + second.size();
    if (length > std::numeric_limits<std::uint32_t>::max()) {
      return fail(
          ErrorCode::kInvalidArgument,
          path.string() + ": a record of " + std::to_string(length) + " bytes, allowed are 4294967295",
          "split the attachment");
    }
    header.length = static_cast<std::uint32_t>(length);
    if (header.type != RecordType::kWire) {
      header.payload_crc = protocol::crc32c(second, protocol::crc32c(first));
    }
    entries.push_back({end, header.length, header.type, header.message});
    put(recording::encode(header));
    put(first);
    put(second);
    static constexpr std::array<std::byte, recording::kAlignment> kZeros{};
    put(std::span(kZeros).first(recording::padded(length) - length));
    return buffer.size() >= kBufferBytes ? flush() : Status();
  }

  Status write_index() {
    std::vector<std::byte> index(entries.size() * recording::kIndexEntryBytes);
    std::byte* at = index.data();
    for (const Entry& entry : entries) {
      protocol::store_le(at, entry.offset);
      protocol::store_le(at + 8, entry.length);
      protocol::store_le(at + 12, entry.type);
      protocol::store_le(at + 14, entry.message);
      at += recording::kIndexEntryBytes;
    }
    std::array<std::byte, recording::kEndPayloadBytes> last{};
    protocol::store_le(last.data(), end);
    protocol::store_le(last.data() + 8, static_cast<std::uint64_t>(entries.size()));
    if (const Status wrote = append({.type = RecordType::kIndex}, index); !wrote) {
      return wrote;
    }
    if (const Status wrote = append({.type = RecordType::kEnd}, last); !wrote) {
      return wrote;
    }
    return flush();
  }
};

Result<RecordingWriter> RecordingWriter::create(const std::filesystem::path& path,
                                                const RecordingInfo& info) {
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  impl->file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (impl->file < 0) {
    return file_error(errno, path, "create");
  }
  impl->buffer.reserve(kBufferBytes + protocol::kMaxFrameBytes + 64);
  impl->put(recording::encode_file_header(info));
  // A disk without room shows here and not after the first exposure.
  if (const Status wrote = impl->flush(); !wrote) {
    return std::unexpected(wrote.error());
  }
  return RecordingWriter(std::move(impl));
}

RecordingWriter::RecordingWriter(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
RecordingWriter::RecordingWriter(RecordingWriter&&) noexcept = default;
RecordingWriter& RecordingWriter::operator=(RecordingWriter&& other) noexcept {
  std::swap(impl_, other.impl_);
  return *this;
}

RecordingWriter::~RecordingWriter() {
  if (impl_) {
    (void)finish();
  }
}

Status RecordingWriter::attach(std::string_view name, std::span<const std::byte> bytes) {
  if (name.empty() || name.size() > 255) {
    return fail(ErrorCode::kInvalidArgument,
                "attachment name has " + std::to_string(name.size()) + " bytes, allowed are 1 to 255",
                "choose another name");
  }
  // The blob starts at a multiple of 8, so that arrays in it can be used where they lie.
  std::vector<std::byte> head(recording::padded(2 + name.size()));
  protocol::store_le(head.data(), static_cast<std::uint16_t>(name.size()));
  std::memcpy(head.data() + 2, name.data(), name.size());
  const Status wrote = impl_->append({.type = RecordType::kAttachment}, head, bytes);
  if (wrote) {
    impl_->attachments.emplace(name);
  }
  return wrote;
}

bool RecordingWriter::has_attachment(std::string_view name) const {
  return impl_->attachments.contains(name);
}

Status RecordingWriter::configuration(const protocol::Configuration& configuration,
                                      std::uint64_t host_time_unix_ns) {
  std::array<std::byte, protocol::max_encoded_size<protocol::Configuration>()> bytes;
  const std::size_t size = protocol::encode(configuration, std::span(bytes)).value_or(0);
  return impl_->append({.type = RecordType::kConfiguration, .host_time_unix_ns = host_time_unix_ns},
                       std::span<const std::byte>(bytes).first(size));
}

Status RecordingWriter::wire(std::span<const std::byte> frame_bytes, std::uint64_t host_time_unix_ns) {
  if (frame_bytes.size() < protocol::kFrameOverhead || frame_bytes.size() > protocol::kMaxFrameBytes) {
    return fail(ErrorCode::kInvalidArgument,
                "wire frame has " + std::to_string(frame_bytes.size()) + " bytes, allowed are 28 to " +
                    std::to_string(protocol::kMaxFrameBytes),
                "record whole wire frames");
  }
  return impl_->append({.type = RecordType::kWire,
                        .message = protocol::load_le<std::uint16_t>(frame_bytes.data() + 6),
                        .host_time_unix_ns = host_time_unix_ns},
                       frame_bytes);
}

Status RecordingWriter::note(std::string_view text, std::uint64_t host_time_unix_ns) {
  return impl_->append({.type = RecordType::kNote, .host_time_unix_ns = host_time_unix_ns},
                       std::as_bytes(std::span(text)));
}

Status RecordingWriter::finish() {
  if (impl_->error) {
    return std::unexpected(*impl_->error);
  }
  if (impl_->finished) {
    return {};
  }
  if (const Status wrote = impl_->write_index(); !wrote) {
    return wrote;
  }
  impl_->finished = true;
  if (::close(std::exchange(impl_->file, -1)) != 0) {
    impl_->error = file_error(errno, impl_->path, "close").error();
    return std::unexpected(*impl_->error);
  }
  return {};
}

std::uint64_t RecordingWriter::bytes_written() const noexcept {
  return impl_->end;
}
const std::filesystem::path& RecordingWriter::path() const noexcept {
  return impl_->path;
}

}  // namespace scatter::device
