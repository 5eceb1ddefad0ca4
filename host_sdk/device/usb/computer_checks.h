// The checks of the computer itself. Internal to this folder: programs use diagnose().
#pragma once

#include <cstddef>
#include <vector>

#include "host_sdk/device/usb/diagnosis.h"

namespace scatter::device::usb {

/// What is known of the installed udev rule.
enum class RuleState { kCurrent, kOther, kMasked, kMissing };
[[nodiscard]] RuleState rule_state(const SystemRoot& root);

/// `instruments`: how many are plugged in, which is what transfer memory depends on.
void check_computer(const DiagnosisOptions& options, std::size_t instruments, std::vector<Finding>& out);

}  // namespace scatter::device::usb
