// Firmware updates on the Cortex-M7: its bootloader starts what this host sends through the UART.
#include <algorithm>
#include <fstream>
#include <optional>
#include <thread>

#include "tests/emulator/releases.h"

using namespace scatter;
using namespace scatter::emulator;
using protocol::SlotVerdict;

namespace {

device::UpdateReport update(const Emulated& emulated, const firmware_files::Package& package,
                            const device::UpdateOptions& options) {
  auto report = device::update_firmware(opener(emulated), package, options);
  if (!report) {
    FAIL(report.error().what);
  }
  return std::move(*report);
}

protocol::UpdateState after_restart(const Emulated& emulated) {
  {
    device::Device device = emulated.open();
    REQUIRE(device.reboot().has_value());
    while (device.status()) {
    }
  }
  const auto state = emulated.open_soon().update_status();
  REQUIRE(state.has_value());
  return *state;
}

ErrorCode refusal(const Status& status) {
  REQUIRE_FALSE(status.has_value());
  INFO(status.error().what);
  CHECK_FALSE(status.error().remedy.empty());
  return status.error().code;
}

}  // namespace

TEST_CASE("An update on trial goes at the next start unless it is confirmed, and stays when it is") {
  Emulated emulated(board_options());
  const auto package = package_of("2.0.0", 1);
  auto trial = update_options();
  trial.confirm = false;
  const auto first = update(emulated, package, trial);
  CHECK(first.outcome == device::UpdateOutcome::kOnTrial);
  CHECK(first.after.running_slot == 1);
  CHECK(first.after.running_version.str() == "2.0.0");
  CHECK(first.after.running_verdict == SlotVerdict::kTrial);

  const auto reverted = after_restart(emulated);
  CHECK(reverted.running_slot == 0);
  CHECK(reverted.running_version.str() == built_package().version());
  CHECK(reverted.running_verdict == SlotVerdict::kConfirmed);
  CHECK(reverted.other_verdict == SlotVerdict::kReverted);

  const auto second = update(emulated, package, update_options());
  CHECK(second.outcome == device::UpdateOutcome::kConfirmed);
  const auto kept = after_restart(emulated);
  CHECK(kept.running_slot == 1);
  CHECK(kept.running_version.str() == "2.0.0");
  CHECK(kept.running_verdict == SlotVerdict::kConfirmed);
  const auto memory = emulated.board().shared_memory();
  const auto body = memory.subspan(firmware::backplane::kSlotOffset[1] + protocol::kImageBodyOffset,
                                   package.image(1).body.size());
  CHECK(std::ranges::equal(body, package.image(1).body));
}

TEST_CASE(
    "The board refuses wrong keys, wrong products, downgrades and damaged images, and goes on as before") {
  auto options = board_options();
  const Folder folder;
  const auto installed = folder / "installed.scfw";
  {
    // Security counter 5, so that there is something to fall below.
    const auto bytes = package_of("5.0.0", 5).bytes();
    std::ofstream(installed, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  options.firmware = installed;
  Emulated emulated(options);
  std::optional<device::Device> opened(emulated.open());
  device::Device& device = *opened;
  const auto header = [](const firmware_files::Package& package) {
    return firmware_files::header_bytes(package.image(1).header);
  };
  firmware_files::SecretKey::Seed seed{};
  seed.fill(0x5A);
  CHECK(refusal(device.update_begin(header(signed_release(
            release("6.0.0", 5), firmware_files::SecretKey(seed))))) == ErrorCode::kPermissionDenied);
  auto other = release("6.0.0", 5);
  other.product = "Kettle";
  CHECK(refusal(device.update_begin(header(signed_release(other, test_key())))) ==
        ErrorCode::kInvalidArgument);
  CHECK(refusal(device.update_begin(header(package_of("4.0.0", 4)))) == ErrorCode::kInvalidArgument);
  // The linking for the slot that runs.
  CHECK(refusal(device.update_begin(firmware_files::header_bytes(package_of("6.0.0", 5).image(0).header))) ==
        ErrorCode::kInvalidArgument);
  const auto good = package_of("6.0.0", 5);
  for (std::size_t bit = 13; bit < 8 * protocol::kImageHeaderBytes; bit += 211) {
    auto flipped = header(good);
    flipped[bit / 8] = static_cast<std::uint8_t>(flipped[bit / 8] ^ (1U << bit % 8));
    INFO("bit " << bit);
    CHECK_FALSE(device.update_begin(flipped).has_value());
  }
  // A body that lacks its end, then one with a flipped bit.
  const std::vector<std::byte>& body = good.image(1).body;
  const std::size_t lacking = body.size() / 32 * 32 - 4096;  // Whole program granules.
  const auto state = device.update_status();
  REQUIRE(state.has_value());
  const device::UpdatePieces pieces{.piece_bytes = state->chunk_bytes};
  const device::Wait patient{.timeout = std::chrono::seconds(60), .stop = {}};
  REQUIRE(device.update_begin(header(good)).has_value());
  if (const auto sent = device.update_write(0, std::span(body).first(lacking), pieces, patient); !sent) {
    FAIL(sent.error().what);
  }
  CHECK_FALSE(device.update_finish().has_value());
  auto flipped = body;
  flipped[body.size() - 100] ^= std::byte{4};
  REQUIRE(device
              .update_write(static_cast<std::uint32_t>(lacking), std::span(flipped).subspan(lacking), pieces,
                            patient)
              .has_value());
  CHECK(refusal(device.update_finish()) == ErrorCode::kDataLoss);
  const auto after = device.update_status();
  REQUIRE(after.has_value());
  CHECK(after->running_version.str() == "5.0.0");
  CHECK(after->running_verdict == SlotVerdict::kConfirmed);
  CHECK(after->lowest_counter == 5);
  opened.reset();
  const auto restarted = after_restart(emulated);
  CHECK(restarted.running_version.str() == "5.0.0");
}
