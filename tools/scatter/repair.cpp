#include "tools/scatter/repair.h"

#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <thread>

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX leaves it to us

namespace scatter::cli {
namespace {

using device::usb::Finding;

/// "y" or "yes" and Enter. Anything else, the end of input and a stop are a no.
bool agreed(const std::stop_token& stop) {
  std::string line;
  while (!stop.stop_requested()) {
    pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    if (poll(&input, 1, 20) <= 0) {
      continue;
    }
    char c = 0;
    if (read(STDIN_FILENO, &c, 1) != 1) {
      break;
    }
    if (c == '\n') {
      return line == "y" || line == "Y" || line == "yes";
    }
    line += c;
  }
  std::fputs("\n", stderr);  // Nobody ended the question's line.
  return false;
}

/// What became of it, for the person who reads along.
void tell(const Repair& repair) {
  switch (repair.outcome) {
    case Repair::Outcome::kFailed:
      std::fprintf(stderr, "  failed with status %d\n", repair.exit_status);
      break;
    case Repair::Outcome::kNobodyToAsk:
      std::fprintf(stderr, "  %s; run it in a terminal, or with --yes\n", words(repair.outcome));
      break;
    case Repair::Outcome::kDone:
    case Repair::Outcome::kDeclined:
      std::fprintf(stderr, "  %s\n", words(repair.outcome));
      break;
  }
}

/// Exit status of the shell; -1 when it could not be started.
int run_in_shell(const std::string& command, const std::stop_token& stop) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  // This program blocks SIGINT for a thread that waits for it, and ignores SIGPIPE: not so the command.
  sigset_t none;
  sigset_t broken_pipe;
  sigemptyset(&none);
  sigemptyset(&broken_pipe);
  sigaddset(&broken_pipe, SIGPIPE);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &broken_pipe);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::string shell = "/bin/sh";
  std::string option = "-c";
  std::string text = command;
  const std::array<char*, 4> words = {shell.data(), option.data(), text.data(), nullptr};
  pid_t process = -1;
  const int started = posix_spawn(&process, shell.c_str(), &files, &attributes, words.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  if (started != 0) {
    return -1;
  }
  int status = 0;
  bool ended = false;
  while (waitpid(process, &status, WNOHANG) == 0) {
    if (stop.stop_requested() && !ended) {
      kill(process, SIGTERM);
      ended = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

const char* words(Repair::Outcome outcome) noexcept {
  switch (outcome) {
    case Repair::Outcome::kDone:
      return "done";
    case Repair::Outcome::kFailed:
      return "failed";
    case Repair::Outcome::kDeclined:
      return "declined";
    case Repair::Outcome::kNobodyToAsk:
      break;
  }
  return "not run: nobody to ask";
}

std::vector<Repair> repair(const std::vector<Finding>& findings, bool yes, const std::stop_token& stop) {
  const bool somebody = isatty(STDIN_FILENO) == 1 && isatty(STDERR_FILENO) == 1;
  std::vector<Repair> out;
  for (const Finding& finding : findings) {
    const bool wrong =
        finding.verdict == Finding::Verdict::kProblem || finding.verdict == Finding::Verdict::kWarning;
    const bool offered =
        std::ranges::any_of(out, [&](const Repair& each) { return each.command == finding.command; });
    if (!wrong || !finding.harmless || finding.command.empty() || offered || stop.stop_requested()) {
      continue;
    }
    Repair one{.command = finding.command};
    std::fprintf(stderr, "%s: %s\n  %s\n", finding.check.c_str(), finding.found.c_str(),
                 finding.command.c_str());
    if (!yes && !somebody) {
      one.outcome = Repair::Outcome::kNobodyToAsk;
    } else {
      if (!yes) {
        std::fputs("Run this command? (y/N) ", stderr);
        std::fflush(stderr);
      }
      if (yes || agreed(stop)) {
        one.exit_status = run_in_shell(one.command, stop);
        one.outcome = one.exit_status == 0 ? Repair::Outcome::kDone : Repair::Outcome::kFailed;
      }
    }
    tell(one);
    out.push_back(std::move(one));
  }
  return out;
}

}  // namespace scatter::cli
