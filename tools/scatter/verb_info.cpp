// scatter info URI|FILE: what an instrument says of itself, or what is in a file.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <memory>

#include "host_sdk/device/update_check.h"
#include "host_sdk/reflectance/direction.h"
#include "tools/scatter/device_access.h"
#include "tools/scatter/file_description.h"
#include "tools/scatter/firmware_description.h"
#include "tools/scatter/text_table.h"

namespace scatter::cli {
namespace {

const char* kind_name(protocol::Target kind) {
  switch (kind) {
    case protocol::Target::kDarkCap:
      return "dark";
    case protocol::Target::kWhiteReference:
      return "white";
    case protocol::Target::kBlackReference:
      return "black";
    case protocol::Target::kTranslucentReference:
      return "translucent";
    case protocol::Target::kSample:
      break;
  }
  return "unknown";
}

const char* verdict_name(protocol::CalibrationVerdict verdict) {
  switch (verdict) {
    case protocol::CalibrationVerdict::kValid:
      return "valid";
    case protocol::CalibrationVerdict::kNeeded:
      return "needed";
    case protocol::CalibrationVerdict::kExpiredAge:
      return "expired: too old";
    case protocol::CalibrationVerdict::kExpiredTemperature:
      return "expired: the temperature moved";
  }
  return "unknown";
}

double celsius(std::int32_t temperature_mK) {
  return temperature_mK / 1000.0 - 273.15;
}

struct Sources {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::string text;
};

Sources sources(const protocol::Descriptor& descriptor) {
  Sources result;
  std::vector<long> heads_deg;
  std::vector<long> wavelengths;
  const auto note = [](std::vector<long>& seen, double value) {
    const long rounded = std::lround(value);
    if (std::ranges::find(seen, rounded) == seen.end()) {
      seen.push_back(rounded);
    }
  };
  for (const auto& light : descriptor.illuminations) {
    const double theta_deg = reflectance::degrees(double(light.theta_rad));
    result.json.push_back({{"theta_deg", theta_deg},
                           {"phi_deg", reflectance::degrees(double(light.phi_rad))},
                           {"wavelength_nm", light.wavelength_nm},
                           {"fwhm_nm", light.fwhm_nm},
                           {"head", light.head}});
    note(heads_deg, theta_deg);
    note(wavelengths, light.wavelength_nm);
  }
  result.text = fmt::format("{} illuminations: heads at {} deg, {} nm", descriptor.illuminations.size(),
                            fmt::join(heads_deg, ", "), fmt::join(wavelengths, ", "));
  return result;
}

/// Firmware slots, last start, last crash; what the device does not know is left out.
void describe_health(device::Device& device, const device::Wait& wait, Answer& answer, TextRows& rows) {
  const auto& hello = device.hello();
  const bool rescue = (hello.capabilities & protocol::kCapabilityRescue) != 0;
  const auto reset = static_cast<protocol::ResetReason>(hello.reset_reason);
  answer.json["rescue_mode"] = rescue;
  answer.json["reset_reason"] = device::words(reset);
  answer.json["boot_count"] = hello.boot_count;
  rows.push_back({"last start", fmt::format("{} (boot {})", device::words(reset), hello.boot_count)});
  if ((hello.capabilities & protocol::kCapabilityUpdate) != 0) {
    if (const auto state = device.update_status(wait)) {
      answer.json["firmware_slots"] = to_json(*state, rescue);
      const TextRows slots = rows_of(*state, rescue);
      rows.insert(rows.end(), slots.begin(), slots.end());
    }
  }
  if (const auto record = device.fault_record(wait)) {
    answer.json["last_crash"] = to_json(*record);
    rows.push_back({"last crash", words(*record)});
  }
}

/// The bootloader answers: all that it knows.
Answer describe_rescue(device::Device& device, const std::string& uri, const device::Wait& wait) {
  const auto& hello = device.hello();
  Answer answer;
  answer.json = {{"kind", "instrument"},
                 {"uri", uri},
                 {"product", hello.product.str()},
                 {"serial", hello.serial.str()},
                 {"firmware", hello.build_id.str()},
                 {"wire_major", hello.wire_major}};
  TextRows rows = {{"instrument", fmt::format("{} {}", hello.product.str(), hello.serial.str())},
                   {"rescue mode", fmt::format("{} answers: no firmware could be started; scatter flash {} "
                                               "FIRMWARE.scfw puts one there",
                                               hello.build_id.str(), uri)}};
  describe_health(device, wait, answer, rows);
  answer.text = text_table(rows);
  return answer;
}

Result<Answer> describe_device(const std::string& uri, const Context& context) {
  auto device = open_device(uri, context);
  if (!device) {
    return std::unexpected(device.error());
  }
  const device::Wait wait{.timeout = std::chrono::seconds(5), .stop = context.stop};
  const auto& hello = device->hello();
  if ((hello.capabilities & protocol::kCapabilityRescue) != 0) {
    return describe_rescue(*device, uri, wait);
  }
  const auto& descriptor = device->descriptor();
  const auto light = sources(descriptor);
  Answer answer;
  answer.json = {{"kind", "instrument"},
                 {"uri", uri},
                 {"product", descriptor.product.str()},
                 {"serial", descriptor.serial.str()},
                 {"hardware_revision", descriptor.hardware_revision.str()},
                 {"firmware", hello.build_id.str()},
                 {"wire_major", hello.wire_major},
                 {"sensor",
                  {{"width_px", descriptor.sensor.width_px},
                   {"height_px", descriptor.sensor.height_px},
                   {"bits", descriptor.sensor.bits},
                   {"full_well_e", descriptor.sensor.full_well_e},
                   {"read_noise_e", descriptor.sensor.read_noise_e}}},
                 {"theta_max_deg", reflectance::degrees(double(descriptor.optics.theta_max_rad))},
                 {"spot_diameter_mm", descriptor.spot_diameter_mm},
                 {"reference_stage", descriptor.reference_stage != 0},
                 {"transmission_module", descriptor.transmission_module != 0},
                 {"illuminations", light.json}};
  TextRows rows = {
      {"instrument",
       fmt::format("{} {}, hardware {}, firmware {}", descriptor.product.str(), descriptor.serial.str(),
                   descriptor.hardware_revision.str(), hello.build_id.str())},
      {"sources", light.text},
      {"sensor", fmt::format("{} x {} pixels, {} bits, directions to {:.0f} deg", descriptor.sensor.width_px,
                             descriptor.sensor.height_px, descriptor.sensor.bits,
                             reflectance::degrees(double(descriptor.optics.theta_max_rad)))},
      {"modules",
       fmt::format("reference stage: {}, transmission: {}", descriptor.reference_stage != 0 ? "yes" : "no",
                   descriptor.transmission_module != 0 ? "yes" : "no")}};
  describe_health(*device, wait, answer, rows);
  if (const auto status = device->status(wait)) {
    answer.json["sensor_temperature_C"] = celsius(status->sensor_temperature_mK);
    answer.json["led_temperature_C"] = celsius(status->led_temperature_mK);
    answer.json["uptime_s"] = double(status->device_time_us) * 1e-6;
    const auto fault = static_cast<protocol::FaultCode>(status->last_fault);
    answer.json["last_fault"] = device::words(fault);
    answer.json["worst_main_loop_turn_us"] = status->worst_poll_us;
    rows.push_back({"health", fmt::format("last fault: {}; longest turn of the main loop: {} us",
                                          device::words(fault), status->worst_poll_us)});
    rows.push_back(
        {"temperature", fmt::format("sensor {:.1f} C, LEDs {:.1f} C", celsius(status->sensor_temperature_mK),
                                    celsius(status->led_temperature_mK))});
  }
  if (const auto states = device->calibration_query(wait)) {
    auto& list = answer.json["calibration"] = nlohmann::ordered_json::array();
    for (const auto& state : *states) {
      list.push_back({{"kind", kind_name(state.kind)},
                      {"verdict", verdict_name(state.verdict)},
                      {"age_s", state.age_s},
                      {"action", state.action.str()}});
      rows.push_back({fmt::format("calibration, {}", kind_name(state.kind)),
                      fmt::format("{}{}{}", verdict_name(state.verdict), state.action.size() > 0 ? ": " : "",
                                  state.action.str())});
    }
  }
  answer.text = text_table(rows);
  return answer;
}

}  // namespace

Verb add_info(CLI::App& root) {
  auto* app = root.add_subcommand("info", "Show what an instrument says of itself, or what is in a file");
  auto target = std::make_shared<std::string>();
  app->add_option("target", *target, "URI of an instrument, or a file")->required();
  return {app, [target](const Context& context) {
            return is_uri(*target, context.registry) ? describe_device(*target, context)
                                                     : describe_file(*target);
          }};
}

}  // namespace scatter::cli
