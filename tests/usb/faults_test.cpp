// What the bus does to single transfers: each fault costs what it must, and is found in the right column.
#include <fmt/format.h>

#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using device::Device;
using integration::Outcome;
using integration::pattern_recipe;

namespace {

constexpr std::uint16_t kFrames = 60;

/// A further instrument with these faults, for one test.
class Faulty {
 public:
  Faulty(Host& host, const std::string& faults, int seed = 11)
      : host_(host),
        slot_(host.bus().add_instrument(fmt::format("fault={}&seed={}", faults, seed))),
        device_(plugged()) {}
  ~Faulty() {
    device_.reset();
    host_.bus().unplug(slot_);
  }
  Faulty(const Faulty&) = delete;
  Faulty& operator=(const Faulty&) = delete;
  [[nodiscard]] Device& device() { return *device_; }
  [[nodiscard]] int slot() const { return slot_; }
  [[nodiscard]] std::string uri() const { return fmt::format("usb:port={}-1", slot_ + 1); }

 private:
  std::unique_ptr<Device> plugged() {
    host_.bus().plug(slot_);
    return std::make_unique<Device>(host_.open_soon(uri()));
  }
  Host& host_;
  int slot_;
  std::unique_ptr<Device> device_;
};

}  // namespace

TEST_CASE("Lost, damaged and cut wire frames cost whole frames, counted as lost on the link") {
  Host host;
  for (const char* fault : {"drop:0.05", "corrupt:0.05", "truncate:0.05"}) {
    INFO(fault);
    Faulty faulty(host, fault);
    const Outcome outcome = integration::run(faulty.device(), pattern_recipe(kFrames));
    REQUIRE_FALSE(outcome.error.has_value());
    const protocol::Ledger& ledger = outcome.summary.ledger;
    CHECK(ledger.balances());
    CHECK(ledger.exposed == kFrames);
    CHECK(ledger.delivered == outcome.complete);
    CHECK(ledger.lost_link > 0);
    CHECK(ledger.delivered > 0);
    CHECK(ledger.lost_sensor + ledger.lost_firmware + ledger.lost_host + ledger.corrupt == 0);
    CHECK(outcome.wrong == 0);
  }
}

TEST_CASE("Repeated and reordered wire frames and garbage between them cost nothing, and are counted") {
  Host host;
  for (const std::string fault : {"duplicate:0.1", "reorder:0.1", "garbage:0.1"}) {
    INFO(fault);
    Faulty faulty(host, fault);
    const Outcome outcome = integration::run(faulty.device(), pattern_recipe(kFrames));
    check_whole(outcome, kFrames);
    CHECK((fault.starts_with("duplicate") == (outcome.summary.link.duplicate_chunks > 0)));
    CHECK((fault.starts_with("garbage") == (outcome.summary.link.skipped_bytes > 0)));
  }
}

TEST_CASE("Transfers that end early cost nothing") {
  Host host;
  Faulty faulty(host, "usb_short:0.3");
  const Outcome outcome = integration::run(faulty.device(), pattern_recipe(kFrames));
  check_whole(outcome, kFrames);
}

TEST_CASE("Babble loses the transfer's bytes: its frames are lost on the link, the others are whole") {
  Host host;
  Faulty faulty(host, "usb_babble:0.03");
  const Outcome outcome = integration::run(faulty.device(), pattern_recipe(kFrames));
  REQUIRE_FALSE(outcome.error.has_value());
  CHECK(outcome.summary.ledger.balances());
  CHECK(outcome.summary.ledger.exposed == kFrames);
  CHECK(outcome.summary.ledger.lost_link > 0);
  CHECK(outcome.summary.ledger.delivered == outcome.complete);
  CHECK(outcome.wrong == 0);
}

TEST_CASE("A stalled endpoint is cleared, and the run goes on with what was lost counted") {
  Host host;
  Faulty faulty(host, "usb_stall:0.01");
  const Outcome outcome = integration::run(faulty.device(), pattern_recipe(kFrames));
  if (outcome.error) {
    FAIL(outcome.error->what);
  }
  CHECK(outcome.summary.ledger.balances());
  CHECK(outcome.summary.ledger.exposed == kFrames);
  CHECK(outcome.summary.ledger.delivered == outcome.complete);
  CHECK(outcome.wrong == 0);
}

TEST_CASE("Everything at once, for ten seeds: no hang, no wrong pixel, a ledger that balances") {
  Host host;
  for (int seed = 0; seed < 10; ++seed) {
    INFO(seed);
    Faulty faulty(host,
                  "drop:0.02+corrupt:0.02+duplicate:0.05+reorder:0.05+truncate:0.02+usb_short:0.1+"
                  "usb_babble:0.005+usb_stall:0.003",
                  seed);
    const Outcome outcome = integration::run(faulty.device(), pattern_recipe(40));
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.summary.ledger.balances());
    CHECK(outcome.summary.ledger.exposed == 40);
    CHECK(outcome.wrong == 0);
  }
}

TEST_CASE("A device that falls silent in a run ends it by a deadline, at that deadline") {
  Host host;
  Device device = host.open();
  REQUIRE(device.configure(endless_recipe()).has_value());
  auto stream = device.start();
  REQUIRE(stream.has_value());
  REQUIRE(stream->next().has_value());
  host.bus().hang();
  const device::Wait wait{.timeout = std::chrono::milliseconds(300)};
  Clock::time_point begin = Clock::now();
  for (;;) {
    begin = Clock::now();
    const auto frame = stream->next(wait);
    if (!frame) {
      CHECK(frame.error().code == ErrorCode::kDeadlineExceeded);
      break;
    }
  }
  CHECK(ms_since(begin) < 400);
  CHECK(stream->summary().ledger.balances());
  host.bus().hang(0, false);
}

TEST_CASE("A link that breaks in a stream says so, and plugged again a new session starts clean") {
  Host host;
  for (const int at_byte : {10'000, 100'000, 250'000}) {
    INFO(at_byte);
    Faulty faulty(host, fmt::format("disconnect:{}", at_byte));
    const Outcome outcome = integration::run(faulty.device(), pattern_recipe(kFrames));
    REQUIRE(outcome.error.has_value());
    CHECK(outcome.error->code == ErrorCode::kDisconnected);
    CHECK(outcome.summary.ledger.balances());
    CHECK(outcome.wrong == 0);
    host.bus().plug(faulty.slot());
    Device again = host.open_soon(faulty.uri());
    check_whole(integration::run(again, pattern_recipe(5)), 5);
  }
}

TEST_CASE("A device that restarts in a run is seen at once, and tells why when it is opened again") {
  Host host;
  Faulty faulty(host, "reset:4");
  protocol::Recipe recipe = pattern_recipe(10);
  recipe.test_pattern = 0;  // The fault counts exposures of the sensor.
  const Outcome outcome = integration::run(faulty.device(), recipe);
  REQUIRE(outcome.error.has_value());
  CHECK(outcome.error->code == ErrorCode::kDisconnected);
  CHECK(outcome.complete <= 3);
  CHECK(outcome.summary.ledger.balances());
  Device again = host.open_soon(faulty.uri());
  CHECK(again.hello().reset_reason == static_cast<std::uint8_t>(protocol::ResetReason::kFault));
  CHECK(integration::run(again, recipe).complete == 10);
}
