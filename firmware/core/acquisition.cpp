#include "firmware/core/acquisition.h"

#include <algorithm>

#include "protocol/endian.h"

namespace scatter::firmware {
namespace {

using protocol::FaultCode;
using protocol::RunEnd;

// A sensor later than its exposure and readout by this much is taken for dead [us].
constexpr std::uint64_t kSensorGraceUs = 500'000;
constexpr std::size_t kDataOffset =
    protocol::kHeaderBytes + protocol::min_encoded_size<protocol::FrameData>();

constexpr Step kWorked{.did_work = true, .wake_at_us = 0};
constexpr Step kWaitsForLink{};

}  // namespace

std::uint32_t Acquisition::start(const ScanPlan& plan, const RunSettings& settings) noexcept {
  plan_ = plan;
  settings_ = settings;
  const protocol::Descriptor& descriptor = ports_.factory.descriptor();
  sequence_.begin(plan, descriptor);
  tally_.configure(plan, descriptor, ports_.factory.object(protocol::ObjectId::kHotPixels));
  credit_.restart(settings.may_send_until);
  report_ = {};
  report_.run_id = next_run_id_++;
  report_.started_us = ports_.clock.now_us();
  next_frame_id_ = 0;
  sensor_faults_ = 0;
  finished_ = stopping_ = end_in_slot_ = false;
  told_monitor_ = told_temperature_ = false;
  phase_ = Phase::kNext;
  return report_.run_id;
}

void Acquisition::credit(std::uint32_t run_id, std::uint32_t may_send_until) noexcept {
  if (active() && run_id == report_.run_id) {
    credit_.grant(may_send_until);
  }
}

void Acquisition::stop() noexcept {
  stopping_ = stopping_ || active();
}

void Acquisition::end_now(RunEnd reason) noexcept {
  if (!active()) {
    return;
  }
  if (phase_ == Phase::kExposing || phase_ == Phase::kReading) {
    if (!test_pattern()) {
      ports_.sensor.release();
    }
    ++report_.ledger.lost_firmware;
  }
  lights_out();
  if (phase_ == Phase::kHold) {
    report_.held_us += ports_.clock.now_us() - hold_since_us_;
  }
  if (output_.discard_stream() && end_in_slot_) {
    // The last frame's end never left: the host cannot have that frame.
    --report_.frames_sent;
    ++report_.ledger.lost_firmware;
  }
  end_in_slot_ = false;
  if (phase_ != Phase::kDraining) {
    report_.reason = static_cast<std::uint8_t>(reason);
    report_.ended_us = ports_.clock.now_us();
  }
  phase_ = Phase::kIdle;
  finished_ = false;
}

void Acquisition::abort_from_outside() noexcept {
  if (active()) {
    end_now(RunEnd::kAborted);
    finished_ = true;
  }
}

protocol::RunState Acquisition::state() const noexcept {
  switch (phase_) {
    case Phase::kIdle:
      return protocol::RunState::kIdle;
    case Phase::kHold:
      return protocol::RunState::kHolding;
    default:
      return protocol::RunState::kRunning;
  }
}

bool Acquisition::take_finished() noexcept {
  const bool finished = finished_;
  finished_ = false;
  return finished;
}

Step Acquisition::step() noexcept {
  switch (phase_) {
    case Phase::kIdle:
      return {};
    case Phase::kNext:
      return step_next();
    case Phase::kHold:
      if (stopping_ || credit_.may_send(next_frame_id_)) {
        report_.held_us += ports_.clock.now_us() - hold_since_us_;
        if (stopping_) {
          finish(RunEnd::kStopped);
        } else {
          flags_ |= protocol::kFrameHeldForCredit;
          trigger();
        }
        return kWorked;
      }
      return kWaitsForLink;
    case Phase::kExposing:
      return step_exposing();
    case Phase::kReading:
      return step_reading();
    case Phase::kDraining:
      if (output_.stream_idle()) {
        phase_ = Phase::kIdle;
        finished_ = true;
        return kWorked;
      }
      return kWaitsForLink;
  }
  return {};
}

void Acquisition::finish(RunEnd reason) noexcept {
  report_.reason = static_cast<std::uint8_t>(reason);
  report_.ended_us = ports_.clock.now_us();
  phase_ = Phase::kDraining;
}

Step Acquisition::step_next() noexcept {
  if (stopping_) {
    finish(RunEnd::kStopped);
    return kWorked;
  }
  const auto shot = sequence_.next();
  if (!shot) {
    finish(RunEnd::kCompleted);
    return kWorked;
  }
  shot_ = *shot;
  flags_ = 0;
  if (!live() && !credit_.may_send(next_frame_id_)) {
    hold_since_us_ = ports_.clock.now_us();
    phase_ = Phase::kHold;
    return kWorked;
  }
  trigger();
  return kWorked;
}

void Acquisition::lights_out() noexcept {
  if (lit_) {
    (void)ports_.illuminator.light(Illuminator::kNone);
    lit_ = false;
  }
}

void Acquisition::trigger() noexcept {
  triggered_us_ = ports_.clock.now_us();
  if (test_pattern()) {
    flags_ |= protocol::kFrameTestPattern;
  } else {
    bool ready = true;
    if (shot_.illumination != Illuminator::kNone) {
      lit_ = true;
      ready = ports_.illuminator.light(shot_.illumination);
    }
    const protocol::Recipe& recipe = plan_->recipe();
    const SensorSettings window{recipe.region_x, recipe.region_y, plan_->width(), plan_->height(),
                                shot_.exposure_us};
    if (!ready || !ports_.sensor.trigger(window)) {
      lose_frame(FaultCode::kSensorTimeout, ready ? "sensor refused the exposure" : "no such LED");
      return;
    }
  }
  begin_ = {};
  begin_.run_id = report_.run_id;
  begin_.frame_id = next_frame_id_++;
  begin_.exposure_start_us = triggered_us_;
  ++report_.ledger.exposed;
  phase_ = Phase::kExposing;
}

Step Acquisition::step_exposing() noexcept {
  const std::uint64_t now = ports_.clock.now_us();
  const std::uint64_t dark_at = triggered_us_ + shot_.exposure_us;
  const std::uint64_t readable_at = dark_at + plan_->readout_us();
  if (test_pattern()) {
    if (now < readable_at) {
      return {.did_work = false, .wake_at_us = readable_at};
    }
    exposed();
    return kWorked;
  }
  // The exposure is over before the readout: no light is wasted on the sample while rows are read.
  if (lit_ && now >= dark_at) {
    lights_out();
    return kWorked;
  }
  switch (ports_.sensor.state()) {
    case SensorState::kReady:
      lights_out();
      exposed();
      return kWorked;
    case SensorState::kExposing: {
      const std::uint64_t late_at = readable_at + kSensorGraceUs;
      if (now >= late_at) {
        ++report_.ledger.lost_sensor;
        lose_frame(FaultCode::kSensorTimeout, "sensor did not finish the exposure");
        return kWorked;
      }
      std::uint64_t wake = ports_.sensor.ready_at_us();
      wake = wake <= now ? late_at : std::min(wake, late_at);
      return {.did_work = false, .wake_at_us = lit_ ? std::min(wake, dark_at) : wake};
    }
    case SensorState::kIdle:
    case SensorState::kFault:
      ++report_.ledger.lost_sensor;
      lose_frame(FaultCode::kSensorTimeout, "sensor reports a fault");
      return kWorked;
  }
  return kWorked;
}

void Acquisition::exposed() noexcept {
  took_us_ = static_cast<std::uint32_t>(ports_.clock.now_us() - triggered_us_);
  if (live() && !credit_.may_send(begin_.frame_id)) {
    drop_frame();
    return;
  }
  check_environment();
  tally_.begin_frame();
  packer_.begin(plan_->recipe().pixel_format);
  begun_ = false;
  sent_bytes_ = frame_crc_ = 0;
  rows_read_ = 0;
  band_first_ = band_end_ = 0;
  phase_ = Phase::kReading;
}

void Acquisition::check_environment() noexcept {
  begin_.sensor_temperature_mK = ports_.thermometer.sensor_mK();
  begin_.led_temperature_mK = ports_.thermometer.led_board_mK();
  const auto outside = [](std::int32_t mK) { return mK < kMinTemperature_mK || mK > kMaxTemperature_mK; };
  if (outside(begin_.sensor_temperature_mK) || outside(begin_.led_temperature_mK)) {
    flags_ |= protocol::kFrameTemperatureOut;
    if (!told_temperature_) {
      told_temperature_ = true;
      events_.fault(FaultCode::kTemperatureOutOfRange,
                    Text("temperature outside 5..50 deg C: let the instrument settle"));
    }
  }
  if (test_pattern()) {
    return;
  }
  begin_.monitor_uv = ports_.monitor.reading_uv();
  if (shot_.kind == protocol::FrameKind::kLight && begin_.monitor_uv < kMonitorNominal / 10) {
    flags_ |= protocol::kFrameMonitorLow;
    if (!told_monitor_) {
      told_monitor_ = true;
      events_.fault(FaultCode::kMonitorLow, Text("no light from illumination ")
                                                << shot_.illumination << ": LED or its cable");
    }
  }
}

Step Acquisition::step_reading() noexcept {
  const std::span<std::byte> slot = output_.stream_slot();
  if (slot.empty()) {
    return kWaitsForLink;
  }
  if (!begun_) {
    send_begin(slot);
  } else if (sent_bytes_ < plan_->frame_bytes()) {
    if (!send_band(slot)) {
      ++report_.ledger.lost_sensor;
      lose_frame(FaultCode::kSensorTimeout, "sensor readout failed");
    }
  } else {
    send_end(slot);
  }
  return kWorked;
}

void Acquisition::send_begin(std::span<std::byte> slot) noexcept {
  const protocol::Recipe& recipe = plan_->recipe();
  begin_.epoch = settings_.epoch;
  begin_.calibration_id = settings_.white;
  if (shot_.illumination != Illuminator::kNone) {
    constexpr float kHalfPi = 1.5707964F;
    const bool below = ports_.factory.descriptor().illuminations[shot_.illumination].theta_rad > kHalfPi;
    begin_.calibration_id = below ? settings_.translucent : settings_.white;
  }
  begin_.kind = shot_.kind;
  begin_.target = recipe.target;
  begin_.illumination = shot_.illumination;
  begin_.bracket = shot_.bracket;
  begin_.sweep = shot_.sweep;
  begin_.exposure_us = shot_.exposure_us;
  begin_.x = recipe.region_x;
  begin_.y = recipe.region_y;
  begin_.width = plan_->width();
  begin_.height = plan_->height();
  begin_.pixel_format = recipe.pixel_format;
  begin_.bits = plan_->bits();
  begin_.total = plan_->frame_bytes();
  end_in_slot_ = false;
  output_.submit_stream(protocol::write_message(slot, output_.stream_header(), begin_));
  begun_ = true;
}

bool Acquisition::read_band(std::uint16_t first, std::uint16_t rows) noexcept {
  const std::uint32_t width = plan_->width();
  const std::span<std::uint16_t> out(band_.data(), std::size_t{rows} * width);
  if (!test_pattern()) {
    return ports_.sensor.read_rows(first, rows, out);
  }
  // Counter pattern: pixel k of frame n is (7919 n + k) modulo the sensor's range.
  const std::uint32_t mask = (1U << plan_->bits()) - 1U;
  std::uint32_t value = begin_.frame_id * 7919U + first * width;
  for (std::uint16_t& pixel : out) {
    pixel = static_cast<std::uint16_t>(value++ & mask);
  }
  return true;
}

bool Acquisition::send_band(std::span<std::byte> slot) noexcept {
  const std::size_t room =
      std::min<std::size_t>(slot.size() - protocol::kTrailerBytes - kDataOffset,
                            settings_.max_payload - protocol::min_encoded_size<protocol::FrameData>());
  const std::uint32_t fit = packer_.pixels_that_fit(static_cast<std::uint32_t>(room));
  const std::uint32_t width = plan_->width();
  if (band_first_ == band_end_) {
    const std::uint32_t most = std::min<std::uint32_t>(fit, static_cast<std::uint32_t>(band_.size())) / width;
    const auto rows = static_cast<std::uint16_t>(
        std::clamp<std::uint32_t>(most, 1, static_cast<std::uint32_t>(plan_->height() - rows_read_)));
    if (!read_band(rows_read_, rows)) {
      return false;
    }
    band_first_ = 0;
    band_end_ = std::size_t{rows} * width;
  }
  const std::span<std::byte> data = slot.subspan(kDataOffset, room);
  const std::size_t count = std::min<std::size_t>(band_end_ - band_first_, fit);
  std::size_t bytes = packer_.pack({band_.data() + band_first_, count}, data);
  band_first_ += count;
  if (band_first_ == band_end_) {
    const auto rows = static_cast<std::uint16_t>(band_end_ / width);
    for (std::uint16_t row = 0; row < rows; ++row) {
      tally_.add_row(static_cast<std::uint16_t>(rows_read_ + row),
                     {band_.data() + std::size_t{row} * width, width});
    }
    rows_read_ = static_cast<std::uint16_t>(rows_read_ + rows);
    if (rows_read_ == plan_->height()) {
      // pixels_that_fit left no room only if the chunk is exactly full; then no bits are over.
      bytes += packer_.finish(data.subspan(bytes));
    }
  }
  const std::span<const std::byte> sent = data.first(bytes);
  const protocol::FrameData chunk{.run_id = report_.run_id,
                                  .frame_id = begin_.frame_id,
                                  .offset = sent_bytes_,
                                  .total = plan_->frame_bytes(),
                                  .data = sent};
  sent_bytes_ += static_cast<std::uint32_t>(bytes);
  end_in_slot_ = false;
  const std::size_t whole = protocol::write_message(slot, output_.stream_header(), chunk);
  frame_crc_ = tail_crc_.append(
      frame_crc_, slot.subspan(protocol::kHeaderBytes, whole - protocol::kFrameOverhead),
      protocol::load_le<std::uint32_t>(slot.data() + whole - protocol::kTrailerBytes), bytes);
  output_.submit_stream(whole);
  return true;
}

void Acquisition::send_end(std::span<std::byte> slot) noexcept {
  if (!test_pattern()) {
    ports_.sensor.release();
  }
  protocol::FrameEnd end;
  end.run_id = report_.run_id;
  end.frame_id = begin_.frame_id;
  end.saturated_pixels = tally_.saturated_pixels();
  end.max_dn = tally_.max_dn();
  end.flags = flags_;
  end.frame_crc = frame_crc_;
  end.readout_end_us = ports_.clock.now_us();
  end_in_slot_ = true;
  output_.submit_stream(protocol::write_message(slot, output_.stream_header(), end));
  ++report_.frames_sent;
  sensor_faults_ = 0;
  sequence_.record(tally_.scene(), took_us_);
  phase_ = Phase::kNext;
}

void Acquisition::lose_frame(FaultCode code, std::string_view what) noexcept {
  if (!test_pattern()) {
    ports_.sensor.release();
  }
  lights_out();
  events_.fault(code,
                Text("frame ") << (next_frame_id_ == 0 ? 0U : next_frame_id_ - 1U) << " lost: " << what);
  sequence_.record_lost(static_cast<std::uint32_t>(ports_.clock.now_us() - triggered_us_));
  if (++sensor_faults_ >= kMaxSensorFaults) {
    finish(RunEnd::kSensorFault);
  } else {
    phase_ = Phase::kNext;
  }
}

void Acquisition::drop_frame() noexcept {
  if (!test_pattern()) {
    ports_.sensor.release();
  }
  ++report_.ledger.lost_firmware;
  sequence_.record_lost(took_us_);
  phase_ = Phase::kNext;
}

}  // namespace scatter::firmware
