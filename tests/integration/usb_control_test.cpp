// What still works while the bulk pipe is full or stuck: requests, the rescue channel, the button.
#include <algorithm>

#include "protocol/rescue_report.h"
#include "protocol/usb_identity.h"
#include "simulator/instrument/virtual_board.h"
#include "simulator/usb/in_pipe.h"
#include "tests/integration/rig.h"
#include "tests/integration/usb_rig.h"

using namespace scatter;
using namespace scatter::integration;
using protocol::RescueCommand;
using protocol::RescueStatus;
using usb_test::Bytes;
using usb_test::PortHost;

namespace usb = protocol::usb;

namespace {

constexpr std::uint8_t kGetReport = 1;  // HID 1.11, section 7.2.
constexpr std::uint16_t kFeatureReport = 0x0300;
constexpr std::uint8_t kClassFromInterface = 0xA1;

Bytes report_of(const protocol::RescueRequest& request) {
  protocol::Report bytes{};
  encode(request, bytes);
  return {bytes.begin(), bytes.end()};
}

/// Input reports until one is of kind R and `wanted` takes it.
template <typename R, typename Decode, typename Wanted>
std::optional<R> input(PortHost& host, const Decode& decode, const Wanted& wanted) {
  for (int i = 0; i < 20; ++i) {
    const std::uint64_t id = host.submit_in(usb::kRescueIn, usb::kRescuePacket);
    const auto completion = host.wait_for(id, 500'000);
    if (!completion) {
      host.cancel(id);
      return std::nullopt;
    }
    if (const auto report = decode(completion->data); report && wanted(*report)) {
      return report;
    }
  }
  return std::nullopt;
}

std::optional<RescueStatus> status_when(PortHost& host,
                                        const std::function<bool(const RescueStatus&)>& wanted) {
  return input<RescueStatus>(host, protocol::decode_rescue_status, wanted);
}

std::optional<protocol::RescueAnswer> ask(PortHost& host, RescueCommand command, std::uint8_t tag) {
  const std::uint64_t id = host.submit_out(usb::kRescueOut, report_of({.command = command, .tag = tag}));
  REQUIRE(host.wait_for(id).has_value());
  return input<protocol::RescueAnswer>(
      host, protocol::decode_rescue_answer,
      [tag](const protocol::RescueAnswer& answer) { return answer.tag == tag; });
}

/// The host's program does something else for so long, and the instrument goes on.
void host_is_busy(simulator::VirtualInstrument& instrument, std::uint64_t duration_us) {
  const std::uint64_t end = instrument.now_us() + duration_us;
  while (instrument.now_us() < end) {
    const std::uint64_t wake = instrument.run_ready();
    instrument.advance_to(std::min(wake, end));
  }
}

/// A host's program that has started an endless run and reads nothing more.
struct StuckStream {
  explicit StuckStream(const std::shared_ptr<simulator::VirtualInstrument>& instrument) : host(instrument) {
    REQUIRE(host.open_stream());
    say(protocol::Hello{});
    REQUIRE(heard<protocol::HelloReply>());
    protocol::Recipe recipe = pattern_recipe(50'000);
    say(protocol::SetConfiguration{.recipe = recipe});
    const auto accepted = heard<protocol::ConfigurationAccepted>();
    REQUIRE(accepted);
    say(protocol::Start{.epoch = accepted->epoch, .may_send_until = 50'000});
    REQUIRE(heard<protocol::Started>());
    host_is_busy(*instrument, 1'000'000);
    REQUIRE(instrument->board().usb()->waiting(usb::kBulkIn) == simulator::InPipe::kBulkCapacity);
  }
  template <typename M>
  void say(const M& message, protocol::Channel channel = protocol::Channel::kControl) {
    Bytes bytes(protocol::kMaxFrameBytes);
    bytes.resize(protocol::write_message(
        bytes, {.channel = channel, .sequence = sequence++, .session = 7, .correlation = ++correlation},
        message));
    REQUIRE(host.wait_for(host.submit_out(usb::kBulkOut, bytes)).has_value());
  }
  template <typename M>
  std::optional<M> heard() {
    for (int i = 0; i < 20; ++i) {
      const auto completion = host.wait_for(host.submit_in(usb::kBulkIn, usb::kTransferBytes));
      if (!completion) {
        return std::nullopt;
      }
      const auto parsed = protocol::parse_frame(completion->data);
      if (parsed.frame) {
        if (const auto message = parsed.frame->as<M>()) {
          return *message;
        }
      }
    }
    return std::nullopt;
  }
  PortHost host;
  std::uint32_t sequence = 0;
  std::uint16_t correlation = 0;
};

}  // namespace

TEST_CASE("A reply overtakes a stream that fills the link: few bytes come between request and reply") {
  const auto instrument = usb_instrument_of("");
  auto device = open_usb(instrument);
  REQUIRE(device.has_value());
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(100);
  recipe.repeats = 60;
  recipe.test_pattern = 1;
  REQUIRE(device->configure(recipe).has_value());
  auto stream = device->start({.credit_window = 64});
  REQUIRE(stream.has_value());
  // What can lie between: the device's queue, the host's sixteen transfers, the frame under way and the next.
  constexpr std::uint64_t kMost = simulator::InPipe::kBulkCapacity + (16 + 2) * usb::kTransferBytes;
  std::uint64_t full = 0;
  for (int i = 0; i < 50; ++i) {
    REQUIRE(stream->next().has_value());
    host_is_busy(*instrument, 200'000);
    full += instrument->board().usb()->waiting(usb::kBulkIn) == simulator::InPipe::kBulkCapacity ? 1 : 0;
    const std::uint64_t before = device->link_statistics().bytes;
    REQUIRE(device->status().has_value());
    CHECK(device->link_statistics().bytes - before <= kMost);
  }
  CHECK(full > 25);  // Else nothing was shown.
}

TEST_CASE("A clean stream over USB copies each pixel once and nothing else") {
  auto device = open_usb(usb_instrument_of(""));
  REQUIRE(device.has_value());
  const Outcome outcome = run(*device, pattern_recipe(50));
  CHECK(outcome.complete == 50);
  CHECK(outcome.summary.link.copied_bytes == 0);
  CHECK(outcome.summary.link.pixel_bytes == 50U * outcome.frames[0].size_bytes);
}

TEST_CASE("The rescue channel answers while the bulk pipe is stuck, and ends the run") {
  const auto instrument = usb_instrument_of("");
  StuckStream stuck(instrument);
  PortHost& host = stuck.host;
  const Bytes feature = host.control_in({.type = kClassFromInterface,
                                         .request = kGetReport,
                                         .value = kFeatureReport,
                                         .index = usb::kRescueInterface},
                                        usb::kRescuePacket);
  const auto busy = protocol::decode_rescue_status(feature);
  REQUIRE(busy.has_value());
  CHECK(busy->session_open);
  CHECK(busy->run_state == static_cast<std::uint8_t>(protocol::RunState::kRunning));
  const auto answer = ask(host, RescueCommand::kAbort, 42);
  REQUIRE(answer.has_value());
  CHECK(answer->status == protocol::StatusCode::kOk);
  CHECK(status_when(host, [](const RescueStatus& status) {
    return status.run_state == static_cast<std::uint8_t>(protocol::RunState::kIdle);
  }));
}

TEST_CASE("The rescue channel restarts an instrument whose bulk pipe is stuck") {
  const auto instrument = usb_instrument_of("");
  StuckStream stuck(instrument);
  const std::uint32_t joins = instrument->usb()->joins();
  const auto answer = ask(stuck.host, RescueCommand::kReboot, 1);
  REQUIRE(answer.has_value());
  CHECK(answer->status == protocol::StatusCode::kOk);
  stuck.host.run_for(1'000'000);
  CHECK(instrument->usb()->joins() == joins + 1);
  auto device = open_usb(instrument);
  REQUIRE(device.has_value());
  CHECK(device->hello().reset_reason == static_cast<std::uint8_t>(protocol::ResetReason::kRequested));
}

TEST_CASE("A press of the measure button reaches the host by itself, and counts from the restart") {
  const auto instrument = usb_instrument_of("");
  PortHost host(instrument);
  REQUIRE((host.plug() && host.enumerate()));
  const auto pressed = [](std::uint32_t times) {
    return [times](const RescueStatus& status) { return status.button_presses == times; };
  };
  instrument->press_button();
  CHECK(status_when(host, pressed(1)));
  instrument->press_button();
  CHECK(status_when(host, pressed(2)));
  REQUIRE(ask(host, RescueCommand::kReboot, 1).has_value());
  host.run_for(1'000'000);
  REQUIRE((host.plug() && host.enumerate()));
  instrument->press_button();
  CHECK(status_when(host, pressed(1)));
}

TEST_CASE("At full speed the same stream comes in smaller packets") {
  const auto instrument = usb_instrument_of("");
  PortHost host(instrument);
  REQUIRE(host.plug(simulator::UsbBusSpeed::kFull));
  auto device = open_usb(instrument);
  REQUIRE(device.has_value());
  const Outcome outcome = run(*device, pattern_recipe(5));
  CHECK(outcome.complete == 5);
  CHECK(outcome.wrong == 0);
}
