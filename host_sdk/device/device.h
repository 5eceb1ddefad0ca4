// An open instrument.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/device/stream.h"
#include "host_sdk/device/transport.h"
#include "host_sdk/device/wait.h"
#include "host_sdk/error/error.h"
#include "protocol/descriptor.h"
#include "protocol/messages.h"

namespace scatter::device {

class RecordingWriter;

struct OpenOptions {
  const TransportRegistry* registry = nullptr;  ///< Null: the built-in schemes (tcp, unix, replay).
  Wait wait = {};                               ///< For the whole of open().
  std::string host_name = "scatter";            ///< Who is asking; shown to a second host.
  std::string build_id;                         ///< Version of the program; "" = the library's.
  std::optional<std::uint16_t> nonce;  ///< Session nonce; by default derived from the transport's Unix
                                       ///< time, so that virtual clocks repeat it.
};

struct Configured {
  std::uint32_t epoch = 0;           ///< Every frame taken with this recipe carries it.
  std::uint32_t planned_frames = 0;  ///< Fixed exposures: exact; automatic: at most.
  Duration planned_duration{};       ///< On the device's clock.
};

struct StartOptions {
  RecordingWriter* recorder = nullptr;  ///< Gets everything a later reader needs; outlives the stream.
  std::uint32_t credit_window = 8;      ///< Frames the device may be ahead, 1..64.
};

/// How update_write() sends.
struct UpdatePieces {
  std::uint32_t piece_bytes = 0;                             ///< UpdateState::chunk_bytes.
  std::size_t depth = 4;                                     ///< Pieces under way at once, 1..4.
  std::function<void(std::uint32_t written)> progress = {};  ///< Bytes of this call that the device has.
};

/// Relation of the device's clock to the transport's Unix time at one moment.
struct ClockReading {
  std::uint64_t host_unix_us = 0;  ///< Middle of the exchange.
  std::uint64_t device_time_us = 0;
  Duration round_trip{};  ///< The reading is uncertain by half of it.
};

struct SelfTestReport {
  std::uint32_t frames = 0;
  std::uint64_t pixels = 0;
  std::uint64_t wrong_pixels = 0;  ///< Differ from the counter pattern.
  RunSummary run;
};

/// Something the device said on its own.
struct DeviceEvent {
  std::uint8_t level = 0;  ///< 0 debug .. 4 error.
  protocol::FaultCode fault = protocol::FaultCode::kNone;
  std::uint64_t device_time_us = 0;
  std::string text;
};

/// A session with one instrument: HELLO said, descriptor read and checked.
///
/// Threads  one thread at a time per Device (its Stream included); different Devices are independent.
/// Waits    every call has a Wait, ends in time, and leaves the session usable after a deadline.
/// Errors   of the device arrive with its code, its text and a remedy; kDisconnected: gone for good.
/// Retries  requests are executed at most once: a lost reply is asked for again with the same
///          correlation id and the device repeats it.
/// End      the destructor aborts a run that is on (within 1 s) and closes the carrier.
class Device {
 public:
  /// A device in rescue mode (HelloReply::capabilities) opens, too; its descriptor holds product and serial
  /// only. Errors  as TransportRegistry::open; kBusy: another host holds it (the message names it);
  ///         kVersionMismatch: no common wire version (the message says which side is older);
  ///         kDataLoss: the descriptor's checksum is wrong.
  [[nodiscard]] static Result<Device> open(std::string_view uri, const OpenOptions& options = {});
  /// The same over a carrier that is open already.
  [[nodiscard]] static Result<Device> open(std::unique_ptr<Transport> transport,
                                           const OpenOptions& options = {});
  Device(Device&&) noexcept;
  Device& operator=(Device&&) noexcept;
  ~Device();

  [[nodiscard]] const protocol::HelloReply& hello() const noexcept;
  [[nodiscard]] const protocol::Descriptor& descriptor() const noexcept;
  /// Unix time on the transport's clock [ns]: virtual for simulators. For recordings and provenance.
  [[nodiscard]] std::uint64_t system_time_unix_ns() const;
  /// The transport's clock, for timing on the instrument's own time base.
  [[nodiscard]] TimePoint now() const;

  /// A stored object, read in chunks, checksum checked; kept, so a second call costs nothing.
  /// Errors  kNotFound: this instrument has none; kDataLoss: checksum; kResourceExhausted: > 64 MiB.
  [[nodiscard]] Result<std::vector<std::byte>> read_object(protocol::ObjectId id, const Wait& wait = {});

  /// Errors  kInvalidArgument: the device names the field; kFailedPrecondition: a run is on.
  [[nodiscard]] Result<Configured> configure(const protocol::Recipe& recipe, const Wait& wait = {});
  [[nodiscard]] Result<protocol::Configuration> configuration(const Wait& wait = {});

  /// Starts a run of the last configuration. With a recorder, descriptor, hot pixels, PRNU map and
  /// configuration are written before the first frame.
  /// Errors  kFailedPrecondition: not configured, or another stream of this device is running.
  [[nodiscard]] Result<Stream> start(const StartOptions& options = {}, const Wait& wait = {});

  [[nodiscard]] Result<protocol::CalibrationBegun> calibration_begin(const Wait& wait = {});
  /// Brings a target under the instrument; waits while a stage moves. `placed == 0`: show
  /// `instruction` to the user, then go on.
  [[nodiscard]] Result<protocol::CalibrationPlaced> calibration_step(std::uint32_t session,
                                                                     protocol::Target target,
                                                                     const Wait& wait = {});
  [[nodiscard]] Status calibration_commit(std::uint32_t session,
                                          const protocol::CalibrationManifest& manifest,
                                          const Wait& wait = {});
  [[nodiscard]] Status calibration_end(std::uint32_t session, const Wait& wait = {});
  /// Newest first, factory last.
  [[nodiscard]] Result<std::vector<protocol::CalibrationManifest>> calibration_list(const Wait& wait = {});
  /// Needed, expired and valid are ordinary results, with what the user must do.
  [[nodiscard]] Result<std::vector<protocol::CalibrationKindState>> calibration_query(const Wait& wait = {});
  [[nodiscard]] Status calibration_undo(protocol::Target kind, const Wait& wait = {});
  [[nodiscard]] Status calibration_restore_factory(const Wait& wait = {});

  [[nodiscard]] Result<protocol::KeyValue> key_value(std::string_view key, const Wait& wait = {});
  /// Errors  kPermissionDenied: read-only key; kInvalidArgument: longer than the wire allows.
  [[nodiscard]] Status set_key_value(std::string_view key, std::string_view value, const Wait& wait = {});

  [[nodiscard]] Result<protocol::DeviceStatus> status(const Wait& wait = {});
  [[nodiscard]] Result<ClockReading> clock_sync(const Wait& wait = {});
  /// Runs the counter test pattern through sensor timing, chunks and link, and checks every pixel.
  [[nodiscard]] Result<SelfTestReport> self_test(std::uint16_t frames = 4, const Wait& wait = {});
  /// The device answers, then restarts; open it again afterwards.
  [[nodiscard]] Status reboot(const Wait& wait = {});

  /// What both firmware slots hold, and how far an update is. See updater.h for a whole update.
  /// Errors  of this and the update calls: kUnimplemented: this device takes no updates over the wire.
  [[nodiscard]] Result<protocol::UpdateState> update_status(const Wait& wait = {});
  /// Announces an image by its signed header. The device checks it before it erases anything, which may take
  /// many seconds; the same header again resumes.
  /// Errors  kPermissionDenied: signature; kInvalidArgument: product, slot, address, size, security counter.
  [[nodiscard]] Status update_begin(const std::array<std::uint8_t, protocol::kImageHeaderBytes>& header,
                                    const Wait& wait = {.timeout = std::chrono::seconds(60)});
  /// Sends a part of the image's body that begins at `offset`. `wait.timeout` is for each piece.
  [[nodiscard]] Status update_write(std::uint32_t offset, std::span<const std::byte> bytes,
                                    const UpdatePieces& how, const Wait& wait = {});
  /// The body is complete: the device verifies it and will try it at the next start.
  /// Errors  kDataLoss: the body is not the announced one.
  [[nodiscard]] Status update_finish(const Wait& wait = {.timeout = std::chrono::seconds(60)});
  /// Keeps the running image. Errors  kFailedPrecondition: it is not on trial.
  [[nodiscard]] Status update_confirm(const Wait& wait = {});
  /// Snapshot of the last crash; present == 0: none since power-on.
  [[nodiscard]] Result<protocol::FaultRecord> fault_record(const Wait& wait = {});

  /// Log and fault events since the last call, oldest first; at most the newest 256 are kept.
  [[nodiscard]] std::vector<DeviceEvent> take_events();
  [[nodiscard]] LinkStatistics link_statistics() const;
  /// What a person should know about the carrier, with a remedy each: a slow bus, little memory for
  /// transfers.
  [[nodiscard]] std::vector<Notice> notices() const;

  struct Impl;

 private:
  explicit Device(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scatter::device
