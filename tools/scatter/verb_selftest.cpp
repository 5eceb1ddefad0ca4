// scatter selftest URI: the counter test pattern through sensor timing, chunks and link, every pixel checked.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "tools/scatter/device_access.h"
#include "tools/scatter/text_table.h"

namespace scatter::cli {
namespace {

struct Asked {
  std::string uri;
  std::uint16_t frames = 4;
  double timeout_s = 60;
};

Result<Answer> selftest(const Asked& asked, const Context& context) {
  auto device = open_device(asked.uri, context);
  if (!device) {
    return std::unexpected(device.error());
  }
  const device::TimePoint started = device->now();
  const auto limit =
      std::chrono::duration_cast<device::Duration>(std::chrono::duration<double>(asked.timeout_s));
  const auto report = device->self_test(asked.frames, {.timeout = limit, .stop = context.stop});
  if (!report) {
    return std::unexpected(report.error());
  }
  const double seconds = std::chrono::duration<double>(device->now() - started).count();
  const device::LinkStatistics link = device->link_statistics();
  const protocol::Ledger& ledger = report->run.ledger;
  const bool good = report->wrong_pixels == 0 && report->frames == asked.frames && ledger.balances();
  Answer answer;
  answer.failed = !good;
  answer.json = {{"uri", asked.uri},
                 {"passed", good},
                 {"frames_asked", asked.frames},
                 {"frames_whole", report->frames},
                 {"pixels", report->pixels},
                 {"wrong_pixels", report->wrong_pixels},
                 {"seconds", seconds},
                 {"ledger",
                  {{"exposed", ledger.exposed},
                   {"delivered", ledger.delivered},
                   {"lost_sensor", ledger.lost_sensor},
                   {"lost_firmware", ledger.lost_firmware},
                   {"lost_link", ledger.lost_link},
                   {"lost_host", ledger.lost_host},
                   {"corrupt", ledger.corrupt},
                   {"balances", ledger.balances()}}},
                 {"link",
                  {{"bytes", link.bytes},
                   {"wire_frames", link.wire_frames},
                   {"bad_frames", link.bad_frames},
                   {"skipped_bytes", link.skipped_bytes},
                   {"stale_frames", link.stale_frames}}}};
  std::vector<std::vector<std::string>> rows = {
      {"pattern", fmt::format("{} of {} frames whole, {} pixels, {} wrong", report->frames, asked.frames,
                              report->pixels, report->wrong_pixels)},
      {"ledger",
       fmt::format("{} exposed = {} delivered + {} lost (sensor {}, firmware {}, link {}, host {}) + {} "
                   "corrupt{}",
                   ledger.exposed, ledger.delivered,
                   ledger.lost_sensor + ledger.lost_firmware + ledger.lost_link + ledger.lost_host,
                   ledger.lost_sensor, ledger.lost_firmware, ledger.lost_link, ledger.lost_host,
                   ledger.corrupt, ledger.balances() ? "" : ": does not balance")},
      {"link",
       fmt::format("{} bytes in {:.3f} s of the instrument's clock, {} wire frames, {} bad, {} bytes skipped",
                   link.bytes, seconds, link.wire_frames, link.bad_frames, link.skipped_bytes)},
      {"result", good ? "passed" : "FAILED: look at the cable, then run scatter conform"}};
  answer.text = text_table(rows);
  return answer;
}

}  // namespace

Verb add_selftest(CLI::App& root) {
  auto* app =
      root.add_subcommand("selftest", "Send the counter test pattern through the instrument and its link");
  auto asked = std::make_shared<Asked>();
  app->add_option("uri", asked->uri, "URI of the instrument")->required();
  app->add_option("--frames", asked->frames, "Whole frames to send")->check(CLI::Range(1, 10000));
  app->add_option("--timeout", asked->timeout_s, "Give up after this time, s")
      ->check(CLI::Range(1.0, 86400.0));
  return {app, [asked](const Context& context) { return selftest(*asked, context); }};
}

}  // namespace scatter::cli
