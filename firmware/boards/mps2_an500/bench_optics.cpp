#include "firmware/boards/mps2_an500/bench_optics.h"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "protocol/crc.h"

namespace scatter::firmware::mps2_an500 {

using backplane::Kind;

void BenchOptics::announce(protocol::ResetReason reason, bool bootloader) noexcept {
  backplane::Booted booted;
  booted.reset_reason = static_cast<std::uint8_t>(reason);
  booted.bootloader = bootloader ? 1 : 0;
  (void)line_.send(booted);  // Cannot fail: the line is empty after a start.
}

bool BenchOptics::poll() noexcept {
  bool any = false;
  while (const auto message = line_.receive()) {
    any = true;
    switch (message->kind) {
      case Kind::kReady:
        if (const auto ready = protocol::decode<backplane::Ready>(message->payload)) {
          take(*ready);
        }
        break;
      case Kind::kSettled:
        if (const auto settled = protocol::decode<backplane::Settled>(message->payload);
            settled && settled->target == target_) {
          moving_ = false;
        }
        break;
      case Kind::kFault:
        if (const auto fault = protocol::decode<backplane::Fault>(message->payload)) {
          take(*fault);
        }
        break;
      default:
        break;  // A later bench may say more.
    }
  }
  return any;
}

void BenchOptics::take(const backplane::Ready& ready) noexcept {
  if (state_ != SensorState::kExposing || ready.number != number_) {
    return;  // Of an exposure that was given up.
  }
  // The pixels were written before the message was sent.
  std::atomic_thread_fence(std::memory_order_acquire);
  state_ = SensorState::kReady;
  monitor_uv_ = ready.monitor_uv;
  wanted_crc_ = ready.pixel_crc;
  readout_failed_ = ready.readout_failed != 0;
  crc_ = 0;
  next_row_ = 0;
}

void BenchOptics::take(const backplane::Fault& fault) noexcept {
  switch (static_cast<Kind>(fault.command)) {
    case Kind::kTrigger:
      if (fault.number == number_ && state_ == SensorState::kExposing) {
        state_ = SensorState::kFault;
      }
      return;
    case Kind::kLight:
      if (state_ == SensorState::kExposing) {
        state_ = SensorState::kFault;  // What is exposed now is not what was asked for.
      }
      return;
    default:
      return;  // A move that is refused never settles; the host's time limit names it.
  }
}

bool BenchOptics::trigger(const SensorSettings& settings) noexcept {
  const protocol::SensorInfo& sensor = descriptor_.sensor;
  const std::uint64_t bytes = std::uint64_t{settings.width} * settings.height * sizeof(std::uint16_t);
  if (state_ != SensorState::kIdle || settings.width == 0 || settings.height == 0 ||
      std::uint32_t{settings.x} + settings.width > sensor.width_px ||
      std::uint32_t{settings.y} + settings.height > sensor.height_px || bytes > frame_.size() ||
      settings.exposure_us < sensor.min_exposure_us || settings.exposure_us > sensor.max_exposure_us) {
    return false;
  }
  backplane::Trigger message;
  message.number = number_ + 1;
  message.x = settings.x;
  message.y = settings.y;
  message.width = settings.width;
  message.height = settings.height;
  message.exposure_us = settings.exposure_us;
  if (!line_.send(message)) {
    return false;
  }
  ++number_;
  settings_ = settings;
  const std::uint64_t readout_us = std::uint64_t{sensor.readout_us} * settings.height / sensor.height_px;
  due_us_ = clock_.now_us() + settings.exposure_us + readout_us;
  state_ = SensorState::kExposing;
  return true;
}

SensorState BenchOptics::state() noexcept {
  const bool early = state_ == SensorState::kReady && clock_.now_us() < due_us_;
  return early ? SensorState::kExposing : state_;
}

std::uint64_t BenchOptics::ready_at_us() noexcept {
  const bool exposing = state_ == SensorState::kExposing || state_ == SensorState::kReady;
  return exposing && clock_.now_us() < due_us_ ? due_us_ : 0;
}

bool BenchOptics::read_rows(std::uint16_t first, std::uint16_t count, std::span<std::uint16_t> out) noexcept {
  const std::size_t pixels = std::size_t{count} * settings_.width;
  if (state() != SensorState::kReady || readout_failed_ || first != next_row_ || out.size() < pixels ||
      std::uint32_t{first} + count > settings_.height) {
    return false;
  }
  const std::size_t row_bytes = std::size_t{settings_.width} * sizeof(std::uint16_t);
  const std::span<const std::byte> from = frame_.subspan(first * row_bytes, count * row_bytes);
  std::memcpy(out.data(), from.data(), from.size());
  // Of the copy: what was checked is what is used, whatever the other side does to its memory meanwhile.
  crc_ = protocol::crc32c(std::as_bytes(out.first(pixels)), crc_);
  next_row_ = static_cast<std::uint16_t>(first + count);
  return next_row_ < settings_.height || crc_ == wanted_crc_;
}

void BenchOptics::release() noexcept {
  if (state_ != SensorState::kIdle) {
    (void)line_.send(backplane::Release{});  // Without room the next Trigger ends the exposure as well.
    state_ = SensorState::kIdle;
  }
}

bool BenchOptics::light(std::uint8_t illumination) noexcept {
  if (illumination != kNone && illumination >= descriptor_.illuminations.size()) {
    return false;
  }
  return line_.send(backplane::Light{.illumination = illumination});
}

bool BenchOptics::move_to(protocol::Target target) noexcept {
  const auto number = static_cast<std::uint8_t>(target);
  if (number > static_cast<std::uint8_t>(protocol::Target::kTranslucentReference)) {
    return false;
  }
  if (!line_.send(backplane::Move{.target = number})) {
    return false;
  }
  target_ = number;
  moving_ = true;
  return true;
}

}  // namespace scatter::firmware::mps2_an500
