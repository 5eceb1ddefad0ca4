#include "host_sdk/device/recording_table.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace scatter::device::recording {

namespace {

std::unexpected<Error> open_error(int number, const std::filesystem::path& path) {
  const std::string what = path.string() + ": " + std::strerror(number);
  if (number == ENOENT || number == ENOTDIR) {
    return fail(ErrorCode::kNotFound, what, "correct the path");
  }
  if (number == EACCES || number == EPERM) {
    return fail(ErrorCode::kPermissionDenied, what, "use an account that may read the file");
  }
  return fail(ErrorCode::kUnavailable, what, "check the file and the disk, then try again");
}

}  // namespace

Result<MappedFile> MappedFile::open(const std::filesystem::path& path) {
  // O_NONBLOCK: a pipe would wait for somebody who writes, before its kind is known.
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    return open_error(errno, path);
  }
  struct stat status{};
  if (::fstat(file, &status) != 0) {
    const int number = errno;
    ::close(file);
    return open_error(number, path);
  }
  if (!S_ISREG(status.st_mode)) {
    ::close(file);
    return fail(ErrorCode::kInvalidArgument, path.string() + ": not a regular file",
                "name a recording (.scat)");
  }
  MappedFile mapped;
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size != 0) {
    void* memory = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
    if (memory == MAP_FAILED) {
      const int number = errno;
      ::close(file);
      return open_error(number, path);
    }
    (void)::madvise(memory, size, MADV_SEQUENTIAL);
    mapped.bytes_ = {static_cast<const std::byte*>(memory), size};
  }
  ::close(file);
  return mapped;
}

MappedFile::MappedFile(MappedFile&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}

MappedFile& MappedFile::operator=(MappedFile&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) {
    ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
  }
}

void MappedFile::forget(std::uint64_t begin, std::uint64_t end) const noexcept {
  constexpr std::uint64_t kPage = 4096;
  begin = (begin + kPage - 1) & ~(kPage - 1);
  end = std::min<std::uint64_t>(end, bytes_.size()) & ~(kPage - 1);
  if (begin < end) {
    (void)::madvise(const_cast<std::byte*>(bytes_.data()) + begin, end - begin, MADV_DONTNEED);
  }
}

Result<RecordTable> RecordTable::read(std::span<const std::byte> bytes, const std::string& name) {
  const std::size_t known = std::min(bytes.size(), kFileMagic.size());
  for (std::size_t i = 0; i < known; ++i) {
    if (static_cast<std::uint8_t>(bytes[i]) != kFileMagic[i]) {
      return fail(ErrorCode::kInvalidArgument, name + ": not a recording",
                  "name a file that `scatter` recorded (.scat)");
    }
  }
  if (bytes.size() < kFileHeaderBytes) {
    return fail(ErrorCode::kDataLoss,
                name + ": the file has " + std::to_string(bytes.size()) + " bytes, its header alone has " +
                    std::to_string(kFileHeaderBytes),
                "record again");
  }
  if (protocol::crc32c(bytes.first(76)) != protocol::load_le<std::uint32_t>(bytes.data() + 76)) {
    return fail(ErrorCode::kDataLoss, name + ": the file header is damaged", "use another copy of the file");
  }
  const auto major = protocol::load_le<std::uint16_t>(bytes.data() + 8);
  if (major != kVersionMajor || protocol::load_le<std::uint32_t>(bytes.data() + 12) != kFileHeaderBytes) {
    return fail(ErrorCode::kInvalidArgument,
                name + ": recording of version " + std::to_string(major) + ", this software reads version " +
                    std::to_string(kVersionMajor),
                "update the host's software");
  }
  RecordTable table;
  table.bytes_ = bytes;
  table.info_.creation_unix_ns = protocol::load_le<std::uint64_t>(bytes.data() + 16);
  const char* tool = reinterpret_cast<const char*>(bytes.data() + 24);
  table.info_.tool.assign(tool, ::strnlen(tool, kToolBytes));
  if (!table.take_index()) {
    table.records_.clear();
    table.scan();
  }
  return table;
}

bool RecordTable::take_index() {
  if (bytes_.size() < kFileHeaderBytes + kEndRecordBytes) {
    return false;
  }
  const std::uint64_t end_at = bytes_.size() - kEndRecordBytes;
  const auto end = decode_header(bytes_.subspan(end_at));
  if (!end || end->type != RecordType::kEnd || end->length != kEndPayloadBytes) {
    return false;
  }
  const std::span<const std::byte> last = bytes_.subspan(end_at + kRecordHeaderBytes, kEndPayloadBytes);
  if (protocol::crc32c(last) != end->payload_crc) {
    return false;
  }
  const auto index_at = protocol::load_le<std::uint64_t>(last.data());
  const auto count = protocol::load_le<std::uint64_t>(last.data() + 8);
  if (index_at < kFileHeaderBytes || index_at > end_at) {
    return false;
  }
  const auto index = decode_header(bytes_.subspan(index_at, end_at - index_at));
  if (!index || index->type != RecordType::kIndex || count != index->length / kIndexEntryBytes ||
      index->length % kIndexEntryBytes != 0 ||
      index_at + kRecordHeaderBytes + padded(index->length) != end_at) {
    return false;
  }
  const std::span<const std::byte> entries = bytes_.subspan(index_at + kRecordHeaderBytes, index->length);
  if (protocol::crc32c(entries) != index->payload_crc) {
    return false;
  }
  records_.reserve(count);
  std::uint64_t expected = kFileHeaderBytes;
  for (std::size_t at = 0; at < entries.size(); at += kIndexEntryBytes) {
    RecordRef record;
    record.offset = protocol::load_le<std::uint64_t>(entries.data() + at);
    record.length = protocol::load_le<std::uint32_t>(entries.data() + at + 8);
    record.type = protocol::load_le<RecordType>(entries.data() + at + 12);
    record.message = protocol::load_le<std::uint16_t>(entries.data() + at + 14);
    if (record.offset != expected) {
      return false;
    }
    expected += kRecordHeaderBytes + padded(record.length);
    if (expected > index_at) {
      return false;
    }
    records_.push_back(record);
  }
  return expected == index_at;
}

void RecordTable::scan() {
  std::uint64_t at = kFileHeaderBytes;
  integrity_.truncated = true;
  while (at < bytes_.size()) {
    const auto header = decode_header(bytes_.subspan(at));
    if (!header) {
      // Look for the next header; when there is none, the rest is the torn end of the file.
      std::uint64_t next = at + kAlignment;
      while (next + kRecordHeaderBytes <= bytes_.size() && !decode_header(bytes_.subspan(next))) {
        next += kAlignment;
      }
      if (next + kRecordHeaderBytes > bytes_.size()) {
        integrity_.bytes_lost += bytes_.size() - at;
        return;
      }
      ++integrity_.corrupted_records;
      integrity_.bytes_lost += next - at;
      at = next;
      continue;
    }
    if (at + kRecordHeaderBytes + header->length > bytes_.size()) {
      integrity_.bytes_lost += bytes_.size() - at;
      return;
    }
    if (header->type == RecordType::kEnd) {
      integrity_.truncated = at + kRecordHeaderBytes + padded(header->length) < bytes_.size();
    } else if (header->type != RecordType::kIndex) {
      records_.push_back({at, header->length, header->type, header->message});
    }
    at += kRecordHeaderBytes + padded(header->length);
  }
}

std::optional<std::span<const std::byte>> RecordTable::payload(std::size_t record) const noexcept {
  const RecordRef& ref = records_[record];
  const auto header = decode_header(bytes_.subspan(ref.offset));
  if (!header || header->type != ref.type || header->length != ref.length || header->message != ref.message) {
    return std::nullopt;
  }
  const std::span<const std::byte> bytes = bytes_.subspan(ref.offset + kRecordHeaderBytes, ref.length);
  if (ref.type != RecordType::kWire && protocol::crc32c(bytes) != header->payload_crc) {
    return std::nullopt;
  }
  return bytes;
}

std::optional<protocol::Frame> RecordTable::wire(std::size_t record) const noexcept {
  const auto bytes = payload(record);
  if (!bytes || records_[record].type != RecordType::kWire) {
    return std::nullopt;
  }
  const protocol::ParseResult parsed = protocol::parse_frame(*bytes);
  if (!parsed.frame || parsed.consumed != bytes->size() ||
      parsed.header.message != records_[record].message) {
    return std::nullopt;
  }
  return parsed.frame;
}

std::uint64_t RecordTable::host_time_unix_ns(std::size_t record) const noexcept {
  return protocol::load_le<std::uint64_t>(bytes_.data() + records_[record].offset + 8);
}

}  // namespace scatter::device::recording
