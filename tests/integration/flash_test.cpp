// Firmware updates of a simulated instrument: the real firmware core, bootloader and flash on its virtual
// board.
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "host_sdk/device/updater.h"
#include "host_sdk/firmware_files/signing.h"
#include "simulator/instrument/virtual_board.h"
#include "tests/integration/rig.h"
#include "tests/unit/firmware_files/made_release.h"

using namespace scatter;
using namespace scatter::integration;
using device::UpdateOutcome;
using firmware_files::Package;
using simulator::VirtualInstrument;

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBodyBytes = 50'000;
const std::vector<protocol::PublicKey> kTrusted = {firmware_files::kTestPublicKey};
const std::string kProduct = "OpenScatter HS-1 (simulated)";

firmware_files::SecretKey test_key() {
  auto key = firmware_files::load_secret_key("firmware/keys/test.key");
  REQUIRE(key);
  return *key;
}

Package release(const std::string& version, std::uint32_t counter = 1, const std::string& product = kProduct,
                const firmware_files::SecretKey& key = test_key()) {
  auto what = firmware_files::test::made_release(version, counter, kBodyBytes);
  what.product = product;
  auto package = firmware_files::sign(what, key);
  REQUIRE(package);
  return *package;
}

device::OpenDevice opener(const std::shared_ptr<VirtualInstrument>& instrument) {
  return [instrument](const device::Wait& wait) {
    device::OpenOptions options;
    options.wait = wait;
    return open_on(instrument, options);
  };
}

device::UpdateOptions options() {
  device::UpdateOptions how;
  how.trusted = kTrusted;
  how.restart = std::chrono::seconds(5);
  return how;
}

/// What HELLO names after a restart.
std::string runs_after_restart(const std::shared_ptr<VirtualInstrument>& instrument) {
  {
    auto device = open_on(instrument);
    REQUIRE(device);
    REQUIRE(device->reboot());
    // The reply comes before the reset; the reset ends the connection.
    while (device->status()) {
    }
  }
  auto device = open_on(instrument);
  REQUIRE(device);
  return std::string(device->hello().build_id.str());
}

std::vector<std::byte> all_cells(VirtualInstrument& instrument) {
  const auto bytes = instrument.board().flash().bytes();
  return {bytes.begin(), bytes.end()};
}

/// The body as it lies in a slot.
std::vector<std::byte> body_in(VirtualInstrument& instrument, std::uint8_t slot, std::size_t size) {
  std::vector<std::byte> out(size);
  REQUIRE(instrument.board().flash().slot(slot).read(protocol::kImageBodyOffset, out));
  return out;
}

/// A cable that is pulled out after so many bytes to the device.
class ShortLived final : public device::Transport {
 public:
  ShortLived(std::unique_ptr<Transport> inner, std::size_t bytes) : inner_(std::move(inner)), left_(bytes) {}
  Result<std::span<const std::byte>> receive(device::TimePoint deadline,
                                             const std::stop_token& stop) override {
    return inner_->receive(deadline, stop);
  }
  Status write(std::span<const std::byte> bytes, device::TimePoint deadline,
               const std::stop_token& stop) override {
    if (bytes.size() > left_) {
      (void)inner_->write(bytes.first(left_), deadline, stop);
      inner_->close();
      return fail(ErrorCode::kDisconnected, "the cable was pulled out", "plug it in again");
    }
    left_ -= bytes.size();
    return inner_->write(bytes, deadline, stop);
  }
  [[nodiscard]] device::TimePoint now() const override { return inner_->now(); }
  [[nodiscard]] std::uint64_t system_time_unix_ns() const override { return inner_->system_time_unix_ns(); }
  void close() noexcept override { inner_->close(); }

 private:
  std::unique_ptr<Transport> inner_;
  std::size_t left_;
};

}  // namespace

TEST_CASE("A release is sent, tried, kept, and still runs after a restart") {
  const auto instrument = instrument_of("");
  const Package package = release("2.0.0");
  const auto report = device::update_firmware(opener(instrument), package, options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(report->before.running_version.str() == "0.1.0");
  CHECK(report->after.running_version.str() == "2.0.0");
  CHECK(report->after.running_verdict == protocol::SlotVerdict::kConfirmed);
  CHECK(body_in(*instrument, 1, package.image(1).body.size()) == package.image(1).body);
  CHECK(runs_after_restart(instrument) == "openscatter 2.0.0");
  CHECK(instrument->board().flash().violations() == 0);
  // And back into slot 0, over what was there.
  const auto next = device::update_firmware(opener(instrument), release("2.1.0"), options());
  REQUIRE(next);
  CHECK(next->slot == 0);
  CHECK(runs_after_restart(instrument) == "openscatter 2.1.0");
}

TEST_CASE("A firmware that nobody confirms goes at the next restart, and can be sent and kept later") {
  const auto instrument = instrument_of("");
  const Package package = release("2.0.0");
  auto how = options();
  how.confirm = false;
  const auto trial = device::update_firmware(opener(instrument), package, how);
  REQUIRE(trial);
  CHECK(trial->outcome == UpdateOutcome::kOnTrial);
  CHECK(trial->after.phase == protocol::UpdatePhase::kTrial);
  CHECK(open_on(instrument)->hello().build_id.str() == "openscatter 2.0.0");
  CHECK(runs_after_restart(instrument) == "openscatter 0.1.0");
  CHECK(open_on(instrument)->update_status()->other_verdict == protocol::SlotVerdict::kReverted);
  const auto again = device::update_firmware(opener(instrument), package, options());
  REQUIRE(again);
  CHECK(again->outcome == UpdateOutcome::kConfirmed);
  CHECK(runs_after_restart(instrument) == "openscatter 2.0.0");
}

TEST_CASE("A cable pulled out anywhere costs only what was under way") {
  const Package package = release("2.0.0");
  for (std::size_t bytes = 200; bytes < kBodyBytes + 4000; bytes += 6113) {
    CAPTURE(bytes);
    const auto instrument = instrument_of("");
    bool first = true;
    const device::OpenDevice open = [&](const device::Wait& wait) -> Result<device::Device> {
      device::OpenOptions how;
      how.wait = wait;
      if (std::exchange(first, false)) {
        return device::Device::open(
            std::make_unique<ShortLived>(tools::make_sim_transport(instrument), bytes), how);
      }
      return open_on(instrument, how);
    };
    auto report = device::update_firmware(open, package, options());
    if (!report) {  // Pulled out before anything was begun: the user runs it again.
      CHECK(report.error().code == ErrorCode::kDisconnected);
      report = device::update_firmware(open, package, options());
    }
    REQUIRE(report);
    CHECK(report->outcome == UpdateOutcome::kConfirmed);
    CHECK(body_in(*instrument, 1, package.image(1).body.size()) == package.image(1).body);
    CHECK(instrument->board().flash().violations() == 0);
  }
}

TEST_CASE("A power cut in the middle costs one erase unit, and the same call goes on") {
  const fs::path file = fs::temp_directory_path() / ("scatter-flash-" + std::to_string(::getpid()));
  fs::remove(file);
  const std::string query = "flash=" + file.string();
  const Package package = release("2.0.0");
  std::stop_source stop;
  auto how = options();
  how.stop = stop.get_token();
  std::uint32_t reached = 0;
  how.progress = [&](const device::UpdateProgress& progress) {
    reached = std::max(reached, progress.done);
    if (progress.done >= kBodyBytes / 2) {
      stop.request_stop();
    }
  };
  {
    const auto stopped = device::update_firmware(opener(instrument_of(query)), package, how);
    REQUIRE_FALSE(stopped);
    CHECK(stopped.error().code == ErrorCode::kAborted);
  }
  const auto instrument = instrument_of(query);  // Power on again.
  CHECK(open_on(instrument)->hello().build_id.str() == "openscatter 0.1.0");
  const auto report = device::update_firmware(opener(instrument), package, options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  // What was begun, the last unit that may be torn, and the pieces under way.
  constexpr std::uint32_t kUnit = 4096;
  CHECK(report->sent_bytes <= report->body_bytes - reached + 2 * kUnit);
  CHECK(report->sent_bytes < report->body_bytes);
  fs::remove(file);
}

TEST_CASE("The instrument itself refuses what it must not take, and touches no cell of its flash") {
  const auto instrument = instrument_of("");
  REQUIRE(device::update_firmware(opener(instrument), release("2.0.0", 5), options()));
  auto device = open_on(instrument);
  REQUIRE(device);
  const auto before = all_cells(*instrument);
  const auto refused = [&](const Package& package, std::size_t slot, const std::string& says) {
    const auto begun = device->update_begin(firmware_files::header_bytes(package.image(slot).header));
    REQUIRE_FALSE(begun);
    CAPTURE(says, begun.error().what);
    CHECK(begun.error().what.find(says) != std::string::npos);
    CHECK(all_cells(*instrument) == before);
  };
  const firmware_files::SecretKey stranger(firmware_files::test::kRfcSeed);
  refused(release("3.0.0", 6, kProduct, stranger), 0, "not signed by a key");
  refused(release("3.0.0", 6, "OpenScatter HS-9"), 0, "product");
  refused(release("3.0.0", 4), 0, "security counter");
  refused(release("3.0.0", 6), 1, "slot 1, expected slot 0");
  // A header that was signed, and then changed.
  auto header = firmware_files::header_bytes(release("3.0.0", 6).image(0).header);
  header[72] = 9;
  CHECK_FALSE(device->update_begin(header));
  CHECK(all_cells(*instrument) == before);
  CHECK(device->update_status()->phase == protocol::UpdatePhase::kIdle);
}

TEST_CASE("A release with a lower security counter than the kept one is refused before the first byte") {
  const auto instrument = instrument_of("");
  REQUIRE(device::update_firmware(opener(instrument), release("2.0.0", 5), options()));
  const auto before = all_cells(*instrument);
  const auto down = device::update_firmware(opener(instrument), release("1.9.0", 4), options());
  REQUIRE_FALSE(down);
  CHECK(down.error().code == ErrorCode::kPermissionDenied);
  CHECK(all_cells(*instrument) == before);
}

TEST_CASE("A body with one wrong bit never becomes ready") {
  const auto instrument = instrument_of("");
  {
    auto device = open_on(instrument);
    REQUIRE(device);
    const Package package = release("2.0.0");
    auto body = package.image(1).body;
    body[body.size() / 2] ^= std::byte{0x40};
    REQUIRE(device->update_begin(firmware_files::header_bytes(package.image(1).header)));
    const std::uint32_t piece = device->update_status()->chunk_bytes;
    REQUIRE(device->update_write(0, body, {.piece_bytes = piece}));
    const auto finished = device->update_finish();
    REQUIRE_FALSE(finished);
    CHECK(finished.error().code == ErrorCode::kDataLoss);
  }
  CHECK(runs_after_restart(instrument) == "openscatter 0.1.0");
}

TEST_CASE("An instrument without any good image answers, says so, and can be flashed") {
  const auto instrument = instrument_of("");
  REQUIRE(instrument->board().flash().slot(0).erase(0));
  CHECK(runs_after_restart(instrument) == "bootloader 0.1.0");
  {
    auto device = open_on(instrument);
    REQUIRE(device);
    CHECK((device->hello().capabilities & protocol::kCapabilityRescue) != 0);
    CHECK(device->hello().product.str() == kProduct);
    const auto refused = device->configure({});
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code == ErrorCode::kFailedPrecondition);
  }
  const auto report = device::update_firmware(opener(instrument), release("2.0.0"), options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(runs_after_restart(instrument) == "openscatter 2.0.0");
}

TEST_CASE("An update comes through a link that loses and damages frames") {
  const std::string fault = GENERATE(as<std::string>(), "drop:0.01", "corrupt:0.01");
  CAPTURE(fault);
  const auto instrument = instrument_of("fault=" + fault);
  const Package package = release("2.0.0");
  const auto report = device::update_firmware(opener(instrument), package, options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(body_in(*instrument, 1, package.image(1).body.size()) == package.image(1).body);
}
