// Recipes: what is accepted, what is refused, and whether frames are what was asked for.
#include <algorithm>
#include <array>
#include <vector>

#include "host_sdk/device/conformance/check_functions.h"
#include "host_sdk/device/conformance/finished_run.h"

namespace scatter::conformance {

using protocol::PixelFormat;
using protocol::Recipe;

namespace {

constexpr std::uint16_t kPatternRows = 24;

unsigned bits_of(PixelFormat format) noexcept {
  return format == PixelFormat::kMono16 ? 16 : format == PixelFormat::kMono10p ? 10 : 12;
}

/// Wrong pixels of a counter pattern: pixel k of frame n is (7919 n + k) modulo the sensor's range.
std::size_t wrong_pixels(const device::Frame& frame) {
  std::vector<std::uint16_t> pixels(frame.pixel_count());
  if (!device::unpack(frame, pixels)) {
    return pixels.size();
  }
  const std::uint32_t mask = (1U << std::min<unsigned>(frame.begin.bits, 16)) - 1U;
  std::size_t wrong = 0;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    wrong += pixels[k] == ((frame.begin.frame_id * 7919U + static_cast<std::uint32_t>(k)) & mask) ? 0U : 1U;
  }
  return wrong;
}

void check_pattern(Subject& subject, Judgement& judge, PixelFormat format) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const protocol::SensorInfo& sensor = device->descriptor().sensor;
  Recipe recipe = small_recipe(device->descriptor());
  recipe.test_pattern = 1;
  recipe.pixel_format = format;
  recipe.repeats = 3;
  recipe.region_x = 0;
  // Odd, so that packed bytes end in the middle of a row.
  recipe.region_width = static_cast<std::uint16_t>(sensor.width_px - (sensor.width_px % 2 == 0 ? 1 : 0));
  recipe.region_height = std::min(kPatternRows, sensor.height_px);
  recipe.region_y = static_cast<std::uint16_t>(sensor.height_px - recipe.region_height);
  if (sensor.bits > bits_of(format)) {
    judge.refused(fmt::format("{} bits per pixel for a sensor of {}", bits_of(format), sensor.bits),
                  device->configure(recipe, subject.wait()), ErrorCode::kInvalidArgument);
    judge.measured(fmt::format("refused: the sensor has {} bits", sensor.bits));
    return;
  }
  const auto run = run_to_end(*device, recipe, subject);
  if (!run) {
    return judge.broken("a run of the test pattern", run.error());
  }
  std::size_t wrong = 0;
  std::size_t pixels = 0;
  for (const device::Frame& frame : run->frames) {
    judge.require(frame.status == device::FrameStatus::kComplete,
                  fmt::format("frame {} is {}", frame.begin.frame_id, device::name(frame.status)));
    if (frame.status != device::FrameStatus::kComplete) {
      continue;
    }
    judge.require((frame.end.flags & protocol::kFrameTestPattern) != 0, "a pattern frame lacks its flag");
    judge.equal("the pixel format", static_cast<int>(format), static_cast<int>(frame.begin.pixel_format));
    judge.equal("the significant bits", unsigned{sensor.bits}, unsigned{frame.begin.bits});
    judge.equal("the bytes of a frame", device::packed_bytes(format, frame.pixel_count()),
                std::uint64_t{frame.begin.total});
    wrong += wrong_pixels(frame);
    pixels += frame.pixel_count();
  }
  judge.equal("the number of frames", std::size_t{recipe.repeats}, run->frames.size());
  judge.equal("the number of wrong pixels", std::size_t{0}, wrong);
  judge.measured(fmt::format("{} pixels", pixels));
}

}  // namespace

void check_configuration(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const protocol::Descriptor& descriptor = device->descriptor();
  const protocol::SensorInfo& sensor = descriptor.sensor;
  const Recipe good = small_recipe(descriptor);
  const auto first = device->configure(good, subject.wait());
  if (!first) {
    return judge.broken("a plain recipe", first.error());
  }
  judge.equal("the planned frames of one exposure", 1U, first->planned_frames);
  std::size_t refusals = 0;
  const auto refuse = [&](std::string_view what, auto&& spoil) {
    Recipe recipe = good;
    spoil(recipe);
    judge.refused(what, device->configure(recipe, subject.wait()), ErrorCode::kInvalidArgument);
    ++refusals;
  };
  refuse("an exposure below the shortest",
         [&](Recipe& r) { r.exposures_us[0] = sensor.min_exposure_us - 1; });
  refuse("an exposure above the longest", [&](Recipe& r) { r.exposures_us[0] = sensor.max_exposure_us + 1; });
  refuse("an illumination that does not exist",
         [&](Recipe& r) { r.illuminations[0] = static_cast<std::uint8_t>(descriptor.illuminations.size()); });
  refuse("a window past the right edge",
         [&](Recipe& r) { r.region_x = static_cast<std::uint16_t>(sensor.width_px - r.region_width + 1); });
  refuse("a window past the lower edge",
         [&](Recipe& r) { r.region_y = static_cast<std::uint16_t>(sensor.height_px - r.region_height + 1); });
  refuse("no repeats", [](Recipe& r) { r.repeats = 0; });
  refuse("nothing to expose", [](Recipe& r) { r.illuminations.resize(0); });
  refuse("an unknown pixel format", [](Recipe& r) { r.pixel_format = static_cast<PixelFormat>(9); });
  refuse("an unknown exposure mode",
         [](Recipe& r) { r.exposure_mode = static_cast<protocol::ExposureMode>(9); });
  refuse("an unknown target", [](Recipe& r) { r.target = static_cast<protocol::Target>(9); });
  const auto kept = device->configuration(subject.wait());
  if (!kept) {
    return judge.broken("get_configuration", kept.error());
  }
  judge.equal("the settings epoch after refused recipes", first->epoch, kept->epoch);
  judge.require(kept->recipe == good, "a refused recipe changed the one in force");
  std::uint32_t epoch = first->epoch;
  for (const std::uint32_t exposure : {sensor.min_exposure_us, sensor.max_exposure_us}) {
    Recipe recipe = good;
    recipe.exposures_us[0] = exposure;
    const auto accepted = device->configure(recipe, subject.wait());
    if (!accepted) {
      judge.broken(fmt::format("an exposure of {} us", exposure), accepted.error());
      continue;
    }
    epoch = epoch + 1 == 0 ? 1 : epoch + 1;
    judge.equal("the settings epoch", epoch, accepted->epoch);
  }
  judge.measured(fmt::format("exposures of {} to {} us taken, {} recipes refused", sensor.min_exposure_us,
                             sensor.max_exposure_us, refusals));
}

void check_pattern_mono16(Subject& subject, Judgement& judge) {
  check_pattern(subject, judge, PixelFormat::kMono16);
}
void check_pattern_mono10p(Subject& subject, Judgement& judge) {
  check_pattern(subject, judge, PixelFormat::kMono10p);
}
void check_pattern_mono12p(Subject& subject, Judgement& judge) {
  check_pattern(subject, judge, PixelFormat::kMono12p);
}

void check_window(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const protocol::SensorInfo& sensor = device->descriptor().sensor;
  struct Window {
    std::uint16_t x, y, width, height;
  };
  const auto last_x = static_cast<std::uint16_t>(sensor.width_px - 1);
  const auto last_y = static_cast<std::uint16_t>(sensor.height_px - 1);
  const std::array windows{Window{0, 0, 1, 1}, Window{last_x, last_y, 1, 1},
                           Window{static_cast<std::uint16_t>(std::min<unsigned>(5, last_x)),
                                  static_cast<std::uint16_t>(std::min<unsigned>(3, last_y)), 33, 7},
                           Window{0, static_cast<std::uint16_t>(last_y / 2), sensor.width_px, 2}};
  std::size_t honoured = 0;
  for (Window window : windows) {
    window.width = static_cast<std::uint16_t>(std::min<unsigned>(window.width, sensor.width_px - window.x));
    window.height =
        static_cast<std::uint16_t>(std::min<unsigned>(window.height, sensor.height_px - window.y));
    Recipe recipe = small_recipe(device->descriptor());
    recipe.region_x = window.x;
    recipe.region_y = window.y;
    recipe.region_width = window.width;
    recipe.region_height = window.height;
    const auto run = run_to_end(*device, recipe, subject);
    const std::string name =
        fmt::format("the window {} x {} at ({}, {})", window.width, window.height, window.x, window.y);
    if (!run) {
      judge.broken(name, run.error());
      continue;
    }
    if (run->frames.size() != 1 || run->frames[0].status != device::FrameStatus::kComplete) {
      judge.complain(fmt::format("{} gave {} frames, not one whole one ({} exposures lost by the sensor)",
                                 name, run->frames.size(), run->summary.ledger.lost_sensor));
      continue;
    }
    const protocol::FrameBegin& begin = run->frames[0].begin;
    judge.require(
        begin.x == window.x && begin.y == window.y && begin.width == window.width &&
            begin.height == window.height,
        fmt::format("{} came as {} x {} at ({}, {})", name, begin.width, begin.height, begin.x, begin.y));
    judge.equal(fmt::format("the size of {} in bytes", name), 2U * window.width * window.height, begin.total);
    ++honoured;
  }
  judge.measured(fmt::format("{} windows", honoured));
}

void check_illuminations(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const protocol::Descriptor& descriptor = device->descriptor();
  constexpr std::uint8_t kOffFrames = 2;
  Recipe recipe = small_recipe(descriptor);
  recipe.illuminations.resize(0);
  for (std::size_t i = 0; i < descriptor.illuminations.size(); ++i) {
    recipe.illuminations.push_back(static_cast<std::uint8_t>(i));
  }
  recipe.off_frames = kOffFrames;
  const auto run = run_to_end(*device, recipe, subject);
  if (!run) {
    return judge.broken("a run over all illuminations", run.error());
  }
  judge.equal("the number of frames", descriptor.illuminations.size() + kOffFrames, run->frames.size());
  std::uint32_t dimmest_uv = 0xFFFF'FFFF;
  std::uint32_t off_uv = 0;
  std::uint64_t before_us = 0;
  for (std::size_t i = 0; i < run->frames.size(); ++i) {
    const device::Frame& frame = run->frames[i];
    if (frame.status != device::FrameStatus::kComplete) {
      judge.complain(fmt::format("frame {} is {}", i, device::name(frame.status)));
      continue;
    }
    const bool off = i < kOffFrames;
    judge.equal(fmt::format("the illumination of frame {}", i), off ? 255U : unsigned(i - kOffFrames),
                unsigned{frame.begin.illumination});
    judge.equal(fmt::format("the kind of frame {}", i), off ? 1 : 0, static_cast<int>(frame.begin.kind));
    judge.equal(fmt::format("the exposure of frame {}", i), recipe.exposures_us[0], frame.begin.exposure_us);
    judge.require(frame.begin.exposure_start_us >= before_us &&
                      frame.end.readout_end_us >= frame.begin.exposure_start_us + frame.begin.exposure_us,
                  fmt::format("the times of frame {} do not hold its exposure", i));
    before_us = frame.end.readout_end_us;
    if (off) {
      off_uv = std::max(off_uv, frame.begin.monitor_uv);
    } else {
      judge.require(frame.begin.monitor_uv > 0 && (frame.end.flags & protocol::kFrameMonitorLow) == 0,
                    fmt::format("the monitor reads {} uV with illumination {} lit", frame.begin.monitor_uv,
                                i - kOffFrames));
      dimmest_uv = std::min(dimmest_uv, frame.begin.monitor_uv);
    }
  }
  judge.require(
      off_uv < dimmest_uv / 10,
      fmt::format("the monitor reads {} uV with all LEDs off, allowed is a tenth of {}", off_uv, dimmest_uv));
  judge.measured(fmt::format("monitor at least {} uV lit, at most {} uV off", dimmest_uv, off_uv));
}

}  // namespace scatter::conformance
