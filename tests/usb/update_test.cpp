// Firmware over the bus: our own updater, and the distribution's dfu-util.
#include "host_sdk/device/updater.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "host_sdk/firmware_files/dfu_suffix.h"
#include "host_sdk/firmware_files/keys.h"
#include "host_sdk/firmware_files/signing.h"
#include "tests/unit/firmware_files/made_release.h"
#include "tests/usb/child.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using device::Device;

namespace {

namespace fs = std::filesystem;

const std::vector<protocol::PublicKey> kTrusted = {firmware_files::kTestPublicKey};

firmware_files::Package release(const std::string& version) {
  const auto key = firmware_files::load_secret_key("firmware/keys/test.key");
  REQUIRE(key);
  auto what = firmware_files::test::made_release(version, 1, 50'000);
  what.product = "OpenScatter HS-1 (simulated)";
  auto package = firmware_files::sign(what, *key);
  REQUIRE(package);
  return *package;
}

device::OpenDevice opener(const Host& host) {
  return [&host](const device::Wait& wait) { return host.try_open("usb:", wait); };
}

device::UpdateOptions options() {
  device::UpdateOptions how;
  how.trusted = kTrusted;
  how.restart = std::chrono::seconds(5);
  return how;
}

/// A file with the suffix that dfu-util wants, gone with the object.
class DfuFile {
 public:
  explicit DfuFile(const firmware_files::Package& package)
      : path_(fs::temp_directory_path() / ("scatter_dfu_" + std::to_string(::getpid()) + ".dfu")) {
    std::vector<std::byte> bytes = package.bytes();
    const firmware_files::DfuSuffix suffix = firmware_files::dfu_suffix(bytes);
    bytes.insert(bytes.end(), suffix.begin(), suffix.end());
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  ~DfuFile() { fs::remove(path_); }
  DfuFile(const DfuFile&) = delete;
  DfuFile& operator=(const DfuFile&) = delete;
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  fs::path path_;
};

bool dfu_util_there() {
  std::string output;
  return Child({"dfu-util", "--version"}, true).wait(output) == 0;
}

}  // namespace

TEST_CASE("A release is sent over USB, tried, kept, and runs after the restart") {
  Host host;
  const auto report = device::update_firmware(opener(host), release("2.0.0"), options());
  if (!report) {
    FAIL(report.error().what);
  }
  CHECK(report->outcome == device::UpdateOutcome::kConfirmed);
  Device device = host.open_soon();
  CHECK(device.hello().build_id.str() == "openscatter 2.0.0");
}

TEST_CASE("A cable pulled out while updating costs only what was under way") {
  Host host;
  const firmware_files::Package package = release("2.1.0");
  bool pulled = false;
  device::UpdateOptions how = options();
  how.progress = [&](const device::UpdateProgress& progress) {
    if (!pulled && progress.stage == device::UpdateStage::kSending && progress.done > 20'000) {
      pulled = true;
      host.bus().unplug();
      host.bus().plug();
    }
  };
  auto report = device::update_firmware(opener(host), package, how);
  if (!report) {
    // It may end when the instrument is not there for a moment; called again it goes on.
    INFO(report.error().what);
    (void)host.open_soon();
    report = device::update_firmware(opener(host), package, options());
  }
  CHECK(pulled);
  if (!report) {
    FAIL(report.error().what);
  }
  CHECK(report->outcome == device::UpdateOutcome::kConfirmed);
  CHECK(host.open_soon().hello().build_id.str() == "openscatter 2.1.0");
}

TEST_CASE("dfu-util lists the instrument, takes it to DFU mode, sends a release, and the release runs") {
  if (!dfu_util_there()) {
    WARN("dfu-util is not installed: skipped. Remedy: apt-get install dfu-util");
    return;
  }
  Host host;
  const DfuFile file(release("3.0.0"));
  std::string listed;
  CHECK(Child({"dfu-util", "-l"}, true).wait(listed) == 0);
  CHECK(listed.find("Found Runtime: [1209:000d]") != std::string::npos);
  CHECK(listed.find("serial=\"SIM-00000001\"") != std::string::npos);
  std::string sent;
  // 251: with -R it says that the device it has just restarted is not there any more.
  const int status =
      Child({"dfu-util", "-d", "1209:000d,1209:000e", "-t", "4096", "-E", "1", "-R", "-D", file.path()}, true)
          .wait(sent);
  INFO(sent);
  CHECK((status == 0 || status == 251));
  CHECK(sent.find("Download done.") != std::string::npos);
  {
    Device device = host.open_soon();
    CHECK(device.hello().build_id.str() == "openscatter 3.0.0");
    // Nobody has confirmed it: at the next restart the old one is back.
    REQUIRE(device.reboot().has_value());
  }
  CHECK(soon([&] {
    Result<Device> device = host.try_open();
    return device && device->hello().build_id.str() == "openscatter 2.1.0";
  }));
}

TEST_CASE("dfu-util is refused a file that nobody signed, and the instrument runs on") {
  if (!dfu_util_there()) {
    return;
  }
  Host host;
  firmware_files::Package package = release("4.0.0");
  DfuFile file(package);
  {
    // One bit of each linking's body: which one the instrument takes is its own choice.
    std::fstream bytes(file.path(), std::ios::in | std::ios::out | std::ios::binary);
    for (const int at : {30'000, 80'000}) {
      bytes.seekg(at);
      const int byte = bytes.get();
      bytes.seekp(at);
      bytes.put(static_cast<char>(byte ^ 1));
    }
  }
  std::string said;
  // The suffix's checksum does not fit any more; dfu-util warns and sends it all the same.
  (void)Child({"dfu-util", "-d", "1209:000d,1209:000e", "-E", "1", "-D", file.path()}, true).wait(said);
  INFO(said);
  CHECK(said.find("failed verification") != std::string::npos);
  host.bus().unplug();
  host.bus().plug();
  CHECK(host.open_soon().hello().build_id.str() != "openscatter 4.0.0");
}
