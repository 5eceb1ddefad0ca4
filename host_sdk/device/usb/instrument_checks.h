// The checks of one instrument on the bus. Internal to this folder: programs use diagnose().
#pragma once

#include <vector>

#include "host_sdk/device/usb/computer_checks.h"
#include "host_sdk/device/usb/diagnosis.h"

namespace scatter::device::usb {

void check_instrument(const DiagnosisOptions& options, const BusEntry& entry, RuleState rule,
                      std::vector<Finding>& out);

}  // namespace scatter::device::usb
