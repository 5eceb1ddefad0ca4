// scatter conform URI: is this device an OpenScatter instrument? Named checks, each with its rule.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "host_sdk/device/conformance/conformance.h"
#include "tools/scatter/device_access.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/text_table.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace scatter::cli {
namespace {

using Open = std::function<Result<std::unique_ptr<device::Transport>>(const device::Wait&)>;
using conformance::Finding;
using conformance::Verdict;

struct Asked {
  std::string uri;
  std::vector<std::string> only;
  bool list = false;
  bool write = false;
};

Answer listed() {
  Answer answer;
  auto& list = answer.json["checks"] = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> rows;
  for (const conformance::CheckInfo& check : conformance::checks()) {
    list.push_back({{"name", check.name},
                    {"promise", check.promise},
                    {"rule", check.rule},
                    {"look_at", check.look_at},
                    {"writes", check.writes}});
    rows.push_back({std::string(check.name), std::string(check.rule), std::string(check.promise)});
  }
  answer.text = text_table(rows);
  return answer;
}

/// The carrier to `uri`, anew each time. An instrument inside this process is switched on once and stays.
Result<Open> opener(const std::string& uri, const Context& context) {
  const auto parsed = device::parse_uri(uri);
  if (parsed && parsed->scheme == "replay") {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{}: a recording is no device", uri),
                "name an instrument; scatter list shows those that can be reached");
  }
  if (parsed && parsed->scheme == "sim") {
    const auto instrument = tools::make_sim_instrument(*parsed);
    if (!instrument) {
      return std::unexpected(instrument.error());
    }
    return Open(
        [instrument = *instrument](const device::Wait&) -> Result<std::unique_ptr<device::Transport>> {
          return tools::make_sim_transport(instrument);
        });
  }
  return Open(
      [uri, &registry = context.registry](const device::Wait& wait) { return registry.open(uri, wait); });
}

std::string mark(Verdict verdict) {
  return verdict == Verdict::kFailed ? "FAILED" : std::string(conformance::name(verdict));
}

Answer described(const std::string& uri, const conformance::Report& report) {
  Answer answer;
  answer.json = {{"uri", uri}, {"conforms", report.passed()}};
  for (const Verdict verdict : {Verdict::kPassed, Verdict::kFailed, Verdict::kMeasured, Verdict::kSkipped}) {
    answer.json[std::string(conformance::name(verdict))] = report.count(verdict);
  }
  auto& list = answer.json["checks"] = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> rows;
  std::string troubles;
  for (const Finding& finding : report.findings) {
    list.push_back({{"name", finding.check.name},
                    {"promise", finding.check.promise},
                    {"rule", finding.check.rule},
                    {"verdict", conformance::name(finding.verdict)},
                    {"measured", finding.measured},
                    {"trouble", finding.trouble},
                    {"look_at", finding.check.look_at}});
    const bool skipped = finding.verdict == Verdict::kSkipped;
    rows.push_back({mark(finding.verdict), std::string(finding.check.name),
                    skipped ? finding.trouble : finding.measured});
    if (finding.verdict == Verdict::kFailed) {
      troubles +=
          fmt::format("\n{}: {}\n  promised: {} ({})\n  look at:  {}\n", finding.check.name, finding.trouble,
                      finding.check.promise, finding.check.rule, finding.check.look_at);
    }
  }
  answer.text = text_table(rows) + troubles +
                fmt::format("\n{} passed, {} failed, {} measured, {} skipped\n",
                            report.count(Verdict::kPassed), report.count(Verdict::kFailed),
                            report.count(Verdict::kMeasured), report.count(Verdict::kSkipped));
  answer.failed = !report.passed();
  return answer;
}

Result<Answer> conform(const Asked& asked, const Context& context) {
  if (asked.list) {
    return listed();
  }
  if (asked.uri.empty()) {
    return fail(ErrorCode::kInvalidArgument, "no instrument is named", "name one, or use --list");
  }
  auto open = opener(asked.uri, context);
  if (!open) {
    return std::unexpected(open.error());
  }
  Progress progress;
  conformance::Options options;
  options.open = std::move(*open);
  options.only = asked.only;
  options.write = asked.write;
  options.stop = context.stop;
  options.progress = [&progress](double fraction, std::string_view check) {
    progress.show(fraction, std::string(check));
  };
  const auto report = conformance::run(options);
  progress.clear();
  if (!report) {
    return std::unexpected(report.error());
  }
  return described(asked.uri, *report);
}

}  // namespace

Verb add_conform(CLI::App& root) {
  auto* app =
      root.add_subcommand("conform", "Check that a device keeps every promise of the protocol and the ports");
  auto asked = std::make_shared<Asked>();
  app->add_option("uri", asked->uri, "URI of the device");
  app->add_option("--only", asked->only, "Run this check only; may be repeated")->type_name("NAME");
  app->add_flag("--list", asked->list, "Show the checks, and the rule that each one proves");
  app->add_flag(
      "--write", asked->write,
      "Also run the checks that change settings and calibrations and restart the device; they put back "
      "what they found");
  return {app, [asked](const Context& context) { return conform(*asked, context); }};
}

}  // namespace scatter::cli
