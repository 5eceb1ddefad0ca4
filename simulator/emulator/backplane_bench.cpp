#include "simulator/emulator/backplane_bench.h"

#include <algorithm>
#include <utility>

#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::simulator {

namespace backplane = firmware::backplane;

namespace {

/// Payloads are whole: a short one is a message of another version.
template <typename M>
std::optional<M> decoded(std::span<const std::byte> payload) {
  return payload.size() < protocol::min_encoded_size<M>() ? std::nullopt : protocol::decode<M>(payload);
}

std::uint32_t store_pixels(std::span<const std::uint16_t> pixels, std::span<std::byte> out) {
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    protocol::store_le(out.data() + 2 * k, pixels[k]);
  }
  return protocol::crc32c(out.first(2 * pixels.size()), 0);
}

}  // namespace

BackplaneBench::BackplaneBench(VirtualBoard& board, BenchPace pace, Ties ties)
    : board_(board), pace_(pace), ties_(std::move(ties)) {}

void BackplaneBench::warm_up() {
  const protocol::Descriptor& descriptor = board_.bench().descriptor();
  float electrons = 0;
  for (std::size_t led = 0; led < descriptor.illuminations.size(); ++led) {
    board_.bench().expected_electrons({.illumination = static_cast<std::uint8_t>(led),
                                       .exposure_us = descriptor.sensor.min_exposure_us,
                                       .width = 1,
                                       .height = 1},
                                      std::span(&electrons, 1));
  }
}

void BackplaneBench::put(std::shared_ptr<const Sample> sample) {
  board_.bench().put(std::move(sample));
  board_.camera().sample_placed();
  warm_up();
}

BackplaneBench::Clock::time_point BackplaneBench::after(Clock::time_point now,
                                                        std::uint64_t us) const noexcept {
  return pace_ == BenchPace::kReal ? now + std::chrono::microseconds(us) : now;
}

Status BackplaneBench::receive(std::span<const std::byte> bytes, Clock::time_point now) {
  decoder_.push(bytes, [&](const BackplaneDecoder::Message& message) { handle(message, now); });
  return run(now);
}

void BackplaneBench::handle(const BackplaneDecoder::Message& message, Clock::time_point now) {
  if (!message.intact) {
    refuse(message.kind);
    return;
  }
  const auto kind = static_cast<backplane::Kind>(message.kind);
  if (kind == backplane::Kind::kBooted) {
    if (const auto booted = decoded<backplane::Booted>(message.payload)) {
      boot(*booted);
    } else {
      refuse(message.kind);
    }
    return;
  }
  bool accepted = false;
  std::uint32_t number = 0;
  if (running_) {
    switch (kind) {
      case backplane::Kind::kLight: {
        const auto light = decoded<backplane::Light>(message.payload);
        accepted = light && board_.camera().light(light->illumination);
        break;
      }
      case backplane::Kind::kTrigger: {
        const auto command = decoded<backplane::Trigger>(message.payload);
        number = command ? command->number : 0;
        accepted = command && trigger(*command, now);
        break;
      }
      case backplane::Kind::kRelease:
        board_.camera().release();
        frame_.reset();
        accepted = true;
        break;
      case backplane::Kind::kMove: {
        const auto command = decoded<backplane::Move>(message.payload);
        accepted = command && move(*command, now);
        break;
      }
      default:
        break;
    }
  } else if (kind == backplane::Kind::kTrigger) {
    const auto command = decoded<backplane::Trigger>(message.payload);
    number = command ? command->number : 0;
  }
  if (!accepted) {
    refuse(message.kind, number);
  }
}

void BackplaneBench::boot(const backplane::Booted& booted) {
  board_.camera().reset();
  board_.clock().boot();
  frame_.reset();
  move_.reset();
  last_number_.reset();
  to_board_.clear();
  running_ = booted.version == backplane::kVersion;
  if (!running_) {
    refuse(static_cast<std::uint8_t>(backplane::Kind::kBooted));
  }
  ++statistics_.boots;
  if (ties_.booted) {
    ties_.booted(booted);
  }
}

bool BackplaneBench::trigger(const backplane::Trigger& trigger, Clock::time_point now) {
  const std::size_t count = std::size_t{trigger.width} * trigger.height;
  if ((last_number_ && trigger.number != *last_number_ + 1) || 2 * count > ties_.frame.size()) {
    return false;
  }
  Camera& camera = board_.camera();
  if (!camera.trigger({.x = trigger.x,
                       .y = trigger.y,
                       .width = trigger.width,
                       .height = trigger.height,
                       .exposure_us = trigger.exposure_us})) {
    return false;
  }
  last_number_ = trigger.number;
  if (conduct_.silent) {
    return true;
  }
  VirtualClock& clock = board_.clock();
  const std::uint64_t began_us = clock.since_power_on_us();
  const std::uint64_t ready_us = camera.ready_at_us() + clock.booted_us();
  clock.advance_to(ready_us);
  PendingFrame pending;
  pending.ready.number = trigger.number;
  pending.ready.monitor_uv = camera.reading_uv();
  pixels_.resize(count);
  pending.ready.readout_failed = camera.read_rows(0, trigger.height, pixels_) ? 0 : 1;
  pending.due = after(now, ready_us - began_us);
  frame_ = pending;
  return true;
}

bool BackplaneBench::move(const backplane::Move& move, Clock::time_point now) {
  Camera& camera = board_.camera();
  if (board_.descriptor().reference_stage == 0 ||
      !camera.move_to(static_cast<protocol::Target>(move.target))) {
    return false;
  }
  VirtualClock& clock = board_.clock();
  std::uint64_t wait_us = 0;
  if (camera.moving()) {
    const std::uint64_t settled_us = camera.settled_at_us() + clock.booted_us();
    wait_us = settled_us - clock.since_power_on_us();
    clock.advance_to(settled_us);
  }
  move_ = PendingMove{.settled = {.target = move.target}, .due = after(now, wait_us)};
  return true;
}

void BackplaneBench::refuse(std::uint8_t command, std::uint32_t number) {
  ++statistics_.refused;
  put_message(to_board_, backplane::Fault{.command = command, .number = number});
}

std::optional<BackplaneBench::Clock::time_point> BackplaneBench::due() const noexcept {
  std::optional<Clock::time_point> first;
  if (frame_ && !frame_->announced) {
    first = frame_->due;
  }
  if (move_ && (!first || move_->due < *first)) {
    first = move_->due;
  }
  return first;
}

Status BackplaneBench::show_temperatures() {
  // Not the camera's readings: those are rounded as the thermometers do it, and these will round themselves.
  const Bench::Temperatures now = board_.bench().temperatures(board_.camera().scheduled_us());
  return ties_.show_temperatures(now.sensor_mK + conduct_.temperature_shift_mK,
                                 now.led_board_mK + conduct_.temperature_shift_mK);
}

Status BackplaneBench::run(Clock::time_point now) {
  if (frame_ && !frame_->announced && frame_->due <= now) {
    if (Status shown = show_temperatures(); !shown) {
      return shown;
    }
    if (frame_->ready.readout_failed == 0) {
      frame_->ready.pixel_crc = store_pixels(pixels_, ties_.frame);
    }
    put_message(to_board_, frame_->ready);
    frame_->announced = true;
    ++statistics_.frames;
  }
  if (move_ && move_->due <= now) {
    if (Status shown = show_temperatures(); !shown) {
      return shown;
    }
    put_message(to_board_, move_->settled);
    move_.reset();
  }
  return {};
}

}  // namespace scatter::simulator
