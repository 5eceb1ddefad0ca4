// scatter doctor: what stands between this computer and its instruments, and the commands that mend it.
#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <sstream>
#include <string_view>

#include "host_sdk/device/usb/diagnosis.h"
#include "host_sdk/device/usb/udev_rule.h"
#include "tools/scatter/repair.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;
namespace usb = device::usb;
using usb::Finding;

struct Options {
  bool udev_rule = false;
  bool fix = false;
  bool yes = false;
  std::string output = ".";
  std::string root = "/";
};

/// As one word of the shell.
std::string quoted(const std::string& word) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/._-+,:@%=";
  if (word.find_first_not_of(kPlain) == std::string::npos) {
    return word;
  }
  std::string text = "'";
  for (const char each : word) {
    text += each == '\'' ? std::string("'\\''") : std::string(1, each);
  }
  return text + "'";
}

/// "scatter" where the shell finds this program under that name, else its path; as the shell wants it.
std::string program() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (error) {
    return "scatter";
  }
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path candidate = fs::path(folder) / "scatter";
    if (access(candidate.c_str(), X_OK) == 0) {
      return fs::equivalent(candidate, self, error) ? "scatter" : quoted(self.string());
    }
  }
  return quoted(self.string());
}

std::ptrdiff_t count(const std::vector<Finding>& findings, Finding::Verdict verdict) {
  return std::ranges::count(findings, verdict, &Finding::verdict);
}

Answer describe(const std::vector<Finding>& findings, const std::vector<Repair>& repairs) {
  Answer answer;
  const auto problems = count(findings, Finding::Verdict::kProblem);
  const auto warnings = count(findings, Finding::Verdict::kWarning);
  auto& list = answer.json["findings"] = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> rows;
  std::string advice;
  for (const Finding& finding : findings) {
    list.push_back({{"check", finding.check},
                    {"subject", finding.subject},
                    {"verdict", usb::words(finding.verdict)},
                    {"found", finding.found},
                    {"why", finding.why},
                    {"command", finding.command},
                    {"harmless", finding.harmless}});
    rows.push_back(
        {usb::words(finding.verdict), finding.check,
         finding.subject.empty() ? finding.found : fmt::format("{}: {}", finding.subject, finding.found)});
    if (finding.verdict != Finding::Verdict::kGood) {
      advice += fmt::format("\n{}{}{}: {}\n", finding.check, finding.subject.empty() ? "" : ", ",
                            finding.subject, finding.why);
      if (!finding.command.empty()) {
        advice += fmt::format("  mended by{}:\n    {}\n",
                              finding.harmless ? "" : " (look first: it changes what somebody made)",
                              finding.command);
      }
    }
  }
  answer.json["problems"] = problems;
  answer.json["warnings"] = warnings;
  auto& run = answer.json["repairs"] = nlohmann::ordered_json::array();
  for (const Repair& each : repairs) {
    run.push_back(
        {{"command", each.command}, {"outcome", words(each.outcome)}, {"exit_status", each.exit_status}});
  }
  answer.text = text_table(rows) + advice +
                fmt::format("\n{} problem{}, {} warning{}\n", problems, problems == 1 ? "" : "s", warnings,
                            warnings == 1 ? "" : "s");
  answer.failed = problems > 0;
  return answer;
}

Result<Answer> run(const Options& options, const Context& context) {
  Answer answer;
  if (options.udev_rule) {
    answer.text = usb::udev_rule();
    answer.json = {{"name", usb::kUdevRuleName}, {"content", usb::udev_rule()}};
    return answer;
  }
  const bool here = options.root == "/";
  if (options.fix && !here) {
    return fail(ErrorCode::kInvalidArgument, "--fix would change this system, not the one under --root",
                "leave out one of them");
  }
  usb::DiagnosisOptions asked;
  asked.root.path = options.root;
  asked.registry = here ? &context.registry : nullptr;
  asked.output_folder = options.output;
  asked.wait.stop = context.stop;
  asked.program = program();
  auto findings = usb::diagnose(asked);
  std::vector<Repair> repairs;
  if (options.fix) {
    repairs = repair(findings, options.yes, context.stop);
    if (std::ranges::any_of(repairs, [](const Repair& each) {
          return each.outcome == Repair::Outcome::kDone || each.outcome == Repair::Outcome::kFailed;
        })) {
      findings = usb::diagnose(asked);
    }
  }
  if (context.stop.stop_requested()) {
    // Instruments that were not asked for that reason have no problem.
    return fail(ErrorCode::kAborted, "doctor: stopped", "start it again when ready");
  }
  return describe(findings, repairs);
}

}  // namespace

Verb add_doctor(CLI::App& root) {
  auto* app = root.add_subcommand("doctor",
                                  "Find what keeps instruments from working, with the commands that mend it");
  auto options = std::make_shared<Options>();
  app->add_flag("--udev-rule", options->udev_rule, "Print the udev rule of this version and nothing else");
  auto* fix = app->add_flag("--fix", options->fix, "Offer to run the harmless ones of the commands");
  app->add_flag("--yes", options->yes, "With --fix: run them without asking")->needs(fix);
  app->add_option("-o,--output", options->output, "Folder where recordings would go, for its free space");
  app->add_option("--root", options->root, "Examine the system under this folder instead of this one")
      ->check(CLI::ExistingDirectory);
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
