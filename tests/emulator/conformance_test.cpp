// The emulated Cortex-M7 board keeps every promise that the suite asks for, over its serial line.
#include <algorithm>

#include "host_sdk/device/conformance/conformance.h"
#include "tests/emulator/rig.h"

using namespace scatter;

TEST_CASE(
    "The firmware's image under QEMU passes the conformance suite, and remembers what the suite stored") {
  emulator::Emulated board(emulator::board_options("seed=11"));
  const device::TransportRegistry registry;
  conformance::Options options;
  options.open = [&](const device::Wait& wait) { return registry.open(board.uri(), wait); };
  options.write = true;
  for (const conformance::CheckInfo& check : conformance::checks()) {
    // Times on a machine that is busy with other tests say nothing.
    if (check.name != "stop-latency") {
      options.only.emplace_back(check.name);
    }
  }
  const auto report = conformance::run(options);
  REQUIRE(report.has_value());
  for (const conformance::Finding& finding : report->findings) {
    INFO(finding.check.name << ": " << finding.trouble);
    CHECK(finding.verdict != conformance::Verdict::kFailed);
    CHECK(finding.verdict != conformance::Verdict::kSkipped);
  }
  const auto updates = std::ranges::find(report->findings, "update-refusals",
                                         [](const auto& finding) { return finding.check.name; });
  CHECK(updates->measured.find("3 headers refused") == 0);
}
