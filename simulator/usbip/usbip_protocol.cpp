#include "simulator/usbip/usbip_protocol.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <fmt/format.h>

namespace scatter::simulator::usbip {
namespace {

constexpr std::uint16_t kOpListRequest = 0x8005;
constexpr std::uint16_t kOpListReply = 0x0005;
constexpr std::uint16_t kOpImportRequest = 0x8003;
constexpr std::uint16_t kOpImportReply = 0x0003;

constexpr std::uint32_t kCmdSubmit = 1;
constexpr std::uint32_t kCmdUnlink = 2;
constexpr std::uint32_t kRetSubmit = 3;
constexpr std::uint32_t kRetUnlink = 4;

constexpr std::uint32_t kFlagShortNotOk = 0x0001;
constexpr std::uint32_t kNoIsochronousPackets = 0xFFFF'FFFF;  ///< In new clients; Linux sends 0.

constexpr std::size_t kPathBytes = 256;

/// Data grows in such steps while it arrives, so that an announced length alone costs nothing.
constexpr std::size_t kGrowth = 64UL * 1024;

std::uint32_t big32(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    value = value << 8U | std::to_integer<std::uint32_t>(bytes[at + k]);
  }
  return value;
}
std::uint16_t big16(std::span<const std::byte> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[at]) << 8U |
                                    std::to_integer<unsigned>(bytes[at + 1]));
}
void put32(std::span<std::byte> bytes, std::size_t at, std::uint32_t value) {
  for (std::size_t k = 0; k < 4; ++k) {
    bytes[at + k] = static_cast<std::byte>(value >> (24 - 8 * k));
  }
}

void append32(std::vector<std::byte>& out, std::uint32_t value) {
  out.resize(out.size() + 4);
  put32(out, out.size() - 4, value);
}
void append16(std::vector<std::byte>& out, std::uint16_t value) {
  out.push_back(static_cast<std::byte>(value >> 8U));
  out.push_back(static_cast<std::byte>(value));
}
void append8(std::vector<std::byte>& out, std::uint8_t value) {
  out.push_back(static_cast<std::byte>(value));
}
/// Text and zeros; the last byte is always zero.
void append_text(std::vector<std::byte>& out, std::string_view text, std::size_t size) {
  const std::size_t start = out.size();
  out.resize(start + size);
  std::memcpy(out.data() + start, text.data(), std::min(text.size(), size - 1));
}
void append_header(std::vector<std::byte>& out, std::uint16_t code, OpStatus status) {
  append16(out, kVersion);
  append16(out, code);
  append32(out, static_cast<std::uint32_t>(status));
}

void append_interface(std::vector<std::byte>& out, const DeviceRecord::Interface& interface) {
  append8(out, interface.device_class);
  append8(out, interface.sub_class);
  append8(out, interface.protocol);
}

void append_device(std::vector<std::byte>& out, const DeviceRecord& device) {
  append_text(out, fmt::format("/sys/devices/virtual/scatter/usb{}/{}", device.bus_number, device.bus_id),
              kPathBytes);
  append_text(out, device.bus_id, kBusIdBytes);
  append32(out, device.bus_number);
  append32(out, device.device_number);
  append32(out, static_cast<std::uint32_t>(device.speed));
  append16(out, device.vendor);
  append16(out, device.product);
  append16(out, device.release_bcd);
  append_interface(out, device.device);
  append8(out, device.configuration);
  append8(out, device.configurations);
  append8(out, static_cast<std::uint8_t>(device.interfaces.size()));
}

UrbHeader reply_header(std::uint32_t command, std::uint32_t sequence, UrbStatus status) {
  UrbHeader header{};
  put32(header, 0, command);
  put32(header, 4, sequence);
  put32(header, 20, static_cast<std::uint32_t>(status));
  return header;
}

}  // namespace

std::optional<Request> RequestReader::next(std::span<const std::byte>& bytes) {
  if (broken()) {
    return std::nullopt;
  }
  return transfers_ ? next_transfer(bytes) : next_operation(bytes);
}

/// True when the header's first `size` bytes are there.
bool RequestReader::fill_header(std::span<const std::byte>& bytes, std::size_t size) {
  if (header_size_ < size) {
    const std::size_t count = std::min(bytes.size(), size - header_size_);
    if (count > 0) {
      std::memcpy(header_.data() + header_size_, bytes.data(), count);
    }
    header_size_ += count;
    bytes = bytes.subspan(count);
  }
  return header_size_ >= size;
}

std::optional<Request> RequestReader::next_operation(std::span<const std::byte>& bytes) {
  if (!fill_header(bytes, kOpHeaderBytes)) {
    return std::nullopt;
  }
  const std::uint16_t version = big16(header_, 0);
  const std::uint16_t code = big16(header_, 2);
  if (version != kVersion) {
    problem_ = fmt::format("the client speaks USB/IP version {:#06x}, expected {:#06x}", version, kVersion);
    return std::nullopt;
  }
  if (code == kOpListRequest) {
    header_size_ = 0;
    return ListDevices{};
  }
  if (code != kOpImportRequest) {
    problem_ = fmt::format("request {:#06x} when it should be {:#06x} (list) or {:#06x} (import)", code,
                           kOpListRequest, kOpImportRequest);
    return std::nullopt;
  }
  if (!fill_header(bytes, kOpHeaderBytes + kBusIdBytes)) {
    return std::nullopt;
  }
  header_size_ = 0;
  const auto* text = reinterpret_cast<const char*>(header_.data()) + kOpHeaderBytes;
  return ImportDevice{std::string(text, ::strnlen(text, kBusIdBytes))};
}

std::optional<Request> RequestReader::next_transfer(std::span<const std::byte>& bytes) {
  if (!submit_) {
    if (!fill_header(bytes, kUrbHeaderBytes)) {
      return std::nullopt;
    }
    header_size_ = 0;
    const std::uint32_t command = big32(header_, 0);
    if (command == kCmdUnlink) {
      return UnlinkUrb{
          .sequence = big32(header_, 4), .device = big32(header_, 8), .victim = big32(header_, 20)};
    }
    if (command != kCmdSubmit) {
      problem_ = fmt::format("command {} when it should be {} (submit) or {} (unlink)", command, kCmdSubmit,
                             kCmdUnlink);
      return std::nullopt;
    }
    if (!parse_submit()) {
      return std::nullopt;
    }
  }
  std::vector<std::byte>& data = submit_->data;
  const std::size_t wanted = (submit_->endpoint & 0x80U) != 0 ? 0 : submit_->length;
  const std::size_t count = std::min(bytes.size(), wanted - data.size());
  if (count > 0 && data.capacity() < data.size() + count) {
    data.reserve(std::min(wanted, std::max(2 * data.size(), data.size() + count + kGrowth)));
  }
  data.insert(data.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
  bytes = bytes.subspan(count);
  if (data.size() < wanted) {
    return std::nullopt;
  }
  return *std::exchange(submit_, std::nullopt);
}

/// False: broken.
bool RequestReader::parse_submit() {
  const std::uint32_t direction = big32(header_, 12);
  const std::uint32_t endpoint = big32(header_, 16);
  const std::uint32_t flags = big32(header_, 20);
  const std::uint32_t length = big32(header_, 24);
  const std::uint32_t packets = big32(header_, 32);
  if (direction > 1 || endpoint > 15) {
    problem_ =
        fmt::format("direction {}, endpoint {} when they should be 0 or 1 and 0 to 15", direction, endpoint);
  } else if (length > kMostTransferBytes) {
    problem_ = fmt::format("a transfer of {} bytes when it should be at most {}", length, kMostTransferBytes);
  } else if (packets != 0 && packets != kNoIsochronousPackets) {
    problem_ = fmt::format("{} isochronous packets for a device without isochronous endpoints", packets);
  }
  if (broken()) {
    return false;
  }
  SubmitUrb urb;
  urb.sequence = big32(header_, 4);
  urb.device = big32(header_, 8);
  urb.endpoint = static_cast<std::uint8_t>(endpoint | direction << 7U);
  urb.short_not_ok = (flags & kFlagShortNotOk) != 0;
  urb.length = length;
  std::memcpy(urb.setup.data(), header_.data() + 40, urb.setup.size());
  submit_ = std::move(urb);
  return true;
}

std::optional<DeviceRecord> read_descriptors(std::span<const std::byte> device,
                                             std::span<const std::byte> configuration) {
  const auto at = [](std::span<const std::byte> bytes, std::size_t k) {
    return std::to_integer<std::uint8_t>(bytes[k]);
  };
  const auto little16 = [&](std::size_t k) {
    return static_cast<std::uint16_t>(at(device, k) | at(device, k + 1) << 8U);
  };
  constexpr std::uint8_t kDevice = 1;
  constexpr std::uint8_t kConfiguration = 2;
  constexpr std::uint8_t kInterface = 4;
  if (device.size() < 18 || at(device, 1) != kDevice || configuration.size() < 9 ||
      at(configuration, 1) != kConfiguration) {
    return std::nullopt;
  }
  DeviceRecord record;
  record.device = {at(device, 4), at(device, 5), at(device, 6)};
  record.vendor = little16(8);
  record.product = little16(10);
  record.release_bcd = little16(12);
  record.configurations = at(device, 17);
  for (std::size_t k = 0; k < configuration.size();) {
    const std::size_t size = at(configuration, k);
    if (size < 2 || size > configuration.size() - k) {
      return std::nullopt;
    }
    if (at(configuration, k + 1) == kInterface && size >= 9 && at(configuration, k + 3) == 0) {
      record.interfaces.push_back(
          {at(configuration, k + 5), at(configuration, k + 6), at(configuration, k + 7)});
    }
    k += size;
  }
  // One byte on the wire counts them, and in the configuration descriptor too.
  if (record.interfaces.size() != at(configuration, 4)) {
    return std::nullopt;
  }
  return record;
}

std::vector<std::byte> device_list(const DeviceRecord* device) {
  std::vector<std::byte> out;
  append_header(out, kOpListReply, OpStatus::kOk);
  append32(out, device == nullptr ? 0 : 1);
  if (device != nullptr) {
    append_device(out, *device);
    for (const DeviceRecord::Interface& each : device->interfaces) {
      append_interface(out, each);
      append8(out, 0);
    }
  }
  return out;
}

std::vector<std::byte> import_reply(OpStatus status, const DeviceRecord* device) {
  std::vector<std::byte> out;
  append_header(out, kOpImportReply, status);
  if (status == OpStatus::kOk && device != nullptr) {
    append_device(out, *device);
  }
  return out;
}

UrbHeader submit_reply(std::uint32_t sequence, UrbStatus status, std::size_t actual) {
  UrbHeader header = reply_header(kRetSubmit, sequence, status);
  put32(header, 24, static_cast<std::uint32_t>(actual));
  return header;
}

UrbHeader unlink_reply(std::uint32_t sequence, UrbStatus status) {
  return reply_header(kRetUnlink, sequence, status);
}

}  // namespace scatter::simulator::usbip
