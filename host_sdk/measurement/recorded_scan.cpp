#include "host_sdk/measurement/recorded_scan.h"

#include <fmt/format.h>
#include <sodium.h>

#include <oneapi/tbb/task_group.h>

#include <array>
#include <cstring>
#include <utility>

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

bool of_sample(const device::RecordedRun& run) noexcept {
  const protocol::Recipe& recipe = run.configuration.recipe;
  return recipe.target == protocol::Target::kSample && recipe.test_pattern == 0;
}

// Frames are merged when this much of them is held and a sweep has ended.
constexpr std::size_t kBatchBytes = std::size_t{12} << 20U;

/// Collects frames into batches of whole sweeps and merges each while the next one is read.
class Merger {
 public:
  explicit Merger(RecordedScan& scan) noexcept : scan_(scan) {}
  Merger(const Merger&) = delete;
  Merger& operator=(const Merger&) = delete;
  ~Merger() { tasks_.wait(); }

  void add(device::Frame frame) {
    if (frame.begin.sweep != sweep_ && filling_.bytes() >= kBatchBytes) {
      merge();
    }
    sweep_ = frame.begin.sweep;
    const std::size_t before = filling_.bytes();
    if (const auto record = filling_.add(scan_.descriptor, std::move(frame))) {
      scan_.frames.push_back(*record);
      scan_.raw_bytes += filling_.bytes() - before;
    } else {
      ++scan_.damaged_frames;
    }
  }
  void end_of_run() {
    merge();
    tasks_.wait();
  }

 private:
  void merge() {
    if (filling_.empty()) {
      return;
    }
    tasks_.wait();  // One batch at a time: the sums are shared.
    merging_ = std::exchange(filling_, {});
    tasks_.run(
        [this] { scan_.light.add(merging_, scan_.references->content().dark, scan_.descriptor.sensor); });
  }

  RecordedScan& scan_;
  FrameBatch filling_;
  FrameBatch merging_;
  std::uint16_t sweep_ = 0;
  oneapi::tbb::task_group tasks_;
};

}  // namespace

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

Result<RecordedScan> open_scan(const device::RecordingReader& reader, const std::string& name,
                               const std::shared_ptr<const ReferenceSet>& given) {
  const auto full = reader.descriptor();
  if (!full && reader.integrity().truncated) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: was cut off before its first frame", name),
                "record again");
  }
  if (!full) {
    return std::unexpected(full.error());
  }
  RecordedScan scan;
  scan.creation_unix_ns = reader.info().creation_unix_ns;
  scan.integrity = reader.integrity().text();
  bool first = true;
  for (const device::RecordedRun& run : reader.runs()) {
    if (!of_sample(run)) {
      continue;
    }
    const protocol::Recipe& recipe = run.configuration.recipe;
    if (first) {
      scan.recipe = recipe;
      first = false;
    } else if (recipe.region_x != scan.recipe.region_x || recipe.region_y != scan.recipe.region_y ||
               recipe.region_width != scan.recipe.region_width ||
               recipe.region_height != scan.recipe.region_height) {
      return fail(ErrorCode::kInvalidArgument, fmt::format("{}: holds runs with different windows", name),
                  "record runs with different windows into different files");
    }
  }
  if (first) {
    return fail(
        ErrorCode::kDataLoss, fmt::format("{}: holds no run of a sample", name),
        scan.integrity.empty() ? "give the recording of a measurement" : scan.integrity + "; record again");
  }
  scan.descriptor = cropped(*full, scan.recipe);

  std::shared_ptr<const ReferenceSet> references = given;
  if (!references) {
    auto attached = attached_references(reader);
    if (!attached) {
      return std::unexpected(attached.error());
    }
    references = std::move(*attached);
  }
  if (!references) {
    return fail(ErrorCode::kFailedPrecondition, fmt::format("{}: the recording carries no calibration", name),
                "run `scatter calibrate URI -o CAL.scat`, then `scatter process` this recording with "
                "--calibration CAL.scat");
  }
  auto fitted = cropped(references, *full, scan.recipe);
  if (!fitted) {
    return std::unexpected(fitted.error());
  }
  scan.references = std::move(*fitted);

  if (const auto bytes = reader.attachment(device::kAttachmentHotPixels)) {
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
  return scan;
}

Status read_frames(const device::RecordingReader& reader, const std::string& name, RecordedScan& scan) {
  Fingerprint fingerprint;
  fingerprint.add(scan.creation_unix_ns);
  Merger merger(scan);
  const auto runs = reader.runs();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (!of_sample(runs[i])) {
      continue;
    }
    auto cursor = reader.frames(i);
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
      merger.add(std::move(**frame));
    }
    merger.end_of_run();
    const device::RecordedRunSummary summary = cursor->summary();
    scan.ledger += summary.ledger;
    if (scan.integrity.empty()) {
      scan.integrity = summary.integrity.text();
    }
    if (runs[i].report) {
      scan.instrument_seconds +=
          1e-6 * static_cast<double>(runs[i].report->ended_us - runs[i].report->started_us);
    }
  }
  if (scan.frames.empty()) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: holds no complete frame of a sample", name),
                scan.integrity.empty() ? "record again" : scan.integrity + "; record again");
  }
  scan.id = fingerprint.hex();
  return {};
}

}  // namespace scatter::measurement
