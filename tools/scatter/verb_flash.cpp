// scatter flash URI IMAGE: brings a signed firmware onto an instrument, tries it, and keeps it when it is
// well.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <memory>

#include "host_sdk/device/update_check.h"
#include "host_sdk/device/updater.h"
#include "host_sdk/firmware_files/package.h"
#include "host_sdk/firmware_files/signing.h"
#include "tools/scatter/device_access.h"
#include "tools/scatter/firmware_description.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/trusted_keys.h"
#include "tools/scatter/version.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace scatter::cli {
namespace {

using device::UpdateOutcome;
using device::UpdateStage;

struct Options {
  std::string uri;
  std::string image;
  std::vector<std::string> keys;
  bool force = false;
  bool no_confirm = false;
  double restart_s = 60;
};

/// Opens the instrument each time that it is asked to. A simulated instrument inside this program stays
/// switched on in between, as one on a cable does.
class Opener {
 public:
  Opener(std::string uri, const Context& context) : uri_(std::move(uri)), context_(context) {}

  Result<device::Device> operator()(const device::Wait& wait) {
    device::OpenOptions options;
    options.registry = &context_.registry;
    options.wait = wait;
    options.build_id = kVersion;
    const auto uri = device::parse_uri(uri_);
    if (!uri || uri->scheme != "sim") {
      return device::Device::open(uri_, options);
    }
    if (simulated_ == nullptr) {
      auto made = tools::make_sim_instrument(*uri);
      if (!made) {
        return std::unexpected(std::move(made.error()));
      }
      simulated_ = std::move(*made);
    }
    return device::Device::open(tools::make_sim_transport(simulated_), options);
  }

 private:
  std::string uri_;
  const Context& context_;
  std::shared_ptr<simulator::VirtualInstrument> simulated_;
};

const char* stage_words(UpdateStage stage) {
  switch (stage) {
    case UpdateStage::kReverting:
      return "restarting to the confirmed firmware";
    case UpdateStage::kPreparing:
      return "erasing the slot";
    case UpdateStage::kSending:
      return "sending";
    case UpdateStage::kVerifying:
      return "verifying";
    case UpdateStage::kRestarting:
      return "waiting for the restart";
    case UpdateStage::kChecking:
      return "checking the new firmware";
  }
  return "";
}

/// Share of the whole that is done; sending takes by far the longest.
double fraction(const device::UpdateProgress& progress) {
  switch (progress.stage) {
    case UpdateStage::kReverting:
    case UpdateStage::kPreparing:
      return 0;
    case UpdateStage::kSending:
      return progress.total == 0 ? 0 : 0.9 * progress.done / progress.total;
    case UpdateStage::kVerifying:
      return 0.92;
    case UpdateStage::kRestarting:
      return 0.95;
    case UpdateStage::kChecking:
      return 0.98;
  }
  return 0;
}

const char* name_of(UpdateOutcome outcome) {
  switch (outcome) {
    case UpdateOutcome::kConfirmed:
      return "confirmed";
    case UpdateOutcome::kOnTrial:
      return "on trial";
    case UpdateOutcome::kReverted:
      return "reverted";
  }
  return "";
}

std::string running_words(const protocol::UpdateState& state) {
  return state.running_version.size() == 0 ? std::string("no firmware")
                                           : std::string(state.running_version.str());
}

Answer answer_for(const device::UpdateReport& report, const firmware_files::Package& package) {
  Answer answer;
  answer.json = {{"outcome", name_of(report.outcome)},
                 {"firmware", to_json(package)},
                 {"slot", report.slot},
                 {"body_bytes", report.body_bytes},
                 {"sent_bytes", report.sent_bytes},
                 {"reconnections", report.reconnections},
                 {"before", to_json(report.before, report.before.running_version.size() == 0)},
                 {"after", to_json(report.after, report.after.running_version.size() == 0)},
                 {"reset_reason", device::words(report.reset_reason)}};
  if (report.outcome != UpdateOutcome::kReverted) {
    answer.text = fmt::format("{} runs in slot {} and is {}; before: {}\n", package.version(), report.slot,
                              report.outcome == UpdateOutcome::kConfirmed
                                  ? "confirmed"
                                  : "on trial: at its next start the instrument goes back, unless the same "
                                    "command without --no-confirm comes first",
                              running_words(report.before));
    return answer;
  }
  answer.failed = true;
  answer.json["why"] = report.why;
  answer.text = fmt::format("reverted: the instrument does not run {}\n{}\n", package.version(), report.why);
  if (report.fault) {
    answer.json["fault"] = to_json(*report.fault);
    answer.text += fmt::format("crash: {}\n", words(*report.fault));
  }
  answer.text += "remedy: report this to the maker of the firmware; the instrument can be used as before\n";
  return answer;
}

Result<Answer> run(const Options& options, const Context& context) {
  const auto keys = trusted_keys(options.keys);
  if (!keys) {
    return std::unexpected(keys.error());
  }
  const auto package = firmware_files::Package::load(options.image);
  if (!package) {
    return std::unexpected(package.error());
  }
  // Before the instrument is looked for: a file that nobody trusts goes nowhere.
  if (const auto signer = firmware_files::verify(*package, *keys); !signer) {
    return fail(signer.error().code, fmt::format("{}: {}", options.image, signer.error().what),
                signer.error().remedy);
  }
  Opener opener(options.uri, context);
  Progress bar;
  device::UpdateOptions how;
  how.trusted = *keys;
  how.same_version_too = options.force;
  how.confirm = !options.no_confirm;
  how.restart =
      std::chrono::duration_cast<device::Duration>(std::chrono::duration<double>(options.restart_s));
  how.stop = context.stop;
  how.progress = [&bar](const device::UpdateProgress& progress) {
    bar.show(fraction(progress), stage_words(progress.stage));
  };
  how.about_to_begin = [&](const protocol::UpdateState& state, std::uint8_t slot) {
    bar.clear();
    if (!context.json) {
      std::fprintf(
          stderr, "%s\n",
          fmt::format("{} runs; {} goes into slot {}: {} bytes, signed with {}", running_words(state),
                      package->version(), slot, package->image(slot).header.body_bytes,
                      key_words(package->key(), package->for_test()))
              .c_str());
    }
  };
  const auto report = device::update_firmware(std::ref(opener), *package, how);
  bar.clear();
  if (!report) {
    Error error = report.error();
    if (error.code == ErrorCode::kAborted) {
      error.remedy = "run the same command again: it goes on from where it stopped";
    }
    return std::unexpected(std::move(error));
  }
  return answer_for(*report, *package);
}

}  // namespace

Verb add_flash(CLI::App& root) {
  auto* app = root.add_subcommand("flash", "Bring a signed firmware onto an instrument");
  auto options = std::make_shared<Options>();
  app->add_option("uri", options->uri, "Instrument, for example usb: or tcp:127.0.0.1:7000")->required();
  app->add_option("image", options->image, "Firmware file (.scfw or .dfu)")->required();
  add_key_option(*app, options->keys);
  app->add_flag("--force", options->force, "Send it although this version runs already");
  app->add_flag("--no-confirm", options->no_confirm,
                "Leave it on trial: at its next start the instrument goes back to the firmware it has now");
  app->add_option("--restart-time", options->restart_s, "Seconds that the instrument may take to come back")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  app->footer("An interrupted update is resumed by the same command.");
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
