// The simulated instrument behind its USB socket passes the same suite.
#include "tests/conformance/suite.h"
#include "tests/usb/port_transport.h"

using namespace scatter;
using namespace scatter::conformance_test;

namespace {

conformance::Options usb_options_for(std::string_view query) {
  auto options = simulator::parse_instrument_options(query);
  REQUIRE(options.has_value());
  options->carrier = simulator::Carrier::kUsb;
  auto made = simulator::VirtualInstrument::make(*options);
  REQUIRE(made.has_value());
  std::shared_ptr<simulator::VirtualInstrument> instrument = std::move(*made);
  conformance::Options suite;
  suite.open = [instrument](const device::Wait&) -> Result<std::unique_ptr<device::Transport>> {
    auto transport = usb_test::make_port_transport(instrument);
    if (!transport) {
      return fail(ErrorCode::kDisconnected, "usb: the instrument could not be opened", "look at the socket");
    }
    return transport;
  };
  return suite;
}

}  // namespace

TEST_CASE("The simulated instrument passes every check over its USB socket") {
  conformance::Options options = usb_options_for("sample=lambertian:0.5&seed=3");
  options.write = true;
  const auto report = conformance::run(options);
  REQUIRE(report.has_value());
  CHECK(failures(*report) == "");
  CHECK(report->findings.size() == conformance::checks().size());
  CHECK(report->count(conformance::Verdict::kMeasured) == 2);
}

TEST_CASE("Over USB, too, instruments of other make-up pass") {
  for (const char* query : {"sample=film:transmittance=0.6,haze=0.3", "calibration=none", "calibration=stale",
                            "profile=fine&references=drawn&seed=9"}) {
    INFO(query);
    const auto report = conformance::run(usb_options_for(query));
    REQUIRE(report.has_value());
    CHECK(failures(*report) == "");
  }
}
