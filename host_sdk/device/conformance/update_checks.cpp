// Crashes and firmware updates: what must be told, and what must be refused.
#include <array>

#include "host_sdk/device/conformance/check_functions.h"
#include "host_sdk/device/conformance/wire_probe.h"
#include "protocol/image_header.h"

namespace scatter::conformance {

using protocol::StatusCode;

namespace {

void put(protocol::ImageText& out, std::string_view text) {
  for (std::size_t i = 0; i < text.size() && i < out.size(); ++i) {
    out[i] = static_cast<std::uint8_t>(text[i]);
  }
}

protocol::UpdateBegin announcing(const protocol::ImageHeader& header) {
  protocol::UpdateBegin out;
  std::array<std::byte, protocol::kImageHeaderBytes> bytes{};
  (void)protocol::encode(header, std::span(bytes));
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    out.header[i] = static_cast<std::uint8_t>(bytes[i]);
  }
  return out;
}

/// All but what says how far a hash has come.
bool same(const protocol::UpdateState& a, const protocol::UpdateState& b) {
  return a.phase == b.phase && a.received == b.received &&
         a.running_version.str() == b.running_version.str() &&
         a.other_version.str() == b.other_version.str() && a.running_slot == b.running_slot &&
         a.running_verdict == b.running_verdict && a.other_verdict == b.other_verdict &&
         a.running_counter == b.running_counter && a.other_counter == b.other_counter &&
         a.lowest_counter == b.lowest_counter;
}

}  // namespace

void check_fault_record(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  const auto record = probe->ask<protocol::FaultRecord>(protocol::FaultRecordRead{});
  if (!record) {
    return judge.broken("fault_record_read", record.error());
  }
  judge.require(record->present <= 1, fmt::format("present is {}, expected is 0 or 1", record->present));
  if (record->present == 0) {
    judge.require(record->pc == 0 && record->lr == 0 && record->sp == 0 && record->uptime_us == 0 &&
                      record->boot_count == 0,
                  "there was no crash, but the record is not empty");
    return judge.measured("no crash since power-on");
  }
  const auto reason = static_cast<protocol::ResetReason>(record->reason);
  judge.require(reason == protocol::ResetReason::kWatchdog || reason == protocol::ResetReason::kFault,
                fmt::format("a crash's reason is {}, expected is 2 (watchdog) or 3 (fault)", record->reason));
  judge.require(!record->build_id.str().empty(), "the record does not say which firmware crashed");
  judge.measured(
      fmt::format("crash in boot {} after {:.1f} s: exception {}, pc 0x{:08X}, lr 0x{:08X}, firmware {}",
                  record->boot_count, static_cast<double>(record->uptime_us) * 1e-6, record->exception,
                  record->pc, record->lr, record->build_id.str()));
}

void check_update_refusals(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  const auto hello = probe->hello(subject);
  if (!hello) {
    return judge.broken("hello", hello.error());
  }
  const auto before = probe->ask<protocol::UpdateState>(protocol::UpdateStatus{});
  if ((hello->capabilities & protocol::kCapabilityUpdate) == 0) {
    judge.refused("update_status of a device without update", before, ErrorCode::kUnimplemented);
    return judge.skip("the device has no update over the wire, and says so");
  }
  if (!before) {
    return judge.broken("update_status", before.error());
  }
  // Headers that are right in all but the signature: only a device that checks it refuses them.
  protocol::ImageHeader unsigned_header;
  put(unsigned_header.product, hello->product.str());
  put(unsigned_header.version, "conformance check");
  unsigned_header.security_counter = 0xFFFF'FFFF;
  unsigned_header.slot = before->running_slot == 0 ? 1 : 0;
  unsigned_header.body_bytes = 4096;
  protocol::ImageHeader other_product = unsigned_header;
  other_product.product = {};
  put(other_product.product, "not this product");
  protocol::ImageHeader no_magic = unsigned_header;
  no_magic.magic = 0;
  std::size_t refusals = 0;
  for (const auto& [what, header] : {std::pair("an image header without magic", no_magic),
                                     std::pair("an image header of another product", other_product),
                                     std::pair("an image header with a wrong signature", unsigned_header)}) {
    const auto answer = probe->status_of(announcing(header));
    if (!answer) {
      return judge.broken(what, answer.error());
    }
    const bool refused = *answer == StatusCode::kInvalidArgument ||
                         *answer == StatusCode::kPermissionDenied ||
                         *answer == StatusCode::kFailedPrecondition || *answer == StatusCode::kOutOfRange;
    judge.require(refused, fmt::format("{} was answered {}", what, protocol::info(*answer).name));
    const auto after = probe->ask<protocol::UpdateState>(protocol::UpdateStatus{});
    judge.require(after && same(*before, *after), fmt::format("{} changed the slots", what));
    if (!judge.good()) {
      return;  // A device that takes one bad header is not offered the next.
    }
    ++refusals;
  }
  if (before->phase == protocol::UpdatePhase::kIdle) {
    Bytes data(16, std::byte{0x5A});
    const auto write =
        probe->status_of(protocol::UpdateWrite{.offset = 0, .data = std::span<const std::byte>(data)});
    judge.require(write && *write == StatusCode::kFailedPrecondition,
                  "update_write before update_begin was not answered FAILED_PRECONDITION");
    const auto finish = probe->status_of(protocol::UpdateFinish{});
    judge.require(finish && *finish == StatusCode::kFailedPrecondition,
                  "update_finish before update_begin was not answered FAILED_PRECONDITION");
  }
  judge.measured(fmt::format("{} headers refused; running {} in slot {}, other slot: {}", refusals,
                             before->running_version.str(), before->running_slot,
                             before->other_version.str().empty() ? "no image" : before->other_version.str()));
}

}  // namespace scatter::conformance
