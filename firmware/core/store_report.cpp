#include "firmware/core/store_report.h"

namespace scatter::firmware {

using Condition = StoreReport::Condition;
using protocol::FaultCode;

FaultCode fault_of(const StoreReport& report) noexcept {
  switch (report.condition) {
    case Condition::kWhole:
      return report.whole_copies < 2 ? FaultCode::kFlashWrite : FaultCode::kNone;
    case Condition::kRecovered:
      return FaultCode::kCalibrationStoreRecovered;
    case Condition::kLaterVersion:
      return FaultCode::kStoreOfLaterVersion;
    case Condition::kUnusable:
      return FaultCode::kFlashWrite;
  }
  return FaultCode::kNone;
}

Text text_of(const StoreReport& report) noexcept {
  switch (report.condition) {
    case Condition::kLaterVersion:
      return Text("the store was written by a later firmware and is left untouched: update the firmware");
    case Condition::kUnusable:
      return Text("flash cannot be used: nothing will be remembered");
    case Condition::kWhole:
    case Condition::kRecovered:
      break;
  }
  Text text("store:");
  if (report.copy_used == 0 && report.damaged > 0) {
    text << " no whole record, begun anew;";
  }
  if (report.damaged > 0) {
    text << " " << report.damaged << " unfinished or damaged records dropped;";
  }
  if (report.copy_mended != 0) {
    text << " copy " << report.copy_mended << " mended from the other;";
  }
  if (report.bad_places > 0) {
    text << " " << report.bad_places << " bad places passed over;";
  }
  return text << (report.whole_copies < 2 ? " only one copy can be written" : " both copies are whole");
}

}  // namespace scatter::firmware
