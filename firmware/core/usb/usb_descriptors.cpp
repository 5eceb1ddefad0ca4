// Names of fields as in USB 2.0 chapter 9, HID 1.11, and Microsoft's OS 2.0 descriptors specification.
#include "firmware/core/usb/usb_descriptors.h"

#include <algorithm>

#include "firmware/core/dfu_device.h"
#include "protocol/usb_identity.h"

namespace scatter::firmware::usb_descriptors {
namespace {

namespace usb = protocol::usb;
using std::uint16_t;
using std::uint32_t;
using std::uint8_t;

template <std::size_t N>
using Bytes = std::array<uint8_t, N>;

constexpr uint8_t low(uint32_t value) {
  return static_cast<uint8_t>(value & 0xFFU);
}
constexpr uint8_t high(uint32_t value) {
  return static_cast<uint8_t>(value >> 8U & 0xFFU);
}
constexpr uint8_t number(Type type) {
  return static_cast<uint8_t>(type);
}

template <std::size_t... N>
constexpr auto join(const Bytes<N>&... parts) {
  Bytes<(N + ...)> all{};
  std::size_t at = 0;
  const auto add = [&](const auto& part) {
    for (const uint8_t byte : part) {
      all[at++] = byte;
    }
  };
  (add(parts), ...);
  return all;
}

// --- configurations

constexpr uint8_t kBusPowered = 0x80;
constexpr uint8_t kMilliampere500 = 250;
constexpr uint16_t kUsbVersion = 0x0210;  // The lowest with a BOS.
constexpr uint16_t kHidVersion = 0x0111;

enum StringIndex : uint8_t {
  kLanguages,
  kManufacturer,
  kProduct,
  kSerial,
  kStreamName,
  kRescueName,
  kDfuName,
};

constexpr Bytes<9> interface(uint8_t its_number, uint8_t setting, uint8_t endpoints, uint8_t its_class,
                             uint8_t sub_class, uint8_t protocol, uint8_t name) {
  return {9, number(Type::kInterface), its_number, setting, endpoints, its_class, sub_class, protocol, name};
}

constexpr Bytes<7> endpoint(uint8_t address, UsbEndpoint::Type type, std::size_t packet, uint8_t interval) {
  return {7,
          number(Type::kEndpoint),
          address,
          static_cast<uint8_t>(type),
          low(static_cast<uint32_t>(packet)),
          high(static_cast<uint32_t>(packet)),
          interval};
}

constexpr Bytes<29> kHidReport = {
    0x06,
    low(usb::kRescueUsagePage),
    high(usb::kRescueUsagePage),  // Usage page
    0x09,
    low(usb::kRescueUsage),  // Usage
    0xA1,
    0x01,  // Collection (application)
    0x15,
    0x00,  // Logical minimum 0
    0x26,
    0xFF,
    0x00,  // Logical maximum 255
    0x75,
    8,  // Report size 8 bits
    0x95,
    usb::kRescuePacket,  // Report count
    0x09,
    0x02,
    0x81,
    0x02,  // Usage 2, input (variable)
    0x09,
    0x03,
    0x91,
    0x02,  // Usage 3, output (variable)
    0x09,
    0x04,
    0xB1,
    0x02,  // Usage 4, feature (variable)
    0xC0,  // End of collection
};

constexpr Bytes<9> kHid = {9,
                           number(Type::kHid),
                           low(kHidVersion),
                           high(kHidVersion),
                           0,  // bCountryCode
                           1,  // bNumDescriptors
                           number(Type::kHidReport),
                           low(kHidReport.size()),
                           high(kHidReport.size())};

constexpr auto run_time_interfaces(UsbSpeed speed) {
  using Pipe = UsbEndpoint::Type;
  const bool fast = speed == UsbSpeed::kHigh;
  const std::size_t bulk = fast ? usb::kHighSpeedBulkPacket : usb::kFullSpeedBulkPacket;
  const uint8_t every_ms = fast ? 4 : 1;  // 2^(4-1) microframes, or frames.
  return join(interface(usb::kStreamInterface, usb::kStreamIdleSetting, 0, usb::kStreamClass,
                        usb::kStreamSubClass, usb::kStreamProtocol, kStreamName),
              interface(usb::kStreamInterface, usb::kStreamOpenSetting, 2, usb::kStreamClass,
                        usb::kStreamSubClass, usb::kStreamProtocol, kStreamName),
              endpoint(usb::kBulkIn, Pipe::kBulk, bulk, 0), endpoint(usb::kBulkOut, Pipe::kBulk, bulk, 0),
              interface(usb::kRescueInterface, 0, 2, 3, 0, 0, kRescueName), kHid,
              endpoint(usb::kRescueIn, Pipe::kInterrupt, usb::kRescuePacket, every_ms),
              endpoint(usb::kRescueOut, Pipe::kInterrupt, usb::kRescuePacket, every_ms),
              interface(usb::kDfuInterface, 0, 0, kDfuInterfaceClass, kDfuInterfaceSubClass,
                        kDfuProtocolRunTime, kDfuName),
              kDfuFunctionalDescriptor);
}

constexpr auto dfu_interfaces() {
  return join(interface(usb::kDfuModeInterface, 0, 0, kDfuInterfaceClass, kDfuInterfaceSubClass,
                        kDfuProtocolDfuMode, kDfuName),
              kDfuFunctionalDescriptor);
}

template <std::size_t N>
constexpr auto with_head(Type type, uint8_t interfaces, const Bytes<N>& rest) {
  constexpr std::size_t kTotal = 9 + N;
  return join(Bytes<9>{9, number(type), low(kTotal), high(kTotal), interfaces, kConfiguration,
                       0,  // iConfiguration
                       kBusPowered, kMilliampere500},
              rest);
}

template <Type kType, UsbSpeed kSpeed>
constexpr auto kRunTimeConfiguration = with_head(kType, 3, run_time_interfaces(kSpeed));
template <Type kType>
constexpr auto kDfuConfiguration = with_head(kType, 1, dfu_interfaces());

constexpr Bytes<10> kDeviceQualifier = {
    10, number(Type::kDeviceQualifier), low(kUsbVersion), high(kUsbVersion), 0, 0, 0, usb::kControlPacket,
    1,  // bNumConfigurations
    0};

// --- Microsoft OS 2.0

constexpr Bytes<4> kWindows8_1 = {0x00, 0x00, 0x03, 0x06};
enum MicrosoftType : uint8_t {
  kSetHeader = 0,
  kSubsetConfiguration = 1,
  kSubsetFunction = 2,
  kCompatibleId = 3,
  kRegistryProperty = 4,
};
constexpr uint8_t kRegMultiSz = 7;

/// UTF-16LE of ASCII, closing zeros included.
template <std::size_t N>
constexpr auto wide(const char (&text)[N]) {
  Bytes<2 * N> all{};
  for (std::size_t i = 0; i < N; ++i) {
    all[2 * i] = static_cast<uint8_t>(text[i]);
  }
  return all;
}

/// WINUSB, and the class of device interfaces by which programs find this function.
template <std::size_t N>
constexpr auto winusb(const char (&interface_guid)[N]) {
  const Bytes<20> compatible = {20, 0, kCompatibleId, 0, 'W', 'I', 'N', 'U', 'S', 'B'};
  const auto name = wide("DeviceInterfaceGUIDs");
  const auto guids = join(wide(interface_guid), Bytes<2>{});  // A list ends with an empty text.
  constexpr std::size_t kPropertyBytes = 10 + name.size() + guids.size();
  return join(compatible,
              Bytes<8>{low(kPropertyBytes), high(kPropertyBytes), kRegistryProperty, 0, kRegMultiSz, 0,
                       low(name.size()), high(name.size())},
              name, Bytes<2>{low(guids.size()), high(guids.size())}, guids);
}

template <std::size_t N>
constexpr auto function_subset(uint8_t first_interface, const Bytes<N>& features) {
  return join(Bytes<8>{8, 0, kSubsetFunction, 0, first_interface, 0, low(8 + N), high(8 + N)}, features);
}

template <std::size_t N>
constexpr auto microsoft_set_of(const Bytes<N>& rest) {
  return join(Bytes<4>{10, 0, kSetHeader, 0}, kWindows8_1, Bytes<2>{low(10 + N), high(10 + N)}, rest);
}

constexpr auto kStreamFeatures = winusb("{AEF06A5B-C3F3-4AB9-A6FB-23649D8BE944}");
constexpr auto kDfuFeatures = winusb("{0E62DA2F-ACB9-4E01-9D3A-D9C497300C7C}");

constexpr auto run_time_set() {
  const auto functions = join(function_subset(usb::kStreamInterface, kStreamFeatures),
                              function_subset(usb::kDfuInterface, kDfuFeatures));
  constexpr std::size_t kBytes = 8 + functions.size();
  // bConfigurationValue: Windows takes it for the index of the configuration, which begins at 0.
  return microsoft_set_of(
      join(Bytes<8>{8, 0, kSubsetConfiguration, 0, 0, 0, low(kBytes), high(kBytes)}, functions));
}

constexpr auto kRunTimeSet = run_time_set();
constexpr auto kDfuSet = microsoft_set_of(kDfuFeatures);  // Not composite: no subsets.

constexpr auto bos_of(std::size_t set_bytes) {
  constexpr Bytes<7> kExtension = {7, number(Type::kDeviceCapability), 2, 0, 0, 0, 0};
  constexpr Bytes<20> kPlatform = {28, number(Type::kDeviceCapability), 5, 0,
                                   // D8DD60DF-4589-4CC7-9CD2-659D9E648A9F
                                   0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C,  //
                                   0x9C, 0xD2, 0x65, 0x9D, 0x9E, 0x64, 0x8A, 0x9F};
  const Bytes<4> set = {low(static_cast<uint32_t>(set_bytes)), high(static_cast<uint32_t>(set_bytes)),
                        kMicrosoftVendorCode, 0};
  constexpr std::size_t kTotal = 5 + 7 + 28;
  return join(Bytes<5>{5, number(Type::kBos), low(kTotal), high(kTotal), 2}, kExtension, kPlatform,
              kWindows8_1, set);
}

constexpr auto kRunTimeBos = bos_of(kRunTimeSet.size());
constexpr auto kDfuBos = bos_of(kDfuSet.size());

template <std::size_t N>
std::span<const std::byte> bytes_of(const Bytes<N>& table) noexcept {
  return std::as_bytes(std::span(table));
}

// --- strings

constexpr uint16_t kUsEnglish = 0x0409;
constexpr uint16_t kReplacement = 0xFFFD;

/// The next code point of UTF-8; kReplacement for a byte that begins none.
uint32_t next_code_point(std::string_view& text) noexcept {
  const auto first = static_cast<uint8_t>(text.front());
  std::size_t more = 0;
  uint32_t value = first;
  if (first >= 0xF0 && first <= 0xF4) {
    more = 3;
    value = first & 0x07U;
  } else if (first >= 0xE0 && first < 0xF0) {
    more = 2;
    value = first & 0x0FU;
  } else if (first >= 0xC2 && first < 0xE0) {
    more = 1;
    value = first & 0x1FU;
  } else if (first >= 0x80) {
    text.remove_prefix(1);
    return kReplacement;
  }
  for (std::size_t i = 1; i <= more; ++i) {
    if (i >= text.size() || (static_cast<uint8_t>(text[i]) & 0xC0U) != 0x80U) {
      text.remove_prefix(i);
      return kReplacement;
    }
    value = value << 6U | (static_cast<uint8_t>(text[i]) & 0x3FU);
  }
  text.remove_prefix(more + 1);
  const bool overlong = (more == 2 && value < 0x800) || (more == 3 && value < 0x1'0000);
  const bool surrogate = value >= 0xD800 && value < 0xE000;
  return overlong || surrogate || value > 0x10'FFFF ? kReplacement : value;
}

std::span<const std::byte> write_string(Buffer& buffer, std::string_view text) noexcept {
  std::size_t size = 2;
  const auto add = [&](uint32_t unit) {
    buffer[size++] = static_cast<std::byte>(low(unit));
    buffer[size++] = static_cast<std::byte>(high(unit));
  };
  while (!text.empty()) {
    const uint32_t value = next_code_point(text);
    const std::size_t needed = value < 0x1'0000 ? 2 : 4;
    if (size + needed > buffer.size()) {
      break;
    }
    if (needed == 2) {
      add(value);
    } else {
      add(0xD800U + ((value - 0x1'0000U) >> 10U));
      add(0xDC00U + ((value - 0x1'0000U) & 0x3FFU));
    }
  }
  buffer[0] = static_cast<std::byte>(size);
  buffer[1] = static_cast<std::byte>(Type::kString);
  return std::span(buffer).first(size);
}

}  // namespace

std::span<const std::byte> device(Buffer& buffer, UsbMode mode, const UsbIdentity& identity) noexcept {
  const uint16_t product = mode == UsbMode::kDfu ? usb::kDfuProductId : usb::kProductId;
  const auto index = [](std::string_view text, uint8_t value) { return text.empty() ? uint8_t{0} : value; };
  const Bytes<18> table = {18,
                           number(Type::kDevice),
                           low(kUsbVersion),
                           high(kUsbVersion),
                           0,  // The class is told by each interface.
                           0,
                           0,
                           usb::kControlPacket,
                           low(usb::kVendorId),
                           high(usb::kVendorId),
                           low(product),
                           high(product),
                           low(identity.release_bcd),
                           high(identity.release_bcd),
                           index(identity.manufacturer, kManufacturer),
                           index(identity.product, kProduct),
                           index(identity.serial, kSerial),
                           1};  // bNumConfigurations
  std::ranges::copy(bytes_of(table), buffer.begin());
  return std::span(buffer).first(table.size());
}

std::span<const std::byte> string(Buffer& buffer, std::uint8_t index, const UsbIdentity& identity) noexcept {
  std::string_view text;
  switch (index) {
    case kLanguages:
      buffer[0] = std::byte{4};
      buffer[1] = static_cast<std::byte>(Type::kString);
      buffer[2] = static_cast<std::byte>(low(kUsEnglish));
      buffer[3] = static_cast<std::byte>(high(kUsEnglish));
      return std::span(buffer).first(4);
    case kManufacturer:
      text = identity.manufacturer;
      break;
    case kProduct:
      text = identity.product;
      break;
    case kSerial:
      text = identity.serial;
      break;
    case kStreamName:
      text = "Measurement";
      break;
    case kRescueName:
      text = "Rescue";
      break;
    case kDfuName:
      text = "Firmware update";
      break;
    default:
      break;
  }
  return text.empty() ? std::span<const std::byte>() : write_string(buffer, text);
}

std::span<const std::byte> configuration(UsbMode mode, UsbSpeed speed, Type type) noexcept {
  const bool other = type == Type::kOtherSpeedConfiguration;
  if (mode == UsbMode::kDfu) {
    return other ? bytes_of(kDfuConfiguration<Type::kOtherSpeedConfiguration>)
                 : bytes_of(kDfuConfiguration<Type::kConfiguration>);
  }
  if (speed == UsbSpeed::kHigh) {
    return other ? bytes_of(kRunTimeConfiguration<Type::kOtherSpeedConfiguration, UsbSpeed::kHigh>)
                 : bytes_of(kRunTimeConfiguration<Type::kConfiguration, UsbSpeed::kHigh>);
  }
  return other ? bytes_of(kRunTimeConfiguration<Type::kOtherSpeedConfiguration, UsbSpeed::kFull>)
               : bytes_of(kRunTimeConfiguration<Type::kConfiguration, UsbSpeed::kFull>);
}

std::span<const std::byte> device_qualifier() noexcept {
  return bytes_of(kDeviceQualifier);
}

std::span<const std::byte> bos(UsbMode mode) noexcept {
  return mode == UsbMode::kDfu ? bytes_of(kDfuBos) : bytes_of(kRunTimeBos);
}

std::span<const std::byte> microsoft_set(UsbMode mode) noexcept {
  return mode == UsbMode::kDfu ? bytes_of(kDfuSet) : bytes_of(kRunTimeSet);
}

std::span<const std::byte> hid() noexcept {
  return bytes_of(kHid);
}

std::span<const std::byte> hid_report() noexcept {
  return bytes_of(kHidReport);
}

}  // namespace scatter::firmware::usb_descriptors
