// The checks of one instrument on the bus. Internal to this folder: programs use diagnose().
#pragma once

#include <vector>

#include "host_sdk/device/usb/computer_checks.h"
#include "host_sdk/device/usb/diagnosis.h"
#include "protocol/messages.h"

namespace scatter::device::usb {

void check_instrument(const DiagnosisOptions& options, const BusEntry& entry, RuleState rule,
                      std::vector<Finding>& out);

/// What an instrument's answer to HELLO says of its firmware and of its protocol.
void check_answer(const DiagnosisOptions& options, const BusEntry& entry, const protocol::HelloReply& hello,
                  std::vector<Finding>& out);

}  // namespace scatter::device::usb
