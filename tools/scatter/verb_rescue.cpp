// scatter rescue TARGET status|abort|reboot|fault: the instrument's HID interface, which answers while its
// frames are stuck or another program holds them.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "host_sdk/device/update_check.h"
#include "tools/scatter/firmware_description.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/usb_target.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string target;
  std::string request = "status";
};

const char* words_of(protocol::RunState state) {
  switch (state) {
    case protocol::RunState::kIdle:
      return "idle";
    case protocol::RunState::kRunning:
      return "running";
    case protocol::RunState::kHolding:
      return "waiting for the host";
  }
  return "unknown";
}

double celsius(std::int32_t temperature_mK) {
  return temperature_mK / 1000.0 - 273.15;
}

Answer describe(const protocol::RescueStatus& status) {
  const char* run = words_of(static_cast<protocol::RunState>(status.run_state));
  const auto reset = device::words(static_cast<protocol::ResetReason>(status.reset_reason));
  Answer answer;
  answer.json = {{"run_state", run},
                 {"run_id", status.run_id},
                 {"exposed", status.exposed},
                 {"session_open", status.session_open},
                 {"button_presses", status.button_presses},
                 {"reset_reason", reset},
                 {"boot_count", status.boot_count},
                 {"uptime_s", double(status.uptime_us) * 1e-6},
                 {"fault_recorded", status.fault_recorded},
                 {"dfu_mode", status.dfu_mode},
                 {"worst_poll_us", status.worst_poll_us},
                 {"sensor_temperature_C", celsius(status.sensor_mK)},
                 {"led_board_temperature_C", celsius(status.led_board_mK)}};
  answer.text = text_table(
      {{"run", fmt::format("{} (run {}, {} frames exposed)", run, status.run_id, status.exposed)},
       {"host program", status.session_open ? "has a session open" : "none"},
       {"measure button", fmt::format("pressed {} times since the start", status.button_presses)},
       {"last start",
        fmt::format("{} (boot {}), {:.1f} s ago", reset, status.boot_count, double(status.uptime_us) * 1e-6)},
       {"last crash", status.fault_recorded ? "recorded: scatter rescue TARGET fault shows it" : "none"},
       {"temperatures", fmt::format("sensor {:.1f} C, LED board {:.1f} C", celsius(status.sensor_mK),
                                    celsius(status.led_board_mK))},
       {"longest pass of its loop", fmt::format("{} us", status.worst_poll_us)}});
  return answer;
}

Result<Answer> run(const Options& options, const Context& context) {
  auto channel = open_rescue(options.target, context);
  if (!channel) {
    return std::unexpected(channel.error());
  }
  const device::Wait wait{.timeout = std::chrono::seconds(5), .stop = context.stop};
  Answer answer;
  if (options.request == "status") {
    const auto status = channel->status(wait);
    return status ? Result<Answer>(describe(*status)) : std::unexpected(status.error());
  }
  if (options.request == "fault") {
    const auto record = channel->fault_record(wait);
    if (!record) {
      return std::unexpected(record.error());
    }
    answer.json = to_json(*record);
    answer.text = fmt::format("last crash: {}\n", words(*record));
    return answer;
  }
  const bool abort = options.request == "abort";
  if (const Status done = abort ? channel->abort(wait) : channel->reboot(wait); !done) {
    return std::unexpected(done.error());
  }
  answer.json = {{"done", options.request}};
  answer.text = abort ? "no run is on any more\n" : "the instrument restarts\n";
  return answer;
}

}  // namespace

Verb add_rescue(CLI::App& root) {
  auto* app = root.add_subcommand(
      "rescue", "Ask a USB instrument that is stuck or held by another program, or end its run");
  auto options = std::make_shared<Options>();
  app->add_option("target", options->target, "usb:, usb:serial=SERIAL, usb:port=PORT or a serial number")
      ->required();
  app->add_option("request", options->request,
                  "status (default), abort (end the run), reboot, fault (the last crash)")
      ->check(CLI::IsMember({"status", "abort", "reboot", "fault"}));
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
