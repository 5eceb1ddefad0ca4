// Runs the commands of a diagnosis that a person agreed to.
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/device/usb/diagnosis.h"

namespace scatter::cli {

/// What became of one command.
struct Repair {
  enum class Outcome { kDone, kFailed, kDeclined, kNobodyToAsk };
  std::string command;
  Outcome outcome = Outcome::kDeclined;
  int exit_status = 0;  ///< 128 + signal when killed.
};
[[nodiscard]] const char* words(Repair::Outcome outcome) noexcept;

/// Offers the harmless command of every warning and problem, each once: shows it on standard error, asks
/// (y/N) unless `yes`, and runs it with /bin/sh; its output goes to standard error. Without a terminal and
/// without `yes` nothing is run. A stop ends the command under way and asks no more.
[[nodiscard]] std::vector<Repair> repair(const std::vector<device::usb::Finding>& findings, bool yes,
                                         const std::stop_token& stop);

}  // namespace scatter::cli
