#include "firmware/boards/mps2_an500/thermometers.h"

#include <array>

#include "firmware/boards/mps2_an500/i2c_bus.h"

namespace scatter::firmware::mps2_an500 {
namespace {

constexpr std::uint8_t kSensorAddress = 0x48;
constexpr std::uint8_t kLedBoardAddress = 0x49;
constexpr std::byte kTemperature{0};
constexpr std::byte kConfiguration{1};
constexpr std::byte kTwelveBits{0x60};

[[nodiscard]] std::int32_t read_mK(std::uint8_t address) noexcept {
  constexpr std::array<std::byte, 1> head{kTemperature};
  std::array<std::byte, 2> value{};
  if (!I2cBus::read(address, head, value)) {
    return 0;
  }
  return tmp105_mK(static_cast<std::uint16_t>(static_cast<std::uint32_t>(value[0]) << 8U |
                                              static_cast<std::uint32_t>(value[1])));
}

}  // namespace

void Thermometers::start() noexcept {
  constexpr std::array<std::byte, 2> twelve_bits{kConfiguration, kTwelveBits};
  (void)I2cBus::write(kSensorAddress, twelve_bits);
  (void)I2cBus::write(kLedBoardAddress, twelve_bits);
}

std::int32_t Thermometers::sensor_mK() noexcept {
  return read_mK(kSensorAddress);
}
std::int32_t Thermometers::led_board_mK() noexcept {
  return read_mK(kLedBoardAddress);
}

}  // namespace scatter::firmware::mps2_an500
