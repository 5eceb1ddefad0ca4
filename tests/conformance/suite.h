// What the conformance tests share: the suite on an instrument in this process.
#pragma once

#include <catch2/catch.hpp>
#include <memory>
#include <string>
#include <utility>

#include "host_sdk/device/conformance/conformance.h"
#include "simulator/instrument/virtual_instrument.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace scatter::conformance_test {

inline std::shared_ptr<simulator::VirtualInstrument> instrument_of(std::string_view query) {
  auto options = simulator::parse_instrument_options(query);
  REQUIRE(options.has_value());
  auto instrument = simulator::VirtualInstrument::make(*options);
  REQUIRE(instrument.has_value());
  return std::move(*instrument);
}

inline conformance::Options options_for(std::shared_ptr<simulator::VirtualInstrument> instrument) {
  conformance::Options options;
  options.open = [instrument = std::move(instrument)](
                     const device::Wait&) -> Result<std::unique_ptr<device::Transport>> {
    return tools::make_sim_transport(instrument);
  };
  return options;
}

/// Every check that failed, with its trouble; "" when none did.
inline std::string failures(const conformance::Report& report) {
  std::string out;
  for (const conformance::Finding& finding : report.findings) {
    if (finding.verdict == conformance::Verdict::kFailed) {
      out += std::string(finding.check.name) + ": " + finding.trouble + "\n";
    }
  }
  return out;
}

}  // namespace scatter::conformance_test
