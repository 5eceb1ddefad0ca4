// Every message of the wire: one struct and one constexpr field list each. The codec, the tables of
// SPEC.md and the machine-readable description are derived from these lists and from nothing else.
// One file because the list of all messages is what they are derived from.
//
// Rules (SPEC.md section 4): fields are little endian, in order, unpadded; arrays and texts carry a
// u16 count; missing trailing fields keep the defaults below; extra trailing bytes are ignored; ids
// are never reused. A request id below 0x8000 has its reply at id | 0x8000 or a StatusReply.
#pragma once

#include <array>
#include <cstdint>
#include <tuple>

#include "protocol/bounded.h"
#include "protocol/descriptor.h"
#include "protocol/field.h"
#include "protocol/image_header.h"
#include "protocol/status.h"
#include "protocol/types.h"

namespace scatter::protocol {

inline constexpr std::uint8_t kWireMajor = 1;
inline constexpr std::uint16_t kSchemaRevision = 2;

enum class MessageId : std::uint16_t {
  kHello = 0x0001,
  kHelloReply = 0x8001,
  kStatusReply = 0x8000,
  kObjectRead = 0x0002,
  kObjectChunk = 0x8002,
  kGetConfiguration = 0x0003,
  kConfiguration = 0x8003,
  kSetConfiguration = 0x0004,
  kConfigurationAccepted = 0x8004,
  kStart = 0x0005,
  kStarted = 0x8005,
  kStop = 0x0006,
  kAbort = 0x0007,
  kRunReport = 0x8006,
  kCredit = 0x0008,
  kFrameBegin = 0x0101,
  kFrameData = 0x0102,
  kFrameEnd = 0x0103,
  kRunFinished = 0x0201,
  kLogEvent = 0x0202,
  kFaultEvent = 0x0203,
  kGetStatus = 0x0009,
  kDeviceStatus = 0x8009,
  kCalibrationBegin = 0x000A,
  kCalibrationBegun = 0x800A,
  kCalibrationStep = 0x000B,
  kCalibrationPlaced = 0x800B,
  kCalibrationCommit = 0x000C,
  kCalibrationEnd = 0x000D,
  kCalibrationList = 0x000E,
  kCalibrationListed = 0x800E,
  kCalibrationQuery = 0x000F,
  kCalibrationState = 0x800F,
  kCalibrationUndo = 0x0010,
  kCalibrationRestoreFactory = 0x0011,
  kKeyValueGet = 0x0012,
  kKeyValue = 0x8012,
  kKeyValueSet = 0x0013,
  kReboot = 0x0014,
  kClockSync = 0x0015,
  kClockSynced = 0x8015,
  kUpdateBegin = 0x0016,
  kUpdateWrite = 0x0017,
  kUpdateFinish = 0x0018,
  kUpdateConfirm = 0x0019,
  kUpdateStatus = 0x001A,
  kUpdateState = 0x801A,
  kFaultRecordRead = 0x001B,
  kFaultRecord = 0x801B,
};

/// Objects that ObjectRead reads.
enum class ObjectId : std::uint16_t {
  kDescriptor = 1,  ///< A Descriptor, encoded like a message.
  kHotPixels = 2,   ///< u32 little endian each: y * width + x, ascending.
  kPrnuMap = 3,     ///< i8 per pixel, row major: relative gain deviation in 0.1 %.
};

enum Capability : std::uint32_t {
  kCapabilityReferenceStage = 1U << 0U,  ///< Places sample and references itself.
  kCapabilityTransmission = 1U << 1U,    ///< The transmission module is mounted.
  kCapabilityUpdate = 1U << 2U,          ///< Update messages are served.
  kCapabilityRescue = 1U << 3U,          ///< The bootloader answers: no image could be started.
};

enum class RunState : std::uint8_t { kIdle = 0, kRunning = 1, kHolding = 2 };

enum class RunEnd : std::uint8_t {
  kCompleted = 0,
  kStopped = 1,
  kAborted = 2,
  kSensorFault = 3,
  kHostGone = 4,  ///< A new HELLO or a closed link ended the run.
};

enum class ResetReason : std::uint8_t {
  kPowerOn = 0,
  kRequested = 1,
  kWatchdog = 2,
  kFault = 3,
  kBrownOut = 4
};

enum class FaultCode : std::uint16_t {
  kNone = 0,
  kSensorTimeout = 1,
  kMonitorLow = 2,
  kTemperatureOutOfRange = 3,
  kFlashWrite = 4,
  kCalibrationStoreRecovered = 5,
  kStoreOfLaterVersion = 6,  ///< The store was written by a later firmware; it is left untouched.
  kFirmwareCrashed = 7,      ///< The last reset came from a fault; see FaultRecord.
};

/// Idle: nothing received. Receiving: an announced image is incomplete. Ready: verified, tried at the next
/// boot. Trial: the running image goes at the next boot unless it is confirmed before.
enum class UpdatePhase : std::uint8_t { kIdle = 0, kReceiving = 1, kReady = 2, kTrial = 3 };

/// What a firmware slot holds, as the device judges it.
enum class SlotVerdict : std::uint8_t {
  kEmpty = 0,         ///< No image begins here.
  kReceiving = 1,     ///< An image that is not complete yet.
  kReady = 2,         ///< Verified, not tried yet.
  kTrial = 3,         ///< Running for the first time, not confirmed yet.
  kReverted = 4,      ///< Was tried and not confirmed in time.
  kConfirmed = 5,     ///< Kept.
  kBadHeader = 6,     ///< Header damaged, of a later version, or its signature wrong.
  kBadBody = 7,       ///< The body's hash differs from the header's.
  kWrongProduct = 8,  ///< Made for another product.
  kRolledBack = 9,    ///< Its security counter is below that of the confirmed image.
  kUnreadable = 10,   ///< The flash cannot be read.
};

/// Why a calibration of one kind can or cannot be used now.
enum class CalibrationVerdict : std::uint8_t {
  kValid = 0,
  kNeeded = 1,
  kExpiredAge = 2,
  kExpiredTemperature = 3
};

struct CalibrationKindState {
  Target kind = Target::kWhiteReference;
  CalibrationVerdict verdict = CalibrationVerdict::kNeeded;
  CalibrationId id{};
  std::uint32_t age_s = 0;
  std::int32_t temperature_change_mK = 0;
  BoundedString<96> action{};  ///< What the user must do; "" when valid.
  static constexpr auto schema() {
    using S = CalibrationKindState;
    return fields(field("kind", &S::kind, "", "1 dark cap, 2 white, 3 black, 4 translucent"),
                  field("verdict", &S::verdict, "", "0 valid, 1 needed, 2 too old, 3 temperature moved"),
                  field("id", &S::id, "", "calibration in force, zero = none"),
                  field("age_s", &S::age_s, "s", "since its commit"),
                  field("temperature_change_mK", &S::temperature_change_mK, "mK", "since the calibration"),
                  field("action", &S::action, "", "what the user must do"));
  }
  friend constexpr bool operator==(const CalibrationKindState&,
                                   const CalibrationKindState&) noexcept = default;
};

/// host -> device, control.
struct Hello {
  static constexpr MessageId kId = MessageId::kHello;
  static constexpr std::string_view kName = "hello";
  static constexpr std::string_view kMeaning = "Opens a session; the nonce in the frame header names it.";
  std::uint8_t min_wire_major = kWireMajor;
  std::uint8_t max_wire_major = kWireMajor;
  std::uint16_t schema_revision = kSchemaRevision;
  std::uint32_t schema_digest = 0;
  std::uint32_t max_payload = 16384;
  std::uint32_t capabilities = 0;
  BoundedString<32> build_id{};
  BoundedString<32> host_name{};
  static constexpr auto schema() {
    return fields(
        field("min_wire_major", &Hello::min_wire_major, "", "lowest wire major the host speaks"),
        field("max_wire_major", &Hello::max_wire_major, "", "highest wire major the host speaks"),
        field("schema_revision", &Hello::schema_revision, "", "host's schema revision"),
        field("schema_digest", &Hello::schema_digest, "", "CRC-32C of the host's schema description"),
        field("max_payload", &Hello::max_payload, "B", "largest payload the host accepts"),
        field("capabilities", &Hello::capabilities, "", "Capability bits of the host"),
        field("build_id", &Hello::build_id, "", "host software version"),
        field("host_name", &Hello::host_name, "", "who is asking, shown to a second host"));
  }
};

/// device -> host.
struct HelloReply {
  static constexpr MessageId kId = MessageId::kHelloReply;
  static constexpr std::string_view kName = "hello_reply";
  static constexpr std::string_view kMeaning = "The session is open; who answers, and in what state.";
  std::uint8_t wire_major = kWireMajor;
  std::uint16_t schema_revision = kSchemaRevision;
  std::uint32_t schema_digest = 0;
  std::uint32_t max_payload = 16384;
  std::uint32_t capabilities = 0;
  BoundedString<32> build_id{};
  BoundedString<32> product{};
  BoundedString<32> serial{};
  std::uint8_t reset_reason = 0;
  std::uint32_t boot_count = 0;
  std::uint64_t device_time_us = 0;
  std::uint32_t epoch = 0;
  std::uint8_t run_state = 0;
  static constexpr auto schema() {
    return fields(
        field("wire_major", &HelloReply::wire_major, "", "chosen wire major"),
        field("schema_revision", &HelloReply::schema_revision, "", "device's schema revision"),
        field("schema_digest", &HelloReply::schema_digest, "", "CRC-32C of the device's schema description"),
        field("max_payload", &HelloReply::max_payload, "B", "negotiated largest payload, both directions"),
        field("capabilities", &HelloReply::capabilities, "", "Capability bits of the device"),
        field("build_id", &HelloReply::build_id, "", "firmware version"),
        field("product", &HelloReply::product, "", "descriptor's product"),
        field("serial", &HelloReply::serial, "", "descriptor's serial number"),
        field("reset_reason", &HelloReply::reset_reason, "", "ResetReason of this boot"),
        field("boot_count", &HelloReply::boot_count, "", "boots since production"),
        field("device_time_us", &HelloReply::device_time_us, "us", "device's clock"),
        field("epoch", &HelloReply::epoch, "", "current settings epoch, 0 = never configured"),
        field("run_state", &HelloReply::run_state, "", "RunState"));
  }
};

/// device -> host.
struct StatusReply {
  static constexpr MessageId kId = MessageId::kStatusReply;
  static constexpr std::string_view kName = "status_reply";
  static constexpr std::string_view kMeaning =
      "Reply of every request that returns no data, and of every request that fails.";
  StatusCode status = StatusCode::kOk;
  std::uint16_t request = 0;
  std::uint32_t pending_ms = 0;
  BoundedString<128> text{};
  static constexpr auto schema() {
    return fields(
        field("status", &StatusReply::status, "", "0 OK, 1 PENDING, else the reason"),
        field("request", &StatusReply::request, "", "message id that this answers"),
        field("pending_ms", &StatusReply::pending_ms, "ms", "PENDING only: the reply comes within this time"),
        field("text", &StatusReply::text, "", "what was wrong, with expected and found values"));
  }
};

/// host -> device, control.
struct ObjectRead {
  static constexpr MessageId kId = MessageId::kObjectRead;
  static constexpr std::string_view kName = "object_read";
  static constexpr std::string_view kMeaning = "Reads a part of a stored object.";
  std::uint16_t object = 0;
  std::uint32_t offset = 0;
  std::uint32_t length = 0;
  static constexpr auto schema() {
    return fields(field("object", &ObjectRead::object, "", "ObjectId"),
                  field("offset", &ObjectRead::offset, "B", "first byte wanted"),
                  field("length", &ObjectRead::length, "B", "wanted; the device may send less"));
  }
};

/// device -> host.
struct ObjectChunk {
  static constexpr MessageId kId = MessageId::kObjectChunk;
  static constexpr std::string_view kName = "object_chunk";
  static constexpr std::string_view kMeaning = "A part of a stored object.";
  std::uint16_t object = 0;
  std::uint32_t offset = 0;
  std::uint32_t total = 0;
  std::uint32_t object_crc = 0;
  TailBytes data{};
  static constexpr auto schema() {
    return fields(field("object", &ObjectChunk::object, "", "ObjectId"),
                  field("offset", &ObjectChunk::offset, "B", "of `data` in the object"),
                  field("total", &ObjectChunk::total, "B", "size of the whole object"),
                  field("object_crc", &ObjectChunk::object_crc, "", "CRC-32C of the whole object"),
                  field("data", &ObjectChunk::data, "", "the bytes"));
  }
};

/// host -> device, control.
struct GetConfiguration {
  static constexpr MessageId kId = MessageId::kGetConfiguration;
  static constexpr std::string_view kName = "get_configuration";
  static constexpr std::string_view kMeaning = "Asks for the recipe in force.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct Configuration {
  static constexpr MessageId kId = MessageId::kConfiguration;
  static constexpr std::string_view kName = "configuration";
  static constexpr std::string_view kMeaning = "The recipe in force.";
  std::uint32_t epoch = 0;
  Recipe recipe{};
  static constexpr auto schema() {
    return fields(field("epoch", &Configuration::epoch, "", "settings epoch of this recipe"),
                  field("recipe", &Configuration::recipe, "", "what to measure"));
  }
};

/// host -> device, control.
struct SetConfiguration {
  static constexpr MessageId kId = MessageId::kSetConfiguration;
  static constexpr std::string_view kName = "set_configuration";
  static constexpr std::string_view kMeaning = "Sets the recipe; not while a run is on.";
  Recipe recipe{};
  static constexpr auto schema() {
    return fields(field("recipe", &SetConfiguration::recipe, "", "what to measure"));
  }
};

/// device -> host.
struct ConfigurationAccepted {
  static constexpr MessageId kId = MessageId::kConfigurationAccepted;
  static constexpr std::string_view kName = "configuration_accepted";
  static constexpr std::string_view kMeaning = "The recipe is in force; a new settings epoch begins.";
  std::uint32_t epoch = 0;
  std::uint32_t planned_frames = 0;
  std::uint32_t planned_duration_us = 0;
  static constexpr auto schema() {
    return fields(field("epoch", &ConfigurationAccepted::epoch, "", "settings epoch that begins"),
                  field("planned_frames", &ConfigurationAccepted::planned_frames, "frames",
                        "fixed: exact; auto: at most"),
                  field("planned_duration_us", &ConfigurationAccepted::planned_duration_us, "us",
                        "on the device's clock; auto: the budget"));
  }
};

/// host -> device, control.
struct Start {
  static constexpr MessageId kId = MessageId::kStart;
  static constexpr std::string_view kName = "start";
  static constexpr std::string_view kMeaning = "Starts a run of the recipe.";
  std::uint32_t epoch = 0;
  std::uint32_t may_send_until = 0;
  static constexpr auto schema() {
    return fields(field("epoch", &Start::epoch, "", "must be the current epoch"),
                  field("may_send_until", &Start::may_send_until, "",
                        "first credit: frame ids below this may be sent"));
  }
};

/// device -> host.
struct Started {
  static constexpr MessageId kId = MessageId::kStarted;
  static constexpr std::string_view kName = "started";
  static constexpr std::string_view kMeaning = "The run is on.";
  std::uint32_t run_id = 0;
  std::uint64_t device_time_us = 0;
  static constexpr auto schema() {
    return fields(field("run_id", &Started::run_id, "", "rises by one per run"),
                  field("device_time_us", &Started::device_time_us, "us", "device's clock"));
  }
};

/// host -> device, control.
struct Stop {
  static constexpr MessageId kId = MessageId::kStop;
  static constexpr std::string_view kName = "stop";
  static constexpr std::string_view kMeaning = "Ends the run after the frame in hand.";
  static constexpr auto schema() { return fields(); }
};

/// host -> device, control.
struct Abort {
  static constexpr MessageId kId = MessageId::kAbort;
  static constexpr std::string_view kName = "abort";
  static constexpr std::string_view kMeaning = "Ends the run now; the frame in hand is lost_firmware.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct RunReport {
  static constexpr MessageId kId = MessageId::kRunReport;
  static constexpr std::string_view kName = "run_report";
  static constexpr std::string_view kMeaning = "Reply of stop and abort: the device's half of the ledger.";
  std::uint32_t run_id = 0;
  std::uint8_t reason = 0;
  Ledger ledger{};
  std::uint32_t frames_sent = 0;
  std::uint64_t started_us = 0;
  std::uint64_t ended_us = 0;
  std::uint64_t held_us = 0;
  static constexpr auto schema() {
    return fields(field("run_id", &RunReport::run_id, "", "run that ended, or the last one"),
                  field("reason", &RunReport::reason, "", "RunEnd"),
                  field("ledger", &RunReport::ledger, "", "exposed, lost_sensor, lost_firmware; the rest 0"),
                  field("frames_sent", &RunReport::frames_sent, "frames", "frames whose end was sent"),
                  field("started_us", &RunReport::started_us, "us", "device's clock at the start"),
                  field("ended_us", &RunReport::ended_us, "us", "device's clock at the end"),
                  field("held_us", &RunReport::held_us, "us", "time the run waited for credit"));
  }
};

/// host -> device, event channel, no reply.
struct Credit {
  static constexpr MessageId kId = MessageId::kCredit;
  static constexpr std::string_view kName = "credit";
  static constexpr std::string_view kMeaning = "Allows more frames; absolute and idempotent, no reply.";
  std::uint32_t run_id = 0;
  std::uint32_t may_send_until = 0;
  static constexpr auto schema() {
    return fields(field("run_id", &Credit::run_id, "", "run it is for; others ignore it"),
                  field("may_send_until", &Credit::may_send_until, "",
                        "frame ids below this may be sent; lower values than before are ignored"));
  }
};

/// device -> host, stream.
struct FrameBegin {
  static constexpr MessageId kId = MessageId::kFrameBegin;
  static constexpr std::string_view kName = "frame_begin";
  static constexpr std::string_view kMeaning = "Metadata of a frame, before its pixels.";
  std::uint32_t run_id = 0;
  std::uint32_t frame_id = 0;
  std::uint32_t epoch = 0;
  CalibrationId calibration_id{};
  FrameKind kind = FrameKind::kLight;
  Target target = Target::kSample;
  std::uint8_t illumination = 0xFF;
  std::uint8_t bracket = 0;
  std::uint16_t sweep = 0;
  std::uint32_t exposure_us = 0;
  std::uint16_t gain_milli = 1000;
  std::int32_t sensor_temperature_mK = 0;
  std::int32_t led_temperature_mK = 0;
  std::uint32_t monitor_uv = 0;
  std::uint64_t exposure_start_us = 0;
  std::uint16_t x = 0;
  std::uint16_t y = 0;
  std::uint16_t width = 0;
  std::uint16_t height = 0;
  PixelFormat pixel_format = PixelFormat::kMono16;
  std::uint8_t bits = 0;
  std::uint32_t total = 0;
  static constexpr auto schema() {
    return fields(
        field("run_id", &FrameBegin::run_id, "", "run"),
        field("frame_id", &FrameBegin::frame_id, "",
              "stamped at the exposure, before anything can be dropped; from 0 per run"),
        field("epoch", &FrameBegin::epoch, "", "settings this frame was taken with"),
        field("calibration_id", &FrameBegin::calibration_id, "", "device's current white calibration"),
        field("kind", &FrameBegin::kind, "", "0 light, 1 ambient, 2 dark"),
        field("target", &FrameBegin::target, "", "what lies under the instrument"),
        field("illumination", &FrameBegin::illumination, "", "index, 255 = none"),
        field("bracket", &FrameBegin::bracket, "", "exposure number within the illumination and sweep"),
        field("sweep", &FrameBegin::sweep, "", "0-based"),
        field("exposure_us", &FrameBegin::exposure_us, "us", "exposure time"),
        field("gain_milli", &FrameBegin::gain_milli, "1e-3", "sensor gain"),
        field("sensor_temperature_mK", &FrameBegin::sensor_temperature_mK, "mK", "of the sensor"),
        field("led_temperature_mK", &FrameBegin::led_temperature_mK, "mK", "of the LED board"),
        field("monitor_uv", &FrameBegin::monitor_uv, "uV", "photodiode reading during the exposure"),
        field("exposure_start_us", &FrameBegin::exposure_start_us, "us", "device's clock"),
        field("x", &FrameBegin::x, "px", "window"), field("y", &FrameBegin::y, "px", "window, top"),
        field("width", &FrameBegin::width, "px", "window"),
        field("height", &FrameBegin::height, "px", "window"),
        field("pixel_format", &FrameBegin::pixel_format, "", "0 Mono16, 1 Mono10p, 2 Mono12p"),
        field("bits", &FrameBegin::bits, "bit", "significant bits"),
        field("total", &FrameBegin::total, "B", "bytes of pixel data"));
  }
};

/// device -> host, stream.
struct FrameData {
  static constexpr MessageId kId = MessageId::kFrameData;
  static constexpr std::string_view kName = "frame_data";
  static constexpr std::string_view kMeaning = "Pixels of a frame: a band of rows.";
  std::uint32_t run_id = 0;
  std::uint32_t frame_id = 0;
  std::uint32_t offset = 0;
  std::uint32_t total = 0;
  TailBytes data{};
  static constexpr auto schema() {
    return fields(field("run_id", &FrameData::run_id, "", "run"),
                  field("frame_id", &FrameData::frame_id, "", "frame in the run"),
                  field("offset", &FrameData::offset, "B", "of `data` in the frame"),
                  field("total", &FrameData::total, "B", "bytes of pixel data of the frame"),
                  field("data", &FrameData::data, "", "pixel bytes"));
  }
};

/// device -> host, stream.
struct FrameEnd {
  static constexpr MessageId kId = MessageId::kFrameEnd;
  static constexpr std::string_view kName = "frame_end";
  static constexpr std::string_view kMeaning = "What is known of a frame only after its last row.";
  std::uint32_t run_id = 0;
  std::uint32_t frame_id = 0;
  std::uint32_t saturated_pixels = 0;
  std::uint16_t max_dn = 0;
  std::uint16_t flags = 0;
  std::uint32_t frame_crc = 0;
  std::uint64_t readout_end_us = 0;
  static constexpr auto schema() {
    return fields(
        field("run_id", &FrameEnd::run_id, "", "run"),
        field("frame_id", &FrameEnd::frame_id, "", "frame in the run"),
        field("saturated_pixels", &FrameEnd::saturated_pixels, "px", "pixels at or above saturation"),
        field("max_dn", &FrameEnd::max_dn, "DN", "brightest unsaturated pixel"),
        field("flags", &FrameEnd::flags, "", "FrameFlags"),
        field("frame_crc", &FrameEnd::frame_crc, "", "CRC-32C of all pixel bytes"),
        field("readout_end_us", &FrameEnd::readout_end_us, "us", "device's clock"));
  }
};

/// device -> host, event.
struct RunFinished {
  static constexpr MessageId kId = MessageId::kRunFinished;
  static constexpr std::string_view kName = "run_finished";
  static constexpr std::string_view kMeaning = "The run ended by itself or by a fault.";
  std::uint32_t run_id = 0;
  std::uint8_t reason = 0;
  Ledger ledger{};
  std::uint32_t frames_sent = 0;
  std::uint64_t started_us = 0;
  std::uint64_t ended_us = 0;
  std::uint64_t held_us = 0;
  static constexpr auto schema() {
    return fields(
        field("run_id", &RunFinished::run_id, "", "run that ended"),
        field("reason", &RunFinished::reason, "", "RunEnd"),
        field("ledger", &RunFinished::ledger, "", "exposed, lost_sensor, lost_firmware; the rest 0"),
        field("frames_sent", &RunFinished::frames_sent, "frames", "frames whose end was sent"),
        field("started_us", &RunFinished::started_us, "us", "device's clock at the start"),
        field("ended_us", &RunFinished::ended_us, "us", "device's clock at the end"),
        field("held_us", &RunFinished::held_us, "us", "time the run waited for credit"));
  }
};

/// device -> host, event.
struct LogEvent {
  static constexpr MessageId kId = MessageId::kLogEvent;
  static constexpr std::string_view kName = "log_event";
  static constexpr std::string_view kMeaning = "A line of the device's log.";
  std::uint8_t level = 0;
  std::uint64_t device_time_us = 0;
  BoundedString<128> text{};
  static constexpr auto schema() {
    return fields(field("level", &LogEvent::level, "", "0 debug .. 4 error"),
                  field("device_time_us", &LogEvent::device_time_us, "us", "device's clock"),
                  field("text", &LogEvent::text, "", "the line"));
  }
};

/// device -> host, event.
struct FaultEvent {
  static constexpr MessageId kId = MessageId::kFaultEvent;
  static constexpr std::string_view kName = "fault_event";
  static constexpr std::string_view kMeaning = "Something is wrong with the device.";
  std::uint16_t fault = 0;
  std::uint64_t device_time_us = 0;
  BoundedString<128> text{};
  static constexpr auto schema() {
    return fields(field("fault", &FaultEvent::fault, "", "FaultCode"),
                  field("device_time_us", &FaultEvent::device_time_us, "us", "device's clock"),
                  field("text", &FaultEvent::text, "", "what happened"));
  }
};

/// host -> device, control.
struct GetStatus {
  static constexpr MessageId kId = MessageId::kGetStatus;
  static constexpr std::string_view kName = "get_status";
  static constexpr std::string_view kMeaning = "Asks how the device is.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct DeviceStatus {
  static constexpr MessageId kId = MessageId::kDeviceStatus;
  static constexpr std::string_view kName = "device_status";
  static constexpr std::string_view kMeaning = "State, temperatures, and counters that name what was lost.";
  std::uint8_t run_state = 0;
  std::uint64_t device_time_us = 0;
  std::int32_t sensor_temperature_mK = 0;
  std::int32_t led_temperature_mK = 0;
  std::uint32_t epoch = 0;
  std::uint32_t run_id = 0;
  std::uint32_t frames_good = 0;
  std::uint32_t frames_bad_header = 0;
  std::uint32_t frames_bad_payload = 0;
  std::uint32_t bytes_skipped = 0;
  std::uint32_t stale_session = 0;
  std::uint32_t duplicates = 0;
  std::uint32_t unknown_events = 0;
  std::uint16_t last_fault = 0;
  std::uint32_t calibration_records_recovered = 0;
  std::uint32_t worst_poll_us = 0;
  static constexpr auto schema() {
    return fields(
        field("run_state", &DeviceStatus::run_state, "", "RunState"),
        field("device_time_us", &DeviceStatus::device_time_us, "us", "device's clock"),
        field("sensor_temperature_mK", &DeviceStatus::sensor_temperature_mK, "mK", "of the sensor"),
        field("led_temperature_mK", &DeviceStatus::led_temperature_mK, "mK", "of the LED board"),
        field("epoch", &DeviceStatus::epoch, "", "settings epoch in force"),
        field("run_id", &DeviceStatus::run_id, "", "run under way, or the last one"),
        field("frames_good", &DeviceStatus::frames_good, "frames", "wire frames accepted"),
        field("frames_bad_header", &DeviceStatus::frames_bad_header, "frames",
              "wire frames with a wrong header checksum"),
        field("frames_bad_payload", &DeviceStatus::frames_bad_payload, "frames",
              "wire frames with a wrong payload checksum"),
        field("bytes_skipped", &DeviceStatus::bytes_skipped, "B", "while looking for a frame"),
        field("stale_session", &DeviceStatus::stale_session, "frames", "wrong nonce"),
        field("duplicates", &DeviceStatus::duplicates, "frames", "requests answered from the reply cache"),
        field("unknown_events", &DeviceStatus::unknown_events, "frames",
              "messages not known, other than requests"),
        field("last_fault", &DeviceStatus::last_fault, "", "FaultCode"),
        field("calibration_records_recovered", &DeviceStatus::calibration_records_recovered, "",
              "damaged records passed over at boot"),
        field("worst_poll_us", &DeviceStatus::worst_poll_us, "us",
              "longest turn of the main loop since boot"));
  }
};

/// host -> device, control.
struct CalibrationBegin {
  static constexpr MessageId kId = MessageId::kCalibrationBegin;
  static constexpr std::string_view kName = "calibration_begin";
  static constexpr std::string_view kMeaning = "Opens a calibration session.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct CalibrationBegun {
  static constexpr MessageId kId = MessageId::kCalibrationBegun;
  static constexpr std::string_view kName = "calibration_begun";
  static constexpr std::string_view kMeaning = "The calibration session is open.";
  std::uint32_t session = 0;
  std::uint8_t reference_stage = 0;
  static constexpr auto schema() {
    return fields(field("session", &CalibrationBegun::session, "", "number of this calibration session"),
                  field("reference_stage", &CalibrationBegun::reference_stage, "",
                        "1: the device places references itself"));
  }
};

/// host -> device, control.
struct CalibrationStep {
  static constexpr MessageId kId = MessageId::kCalibrationStep;
  static constexpr std::string_view kName = "calibration_step";
  static constexpr std::string_view kMeaning =
      "Brings a target under the instrument; PENDING while the stage moves.";
  std::uint32_t session = 0;
  Target target = Target::kWhiteReference;
  static constexpr auto schema() {
    return fields(field("session", &CalibrationStep::session, "", "calibration session"),
                  field("target", &CalibrationStep::target, "", "what to bring under the instrument"));
  }
};

/// device -> host.
struct CalibrationPlaced {
  static constexpr MessageId kId = MessageId::kCalibrationPlaced;
  static constexpr std::string_view kName = "calibration_placed";
  static constexpr std::string_view kMeaning = "The target is in place, or the user must place it.";
  std::uint8_t placed = 0;
  BoundedString<128> instruction{};
  static constexpr auto schema() {
    return fields(field("placed", &CalibrationPlaced::placed, "", "1: the stage placed it; 0: the user must"),
                  field("instruction", &CalibrationPlaced::instruction, "", "what the user must do"));
  }
};

/// host -> device, control.
struct CalibrationCommit {
  static constexpr MessageId kId = MessageId::kCalibrationCommit;
  static constexpr std::string_view kName = "calibration_commit";
  static constexpr std::string_view kMeaning = "Stores a manifest; the earlier one stays for undo.";
  std::uint32_t session = 0;
  CalibrationManifest manifest{};
  static constexpr auto schema() {
    return fields(field("session", &CalibrationCommit::session, "", "calibration session"),
                  field("manifest", &CalibrationCommit::manifest, "", "what to store"));
  }
};

/// host -> device, control.
struct CalibrationEnd {
  static constexpr MessageId kId = MessageId::kCalibrationEnd;
  static constexpr std::string_view kName = "calibration_end";
  static constexpr std::string_view kMeaning =
      "Closes the calibration session, committed or not; the sample comes back.";
  std::uint32_t session = 0;
  static constexpr auto schema() {
    return fields(field("session", &CalibrationEnd::session, "", "calibration session"));
  }
};

/// host -> device, control.
struct CalibrationList {
  static constexpr MessageId kId = MessageId::kCalibrationList;
  static constexpr std::string_view kName = "calibration_list";
  static constexpr std::string_view kMeaning = "Asks for the stored manifests.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct CalibrationListed {
  static constexpr MessageId kId = MessageId::kCalibrationListed;
  static constexpr std::string_view kName = "calibration_listed";
  static constexpr std::string_view kMeaning = "The stored manifests.";
  BoundedArray<CalibrationManifest, 8> manifests{};
  static constexpr auto schema() {
    return fields(field("manifests", &CalibrationListed::manifests, "", "newest first, factory last"));
  }
};

/// host -> device, control.
struct CalibrationQuery {
  static constexpr MessageId kId = MessageId::kCalibrationQuery;
  static constexpr std::string_view kName = "calibration_query";
  static constexpr std::string_view kMeaning = "Asks whether the calibration is good for a measurement now.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct CalibrationState {
  static constexpr MessageId kId = MessageId::kCalibrationState;
  static constexpr std::string_view kName = "calibration_state";
  static constexpr std::string_view kMeaning =
      "What can be used and what is needed; an ordinary result, not an error.";
  BoundedArray<CalibrationKindState, 8> states{};
  static constexpr auto schema() {
    return fields(field("states", &CalibrationState::states, "", "one per kind"));
  }
};

/// host -> device, control.
struct CalibrationUndo {
  static constexpr MessageId kId = MessageId::kCalibrationUndo;
  static constexpr std::string_view kName = "calibration_undo";
  static constexpr std::string_view kMeaning = "Makes the kind's previous manifest current again.";
  Target kind = Target::kWhiteReference;
  static constexpr auto schema() {
    return fields(field("kind", &CalibrationUndo::kind, "", "1 dark cap, 2 white, 3 black, 4 translucent"));
  }
};

/// host -> device, control.
struct CalibrationRestoreFactory {
  static constexpr MessageId kId = MessageId::kCalibrationRestoreFactory;
  static constexpr std::string_view kName = "calibration_restore_factory";
  static constexpr std::string_view kMeaning =
      "Forgets all session manifests; factory data are never touched.";
  static constexpr auto schema() { return fields(); }
};

/// host -> device, control.
struct KeyValueGet {
  static constexpr MessageId kId = MessageId::kKeyValueGet;
  static constexpr std::string_view kName = "key_value_get";
  static constexpr std::string_view kMeaning = "Reads a stored setting.";
  BoundedString<32> key{};
  static constexpr auto schema() { return fields(field("key", &KeyValueGet::key, "", "setting's name")); }
};

/// device -> host.
struct KeyValue {
  static constexpr MessageId kId = MessageId::kKeyValue;
  static constexpr std::string_view kName = "key_value";
  static constexpr std::string_view kMeaning = "A stored setting.";
  BoundedString<32> key{};
  BoundedString<64> value{};
  std::uint8_t read_only = 0;
  static constexpr auto schema() {
    return fields(field("key", &KeyValue::key, "", "setting's name"),
                  field("value", &KeyValue::value, "", "setting's value"),
                  field("read_only", &KeyValue::read_only, "", "1: cannot be written"));
  }
};

/// host -> device, control.
struct KeyValueSet {
  static constexpr MessageId kId = MessageId::kKeyValueSet;
  static constexpr std::string_view kName = "key_value_set";
  static constexpr std::string_view kMeaning = "Writes a stored setting.";
  BoundedString<32> key{};
  BoundedString<64> value{};
  static constexpr auto schema() {
    return fields(field("key", &KeyValueSet::key, "", "setting's name"),
                  field("value", &KeyValueSet::value, "", "setting's value"));
  }
};

/// host -> device, control.
struct Reboot {
  static constexpr MessageId kId = MessageId::kReboot;
  static constexpr std::string_view kName = "reboot";
  static constexpr std::string_view kMeaning = "Restarts the device; the reply comes before the reset.";
  static constexpr auto schema() { return fields(); }
};

/// host -> device, control.
struct ClockSync {
  static constexpr MessageId kId = MessageId::kClockSync;
  static constexpr std::string_view kName = "clock_sync";
  static constexpr std::string_view kMeaning = "Asks for the device clock, giving the host clock.";
  std::uint64_t host_time_us = 0;
  static constexpr auto schema() {
    return fields(
        field("host_time_us", &ClockSync::host_time_us, "us", "host's clock, Unix epoch; 0 = unknown"));
  }
};

/// device -> host.
struct ClockSynced {
  static constexpr MessageId kId = MessageId::kClockSynced;
  static constexpr std::string_view kName = "clock_synced";
  static constexpr std::string_view kMeaning = "Both clocks.";
  std::uint64_t host_time_us = 0;
  std::uint64_t device_time_us = 0;
  static constexpr auto schema() {
    return fields(field("host_time_us", &ClockSynced::host_time_us, "us", "as sent"),
                  field("device_time_us", &ClockSynced::device_time_us, "us", "device's clock"));
  }
};

/// host -> device, control.
struct UpdateBegin {
  static constexpr MessageId kId = MessageId::kUpdateBegin;
  static constexpr std::string_view kName = "update_begin";
  static constexpr std::string_view kMeaning =
      "Announces a firmware image by its signed header; the same header again resumes.";
  std::array<std::uint8_t, kImageHeaderBytes> header{};
  static constexpr auto schema() {
    return fields(field("header", &UpdateBegin::header, "", "the image's header, see image_header.h"));
  }
};

/// host -> device, control.
struct UpdateWrite {
  static constexpr MessageId kId = MessageId::kUpdateWrite;
  static constexpr std::string_view kName = "update_write";
  static constexpr std::string_view kMeaning = "A part of the image's body; idempotent by offset.";
  std::uint32_t offset = 0;
  TailBytes data{};
  static constexpr auto schema() {
    return fields(field("offset", &UpdateWrite::offset, "B", "of `data` in the body"),
                  field("data", &UpdateWrite::data, "", "the bytes"));
  }
};

/// host -> device, control.
struct UpdateFinish {
  static constexpr MessageId kId = MessageId::kUpdateFinish;
  static constexpr std::string_view kName = "update_finish";
  static constexpr std::string_view kMeaning =
      "The image is complete: verify it and mark it for the next boot.";
  static constexpr auto schema() { return fields(); }
};

/// host -> device, control.
struct UpdateConfirm {
  static constexpr MessageId kId = MessageId::kUpdateConfirm;
  static constexpr std::string_view kName = "update_confirm";
  static constexpr std::string_view kMeaning = "Keep the running image.";
  static constexpr auto schema() { return fields(); }
};

/// host -> device, control.
struct UpdateStatus {
  static constexpr MessageId kId = MessageId::kUpdateStatus;
  static constexpr std::string_view kName = "update_status";
  static constexpr std::string_view kMeaning = "Asks how far the update is.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct UpdateState {
  static constexpr MessageId kId = MessageId::kUpdateState;
  static constexpr std::string_view kName = "update_state";
  static constexpr std::string_view kMeaning = "How far the update is, and what both slots hold.";
  UpdatePhase phase = UpdatePhase::kIdle;
  std::uint32_t received = 0;
  BoundedString<32> running_version{};
  BoundedString<32> other_version{};
  std::uint8_t running_slot = 0;
  SlotVerdict running_verdict = SlotVerdict::kEmpty;
  SlotVerdict other_verdict = SlotVerdict::kEmpty;
  std::uint32_t running_counter = 0;
  std::uint32_t other_counter = 0;
  std::uint32_t lowest_counter = 0;
  std::uint32_t slot_bytes = 0;
  std::uint32_t chunk_bytes = 0;
  static constexpr auto schema() {
    using S = UpdateState;
    return fields(
        field("phase", &S::phase, "", "0 idle, 1 receiving, 2 ready, 3 trial"),
        field("received", &S::received, "B", "of the body: go on from here"),
        field("running_version", &S::running_version, "", "version of the running image"),
        field("other_version", &S::other_version, "", "version in the other slot, \"\" = none"),
        field("running_slot", &S::running_slot, "", "0 or 1; an image must be linked for the other one"),
        field("running_verdict", &S::running_verdict, "", "SlotVerdict of the running image"),
        field("other_verdict", &S::other_verdict, "", "SlotVerdict of the other slot"),
        field("running_counter", &S::running_counter, "", "security counter of the running image"),
        field("other_counter", &S::other_counter, "", "security counter in the other slot"),
        field("lowest_counter", &S::lowest_counter, "", "images below this are refused"),
        field("slot_bytes", &S::slot_bytes, "B", "largest body that fits"),
        field("chunk_bytes", &S::chunk_bytes, "B", "update_write sends this much, the last one less"));
  }
};

/// host -> device, control.
struct FaultRecordRead {
  static constexpr MessageId kId = MessageId::kFaultRecordRead;
  static constexpr std::string_view kName = "fault_record_read";
  static constexpr std::string_view kMeaning = "Asks for the snapshot of the last crash.";
  static constexpr auto schema() { return fields(); }
};

/// device -> host.
struct FaultRecord {
  static constexpr MessageId kId = MessageId::kFaultRecord;
  static constexpr std::string_view kName = "fault_record";
  static constexpr std::string_view kMeaning = "What the processor was doing when the firmware last crashed.";
  std::uint8_t present = 0;
  std::uint8_t reason = 0;
  std::uint8_t exception = 0;
  std::uint32_t boot_count = 0;
  std::uint64_t uptime_us = 0;
  std::uint32_t pc = 0;
  std::uint32_t lr = 0;
  std::uint32_t sp = 0;
  std::uint32_t psr = 0;
  std::uint32_t fault_status = 0;
  std::uint32_t hard_fault_status = 0;
  std::uint32_t fault_address = 0;
  BoundedString<32> build_id{};
  static constexpr auto schema() {
    using F = FaultRecord;
    return fields(field("present", &F::present, "", "0: there was no crash since power-on; the rest is 0"),
                  field("reason", &F::reason, "", "ResetReason: 2 watchdog, 3 fault"),
                  field("exception", &F::exception, "", "processor's exception number, 0 = none (watchdog)"),
                  field("boot_count", &F::boot_count, "", "boot in which it happened"),
                  field("uptime_us", &F::uptime_us, "us", "device's clock at the crash"),
                  field("pc", &F::pc, "", "program counter"), field("lr", &F::lr, "", "link register"),
                  field("sp", &F::sp, "", "stack pointer"), field("psr", &F::psr, "", "program status"),
                  field("fault_status", &F::fault_status, "", "CFSR"),
                  field("hard_fault_status", &F::hard_fault_status, "", "HFSR"),
                  field("fault_address", &F::fault_address, "", "MMFAR or BFAR when valid, else 0"),
                  field("build_id", &F::build_id, "", "firmware that crashed"));
  }
};

/// Every message, in the order of SPEC.md. A message that is not here does not exist.
using AllMessages =
    std::tuple<Hello, HelloReply, StatusReply, ObjectRead, ObjectChunk, GetConfiguration, Configuration,
               SetConfiguration, ConfigurationAccepted, Start, Started, Stop, Abort, RunReport, Credit,
               FrameBegin, FrameData, FrameEnd, RunFinished, LogEvent, FaultEvent, GetStatus, DeviceStatus,
               CalibrationBegin, CalibrationBegun, CalibrationStep, CalibrationPlaced, CalibrationCommit,
               CalibrationEnd, CalibrationList, CalibrationListed, CalibrationQuery, CalibrationState,
               CalibrationUndo, CalibrationRestoreFactory, KeyValueGet, KeyValue, KeyValueSet, Reboot,
               ClockSync, ClockSynced, UpdateBegin, UpdateWrite, UpdateFinish, UpdateConfirm, UpdateStatus,
               UpdateState, FaultRecordRead, FaultRecord>;

}  // namespace scatter::protocol
