// A device that breaks one rule fails the check that proves it. The device is the simulated instrument behind
// a carrier that tampers; what it does to the frames is what the row says.
#include <algorithm>
#include <map>

#include "protocol/crc.h"
#include "tests/conformance/suite.h"
#include "tests/conformance/tampering_transport.h"

using namespace scatter;
using namespace scatter::conformance_test;
using namespace scatter::protocol;

namespace {

using Frames = std::vector<Passing>;

struct Breach {
  std::string_view check;
  std::string_view what;
  /// Made anew for each connection (the first one asks for the descriptor, before any check). `memory`
  /// outlives connections: what a broken device remembers.
  std::function<Tampering(std::map<std::string, std::uint64_t>& memory)> device;
  std::string_view query = "seed=3";
};

/// Changes every message M on its way to the host.
template <Message M, typename Change>
auto on(Change change) {
  return [change](std::map<std::string, std::uint64_t>&) {
    return Tampering{.to_host =
                         [change](Passing frame) {
                           (void)frame.change<M>(change);
                           return Frames{std::move(frame)};
                         },
                     .to_device = {}};
  };
}

/// Changes the n-th message M (from 0) of each connection.
template <Message M, typename Change>
auto on_nth(int n, Change change) {
  return [n, change](std::map<std::string, std::uint64_t>&) {
    auto seen = std::make_shared<int>(0);
    return Tampering{.to_host =
                         [n, change, seen](Passing frame) {
                           if (frame.id() == M::kId && (*seen)++ == n) {
                             (void)frame.change<M>(change);
                           }
                           return Frames{std::move(frame)};
                         },
                     .to_device = {}};
  };
}

/// Changes the descriptor, which comes in pieces: the first piece is decoded, changed, encoded and completed.
template <typename Change>
auto with_descriptor(Change change) {
  return on<ObjectChunk>([change](ObjectChunk& chunk) {
    static Bytes changed;
    Descriptor descriptor;
    if (chunk.object != 1 || chunk.offset != 0 || chunk.data.size() != chunk.total ||
        !decode_into(chunk.data, descriptor)) {
      return;
    }
    change(descriptor);
    changed.assign(encoded_size(descriptor), std::byte{});
    (void)encode(descriptor, std::span(changed));
    chunk.data = std::span<const std::byte>(changed);
    chunk.total = static_cast<std::uint32_t>(changed.size());
    chunk.object_crc = crc32c(changed);
  });
}

/// Anything done to frames to the host or to the device.
auto to_host(Tamper tamper) {
  return [tamper = std::move(tamper)](std::map<std::string, std::uint64_t>&) {
    return Tampering{.to_host = tamper, .to_device = {}};
  };
}
auto to_device(Tamper tamper) {
  return [tamper = std::move(tamper)](std::map<std::string, std::uint64_t>&) {
    return Tampering{.to_host = {}, .to_device = tamper};
  };
}

const std::vector<Breach>& breaches() {
  static const std::vector<Breach> kBreaches =
      {
          {"hello", "answers without a serial number",
           on<HelloReply>([](HelloReply& r) { r.serial = std::string_view(); })},
          {"hello", "puts another nonce into its frames", to_host([](Passing frame) {
             frame.header.session = static_cast<std::uint16_t>(
                 frame.id() == MessageId::kDeviceStatus ? frame.header.session + 1 : frame.header.session);
             return Frames{std::move(frame)};
           })},
          {"payload-limit", "agrees to more than was offered",
           on<HelloReply>([](HelloReply& r) { r.max_payload = 16384; })},
          {"payload-limit", "takes an offer below 1024 bytes", to_device([](Passing frame) {
             (void)frame.change<Hello>([](Hello& h) { h.max_payload = std::max(h.max_payload, 1024U); });
             return Frames{std::move(frame)};
           })},
          {"version-refusal", "words the frozen refusal in another way",
           on<StatusReply>([](StatusReply& r) { r.text = std::string_view("wire version not supported"); })},
          {"version-refusal", "numbers the frozen refusal", to_host([](Passing frame) {
             frame.header.sequence += frame.id() == MessageId::kStatusReply ? 3 : 0;
             return Frames{std::move(frame)};
           })},
          {"before-hello", "serves a request before HELLO", to_host([](Passing frame) {
             if (frame.id() == MessageId::kStatusReply) {
               frame.header.message = static_cast<std::uint16_t>(MessageId::kDeviceStatus);
               frame.payload.assign(encoded_size(DeviceStatus{}), std::byte{});
             }
             return Frames{std::move(frame)};
           })},
          {"sequence", "does not count its control frames", to_host([](Passing frame) {
             frame.header.sequence = frame.header.channel == Channel::kControl ? 0 : frame.header.sequence;
             return Frames{std::move(frame)};
           })},
          {"stale-session", "serves frames of any session",
           [](std::map<std::string, std::uint64_t>&) {
             auto session = std::make_shared<std::uint16_t>(0);
             return Tampering{.to_host = {}, .to_device = [session](Passing frame) {
                                if (frame.id() == MessageId::kHello) {
                                  *session = frame.header.session;
                                }
                                frame.header.session = *session;
                                return Frames{std::move(frame)};
                              }};
           }},
          {"stale-session", "does not count stale frames",
           on<DeviceStatus>([](DeviceStatus& s) { s.stale_session = 0; })},
          {"new-session-ends-run", "goes on with the run after a new HELLO",
           on_nth<HelloReply>(1, [](HelloReply& r) { r.run_state = 1; })},
          {"one-reply", "answers twice", to_host([](Passing frame) {
             return frame.id() == MessageId::kKeyValue ? Frames{frame, frame} : Frames{frame};
           })},
          {"one-reply", "does not answer", to_host([](Passing frame) {
             return frame.id() == MessageId::kCalibrationListed ? Frames{} : Frames{frame};
           })},
          {"one-reply", "answers with another correlation", to_host([](Passing frame) {
             frame.header.correlation ^=
                 frame.id() == MessageId::kObjectChunk ? std::uint16_t{0x4000} : std::uint16_t{0};
             return Frames{std::move(frame)};
           })},
          {"repeated-request", "executes a repeated request again",
           [](std::map<std::string, std::uint64_t>&) {
             auto correlation = std::make_shared<std::uint16_t>(0x4000);
             auto asked = std::make_shared<std::map<std::uint16_t, std::uint16_t>>();
             // Gives each copy a correlation of its own, and the reply the one that was asked with.
             return Tampering{.to_host =
                                  [asked](Passing frame) {
                                    if (const auto found = asked->find(frame.header.correlation);
                                        found != asked->end()) {
                                      frame.header.correlation = found->second;
                                    }
                                    return Frames{std::move(frame)};
                                  },
                              .to_device =
                                  [asked, correlation](Passing frame) {
                                    if (frame.id() == MessageId::kSetConfiguration) {
                                      (*asked)[++*correlation] = frame.header.correlation;
                                      frame.header.correlation = *correlation;
                                    }
                                    return Frames{std::move(frame)};
                                  }};
           }},
          {"unknown-messages", "answers unknown requests with NOT_FOUND",
           on<StatusReply>([](StatusReply& r) { r.status = StatusCode::kNotFound; })},
          {"unknown-messages", "does not count unknown events",
           on<DeviceStatus>([](DeviceStatus& s) { s.unknown_events = 0; })},
          {"bad-payload", "takes invalid payloads",
           on<StatusReply>([](StatusReply& r) { r.status = StatusCode::kOk; })},
          {"payload-evolution", "refuses bytes behind the last field", to_device([](Passing frame) {
             frame.payload.resize(frame.payload.size() > 40 && frame.id() == MessageId::kObjectRead
                                      ? 3
                                      : frame.payload.size());
             return Frames{std::move(frame)};
           })},
          {"flags", "refuses what it should ignore", to_host([](Passing frame) {
             (void)frame.change<StatusReply>([](StatusReply& r) { r.status = StatusCode::kUnimplemented; });
             return Frames{std::move(frame)};
           })},
          {"garbage", "stays out of step after garbage",
           [](std::map<std::string, std::uint64_t>&) {
             auto served = std::make_shared<int>(0);
             return Tampering{.to_host = {}, .to_device = [served](Passing frame) {
                                return ++*served > 2 ? Frames{} : Frames{std::move(frame)};
                              }};
           }},
          {"damaged-frames", "answers damaged frames", to_host([](Passing frame) {
             if (frame.id() != MessageId::kKeyValue) {
               return Frames{frame};
             }
             Passing other = frame;
             other.header.correlation = static_cast<std::uint16_t>(other.header.correlation - 1);
             return Frames{other, frame};
           })},
          {"damaged-frames", "loses the frame behind a damaged one", to_host([](Passing frame) {
             return frame.id() == MessageId::kKeyValue ? Frames{} : Frames{frame};
           })},
          {"cut-frame", "waits for ever for the rest of a frame",
           [](std::map<std::string, std::uint64_t>&) {
             return Tampering{.to_host = {}, .to_device = [](Passing frame) {
                                return frame.id() == MessageId::kGetStatus ? Frames{}
                                                                           : Frames{std::move(frame)};
                              }};
           }},
          {"descriptor", "has optics whose image folds back",
           with_descriptor([](Descriptor& d) { d.optics.a3 = -5; })},
          {"descriptor", "has an empty range of exposures",
           with_descriptor([](Descriptor& d) { d.sensor.min_exposure_us = d.sensor.max_exposure_us + 1; })},
          {"descriptor", "has one head in two places",
           with_descriptor([](Descriptor& d) { d.illuminations[0].theta_rad += 0.1F; })},
          {"descriptor", "names a stage in the descriptor only", on<HelloReply>([](HelloReply& r) {
             r.capabilities &= ~std::uint32_t{kCapabilityReferenceStage};
           })},
          {"descriptor", "calls a sample a certified reference",
           with_descriptor([](Descriptor& d) { d.certificates[0].kind = Target::kSample; })},
          {"objects", "sends an object with another checksum",
           on<ObjectChunk>([](ObjectChunk& chunk) { chunk.object_crc ^= chunk.object == 2 ? 1U : 0U; })},
          {"objects", "has an object for every number",
           on<StatusReply>([](StatusReply& r) { r.status = StatusCode::kUnavailable; })},
          {"settings", "lets the serial number be written",
           on<StatusReply>([](StatusReply& r) { r.status = StatusCode::kOk; })},
          {"settings", "shows another serial number",
           on<KeyValue>([](KeyValue& v) { v.value = std::string_view("000000"); })},
          {"clock", "has a clock that goes back",
           on_nth<ClockSynced>(20, [](ClockSynced& c) { c.device_time_us = 0; })},
          {"clock", "has a clock that runs twice as fast",
           on<ClockSynced>([](ClockSynced& c) { c.device_time_us *= 2; })},
          {"temperatures", "has no thermometer",
           on<DeviceStatus>([](DeviceStatus& s) { s.led_temperature_mK = 0; })},
          {"configuration", "takes what it cannot do", to_device([](Passing frame) {
             (void)frame.change<SetConfiguration>([](SetConfiguration& s) {
               s.recipe.repeats = std::max<std::uint16_t>(s.recipe.repeats, 1);
             });
             return Frames{std::move(frame)};
           })},
          {"configuration", "keeps the settings epoch",
           on<ConfigurationAccepted>([](ConfigurationAccepted& c) { c.epoch = 7; })},
          {"pattern-mono16", "has a stuck pixel bit", to_host([](Passing frame) {
             if (frame.id() == MessageId::kFrameData) {
               frame.payload.back() |= std::byte{0x02};
             }
             return Frames{std::move(frame)};
           })},
          {"pattern-mono10p", "ends packed frames a byte late",
           on<FrameBegin>([](FrameBegin& b) { b.total += 1; })},
          {"pattern-mono12p", "calls packed frames unpacked",
           on<FrameBegin>([](FrameBegin& b) { b.pixel_format = PixelFormat::kMono16; })},
          {"window", "moves the window to where it can",
           on<FrameBegin>([](FrameBegin& b) { b.x = static_cast<std::uint16_t>(b.x & ~std::uint16_t{3}); })},
          {"illuminations", "has a dead LED",
           on<FrameBegin>([](FrameBegin& b) { b.monitor_uv = b.illumination == 2 ? 0 : b.monitor_uv; })},
          {"illuminations", "leaves an LED on for LED-off frames", on<FrameBegin>([](FrameBegin& b) {
             b.monitor_uv = b.illumination == 255 ? 400'000 : b.monitor_uv;
           })},
          {"illuminations", "has two LEDs exchanged", on<FrameBegin>([](FrameBegin& b) {
             b.illumination = b.illumination == 1 ? 0 : b.illumination == 0 ? 1 : b.illumination;
           })},
          {"run-completed", "forgets an exposure",
           on<RunFinished>([](RunFinished& r) { --r.ledger.exposed; })},
          {"run-completed", "loses a frame without saying so", to_host([](Passing frame) {
             const auto end = decode<FrameEnd>(std::span<const std::byte>(frame.payload));
             const bool third = frame.id() == MessageId::kFrameEnd && end && end->frame_id == 3;
             return third ? Frames{} : Frames{std::move(frame)};
           })},
          {"run-stopped", "does not say that it was stopped",
           on<RunReport>([](RunReport& r) { r.reason = 0; })},
          {"run-aborted", "forgets the frame that an abort cuts off",
           on<RunReport>([](RunReport& r) { r.ledger.exposed += 1; })},
          {"run-order", "starts with any settings epoch",
           [](std::map<std::string, std::uint64_t>&) {
             auto epoch = std::make_shared<std::uint32_t>(0);
             return Tampering{.to_host =
                                  [epoch](Passing frame) {
                                    if (const auto accepted = decode<ConfigurationAccepted>(
                                            std::span<const std::byte>(frame.payload));
                                        frame.id() == MessageId::kConfigurationAccepted && accepted) {
                                      *epoch = accepted->epoch;
                                    }
                                    return Frames{std::move(frame)};
                                  },
                              .to_device =
                                  [epoch](Passing frame) {
                                    (void)frame.change<Start>([&](Start& s) { s.epoch = *epoch; });
                                    return Frames{std::move(frame)};
                                  }};
           }},
          {"run-order", "gives run ids twice", on<Started>([](Started& s) { s.run_id = 1; })},
          {"credit-hold", "sends without credit", to_device([](Passing frame) {
             (void)frame.change<Start>([](Start& s) { s.may_send_until = 1000; });
             return Frames{std::move(frame)};
           })},
          {"credit-hold", "does not report the time held",
           on<RunFinished>([](RunFinished& r) { r.held_us = 0; })},
          {"live-preview", "holds a live preview", to_device([](Passing frame) {
             (void)frame.change<SetConfiguration>([](SetConfiguration& s) { s.recipe.live_preview = 0; });
             return Frames{std::move(frame)};
           })},
          {"live-preview", "does not count what it drops",
           on<RunFinished>([](RunFinished& r) { r.ledger.lost_firmware = 0; })},
          {"stop-latency", "stops when the run is over",
           to_device(
               [](Passing frame) {
                 (void)frame.change<SetConfiguration>([](SetConfiguration& s) { s.recipe.repeats = 150; });
                 return frame.id() == MessageId::kStop ? Frames{} : Frames{std::move(frame)};
               })},
          {"calibration-rules", "says nothing of what to do",
           on<CalibrationState>(
               [](CalibrationState& s) {
                 for (auto& state : s.states) {
                   state.action = std::string_view();
                 }
               })},
          {"calibration-rules", "takes commits outside a session",
           to_host(
               [](Passing frame) {
                 (void)frame.change<StatusReply>([](StatusReply& r) { r.status = StatusCode::kOk; });
                 return Frames{std::move(frame)};
               })},
          {"fault-record", "keeps a record of no crash",
           on<FaultRecord>([](FaultRecord& r) { r.pc = 0x0800'1234; })},
          {"update-refusals", "starts to receive an image that nobody signed",
           to_host(
               [](Passing frame) {
                 (void)frame.change<StatusReply>([](StatusReply& r) { r.status = StatusCode::kOk; });
                 return Frames{std::move(frame)};
               })},
          {"update-refusals", "erases before it checks",
           on_nth<UpdateState>(1, [](UpdateState& s) { s.other_verdict = SlotVerdict::kUnreadable; })},
          {"settings-persist", "forgets settings at a restart",
           [](std::map<std::string, std::uint64_t>& memory) {
             const std::uint64_t connection = memory["connections"]++;
             return Tampering{.to_host =
                                  [connection](Passing frame) {
                                    (void)frame.change<KeyValue>([&](KeyValue& v) {
                                      v.value = connection > 1 ? std::string_view() : v.value.str();
                                    });
                                    return Frames{std::move(frame)};
                                  },
                              .to_device = {}};
           }},
          {"settings-persist", "does not know why it restarted",
           on<HelloReply>([](HelloReply& r) { r.reset_reason = 0; })},
          {"calibration-persists", "forgets calibrations at a restart",
           [](std::map<std::string, std::uint64_t>& memory) {
             const std::uint64_t connection = memory["connections"]++;
             return Tampering{.to_host =
                                  [connection](Passing frame) {
                                    (void)frame.change<CalibrationListed>([&](CalibrationListed& l) {
                                      l.manifests.resize(connection > 1 ? 0 : l.manifests.size());
                                    });
                                    return Frames{std::move(frame)};
                                  },
                              .to_device = {}};
           }},
          {"calibration-persists", "undoes nothing", to_device([](Passing frame) {
             frame.header.message = static_cast<std::uint16_t>(
                 frame.id() == MessageId::kCalibrationUndo ? MessageId::kGetStatus : frame.id());
             return Frames{std::move(frame)};
           })},
          {"main-loop", "has turns as long as the watchdog's time",
           on<DeviceStatus>([](DeviceStatus& s) { s.worst_poll_us = 1'200'000; })},
      };
  return kBreaches;
}

conformance::Verdict verdict_of(const Breach& breach, bool broken, std::string& trouble) {
  const auto instrument = instrument_of(breach.query);
  auto memory = std::make_shared<std::map<std::string, std::uint64_t>>();
  conformance::Options options = options_for(instrument);
  if (broken) {
    options.open = [&breach, instrument,
                    memory](const device::Wait&) -> Result<std::unique_ptr<device::Transport>> {
      return tampered(tools::make_sim_transport(instrument), breach.device(*memory));
    };
  }
  options.only = {std::string(breach.check)};
  options.write = true;
  const auto report = conformance::run(options);
  REQUIRE(report.has_value());
  REQUIRE(report->findings.size() == 1);
  trouble = report->findings[0].trouble;
  return report->findings[0].verdict;
}

}  // namespace

TEST_CASE("A device that breaks a rule fails the check of that rule, and only because it breaks it") {
  for (const Breach& breach : breaches()) {
    INFO("a device that " << breach.what);
    std::string trouble;
    CHECK(verdict_of(breach, false, trouble) != conformance::Verdict::kFailed);
    INFO(breach.check << ": " << trouble);
    const auto verdict = verdict_of(breach, true, trouble);
    INFO(trouble);
    CHECK(verdict == conformance::Verdict::kFailed);
    CHECK_FALSE(trouble.empty());
  }
}

TEST_CASE("Every check that can fail is shown to fail") {
  for (const conformance::CheckInfo& check : conformance::checks()) {
    INFO(check.name);
    const bool only_measures = check.name == "round-trip" || check.name == "throughput";
    CHECK(only_measures !=
          std::ranges::any_of(breaches(), [&](const Breach& b) { return b.check == check.name; }));
  }
}
