#include "host_sdk/measurement/references.h"

#include <fmt/format.h>
#include <sodium.h>

#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>

namespace scatter::measurement {
namespace {

static_assert(std::endian::native == std::endian::little, "planes are stored as they lie in memory");

constexpr std::string_view kMagic = "OSREF001";
constexpr std::size_t kMaxPixels = std::size_t{4096} * 4096;
constexpr std::size_t kMaxHeader = std::size_t{1} << 20U;

/// Upper half of the float, rounded up: a variance is never understated.
std::uint16_t to_bf16(float value) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return static_cast<std::uint16_t>((bits + 0xFFFFU) >> 16U);
}
float from_bf16(std::uint16_t bits) noexcept {
  return std::bit_cast<float>(std::uint32_t{bits} << 16U);
}

void append(std::vector<std::byte>& out, const void* data, std::size_t bytes) {
  const auto* first = static_cast<const std::byte*>(data);
  out.insert(out.end(), first, first + bytes);
}

void append_variance(std::vector<std::byte>& out, const std::vector<float>& variance) {
  std::vector<std::uint16_t> half(variance.size());
  for (std::size_t i = 0; i < variance.size(); ++i) {
    half[i] = to_bf16(variance[i]);
  }
  append(out, half.data(), half.size() * sizeof(std::uint16_t));
}

nlohmann::json header_of(const ReferenceSet::Content& c) {
  nlohmann::json illuminations = nlohmann::json::array();
  for (const ReferenceImages& image : c.illuminations) {
    illuminations.push_back({{"index", image.illumination}, {"exposures_s_v", image.reference_exposures}});
  }
  nlohmann::json certificates = nlohmann::json::array();
  for (const protocol::ReferenceCertificate& row : c.certificates) {
    certificates.push_back({{"kind", static_cast<int>(row.kind)},
                            {"id", std::string(row.id.str())},
                            {"f_per_sr", std::vector<float>(row.f_per_sr.begin(), row.f_per_sr.end())},
                            {"relative_uncertainty", std::vector<float>(row.relative_uncertainty.begin(),
                                                                        row.relative_uncertainty.end())}});
  }
  return {{"serial", c.serial},
          {"width", c.width},
          {"height", c.height},
          {"illuminations", std::move(illuminations)},
          {"certificates", std::move(certificates)},
          {"dark_offset_variance_dn2", c.dark.offset_variance_dn2},
          {"dark_rate_variance_e2_per_s2", c.dark.rate_variance_e2_per_s2},
          {"dark_temperature_mK", c.dark.sensor_temperature_mK},
          {"unix_time_s", c.unix_time_s},
          {"device_time_us", c.device_time_us},
          {"sensor_temperature_mK", c.sensor_temperature_mK},
          {"led_temperature_mK", c.led_temperature_mK}};
}

void read_header(const nlohmann::json& j, ReferenceSet::Content& c) {
  c.serial = j.at("serial").get<std::string>();
  c.width = j.at("width").get<std::uint16_t>();
  c.height = j.at("height").get<std::uint16_t>();
  for (const auto& row : j.at("illuminations")) {
    ReferenceImages image;
    image.illumination = row.at("index").get<std::uint8_t>();
    image.reference_exposures = row.at("exposures_s_v").get<std::vector<float>>();
    c.illuminations.push_back(std::move(image));
  }
  for (const auto& row : j.at("certificates")) {
    protocol::ReferenceCertificate certificate;
    certificate.kind = static_cast<protocol::Target>(row.at("kind").get<int>());
    certificate.id = std::string_view(row.at("id").get_ref<const std::string&>());
    certificate.f_per_sr.assign(row.at("f_per_sr").get<std::vector<float>>());
    certificate.relative_uncertainty.assign(row.at("relative_uncertainty").get<std::vector<float>>());
    c.certificates.push_back(certificate);
  }
  c.dark.offset_variance_dn2 = j.at("dark_offset_variance_dn2").get<float>();
  c.dark.rate_variance_e2_per_s2 = j.at("dark_rate_variance_e2_per_s2").get<float>();
  c.dark.sensor_temperature_mK = j.at("dark_temperature_mK").get<std::int32_t>();
  c.unix_time_s = j.at("unix_time_s").get<std::uint64_t>();
  c.device_time_us = j.at("device_time_us").get<std::uint64_t>();
  c.sensor_temperature_mK = j.at("sensor_temperature_mK").get<std::int32_t>();
  c.led_temperature_mK = j.at("led_temperature_mK").get<std::int32_t>();
}

std::unexpected<Error> damaged(std::string what) {
  return fail(ErrorCode::kDataLoss, "calibration: " + std::move(what),
              "calibrate again, or use an intact copy of the file");
}

}  // namespace

std::shared_ptr<const ReferenceSet> ReferenceSet::make(Content content) {
  // Variances are rounded as the file rounds them, so that a set and its copy give the same numbers.
  for (ReferenceImages& image : content.illuminations) {
    for (RateImage* rates : {&image.reference, &image.black}) {
      for (float& v : rates->variance) {
        v = from_bf16(to_bf16(v));
      }
    }
  }
  std::shared_ptr<ReferenceSet> set(new ReferenceSet);
  set->content_ = std::move(content);
  const std::vector<std::byte> bytes = set->serialise();
  crypto_hash_sha256(set->sha256_.data(), reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  return set;
}

std::shared_ptr<const ReferenceSet> ReferenceSet::with_identity(Content content,
                                                                const std::array<std::uint8_t, 32>& sha256) {
  std::shared_ptr<ReferenceSet> set(new ReferenceSet);
  set->content_ = std::move(content);
  set->sha256_ = sha256;
  return set;
}

std::vector<std::byte> ReferenceSet::serialise() const {
  const std::string header = header_of(content_).dump();
  const auto length = static_cast<std::uint32_t>(header.size());
  const std::size_t pixels = std::size_t{content_.width} * content_.height;
  std::vector<std::byte> out;
  out.reserve(kMagic.size() + 4 + header.size() + pixels * (8 + 12 * content_.illuminations.size()));
  append(out, kMagic.data(), kMagic.size());
  append(out, &length, sizeof length);
  append(out, header.data(), header.size());
  append(out, content_.dark.offset_dn.data(), pixels * sizeof(float));
  append(out, content_.dark.dark_rate_e_per_s.data(), pixels * sizeof(float));
  for (const ReferenceImages& image : content_.illuminations) {
    for (const RateImage* rates : {&image.reference, &image.black}) {
      append(out, rates->rate.data(), pixels * sizeof(float));
      append_variance(out, rates->variance);
    }
  }
  return out;
}

Result<std::shared_ptr<const ReferenceSet>> ReferenceSet::parse(
    std::span<const std::byte> bytes, const std::optional<std::array<std::uint8_t, 32>>& known_sha256) {
  std::uint32_t length = 0;
  if (bytes.size() < kMagic.size() + sizeof length ||
      std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) != 0) {
    return damaged(fmt::format("does not begin with \"{}\"", kMagic));
  }
  std::memcpy(&length, bytes.data() + kMagic.size(), sizeof length);
  std::span<const std::byte> rest = bytes.subspan(kMagic.size() + sizeof length);
  if (length > kMaxHeader || length > rest.size()) {
    return damaged(fmt::format("header length is {}, {} bytes are left", length, rest.size()));
  }
  std::shared_ptr<ReferenceSet> set(new ReferenceSet);
  Content& c = set->content_;
  try {
    read_header(nlohmann::json::parse(reinterpret_cast<const char*>(rest.data()),
                                      reinterpret_cast<const char*>(rest.data()) + length),
                c);
  } catch (const nlohmann::json::exception& e) {
    return damaged(fmt::format("header: {}", e.what()));
  }
  rest = rest.subspan(length);
  const std::size_t pixels = std::size_t{c.width} * c.height;
  const std::size_t expected = pixels * (8 + 12 * c.illuminations.size());
  if (pixels == 0 || pixels > kMaxPixels || rest.size() != expected) {
    return damaged(fmt::format("{} x {} pixels and {} illuminations need {} bytes of images, found {}",
                               c.width, c.height, c.illuminations.size(), expected, rest.size()));
  }
  const auto take_f32 = [&](std::vector<float>& plane) {
    plane.resize(pixels);
    std::memcpy(plane.data(), rest.data(), pixels * sizeof(float));
    rest = rest.subspan(pixels * sizeof(float));
  };
  take_f32(c.dark.offset_dn);
  take_f32(c.dark.dark_rate_e_per_s);
  for (ReferenceImages& image : c.illuminations) {
    for (RateImage* rates : {&image.reference, &image.black}) {
      take_f32(rates->rate);
      rates->variance.resize(pixels);
      for (std::size_t i = 0; i < pixels; ++i) {
        std::uint16_t half = 0;
        std::memcpy(&half, rest.data() + i * sizeof half, sizeof half);
        rates->variance[i] = from_bf16(half);
      }
      rest = rest.subspan(pixels * sizeof(std::uint16_t));
    }
  }
  if (known_sha256) {
    set->sha256_ = *known_sha256;
  } else {
    crypto_hash_sha256(set->sha256_.data(), reinterpret_cast<const unsigned char*>(bytes.data()),
                       bytes.size());
  }
  return set;
}

protocol::CalibrationId ReferenceSet::id() const noexcept {
  protocol::CalibrationId id{};
  std::copy_n(sha256_.begin(), id.size(), id.begin());
  return id;
}

std::string ReferenceSet::id_hex() const {
  std::string text;
  for (const std::uint8_t byte : id()) {
    text += fmt::format("{:02x}", byte);
  }
  return text;
}

const ReferenceImages* ReferenceSet::find(std::uint8_t illumination) const noexcept {
  for (const ReferenceImages& image : content_.illuminations) {
    if (image.illumination == illumination) {
      return &image;
    }
  }
  return nullptr;
}

const protocol::ReferenceCertificate* ReferenceSet::certificate(protocol::Target kind) const noexcept {
  for (const protocol::ReferenceCertificate& row : content_.certificates) {
    if (row.kind == kind) {
      return &row;
    }
  }
  return nullptr;
}

}  // namespace scatter::measurement
