// Power cuts: QEMU is killed with SIGKILL at seeded random moments of calibration saves and of updates. The
// board starts again from what its two files hold: the old or the new, never something mixed. 5 cuts of each;
// SCATTER_NIGHTLY=1: 50.
#include <atomic>
#include <cstdlib>
#include <map>
#include <random>
#include <set>
#include <stop_token>
#include <thread>

#include "tests/emulator/releases.h"

using namespace scatter;
using namespace scatter::emulator;

namespace {

int cuts() {
  const char* nightly = std::getenv("SCATTER_NIGHTLY");
  return nightly != nullptr && *nightly != '\0' && *nightly != '0' ? 50 : 5;
}

/// Cuts the power after a while, unless it is told before that there is nothing left to cut.
class Cutter {
 public:
  Cutter(Emulated& emulated, std::chrono::microseconds after)
      : thread_([pid = emulated.board().process_id(), after, this](const std::stop_token&) {
          std::this_thread::sleep_for(after);
          ::kill(pid, SIGKILL);
          cut_.request_stop();
        }) {}
  [[nodiscard]] std::stop_token cut() const { return cut_.get_token(); }

 private:
  std::stop_source cut_;
  std::jthread thread_;
};

/// A manifest whose every field tells its number.
protocol::CalibrationManifest manifest(std::uint8_t number) {
  protocol::CalibrationManifest m;
  m.id.fill(number);
  m.kind = protocol::Target::kWhiteReference;
  m.unix_time_s = 1'767'225'600ULL + number;
  m.certificate_id = std::string_view(std::string("certificate ") + std::to_string(number));
  for (int k = 0; k < 6; ++k) {
    m.scalars.push_back(static_cast<float>(number));
  }
  return m;
}

/// Number of a manifest that is whole; -1: none there.
int number_of(const std::vector<protocol::CalibrationManifest>& list) {
  if (list.empty()) {
    return -1;
  }
  const protocol::CalibrationManifest& newest = list.front();
  const auto wanted = manifest(newest.id[0]);
  CHECK(newest.id == wanted.id);
  CHECK(newest.unix_time_s == wanted.unix_time_s);
  CHECK(newest.certificate_id.str() == wanted.certificate_id.str());
  CHECK(newest.scalars == wanted.scalars);
  return newest.id[0];
}

}  // namespace

TEST_CASE("Power cuts in calibration saves leave the old or the new calibration, never a mixed one") {
  const Folder folder;
  auto options = board_options();
  options.state = folder / "state";
  std::mt19937 random(20261122);
  int kept = -1;  // Acknowledged.
  int tried = -1;
  std::set<bool> outcomes;
  for (int cut = 0; cut <= cuts(); ++cut) {
    INFO("cut " << cut << " of seed 20261122, last acknowledged " << kept << ", last tried " << tried);
    Emulated emulated(options);
    device::Device device = emulated.open();
    const auto list = device.calibration_list();
    REQUIRE(list.has_value());
    const int found = number_of(*list);
    CHECK((found == kept || found == tried));
    if (found != kept && found != tried) {
      break;
    }
    outcomes.insert(found == tried);
    kept = found;
    if (cut == cuts()) {
      break;
    }
    const auto begun = device.calibration_begin();
    REQUIRE(begun.has_value());
    const Cutter cutter(emulated, std::chrono::microseconds(random() % 150'000));
    // One after the other until the power goes.
    while (true) {
      tried = (kept + 1) % 250;
      if (!device.calibration_commit(begun->session, manifest(static_cast<std::uint8_t>(tried)),
                                     {.timeout = std::chrono::seconds(20), .stop = cutter.cut()})) {
        break;
      }
      kept = tried;
    }
    emulated.cut_power();
  }
}

TEST_CASE("Power cuts in updates leave a board that starts the old or the new firmware, whole") {
  const Folder folder;
  auto options = board_options();
  options.state = folder / "state";
  std::mt19937 random(20261123);
  std::string kept = built_package().version();
  std::string tried = kept;
  std::map<std::string, firmware_files::Package> sent{{kept, built_package()}};
  for (int cut = 0; cut <= cuts(); ++cut) {
    INFO("cut " << cut << " of seed 20261123, last kept " << kept << ", last tried " << tried);
    Emulated emulated(options);
    protocol::UpdateState state;
    {
      device::Device device = emulated.open();
      const auto found = device.update_status();
      REQUIRE(found.has_value());
      state = *found;
      CHECK((device.hello().capabilities & protocol::kCapabilityRescue) == 0);
    }
    const std::string version(state.running_version.str());
    REQUIRE((version == kept || version == tried));
    if (state.running_verdict == protocol::SlotVerdict::kConfirmed) {
      kept = version;
    }
    const auto& body = sent.at(version).image(state.running_slot).body;
    const auto slot = emulated.board().shared_memory().subspan(
        firmware::backplane::kSlotOffset[state.running_slot] + protocol::kImageBodyOffset, body.size());
    CHECK(std::ranges::equal(slot, body));
    if (cut == cuts()) {
      break;
    }
    tried = "9.0." + std::to_string(cut + 1);
    const auto& package = sent.emplace(tried, package_of(tried, 1)).first->second;
    const Cutter cutter(emulated, std::chrono::microseconds(random() % 6'000'000));
    auto how = update_options();
    how.stop = cutter.cut();
    how.restart = std::chrono::seconds(10);
    const auto report = device::update_firmware(opener(emulated), package, how);
    if (report && report->outcome == device::UpdateOutcome::kConfirmed) {
      kept = tried;
    }
    emulated.cut_power();
  }
}
