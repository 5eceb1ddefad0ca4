#include "host_sdk/device/device.h"

#include <algorithm>
#include <map>
#include <utility>

#include "host_sdk/device/recording_writer.h"
#include "host_sdk/device/request_series.h"
#include "host_sdk/device/session.h"
#include "host_sdk/device/stream_state.h"
#include "protocol/crc.h"

namespace scatter::device {

namespace {

constexpr std::uint32_t kMaxObjectBytes = 64U << 20U;
constexpr std::uint64_t kMaxFrameBytes = 64U << 20U;
constexpr std::uint64_t kMaxWindowBytes = 256U << 20U;
constexpr std::uint32_t kMaxWindow = 64;
constexpr Duration kFarewell = std::chrono::seconds(1);

/// What is left of a wait that several requests share.
Wait rest_of(const Wait& wait, TimePoint deadline, TimePoint now) {
  return {.timeout = deadline - now, .stop = wait.stop};
}

}  // namespace

struct Device::Impl {
  std::shared_ptr<Session> session;
  protocol::HelloReply hello;
  protocol::Descriptor descriptor;
  std::optional<protocol::Configuration> configuration;
  std::map<protocol::ObjectId, std::vector<std::byte>> objects;

  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (session == nullptr) {
      return;
    }
    if (session->sink() != nullptr && !session->closed()) {
      (void)session->request<protocol::RunReport>(protocol::Abort{}, {.timeout = kFarewell, .stop = {}});
    }
    session->close();
  }

  template <typename Reply, typename Request>
  Result<Reply> ask(const Request& request, const Wait& wait) {
    return session->request<Reply>(request, wait);
  }
  template <typename Request>
  Status tell(const Request& request, const Wait& wait) {
    const auto reply = session->request<protocol::StatusReply>(request, wait);
    return reply ? Status() : Status(std::unexpected(reply.error()));
  }

  Result<std::vector<std::byte>> fetch(protocol::ObjectId id, const Wait& wait);
  Status prepare(RecordingWriter& recorder, const Wait& wait);
  [[nodiscard]] std::uint64_t frame_bytes(const protocol::Recipe& recipe) const;
};

Result<std::vector<std::byte>> Device::Impl::fetch(protocol::ObjectId id, const Wait& wait) {
  if (const auto kept = objects.find(id); kept != objects.end()) {
    return kept->second;
  }
  const auto number = static_cast<std::uint16_t>(id);
  const auto damaged = [number](std::string_view why) {
    return fail(ErrorCode::kDataLoss, "object " + std::to_string(number) + ": " + std::string(why),
                "read it again; if it stays so, restore the device's factory data");
  };
  const TimePoint deadline = session->now() + wait.timeout;
  std::vector<std::byte> out;
  std::uint32_t total = 0;
  std::uint32_t crc = 0;
  do {
    protocol::ObjectRead read;
    read.object = number;
    read.offset = static_cast<std::uint32_t>(out.size());
    read.length = protocol::kMaxPayload;
    const auto chunk = session->request<protocol::ObjectChunk>(read, deadline, wait.stop);
    if (!chunk) {
      return std::unexpected(chunk.error());
    }
    if (out.empty()) {
      total = chunk->total;
      crc = chunk->object_crc;
      if (total > kMaxObjectBytes) {
        return fail(ErrorCode::kResourceExhausted,
                    "object " + std::to_string(number) + " has " + std::to_string(total) +
                        " bytes, allowed are " + std::to_string(kMaxObjectBytes),
                    "update the host's software");
      }
    }
    if (chunk->object != number || chunk->offset != out.size() || chunk->total != total ||
        chunk->object_crc != crc || chunk->data.size() > total - out.size() ||
        (chunk->data.empty() && out.size() < total)) {
      return damaged("its chunks do not fit together");
    }
    out.insert(out.end(), chunk->data.begin(), chunk->data.end());
  } while (out.size() < total);
  if (protocol::crc32c(out) != crc) {
    return damaged("the checksum is wrong");
  }
  objects[id] = out;
  return out;
}

Status Device::Impl::prepare(RecordingWriter& recorder, const Wait& wait) {
  const TimePoint deadline = session->now() + wait.timeout;
  if (!recorder.has_attachment(kAttachmentHello)) {
    std::vector<std::byte> bytes(protocol::encoded_size(hello));
    (void)protocol::encode(hello, std::span(bytes));
    if (const Status wrote = recorder.attach(kAttachmentHello, bytes); !wrote) {
      return wrote;
    }
  }
  static constexpr std::pair<protocol::ObjectId, std::string_view> kObjects[] = {
      {protocol::ObjectId::kDescriptor, kAttachmentDescriptor},
      {protocol::ObjectId::kHotPixels, kAttachmentHotPixels},
      {protocol::ObjectId::kPrnuMap, kAttachmentPrnuMap},
  };
  for (const auto& [id, name] : kObjects) {
    if (recorder.has_attachment(name)) {
      continue;
    }
    const Result<std::vector<std::byte>> bytes = fetch(id, rest_of(wait, deadline, session->now()));
    if (!bytes && bytes.error().code == ErrorCode::kNotFound) {
      continue;
    }
    if (!bytes) {
      return std::unexpected(bytes.error());
    }
    if (const Status wrote = recorder.attach(name, *bytes); !wrote) {
      return wrote;
    }
  }
  return recorder.configuration(*configuration, session->transport().system_time_unix_ns());
}

std::uint64_t Device::Impl::frame_bytes(const protocol::Recipe& recipe) const {
  const std::uint64_t width = recipe.region_width != 0 ? recipe.region_width : descriptor.sensor.width_px;
  const std::uint64_t height = recipe.region_height != 0 ? recipe.region_height : descriptor.sensor.height_px;
  return packed_bytes(recipe.pixel_format, width * height);
}

Result<Device> Device::open(std::string_view uri, const OpenOptions& options) {
  static const TransportRegistry kBuiltIn;
  const TransportRegistry& registry = options.registry != nullptr ? *options.registry : kBuiltIn;
  Result<std::unique_ptr<Transport>> transport = registry.open(uri, options.wait);
  if (!transport) {
    return std::unexpected(std::move(transport.error()));
  }
  Result<Device> device = open(std::move(*transport), options);
  if (!device) {
    device.error().what = std::string(uri) + ": " + device.error().what;
  }
  return device;
}

Result<Device> Device::open(std::unique_ptr<Transport> transport, const OpenOptions& options) {
  const TimePoint deadline = transport->now() + options.wait.timeout;
  auto impl = std::make_unique<Impl>();
  Result<std::unique_ptr<Session>> session = Session::open(std::move(transport), options, deadline);
  if (!session) {
    return std::unexpected(std::move(session.error()));
  }
  impl->session = std::move(*session);
  impl->hello = impl->session->hello();
  if ((impl->hello.capabilities & protocol::kCapabilityRescue) != 0) {
    // The bootloader has no descriptor to give; what HELLO says is enough to put a firmware on the device.
    impl->descriptor.product = impl->hello.product;
    impl->descriptor.serial = impl->hello.serial;
    return Device(std::move(impl));
  }
  const Result<std::vector<std::byte>> bytes =
      impl->fetch(protocol::ObjectId::kDescriptor, rest_of(options.wait, deadline, impl->session->now()));
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  if (!protocol::decode_into(*bytes, impl->descriptor)) {
    return fail(ErrorCode::kDataLoss,
                "descriptor: its " + std::to_string(bytes->size()) + " bytes cannot be read",
                "update the device's firmware or the host's software");
  }
  return Device(std::move(impl));
}

Device::Device(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Device::Device(Device&&) noexcept = default;
Device& Device::operator=(Device&&) noexcept = default;
Device::~Device() = default;

const protocol::HelloReply& Device::hello() const noexcept {
  return impl_->hello;
}
const protocol::Descriptor& Device::descriptor() const noexcept {
  return impl_->descriptor;
}
TimePoint Device::now() const {
  return impl_->session->now();
}

std::uint64_t Device::system_time_unix_ns() const {
  return impl_->session->transport().system_time_unix_ns();
}

Result<std::vector<std::byte>> Device::read_object(protocol::ObjectId id, const Wait& wait) {
  return impl_->fetch(id, wait);
}

Result<Configured> Device::configure(const protocol::Recipe& recipe, const Wait& wait) {
  const auto reply =
      impl_->ask<protocol::ConfigurationAccepted>(protocol::SetConfiguration{.recipe = recipe}, wait);
  if (!reply) {
    return std::unexpected(reply.error());
  }
  impl_->configuration = protocol::Configuration{.epoch = reply->epoch, .recipe = recipe};
  return Configured{.epoch = reply->epoch,
                    .planned_frames = reply->planned_frames,
                    .planned_duration = std::chrono::microseconds(reply->planned_duration_us)};
}

Result<protocol::Configuration> Device::configuration(const Wait& wait) {
  auto reply = impl_->ask<protocol::Configuration>(protocol::GetConfiguration{}, wait);
  if (reply && reply->epoch != 0) {
    impl_->configuration = *reply;
  }
  return reply;
}

Result<Stream> Device::start(const StartOptions& options, const Wait& wait) {
  if (impl_->session->sink() != nullptr) {
    return fail(ErrorCode::kFailedPrecondition, "start: another stream of this device is running",
                "read it to its end, or abort it");
  }
  const TimePoint deadline = impl_->session->now() + wait.timeout;
  if (!impl_->configuration) {
    if (const auto current = configuration(wait); !current) {
      return std::unexpected(current.error());
    }
    if (!impl_->configuration) {
      return fail(ErrorCode::kFailedPrecondition, "start: the device is not configured",
                  "configure it first");
    }
  }
  const std::uint64_t frame_bytes = impl_->frame_bytes(impl_->configuration->recipe);
  if (frame_bytes > kMaxFrameBytes) {
    return fail(ErrorCode::kResourceExhausted,
                "start: a frame of " + std::to_string(frame_bytes) + " bytes, allowed are " +
                    std::to_string(kMaxFrameBytes),
                "choose a smaller region");
  }
  if (options.recorder != nullptr) {
    const Status prepared = impl_->prepare(*options.recorder, rest_of(wait, deadline, impl_->session->now()));
    if (!prepared) {
      return std::unexpected(prepared.error());
    }
  }
  const std::uint64_t affordable =
      std::max<std::uint64_t>(kMaxWindowBytes / std::max<std::uint64_t>(frame_bytes, 1), 1);
  AssemblerLimits limits;
  limits.max_frame_bytes = static_cast<std::uint32_t>(frame_bytes);
  StreamPlan plan;
  plan.window = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(std::clamp(options.credit_window, 1U, kMaxWindow), affordable));
  plan.live = impl_->configuration->recipe.live_preview != 0;
  plan.recorder = options.recorder;
  limits.max_open = plan.window;
  limits.until = plan.window;
  limits.after_run = impl_->session->last_run;
  limits.epoch = impl_->configuration->epoch;
  auto state = std::make_unique<Stream::State>(impl_->session, limits, plan);
  const Status started =
      state->start(impl_->configuration->epoch, rest_of(wait, deadline, impl_->session->now()));
  if (!started) {
    return std::unexpected(started.error());
  }
  return Stream(std::move(state));
}

Result<protocol::CalibrationBegun> Device::calibration_begin(const Wait& wait) {
  return impl_->ask<protocol::CalibrationBegun>(protocol::CalibrationBegin{}, wait);
}

Result<protocol::CalibrationPlaced> Device::calibration_step(std::uint32_t session, protocol::Target target,
                                                             const Wait& wait) {
  return impl_->ask<protocol::CalibrationPlaced>(
      protocol::CalibrationStep{.session = session, .target = target}, wait);
}

Status Device::calibration_commit(std::uint32_t session, const protocol::CalibrationManifest& manifest,
                                  const Wait& wait) {
  return impl_->tell(protocol::CalibrationCommit{.session = session, .manifest = manifest}, wait);
}

Status Device::calibration_end(std::uint32_t session, const Wait& wait) {
  return impl_->tell(protocol::CalibrationEnd{.session = session}, wait);
}

Result<std::vector<protocol::CalibrationManifest>> Device::calibration_list(const Wait& wait) {
  const auto reply = impl_->ask<protocol::CalibrationListed>(protocol::CalibrationList{}, wait);
  if (!reply) {
    return std::unexpected(reply.error());
  }
  return std::vector(reply->manifests.begin(), reply->manifests.end());
}

Result<std::vector<protocol::CalibrationKindState>> Device::calibration_query(const Wait& wait) {
  const auto reply = impl_->ask<protocol::CalibrationState>(protocol::CalibrationQuery{}, wait);
  if (!reply) {
    return std::unexpected(reply.error());
  }
  return std::vector(reply->states.begin(), reply->states.end());
}

Status Device::calibration_undo(protocol::Target kind, const Wait& wait) {
  return impl_->tell(protocol::CalibrationUndo{.kind = kind}, wait);
}

Status Device::calibration_restore_factory(const Wait& wait) {
  return impl_->tell(protocol::CalibrationRestoreFactory{}, wait);
}

Result<protocol::KeyValue> Device::key_value(std::string_view key, const Wait& wait) {
  return impl_->ask<protocol::KeyValue>(protocol::KeyValueGet{.key = key}, wait);
}

Status Device::set_key_value(std::string_view key, std::string_view value, const Wait& wait) {
  using Message = protocol::KeyValueSet;
  if (key.size() > decltype(Message::key)::kCapacity || value.size() > decltype(Message::value)::kCapacity) {
    return fail(ErrorCode::kInvalidArgument,
                "key_value_set: key of " + std::to_string(key.size()) + " and value of " +
                    std::to_string(value.size()) + " bytes, allowed are 32 and 64",
                "shorten it");
  }
  return impl_->tell(Message{.key = key, .value = value}, wait);
}

Result<protocol::DeviceStatus> Device::status(const Wait& wait) {
  return impl_->ask<protocol::DeviceStatus>(protocol::GetStatus{}, wait);
}

Result<ClockReading> Device::clock_sync(const Wait& wait) {
  Transport& transport = impl_->session->transport();
  const TimePoint sent = transport.now();
  const std::uint64_t sent_unix_us = transport.system_time_unix_ns() / 1000;
  const auto reply =
      impl_->ask<protocol::ClockSynced>(protocol::ClockSync{.host_time_us = sent_unix_us}, wait);
  if (!reply) {
    return std::unexpected(reply.error());
  }
  const Duration round_trip = transport.now() - sent;
  const auto half_us = std::chrono::duration_cast<std::chrono::microseconds>(round_trip).count() / 2;
  return ClockReading{
      .host_unix_us = sent_unix_us + static_cast<std::uint64_t>(std::max<std::int64_t>(half_us, 0)),
      .device_time_us = reply->device_time_us,
      .round_trip = round_trip};
}

Result<SelfTestReport> Device::self_test(std::uint16_t frames, const Wait& wait) {
  const TimePoint deadline = now() + wait.timeout;
  protocol::Recipe recipe;
  recipe.test_pattern = 1;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(std::max<std::uint32_t>(impl_->descriptor.sensor.min_exposure_us, 1));
  recipe.repeats = frames;
  if (const auto configured = configure(recipe, wait); !configured) {
    return std::unexpected(configured.error());
  }
  Result<Stream> stream = start({}, rest_of(wait, deadline, now()));
  if (!stream) {
    return std::unexpected(stream.error());
  }
  SelfTestReport report;
  std::vector<std::uint16_t> pixels;
  for (;;) {
    const Result<std::optional<Frame>> frame = stream->next(rest_of(wait, deadline, now()));
    if (!frame) {
      return std::unexpected(frame.error());
    }
    if (!*frame) {
      break;
    }
    if ((*frame)->status != FrameStatus::kComplete) {
      continue;  // The ledger names it.
    }
    pixels.resize((*frame)->pixel_count());
    if (const Status unpacked = unpack(**frame, pixels); !unpacked) {
      return std::unexpected(unpacked.error());
    }
    // Pixel k of frame n is n * 7919 + k, cut to the significant bits (Recipe::test_pattern).
    const protocol::FrameBegin& begin = (*frame)->begin;
    const std::uint32_t mask = (1U << std::min<unsigned>(begin.bits, 16)) - 1U;
    const std::uint32_t first = begin.frame_id * 7919U;
    for (std::size_t k = 0; k < pixels.size(); ++k) {
      report.wrong_pixels += pixels[k] != ((first + static_cast<std::uint32_t>(k)) & mask) ? 1U : 0U;
    }
    report.pixels += pixels.size();
    ++report.frames;
  }
  report.run = stream->summary();
  return report;
}

Status Device::reboot(const Wait& wait) {
  return impl_->tell(protocol::Reboot{}, wait);
}

Result<protocol::UpdateState> Device::update_status(const Wait& wait) {
  return impl_->ask<protocol::UpdateState>(protocol::UpdateStatus{}, wait);
}

Status Device::update_begin(const std::array<std::uint8_t, protocol::kImageHeaderBytes>& header,
                            const Wait& wait) {
  return impl_->tell(protocol::UpdateBegin{.header = header}, wait);
}

Status Device::update_write(std::uint32_t offset, std::span<const std::byte> bytes, const UpdatePieces& how,
                            const Wait& wait) {
  const std::size_t room = std::min<std::size_t>(impl_->hello.max_payload, protocol::kMaxPayload);
  if (how.piece_bytes == 0 || how.piece_bytes + protocol::min_encoded_size<protocol::UpdateWrite>() > room) {
    return fail(ErrorCode::kInvalidArgument,
                "update_write: pieces of " + std::to_string(how.piece_bytes) +
                    " bytes do not fit into payloads of " + std::to_string(room),
                "take the size that the device names");
  }
  // Pieces are answered in any order, but they all have the same size except the last one.
  std::size_t answered = 0;
  RequestSeries series(*impl_->session, how.depth, wait, [&] {
    answered = std::min<std::size_t>(answered + how.piece_bytes, bytes.size());
    if (how.progress) {
      how.progress(static_cast<std::uint32_t>(answered));
    }
  });
  for (std::size_t at = 0; at < bytes.size(); at += how.piece_bytes) {
    const protocol::UpdateWrite piece{
        .offset = offset + static_cast<std::uint32_t>(at),
        .data = bytes.subspan(at, std::min<std::size_t>(how.piece_bytes, bytes.size() - at))};
    if (const Status sent = series.push(piece); !sent) {
      return sent;
    }
  }
  return series.finish();
}

Status Device::update_finish(const Wait& wait) {
  return impl_->tell(protocol::UpdateFinish{}, wait);
}

Status Device::update_confirm(const Wait& wait) {
  return impl_->tell(protocol::UpdateConfirm{}, wait);
}

Result<protocol::FaultRecord> Device::fault_record(const Wait& wait) {
  return impl_->ask<protocol::FaultRecord>(protocol::FaultRecordRead{}, wait);
}

std::vector<DeviceEvent> Device::take_events() {
  return impl_->session->take_events();
}
LinkStatistics Device::link_statistics() const {
  return impl_->session->statistics();
}
std::vector<Notice> Device::notices() const {
  return impl_->session->transport().notices();
}

}  // namespace scatter::device
