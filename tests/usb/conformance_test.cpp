// The conformance suite on the instrument behind real libusb. Its clock is a real one: the suite compares
// clocks.
#include "host_sdk/device/conformance/conformance.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;

TEST_CASE("The instrument passes the conformance suite over USB") {
  Host host;
  conformance::Options options;
  options.write = true;
  options.open = [&](const device::Wait& wait) -> Result<std::unique_ptr<device::Transport>> {
    // After a restart the device joins the bus anew.
    Result<std::unique_ptr<device::Transport>> transport = host.registry().open("usb:", wait);
    (void)soon([&] {
      if (!transport) {
        transport = host.registry().open("usb:", wait);
      }
      return transport.has_value();
    });
    return transport;
  };
  const auto report = conformance::run(options);
  REQUIRE(report.has_value());
  std::string failures;
  for (const conformance::Finding& finding : report->findings) {
    if (finding.verdict == conformance::Verdict::kFailed) {
      failures += std::string(finding.check.name) + ": " + finding.trouble + "\n";
    }
  }
  CHECK(failures == "");
}
