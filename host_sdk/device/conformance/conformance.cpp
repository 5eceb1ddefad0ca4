#include "host_sdk/device/conformance/conformance.h"

#include <algorithm>
#include <array>

#include "host_sdk/device/conformance/check_functions.h"

namespace scatter::conformance {

namespace {

using CheckFunction = void (*)(Subject&, Judgement&);

// clang-format off
constexpr std::array kInfos{
    CheckInfo{"hello", "HELLO is answered with who answers and what was agreed.", "SPEC 6.1, 6.2", "Dispatcher::hello; Factory::descriptor"},
    CheckInfo{"payload-limit", "No payload is longer than agreed; an offer below 1024 bytes is refused.", "SPEC 6.3", "Link::max_payload; protocol::negotiate"},
    CheckInfo{"version-refusal", "A host of another wire major gets the one refusal whose bytes never change.", "SPEC 6.4", "protocol::negotiate; the refusal's sequence number"},
    CheckInfo{"before-hello", "Nothing but HELLO is served before HELLO.", "SPEC 5.6", "Link::connected; Dispatcher::on_frame"},
    CheckInfo{"sequence", "Sequence numbers start at 0 with each session and rise by one per channel.", "SPEC 1.9", "LinkOutput::begin_session; frames lost in Link::write"},
    CheckInfo{"stale-session", "Frames of another session are discarded and counted.", "SPEC 6.5", "Dispatcher::on_frame"},
    CheckInfo{"new-session-ends-run", "HELLO ends the session and the run before it.", "SPEC 6.1", "Acquisition::end_now; bytes left in the carrier's buffers"},
    CheckInfo{"one-reply", "Every request gets exactly one reply, in its own session and correlation.", "SPEC 5.1", "Dispatcher::execute; Link::write that takes less than it says"},
    CheckInfo{"repeated-request", "A repeated request is answered with the same bytes and executed once.", "SPEC 5.2", "protocol::ReplyCache"},
    CheckInfo{"unknown-messages", "An unknown request gets UNIMPLEMENTED; an unknown event is ignored and counted.", "SPEC 5.4", "Dispatcher::execute, on_event"},
    CheckInfo{"bad-payload", "A request whose payload is invalid gets INVALID_ARGUMENT.", "SPEC 4.2, 4.4, 5.5", "protocol/codec.h"},
    CheckInfo{"payload-evolution", "Missing trailing fields have their defaults; bytes behind the last field are ignored.", "SPEC 4.3, 4.5", "protocol/codec.h"},
    CheckInfo{"flags", "An unknown incompatible flag is refused, unknown compatible flags are ignored.", "SPEC 1.5, 1.6", "Dispatcher::on_refused"},
    CheckInfo{"garbage", "After garbage the next frame is served.", "SPEC 2.2, 2.3, 3.4", "protocol::LinkDecoder; Link::read that drops or repeats bytes"},
    CheckInfo{"damaged-frames", "A frame with a flipped bit is never answered, and costs no other frame.", "SPEC 2.2, 2.3", "protocol::parse_frame; a hardware CRC unit set up wrongly"},
    CheckInfo{"cut-frame", "A frame that is never finished does not keep the device from serving the next one for long.", "SPEC 2.5", "Instrument::receive; Clock"},
    CheckInfo{"descriptor", "The descriptor can be an instrument: ranges, optics that grow with theta, sources, certificates.", "SPEC 10; ports.h Factory", "the factory set of this unit"},
    CheckInfo{"objects", "Stored objects are read whole, with the checksum that every piece names.", "SPEC 10.1, 10.2; ports.h Factory", "Factory::object; flash that is not mapped for reading"},
    CheckInfo{"settings", "The serial number is readable and read-only; unknown settings are refused.", "SPEC 9 key_value", "firmware/core/settings.h"},
    CheckInfo{"clock", "The device's clock never goes back and keeps the host's pace.", "ports.h Clock", "the timer's prescaler; reading a 64-bit count in two halves"},
    CheckInfo{"temperatures", "Both thermometers read something plausible.", "ports.h Thermometer", "bus address and scale: values are mK, 293150 is 20 deg C"},
    CheckInfo{"configuration", "Recipes in range are taken, others refused without effect; each accepted one gets the next epoch.", "SPEC 7.3; ports.h Sensor", "ScanPlan::make; the descriptor's exposure range"},
    CheckInfo{"pattern-mono16", "The counter pattern arrives exactly, 16 bits per pixel.", "SPEC 7.5", "RowPacker; Link::write"},
    CheckInfo{"pattern-mono10p", "The counter pattern arrives exactly, 10 bits per pixel.", "SPEC 7.5", "RowPacker; Link::write"},
    CheckInfo{"pattern-mono12p", "The counter pattern arrives exactly, 12 bits per pixel.", "SPEC 7.5", "RowPacker; Link::write"},
    CheckInfo{"window", "Any window on the sensor is taken and comes as asked for.", "SPEC 9 set_configuration; ports.h Sensor", "Sensor::trigger: round out to what the sensor can and crop; DMA lengths"},
    CheckInfo{"illuminations", "Every illumination lights its LED for its exposure, and none is lit for LED-off frames.", "ports.h Illuminator, Monitor, Sensor", "LED wiring and order; the monitor's gain; the sensor's strobe"},
    CheckInfo{"run-completed", "A run that completes accounts for every exposure.", "SPEC 7.4", "Acquisition's ledger; Sensor::read_rows that fails"},
    CheckInfo{"run-stopped", "A run that is stopped accounts for every exposure.", "SPEC 7.4", "Acquisition::stop; Sensor::release"},
    CheckInfo{"run-aborted", "A run that is aborted accounts for every exposure.", "SPEC 7.4", "Acquisition::end_now; Sensor::release during an exposure"},
    CheckInfo{"run-order", "A second start and a new configuration are refused while a run is on; run ids rise by one.", "SPEC 7.3, 9 start", "dispatcher_run.cpp"},
    CheckInfo{"credit-hold", "Without credit a run holds its next exposure, says so, and goes on when it is granted.", "SPEC 7.1, 7.6", "Acquisition::credit, step"},
    CheckInfo{"live-preview", "Without credit a live preview drops whole frames and counts them.", "SPEC 7.6", "Acquisition::drop_frame"},
    CheckInfo{"stop-latency", "Stop overtakes pixels: 99 of 100 end within 100 ms on a link that carries a frame in 20 ms.", "SPEC 7.7", "buffers between LinkOutput and the wire"},
    CheckInfo{"round-trip", "Time from a request to its reply; no limit.", "SPEC 5.1", "the carrier"},
    CheckInfo{"throughput", "Bytes per second of the test pattern; no limit.", "SPEC 7.5", "Link::write; DMA to the carrier"},
    CheckInfo{"calibration-rules", "Stored calibrations are listed newest first, judged, and not changed by refused requests.", "SPEC 9 calibration_*", "dispatcher_calibration.cpp; ports.h Flash"},
    CheckInfo{"fault-record", "The snapshot of the last crash can be read.", "SPEC 9 fault_record; ports.h Reset", "Reset::fault_record; RAM that start-up code clears"},
    CheckInfo{"update-refusals", "Images of another product or with a wrong signature are refused before anything is erased.", "SPEC 9 update_begin; ports.h ImageSlots, Verifier", "UpdateReceiver; Verifier::verify"},
    CheckInfo{"settings-persist", "A setting survives a restart, which is counted and has a reason.", "ports.h Flash, Reset", "Flash::program, erase; Reset::reason", true},
    CheckInfo{"calibration-persists", "Calibrations survive a restart, and undo brings back the earlier one.", "SPEC 9 calibration_undo; ports.h Flash", "Flash::program, erase", true},
    CheckInfo{"main-loop", "No turn of the main loop comes near the watchdog's time.", "ports.h Watchdog; firmware/core/step.h", "port calls that wait: they must return at once"},
};
constexpr std::array<CheckFunction, kInfos.size()> kFunctions{
    check_hello, check_payload_limit, check_version_refusal, check_before_hello, check_sequence, check_stale_session,
    check_new_session_ends_run, check_one_reply, check_repeated_request, check_unknown_messages, check_bad_payload,
    check_payload_evolution, check_flags, check_garbage, check_damaged_frames, check_cut_frame, check_descriptor,
    check_objects, check_settings, check_clock, check_temperatures, check_configuration, check_pattern_mono16,
    check_pattern_mono10p, check_pattern_mono12p, check_window, check_illuminations, check_run_completed,
    check_run_stopped, check_run_aborted, check_run_order, check_credit_hold, check_live_preview, check_stop_latency,
    check_round_trip, check_throughput, check_calibration_rules, check_fault_record, check_update_refusals,
    check_settings_persist, check_calibration_persists, check_main_loop};
// clang-format on

}  // namespace

std::string_view name(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kPassed:
      return "passed";
    case Verdict::kFailed:
      return "failed";
    case Verdict::kMeasured:
      return "measured";
    case Verdict::kSkipped:
      return "skipped";
  }
  return "failed";
}

std::span<const CheckInfo> checks() noexcept {
  return kInfos;
}

std::size_t Report::count(Verdict verdict) const noexcept {
  return static_cast<std::size_t>(std::ranges::count(findings, verdict, &Finding::verdict));
}

Result<Report> run(const Options& options) {
  for (const std::string& wanted : options.only) {
    if (std::ranges::find(kInfos, wanted, &CheckInfo::name) == kInfos.end()) {
      return fail(ErrorCode::kInvalidArgument, "there is no check '" + wanted + "'",
                  "choose from scatter conform --list");
    }
  }
  Subject subject(options);
  // Whoever cannot be reached at all is not a device that fails.
  if (const auto reached = subject.descriptor(); !reached) {
    const ErrorCode code = reached.error().code;
    if (code != ErrorCode::kDataLoss && code != ErrorCode::kDeadlineExceeded &&
        code != ErrorCode::kVersionMismatch) {
      return std::unexpected(reached.error());
    }
  }
  Report report;
  for (std::size_t i = 0; i < kInfos.size(); ++i) {
    const CheckInfo& info = kInfos[i];
    if (!options.only.empty() && std::ranges::find(options.only, info.name) == options.only.end()) {
      continue;
    }
    if (options.progress) {
      options.progress(static_cast<double>(i) / kInfos.size(), info.name);
    }
    Judgement judge;
    if (info.writes && !options.write) {
      judge.skip("changes what the device remembers (and puts it back): runs with --write only");
    } else {
      kFunctions[i](subject, judge);
    }
    if (options.stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "stopped on request", "start again when ready");
    }
    Finding finding = judge.finding();
    finding.check = info;
    report.findings.push_back(std::move(finding));
  }
  return report;
}

}  // namespace scatter::conformance
