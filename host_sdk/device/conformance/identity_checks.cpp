// What the device says of itself.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_sdk/device/conformance/check_functions.h"
#include "host_sdk/device/conformance/wire_probe.h"
#include "protocol/endian.h"

namespace scatter::conformance {

using protocol::Descriptor;
using protocol::ObjectId;

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::int32_t kColdest_mK = 233'150;  // -40 deg C
constexpr std::int32_t kHottest_mK = 358'150;  // 85 deg C

bool within(float value, float low, float high) noexcept {
  return value >= low && value <= high;  // False for NaN.
}

void judge_sensor(const protocol::SensorInfo& sensor, Judgement& judge) {
  judge.require(sensor.width_px > 0 && sensor.height_px > 0, "the sensor has no pixels");
  judge.require(sensor.bits >= 8 && sensor.bits <= 16,
                fmt::format("the sensor has {} bits, expected are 8..16", sensor.bits));
  judge.require(sensor.min_exposure_us > 0 && sensor.min_exposure_us <= sensor.max_exposure_us,
                fmt::format("exposures from {} to {} us make no range", sensor.min_exposure_us,
                            sensor.max_exposure_us));
  judge.require(sensor.readout_us > 0, "readout_us is 0");
  judge.require(sensor.gain_e_per_dn > 0 && sensor.full_well_e > 0, "gain or full well is not positive");
  judge.require(sensor.read_noise_e >= 0 && sensor.black_level_dn >= 0 &&
                    sensor.black_level_dn < static_cast<float>(1UL << std::min<unsigned>(sensor.bits, 16)),
                "read noise or black level is out of range");
  judge.require(sensor.dark_current_e_per_s >= 0 && sensor.dark_doubling_K > 0,
                "dark current is negative or dark_doubling_K is not positive");
  judge.require(std::abs(sensor.linearity) < 0.5F, "the linearity coefficient is not small");
}

void judge_optics(const Descriptor& descriptor, Judgement& judge) {
  const protocol::Optics& o = descriptor.optics;
  judge.require(within(o.center_x_px, 0, descriptor.sensor.width_px) &&
                    within(o.center_y_px, 0, descriptor.sensor.height_px),
                "the image of theta = 0 does not lie on the sensor");
  judge.require(o.radius_px > 0, "radius_px is not positive");
  judge.require(
      o.theta_max_rad > 0 && o.theta_max_rad <= o.image_theta_max_rad && o.image_theta_max_rad <= kPi,
      fmt::format("theta_max {} and image_theta_max {} make no range", o.theta_max_rad,
                  o.image_theta_max_rad));
  float before = -1;
  for (int i = 0; i <= 180; ++i) {
    const float t = o.image_theta_max_rad * static_cast<float>(i) / 180;
    const float r = t * (o.a1 + t * t * (o.a3 + t * t * o.a5));
    if (!(r > before)) {
      judge.complain(fmt::format("the image's radius does not grow with theta at {:.3f} rad", t));
      return;
    }
    before = r;
  }
}

void judge_illuminations(const Descriptor& descriptor, Judgement& judge) {
  judge.require(!descriptor.illuminations.empty(), "there is no illumination");
  std::size_t number = 0;
  for (const protocol::Illumination& light : descriptor.illuminations) {
    judge.require(within(light.theta_rad, 0, kPi) && std::isfinite(light.phi_rad),
                  fmt::format("illumination {}: its direction is none", number));
    judge.require(
        within(light.wavelength_nm, 300, 1200) && light.fwhm_nm > 0,
        fmt::format("illumination {}: {} nm, {} nm wide", number, light.wavelength_nm, light.fwhm_nm));
    judge.require(light.angular_radius_rad >= 0 && light.angular_radius_rad < kPi / 4,
                  fmt::format("illumination {}: radius {} rad", number, light.angular_radius_rad));
    judge.require(light.channel <= 3, fmt::format("illumination {}: channel {}", number, light.channel));
    for (const protocol::Illumination& other : descriptor.illuminations) {
      judge.require(
          other.head != light.head || (other.theta_rad == light.theta_rad && other.phi_rad == light.phi_rad),
          fmt::format("illumination {}: head {} stands in two places", number, light.head));
    }
    ++number;
  }
}

void judge_certificates(const Descriptor& descriptor, Judgement& judge) {
  for (const protocol::ReferenceCertificate& c : descriptor.certificates) {
    judge.require(
        c.kind >= protocol::Target::kWhiteReference && c.kind <= protocol::Target::kTranslucentReference,
        fmt::format("certificate {}: kind {} is no reference", c.id.str(), static_cast<int>(c.kind)));
    judge.require(!c.id.str().empty(), "a certificate has no name");
    judge.require(!c.f_per_sr.empty() && c.f_per_sr.size() == c.relative_uncertainty.size(),
                  fmt::format("certificate {}: values and uncertainties do not match", c.id.str()));
    judge.require(std::ranges::all_of(c.f_per_sr, [](float f) { return within(f, 0, 10); }) &&
                      std::ranges::all_of(c.relative_uncertainty, [](float u) { return within(u, 0, 1); }),
                  fmt::format("certificate {}: a value is out of range", c.id.str()));
  }
}

}  // namespace

void check_descriptor(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const Descriptor& descriptor = device->descriptor();
  const protocol::HelloReply& hello = device->hello();
  judge.equal("the descriptor's product", hello.product.str(), descriptor.product.str());
  judge.equal("the descriptor's serial number", hello.serial.str(), descriptor.serial.str());
  judge_sensor(descriptor.sensor, judge);
  judge_optics(descriptor, judge);
  judge_illuminations(descriptor, judge);
  judge_certificates(descriptor, judge);
  judge.require(descriptor.spot_diameter_mm > 0, "spot_diameter_mm is not positive");
  judge.require(descriptor.calibration_span_mK > 0 && descriptor.dark_lifetime_s > 0 &&
                    descriptor.reference_lifetime_s > 0,
                "calibrations have no life");
  judge.equal("the capability of a reference stage", descriptor.reference_stage != 0,
              (hello.capabilities & protocol::kCapabilityReferenceStage) != 0);
  judge.equal("the capability of transmission", descriptor.transmission_module != 0,
              (hello.capabilities & protocol::kCapabilityTransmission) != 0);
  judge.measured(fmt::format("{} x {} pixels of {} bits, {} illuminations, {} certificates",
                             descriptor.sensor.width_px, descriptor.sensor.height_px, descriptor.sensor.bits,
                             descriptor.illuminations.size(), descriptor.certificates.size()));
}

void check_objects(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const protocol::SensorInfo& sensor = device->descriptor().sensor;
  const std::uint32_t pixels = std::uint32_t{sensor.width_px} * sensor.height_px;
  const device::Wait patient = subject.wait(std::chrono::seconds(55));
  std::string figures;
  for (const ObjectId id : {ObjectId::kDescriptor, ObjectId::kHotPixels, ObjectId::kPrnuMap}) {
    const auto bytes = device->read_object(id, patient);
    if (!bytes && bytes.error().code == ErrorCode::kNotFound && id != ObjectId::kDescriptor) {
      figures += fmt::format("{}object {} none", figures.empty() ? "" : ", ", static_cast<int>(id));
      continue;
    }
    if (!bytes) {
      judge.broken(fmt::format("object {}", static_cast<int>(id)), bytes.error());
      continue;
    }
    figures +=
        fmt::format("{}object {} {} B", figures.empty() ? "" : ", ", static_cast<int>(id), bytes->size());
    if (id == ObjectId::kHotPixels) {
      judge.require(bytes->size() % 4 == 0, "the list of hot pixels is not whole");
      std::int64_t before = -1;
      for (std::size_t at = 0; at + 4 <= bytes->size(); at += 4) {
        const auto index = protocol::load_le<std::uint32_t>(bytes->data() + at);
        if (index <= before || index >= pixels) {
          judge.complain(fmt::format("hot pixel {} is not ascending or not on the sensor", index));
          break;
        }
        before = index;
      }
    } else if (id == ObjectId::kPrnuMap) {
      judge.equal("the size of the gain map", std::size_t{pixels}, bytes->size());
    }
  }
  judge.refused("object 65535", device->read_object(static_cast<ObjectId>(0xFFFF), subject.wait()),
                ErrorCode::kNotFound);
  judge.measured(std::move(figures));
}

void check_settings(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const std::string serial(device->descriptor().serial.str());
  const auto found = device->key_value("serial", subject.wait());
  if (!found) {
    return judge.broken("the setting 'serial'", found.error());
  }
  judge.equal("the setting 'serial'", std::string_view(serial), found->value.str());
  judge.equal("read_only of 'serial'", 1, int{found->read_only});
  // Its own value, so that even a device that takes it stays what it was.
  judge.refused("writing 'serial'", device->set_key_value("serial", serial, subject.wait()),
                ErrorCode::kPermissionDenied);
  judge.refused("an unknown setting", device->key_value("no such key", subject.wait()), ErrorCode::kNotFound);
  judge.refused("writing an unknown setting", device->set_key_value("no such key", "x", subject.wait()),
                ErrorCode::kNotFound);
}

void check_clock(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  struct Reading {
    double asked_us = 0;  ///< Of the transport's clock.
    double answered_us = 0;
    std::uint64_t device_us = 0;
  };
  const device::TimePoint start = probe->now();
  const auto since_start_us = [&] {
    return std::chrono::duration<double, std::micro>(probe->now() - start).count();
  };
  std::vector<Reading> readings;
  for (int i = 0; i < 40; ++i) {
    const protocol::ClockSync request{.host_time_us = probe->unix_time_us()};
    Reading reading{.asked_us = since_start_us()};
    const auto reply = probe->ask<protocol::ClockSynced>(request);
    if (!reply) {
      return judge.broken("clock_sync", reply.error());
    }
    reading.answered_us = since_start_us();
    reading.device_us = reply->device_time_us;
    judge.equal("the host's time in the reply", request.host_time_us, reply->host_time_us);
    judge.require(readings.empty() || reading.device_us >= readings.back().device_us,
                  fmt::format("the clock went back to {} us", reading.device_us));
    readings.push_back(reading);
    // Time passes on a virtual clock only while somebody waits.
    if (i % 4 == 3) {
      (void)probe->collect(std::chrono::milliseconds(25));
    }
  }
  const Reading& first = readings.front();
  const Reading& last = readings.back();
  const double host_us = (last.asked_us + last.answered_us - first.asked_us - first.answered_us) / 2;
  const auto device_us = static_cast<double>(last.device_us - first.device_us);
  const double uncertain_us = (last.answered_us - last.asked_us + first.answered_us - first.asked_us) / 2 + 2;
  // A crystal is far better than 0.2 %.
  judge.require(
      std::abs(device_us - host_us) <= uncertain_us + 0.002 * host_us,
      fmt::format("{:.0f} us of the host are {:.0f} us of the device, allowed is a difference of {:.0f}",
                  host_us, device_us, uncertain_us + 0.002 * host_us));
  judge.measured(fmt::format("{:.0f} us of the host are {:.0f} us of the device, +-{:.0f} us", host_us,
                             device_us, uncertain_us));
}

void check_temperatures(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const auto status = device->status(subject.wait());
  if (!status) {
    return judge.broken("get_status", status.error());
  }
  for (const auto& [name, mK] : {std::pair("sensor", status->sensor_temperature_mK),
                                 std::pair("LED board", status->led_temperature_mK)}) {
    judge.require(
        mK >= kColdest_mK && mK <= kHottest_mK,
        fmt::format("the {}'s temperature is {:.2f} C, plausible are -40..85", name, mK / 1000.0 - 273.15));
  }
  judge.measured(fmt::format("sensor {:.2f} C, LEDs {:.2f} C",
                             status->sensor_temperature_mK / 1000.0 - 273.15,
                             status->led_temperature_mK / 1000.0 - 273.15));
}

}  // namespace scatter::conformance
