#include "host_sdk/measurement/reference_run.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "host_sdk/device/device.h"
#include "host_sdk/measurement/exposure_merge.h"
#include "host_sdk/measurement/frame_batch.h"
#include "host_sdk/measurement/light_sums.h"
#include "host_sdk/measurement/recipe_run.h"

namespace scatter::measurement {
namespace {

using protocol::Target;

constexpr std::uint16_t kDarkFrames = 24;      // Per exposure: offset known to a fifth of the read noise.
constexpr std::uint16_t kReferenceSweeps = 8;  // Reference noise a third of a single frame's.
constexpr std::uint16_t kBlackSweeps = 2;
constexpr std::uint32_t kProbe_us = 1000;
constexpr std::uint32_t kBlackProbe_us = 60'000;

/// Running mean of frames, per pixel, counts.
class MeanFrame {
 public:
  void add(std::span<const std::uint16_t> dn) {
    sum_.resize(dn.size(), 0);
    oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, dn.size(), 65536),
                              [&](const auto& r) {
                                for (std::size_t p = r.begin(); p != r.end(); ++p) {
                                  sum_[p] += dn[p];
                                }
                              });
    ++count_;
  }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] std::size_t size() const noexcept { return sum_.size(); }
  [[nodiscard]] double at(std::size_t p) const noexcept {
    return static_cast<double>(sum_[p]) / static_cast<double>(count_);
  }

 private:
  std::vector<std::uint32_t> sum_;
  std::size_t count_ = 0;
};

}  // namespace

ReferenceRun::ReferenceRun(device::Device& device, Geometry geometry, std::stop_token stop) noexcept
    : device_(&device), geometry_(geometry), stop_(std::move(stop)) {}

Status ReferenceRun::take(Target target, const std::function<void(double)>& progress) {
  return target == Target::kDarkCap ? take_dark(progress) : take_reference(target, progress);
}

Status ReferenceRun::take_dark(const std::function<void(double)>& progress) {
  const protocol::SensorInfo& sensor = device_->descriptor().sensor;
  MeanFrame brief;
  MeanFrame lengthy;
  double temperature_mK = 0;
  for (const bool is_long : {false, true}) {
    protocol::Recipe recipe;
    recipe.target = Target::kDarkCap;
    recipe.off_frames = kDarkFrames;
    recipe.off_exposure_us = is_long ? sensor.max_exposure_us : sensor.min_exposure_us;
    const double from = is_long ? 0.5 : 0.0;
    const auto report = run_recipe(
        *device_, recipe, nullptr, stop_, [&](const device::Frame& frame, double fraction) -> Status {
          if (frame.status == device::FrameStatus::kComplete) {
            (is_long ? lengthy : brief)
                .add({reinterpret_cast<const std::uint16_t*>(frame.bytes().data()), frame.pixel_count()});
            temperature_mK += frame.begin.sensor_temperature_mK;
          }
          progress(from + 0.5 * fraction);
          return {};
        });
    if (!report) {
      return std::unexpected(report.error());
    }
  }
  if (brief.count() == 0 || lengthy.count() == 0) {
    return fail(ErrorCode::kDataLoss, "no complete dark frame arrived",
                "check the link, then calibrate again");
  }
  const SensorResponse response(sensor);
  DarkModel& dark = content_.dark;
  dark.sensor_temperature_mK = static_cast<std::int32_t>(
      std::lround(temperature_mK / static_cast<double>(brief.count() + lengthy.count())));
  const double span_s = 1e-6 * (sensor.max_exposure_us - sensor.min_exposure_us);
  const double short_s = 1e-6 * sensor.min_exposure_us;
  const auto gain = static_cast<double>(sensor.gain_e_per_dn);
  dark.offset_dn.resize(brief.size());
  dark.dark_rate_e_per_s.resize(brief.size());
  for (std::size_t p = 0; p < brief.size(); ++p) {
    const double rate = (lengthy.at(p) - brief.at(p)) * gain / span_s;
    dark.dark_rate_e_per_s[p] = static_cast<float>(rate);
    dark.offset_dn[p] = static_cast<float>(brief.at(p) - rate * short_s / gain);
  }
  const double read_e2 = static_cast<double>(response.read_variance_e2());
  dark.offset_variance_dn2 = static_cast<float>(read_e2 / (gain * gain) / static_cast<double>(brief.count()));
  dark.rate_variance_e2_per_s2 = static_cast<float>(
      read_e2 * (1.0 / static_cast<double>(brief.count()) + 1.0 / static_cast<double>(lengthy.count())) /
      (span_s * span_s));
  return {};
}

Status ReferenceRun::take_reference(Target target, const std::function<void(double)>& progress) {
  const protocol::Descriptor& d = device_->descriptor();
  const bool is_black = target == Target::kBlackReference;
  // One head at a time: its frames are merged and dropped before the next head's arrive, so memory
  // stays at a few dozen frames.
  std::vector<std::vector<std::uint8_t>> heads;
  for (const std::uint8_t illumination : illuminations_of(d, geometry_)) {
    const std::size_t head = d.illuminations[illumination].head;
    heads.resize(std::max(heads.size(), head + 1));
    heads[head].push_back(illumination);
  }
  std::erase_if(heads, [](const auto& head) { return head.empty(); });
  if (heads.empty()) {
    return fail(ErrorCode::kFailedPrecondition, "the instrument has no source for this geometry",
                geometry_ == Geometry::kTransmission ? "mount the transmission module"
                                                     : "check the descriptor with `scatter info`");
  }
  for (std::size_t h = 0; h < heads.size(); ++h) {
    protocol::Recipe recipe;
    recipe.target = target;
    recipe.illuminations.assign(heads[h]);
    recipe.exposure_mode = protocol::ExposureMode::kAuto;
    recipe.exposures_us.push_back(is_black ? kBlackProbe_us : kProbe_us);
    recipe.max_brackets = 2;
    recipe.repeats = is_black ? kBlackSweeps : kReferenceSweeps;
    recipe.time_budget_us = is_black ? 3'000'000 : 5'000'000;
    FrameBatch batch;
    std::vector<FrameRecord> frames;
    const auto report = run_recipe(
        *device_, recipe, nullptr, stop_, [&](const device::Frame& frame, double fraction) -> Status {
          if (const auto record = batch.add(d, frame)) {
            frames.push_back(*record);
          }
          progress((static_cast<double>(h) + fraction) / static_cast<double>(heads.size()));
          return {};
        });
    if (!report) {
      return std::unexpected(report.error());
    }
    LightSums light;
    light.add(batch, content_.dark, d.sensor);
    for (const std::uint8_t illumination : heads[h]) {
      const LightSums::Planes* planes = light.find(illumination);
      if (planes == nullptr) {
        continue;
      }
      const RateImage& image = planes->image;
      const auto at = std::ranges::find(content_.illuminations, illumination, &ReferenceImages::illumination);
      ReferenceImages& images =
          at != content_.illuminations.end() ? *at : content_.illuminations.emplace_back();
      images.illumination = illumination;
      content_.sensor_temperature_mK = frames.back().begin.sensor_temperature_mK;
      content_.led_temperature_mK = frames.back().begin.led_temperature_mK;
      if (is_black) {
        images.black = image;
        continue;
      }
      std::vector<float> exposures;
      for (const FrameRecord& frame : frames) {
        if (frame.begin.illumination == illumination) {
          exposures.push_back(static_cast<float>(frame.exposure_s * frame.monitor_v));
        }
      }
      images.reference_exposures = distinct_exposures(std::move(exposures));
      const auto saturated = static_cast<std::size_t>(
          std::ranges::count_if(image.variance, [](float v) { return std::isinf(v); }));
      if (saturated > image.variance.size() / 100) {
        return fail(
            ErrorCode::kFailedPrecondition,
            fmt::format("illumination {}: {} of {} pixels of the reference are saturated", illumination,
                        saturated, image.variance.size()),
            "check that the white reference, not a mirror, lies under the instrument, then calibrate again");
      }
      images.reference = image;
    }
  }
  return {};
}

Result<std::shared_ptr<const ReferenceSet>> ReferenceRun::finish() {
  const protocol::Descriptor& d = device_->descriptor();
  std::erase_if(content_.illuminations,
                [](const ReferenceImages& i) { return i.reference.rate.empty() || i.black.rate.empty(); });
  std::ranges::sort(content_.illuminations, {}, &ReferenceImages::illumination);
  for (const ReferenceImages& images : content_.illuminations) {
    const double reference = std::reduce(images.reference.rate.begin(), images.reference.rate.end(), 0.0);
    const double black = std::reduce(images.black.rate.begin(), images.black.rate.end(), 0.0);
    if (!(reference > 2 * black)) {
      return fail(
          ErrorCode::kFailedPrecondition,
          fmt::format("illumination {}: the reference gives {:.3g} times the light of the black one, "
                      "expected more than 2",
                      images.illumination, black > 0 ? reference / black : 0.0),
          "place the white reference when asked for it and the black one when asked for that; check the LED");
    }
  }
  if (content_.illuminations.empty()) {
    return fail(ErrorCode::kDataLoss, "no illumination was calibrated",
                "check the link, then calibrate again");
  }
  content_.serial = std::string(d.serial.str());
  content_.width = d.sensor.width_px;
  content_.height = d.sensor.height_px;
  for (const protocol::ReferenceCertificate& certificate : d.certificates) {
    content_.certificates.push_back(certificate);
  }
  content_.unix_time_s = device_->system_time_unix_ns() / 1'000'000'000ULL;
  return ReferenceSet::make(std::move(content_));
}

}  // namespace scatter::measurement
