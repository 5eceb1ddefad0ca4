#include "host_sdk/measurement/recorded_scan.h"

#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <cstring>

#include "host_sdk/device/recording_reader.h"
#include "host_sdk/measurement/attachments.h"
#include "protocol/codec.h"

namespace scatter::measurement {
namespace {

struct Window {
  std::size_t x = 0, y = 0, width = 0, height = 0;
};

Window window_of(const protocol::Descriptor& d, const protocol::Recipe& r) noexcept {
  const std::size_t width = r.region_width == 0 ? d.sensor.width_px - r.region_x : r.region_width;
  const std::size_t height = r.region_height == 0 ? d.sensor.height_px - r.region_y : r.region_height;
  return {r.region_x, r.region_y, width, height};
}

bool whole(const protocol::Descriptor& d, const Window& w) noexcept {
  return w.x == 0 && w.y == 0 && w.width == d.sensor.width_px && w.height == d.sensor.height_px;
}

std::vector<float> crop(const std::vector<float>& plane, std::size_t stride, const Window& w) {
  std::vector<float> out;
  out.reserve(w.width * w.height);
  for (std::size_t j = 0; j < w.height; ++j) {
    const auto row = plane.begin() + static_cast<std::ptrdiff_t>((w.y + j) * stride + w.x);
    out.insert(out.end(), row, row + static_cast<std::ptrdiff_t>(w.width));
  }
  return out;
}

/// Running SHA-256 over encoded metadata.
class Fingerprint {
 public:
  Fingerprint() { crypto_hash_sha256_init(&state_); }
  template <typename Message>
  void add(const Message& message) {
    std::array<std::byte, 256> buffer;
    if (const auto size = protocol::encode(message, buffer)) {
      crypto_hash_sha256_update(&state_, reinterpret_cast<const unsigned char*>(buffer.data()), *size);
    }
  }
  void add(std::uint64_t value) {
    crypto_hash_sha256_update(&state_, reinterpret_cast<const unsigned char*>(&value), sizeof value);
  }
  [[nodiscard]] std::string hex() {
    std::array<std::uint8_t, 32> sum{};
    crypto_hash_sha256_final(&state_, sum.data());
    std::string text;
    for (const std::uint8_t byte : sum) {
      text += fmt::format("{:02x}", byte);
    }
    return text;
  }

 private:
  crypto_hash_sha256_state state_{};
};

void add(protocol::Ledger& sum, const protocol::Ledger& l) noexcept {
  sum.exposed += l.exposed;
  sum.delivered += l.delivered;
  sum.lost_sensor += l.lost_sensor;
  sum.lost_firmware += l.lost_firmware;
  sum.lost_link += l.lost_link;
  sum.lost_host += l.lost_host;
  sum.corrupt += l.corrupt;
}

}  // namespace

std::vector<Exposure> IlluminationFrames::exposures() const {
  std::vector<Exposure> out;
  out.reserve(frames.size());
  for (const ScanFrame& frame : frames) {
    out.push_back(frame.exposure);
  }
  return out;
}

double monitor_volts(const protocol::Descriptor& d, const protocol::FrameBegin& begin) noexcept {
  const double kelvin = 1e-3 * (begin.led_temperature_mK - d.sensor.reference_temperature_mK);
  return 1e-6 * begin.monitor_uv / (1.0 + static_cast<double>(d.monitor_slope_per_K) * kelvin);
}

bool add_frame(RecordedScan& scan, const protocol::Descriptor& full, device::Frame frame) {
  if (frame.status != device::FrameStatus::kComplete || frame.pixel_count() == 0) {
    ++scan.damaged_frames;
    return false;
  }
  ScanFrame row;
  row.begin = frame.begin;
  row.end = frame.end;
  row.exposure.exposure_s = 1e-6 * frame.begin.exposure_us;
  row.exposure.sensor_temperature_mK = frame.begin.sensor_temperature_mK;
  scan.raw_bytes += frame.size_bytes;
  if (frame.begin.pixel_format == protocol::PixelFormat::kMono16) {
    row.exposure.dn = {reinterpret_cast<const std::uint16_t*>(frame.bytes().data()), frame.pixel_count()};
    scan.keep_alive.push_back(std::move(frame));
  } else {
    std::vector<std::uint16_t>& pixels = scan.unpacked.emplace_back(frame.pixel_count());
    if (!device::unpack(frame, pixels)) {
      scan.unpacked.pop_back();
      ++scan.damaged_frames;
      return false;
    }
    row.exposure.dn = pixels;
  }
  if (row.begin.kind != protocol::FrameKind::kLight) {
    row.exposure.monitor_v = 1.0;
    scan.off.push_back(row);
    return true;
  }
  row.exposure.monitor_v = monitor_volts(full, row.begin);
  auto at = std::ranges::find(scan.lit, row.begin.illumination, &IlluminationFrames::illumination);
  if (at == scan.lit.end()) {
    scan.lit.push_back({row.begin.illumination, {}});
    at = scan.lit.end() - 1;
  }
  at->frames.push_back(row);
  return true;
}

void sort_frames(RecordedScan& scan) {
  const auto order = [](const ScanFrame& a, const ScanFrame& b) {
    return std::tuple(a.begin.exposure_us, a.begin.run_id, a.begin.frame_id) <
           std::tuple(b.begin.exposure_us, b.begin.run_id, b.begin.frame_id);
  };
  std::ranges::sort(scan.lit, {}, &IlluminationFrames::illumination);
  for (IlluminationFrames& group : scan.lit) {
    std::ranges::sort(group.frames, order);
  }
  std::ranges::sort(scan.off, order);
}

protocol::Descriptor cropped(const protocol::Descriptor& descriptor, const protocol::Recipe& recipe) {
  const Window w = window_of(descriptor, recipe);
  protocol::Descriptor d = descriptor;
  d.sensor.width_px = static_cast<std::uint16_t>(w.width);
  d.sensor.height_px = static_cast<std::uint16_t>(w.height);
  d.optics.center_x_px -= static_cast<float>(w.x);
  d.optics.center_y_px -= static_cast<float>(w.y);
  return d;
}

Result<std::shared_ptr<const ReferenceSet>> cropped(const std::shared_ptr<const ReferenceSet>& references,
                                                    const protocol::Descriptor& full,
                                                    const protocol::Recipe& recipe) {
  const ReferenceSet::Content& c = references->content();
  if (c.serial != full.serial.str()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("calibration {} is of instrument {}, the recording of {}", references->id_hex(),
                            c.serial, full.serial.str()),
                "use a calibration of the same instrument");
  }
  if (c.width != full.sensor.width_px || c.height != full.sensor.height_px) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("calibration {} has {} x {} pixels, the instrument {} x {}", references->id_hex(),
                            c.width, c.height, full.sensor.width_px, full.sensor.height_px),
                "use a calibration of the whole sensor");
  }
  const Window w = window_of(full, recipe);
  if (whole(full, w)) {
    return references;
  }
  ReferenceSet::Content out = c;
  out.width = static_cast<std::uint16_t>(w.width);
  out.height = static_cast<std::uint16_t>(w.height);
  out.dark.offset_dn = crop(c.dark.offset_dn, c.width, w);
  out.dark.dark_rate_e_per_s = crop(c.dark.dark_rate_e_per_s, c.width, w);
  for (std::size_t i = 0; i < c.illuminations.size(); ++i) {
    for (const auto member : {&ReferenceImages::reference, &ReferenceImages::black}) {
      const RateImage& from = c.illuminations[i].*member;
      out.illuminations[i].*member = {crop(from.rate, c.width, w), crop(from.variance, c.width, w)};
    }
  }
  return ReferenceSet::with_identity(std::move(out), references->sha256());
}

Result<LoadedRecording> load_recording(const std::filesystem::path& file, protocol::Target target) {
  auto reader = device::RecordingReader::open(file);
  if (!reader) {
    return std::unexpected(reader.error());
  }
  const auto full = reader->descriptor();
  if (!full) {
    return std::unexpected(full.error());
  }
  LoadedRecording out;
  out.full = *full;
  RecordedScan& scan = out.scan;
  scan.creation_unix_ns = reader->info().creation_unix_ns;
  scan.integrity = reader->integrity().text();

  Fingerprint fingerprint;
  fingerprint.add(scan.creation_unix_ns);
  bool first = true;
  const auto runs = reader->runs();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const protocol::Recipe& recipe = runs[i].configuration.recipe;
    if (recipe.target != target || recipe.test_pattern != 0) {
      continue;
    }
    if (first) {
      scan.recipe = recipe;
    } else if (recipe.region_x != scan.recipe.region_x || recipe.region_y != scan.recipe.region_y ||
               recipe.region_width != scan.recipe.region_width ||
               recipe.region_height != scan.recipe.region_height) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: run {} has another window than the runs before", file.string(), i + 1),
                  "record runs with different windows into different files");
    }
    first = false;
    auto cursor = reader->frames(i);
    if (!cursor) {
      return std::unexpected(cursor.error());
    }
    while (true) {
      auto frame = cursor->next();
      if (!frame) {
        return std::unexpected(frame.error());
      }
      if (!*frame) {
        break;
      }
      fingerprint.add((*frame)->begin);
      fingerprint.add((*frame)->end);
      add_frame(scan, *full, std::move(**frame));
    }
    const device::RecordedRunSummary summary = cursor->summary();
    add(scan.ledger, summary.ledger);
    if (scan.integrity.empty()) {
      scan.integrity = summary.integrity.text();
    }
    if (runs[i].report) {
      scan.instrument_seconds +=
          1e-6 * static_cast<double>(runs[i].report->ended_us - runs[i].report->started_us);
    }
  }
  if (scan.lit.empty() && scan.off.empty()) {
    return fail(ErrorCode::kDataLoss,
                fmt::format("{}: holds no complete frame of a {}", file.string(),
                            target == protocol::Target::kSample ? "sample" : "reference"),
                scan.integrity.empty() ? "record again" : scan.integrity + "; record again");
  }
  sort_frames(scan);
  scan.id = fingerprint.hex();
  scan.descriptor = cropped(*full, scan.recipe);

  if (const auto bytes = reader->attachment(device::kAttachmentHotPixels)) {
    const Window w = window_of(*full, scan.recipe);
    for (std::size_t at = 0; at + sizeof(std::uint32_t) <= bytes->size(); at += sizeof(std::uint32_t)) {
      std::uint32_t p = 0;
      std::memcpy(&p, bytes->data() + at, sizeof p);
      const std::size_t x = p % full->sensor.width_px;
      const std::size_t y = p / full->sensor.width_px;
      if (x >= w.x && x < w.x + w.width && y >= w.y && y < w.y + w.height) {
        scan.hot_pixels.push_back(static_cast<std::uint32_t>((y - w.y) * w.width + (x - w.x)));
      }
    }
  }
  auto references = attached_references(*reader);
  if (!references) {
    return std::unexpected(references.error());
  }
  if (*references) {
    auto fitted = cropped(*references, *full, scan.recipe);
    if (!fitted) {
      return std::unexpected(fitted.error());
    }
    out.references = std::move(*fitted);
  }
  return out;
}

}  // namespace scatter::measurement
