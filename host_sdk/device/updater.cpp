#include "host_sdk/device/updater.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "host_sdk/device/update_check.h"

namespace scatter::device {
namespace {

using firmware_files::Package;
using protocol::FaultCode;
using protocol::ResetReason;
using RealClock = std::chrono::steady_clock;

/// Attempts in a row that brought no byte across before the last error is the answer.
constexpr int kFruitlessAttempts = 4;
constexpr auto kBetweenOpenings = std::chrono::milliseconds(100);
/// A device that was told to restart is gone after this.
constexpr auto kRestartBegins = std::chrono::seconds(2);
/// A relay may hold the connection that we closed for a moment longer; after this it is another host.
constexpr auto kOwnShadow = std::chrono::seconds(5);
constexpr Duration kFirstOpening = std::chrono::seconds(10);
constexpr Duration kOneOpening = std::chrono::seconds(5);
constexpr std::uint16_t kSelfTestFrames = 1;
constexpr int kSelfTests = 5;

bool final_answer(ErrorCode code) {
  return code == ErrorCode::kAborted || code == ErrorCode::kPermissionDenied ||
         code == ErrorCode::kUnimplemented || code == ErrorCode::kVersionMismatch || code == ErrorCode::kBusy;
}

/// One update from its first look to its end.
class Update {
 public:
  Update(const OpenDevice& open, const Package& package, const UpdateOptions& options)
      : open_(open), package_(package), options_(options) {}

  Result<UpdateReport> run() {
    if (const Status opened = connect(kFirstOpening); !opened) {
      return std::unexpected(opened.error());
    }
    auto plan = over_broken_links([this] { return look(); });
    if (plan && plan->start == UpdateStart::kRevert) {
      show(UpdateStage::kReverting);
      if (const Status restarted = restart(); !restarted) {
        return std::unexpected(restarted.error());
      }
      plan = over_broken_links([this] { return look(); });
      if (plan && plan->start == UpdateStart::kRevert) {
        return fail(ErrorCode::kFailedPrecondition,
                    "the running firmware is on trial and stays so after a restart",
                    "confirm it or switch the instrument off and on, then try again");
      }
    }
    if (!plan) {
      return std::unexpected(plan.error());
    }
    report_.slot = plan->slot;
    if (plan->start == UpdateStart::kConfirm) {
      report_.slot = state_.running_slot;
      report_.body_bytes = package_.image(report_.slot).header.body_bytes;
      return judge();
    }
    report_.body_bytes = package_.image(plan->slot).header.body_bytes;
    if (options_.about_to_begin) {
      options_.about_to_begin(state_, plan->slot);
    }
    if (const Status sent = send(); !sent) {
      return std::unexpected(sent.error());
    }
    show(UpdateStage::kRestarting);
    if (const Status restarted = restart(); !restarted) {
      return std::unexpected(restarted.error());
    }
    return judge();
  }

 private:
  [[nodiscard]] Wait wait() const { return {.timeout = options_.request, .stop = options_.stop}; }

  void show(UpdateStage stage, std::uint32_t done = 0) const {
    if (options_.progress) {
      options_.progress({.stage = stage, .done = done, .total = report_.body_bytes});
    }
  }

  Status connect(Duration timeout) {
    device_.reset();
    auto device = open_({.timeout = timeout, .stop = options_.stop});
    if (!device) {
      return std::unexpected(std::move(device.error()));
    }
    device_.emplace(std::move(*device));
    return {};
  }

  /// A link that breaks says nothing about the step that it interrupted: opens it and does the step again.
  template <typename Step>
  auto over_broken_links(Step step) -> decltype(step()) {
    for (int attempt = 1;; ++attempt) {
      auto done = step();
      if (done || done.error().code != ErrorCode::kDisconnected || attempt == kFruitlessAttempts) {
        return done;
      }
      if (const Status again = reconnect([](Device&) { return true; }); !again) {
        return std::unexpected(again.error());
      }
    }
  }

  /// Opens the device again and again until `good` says that it is the one waited for.
  template <typename Good>
  Status reconnect(Good good) {
    const auto begin = RealClock::now();
    const auto end = begin + options_.restart;
    for (;;) {
      const Status opened = connect(kOneOpening);
      if (opened && good(*device_)) {
        return {};
      }
      if (options_.stop.stop_requested()) {
        return fail(ErrorCode::kAborted, "stopped while the instrument was away",
                    "run the same command again: it goes on from here");
      }
      const bool busy = !opened && opened.error().code == ErrorCode::kBusy;
      if (busy && RealClock::now() >= begin + kOwnShadow) {
        return opened;
      }
      if (RealClock::now() >= end) {
        const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(options_.restart).count();
        return fail(ErrorCode::kDeadlineExceeded,
                    "the instrument did not come back within " + std::to_string(seconds) + " s" +
                        (opened ? std::string(": it did not restart") : ": " + opened.error().what),
                    "switch it off and on, then run the same command again: it goes on from where it is");
      }
      device_.reset();
      std::this_thread::sleep_for(kBetweenOpenings);
    }
  }

  /// Asks what the device holds, and whether the release may go there.
  Result<UpdatePlan> look() {
    protocol::UpdateState state;
    if ((device_->hello().capabilities & protocol::kCapabilityUpdate) != 0) {
      const auto answer = device_->update_status(wait());
      if (!answer) {
        return std::unexpected(answer.error());
      }
      state = *answer;
    }
    if (const auto status = device_->status(wait())) {
      fault_before_ = static_cast<FaultCode>(status->last_fault);
    }
    state_ = state;
    report_.before = state;
    return check_update(package_, device_->hello(), device_->hello().product.str(), state,
                        {.keys = options_.trusted, .same_version_too = options_.same_version_too});
  }

  /// Sends header and body, and has the device verify them; goes on after a lost link.
  Status send() {
    std::uint32_t best = 0;
    std::size_t depth = options_.depth;
    for (int fruitless = 0;;) {
      const Status sent = send_once(depth);
      if (sent) {
        return {};
      }
      Error error = sent.error();
      fruitless = received_ > best ? 0 : fruitless + 1;
      best = std::max(best, received_);
      // What the device refuses before it has anything, it will refuse again.
      const bool refused = error.code == ErrorCode::kInvalidArgument && !begun_;
      if (final_answer(error.code) || refused || fruitless >= kFruitlessAttempts) {
        return std::unexpected(std::move(error));
      }
      depth = 1;  // A piece that was lost on the way makes those sent behind it come out of order.
      ++report_.reconnections;
      if (const Status again = reconnect([](Device&) { return true; }); !again) {
        return again;
      }
    }
  }

  Status send_once(std::size_t depth) {
    const firmware_files::Image& image = package_.image(report_.slot);
    begun_ = false;
    show(UpdateStage::kPreparing);
    if (const Status begun = device_->update_begin(firmware_files::header_bytes(image.header), wait());
        !begun) {
      return begun;
    }
    begun_ = true;
    const auto state = device_->update_status(wait());
    if (!state) {
      return std::unexpected(state.error());
    }
    const std::uint32_t from = state->received;
    if (from > image.body.size()) {
      return fail(ErrorCode::kDataLoss,
                  "the device says that it has " + std::to_string(from) + " bytes of " +
                      std::to_string(image.body.size()),
                  "update the host's software");
    }
    received_ = std::max(received_, from);
    show(UpdateStage::kSending, from);
    const UpdatePieces how{
        .piece_bytes = state->chunk_bytes, .depth = depth, .progress = [&](std::uint32_t written) {
          report_.sent_bytes += written - written_;
          written_ = written;
          received_ = std::max(received_, from + written);
          show(UpdateStage::kSending, from + written);
        }};
    written_ = 0;
    const auto rest = std::span<const std::byte>(image.body).subspan(from);
    if (const Status wrote = device_->update_write(from, rest, how, wait()); !wrote) {
      return wrote;
    }
    show(UpdateStage::kVerifying);
    return device_->update_finish(wait());
  }

  Status restart() {
    const std::uint32_t boots = device_->hello().boot_count;
    // Its clock starts again, which tells when it cannot count its starts (in rescue mode, or its flash is
    // worn).
    const auto clock = device_->clock_sync(wait());
    const std::uint64_t up_us = clock ? clock->device_time_us : device_->hello().device_time_us;
    const auto reboot = [this] { return device_->reboot(wait()); };
    if (const Status told = reboot(); !told && told.error().code != ErrorCode::kDisconnected) {
      return told;
    }
    auto told_at = RealClock::now();
    return reconnect([&](Device& device) {
      if (device.hello().boot_count != boots || device.hello().device_time_us < up_us) {
        return true;
      }
      if (RealClock::now() >= told_at + kRestartBegins) {  // The link broke before the request was through.
        (void)device.reboot(wait());
        told_at = RealClock::now();
      }
      return false;
    });
  }

  /// After the restart: does the new firmware run, and is it well? Then it is kept, else it goes.
  Result<UpdateReport> judge() {
    show(UpdateStage::kChecking);
    return over_broken_links([this] { return judge_once(); });
  }

  Result<UpdateReport> judge_once() {
    if (const Status looked = look_after(); !looked) {
      return std::unexpected(looked.error());
    }
    if (!runs()) {
      report_.outcome = UpdateOutcome::kReverted;
      report_.why = unwell_.empty() ? why_it_does_not_run() : unwell_;
      if (const auto record = device_->fault_record(wait()); record && record->present != 0) {
        report_.fault = *record;
      }
      return report_;
    }
    if (const Status well = check_health(); !well) {
      const ErrorCode code = well.error().code;
      if (code == ErrorCode::kAborted || code == ErrorCode::kDisconnected) {
        return std::unexpected(well.error());
      }
      unwell_ = "version " + package_.version() + " started, but " + well.error().what;
      return give_up();
    }
    if (!options_.confirm) {
      report_.outcome = UpdateOutcome::kOnTrial;
      return report_;
    }
    if (const Status confirmed = device_->update_confirm(wait()); !confirmed) {
      return std::unexpected(confirmed.error());
    }
    if (const Status looked = look_after(); !looked) {
      return std::unexpected(looked.error());
    }
    if (report_.after.running_verdict != protocol::SlotVerdict::kConfirmed) {
      return fail(ErrorCode::kInternal,
                  "the instrument took the confirmation, but its slot is " +
                      std::string(words(report_.after.running_verdict)),
                  "run the same command again");
    }
    report_.outcome = UpdateOutcome::kConfirmed;
    return report_;
  }

  Status look_after() {
    const auto state = device_->update_status(wait());
    if (!state) {
      return std::unexpected(state.error());
    }
    report_.after = *state;
    report_.reset_reason = static_cast<ResetReason>(device_->hello().reset_reason);
    return {};
  }

  [[nodiscard]] bool runs() const {
    return (device_->hello().capabilities & protocol::kCapabilityRescue) == 0 &&
           report_.after.running_slot == report_.slot &&
           report_.after.running_version.str() == package_.version();
  }

  [[nodiscard]] std::string why_it_does_not_run() const {
    if ((device_->hello().capabilities & protocol::kCapabilityRescue) != 0) {
      return "no firmware could be started, the bootloader answers; slot " + std::to_string(report_.slot) +
             " is " + std::string(words(report_.after.other_verdict));
    }
    return "version " + std::string(report_.after.running_version.str()) + " runs in slot " +
           std::to_string(report_.after.running_slot) + ", slot " + std::to_string(report_.slot) + " is " +
           std::string(words(report_.after.other_verdict)) +
           "; last start: " + std::string(words(report_.reset_reason));
  }

  Status check_health() {
    const auto status = device_->status(wait());
    if (!status) {
      return std::unexpected(status.error());
    }
    const auto fault = static_cast<FaultCode>(status->last_fault);
    // A dead LED or a worn store was there before; only what is new speaks against the firmware.
    if (fault != FaultCode::kNone && fault != FaultCode::kCalibrationStoreRecovered &&
        fault != fault_before_) {
      return fail(ErrorCode::kInternal, "its status names a fault: " + std::string(words(fault)),
                  "report this to the maker of the firmware");
    }
    Result<SelfTestReport> test = device_->self_test(kSelfTestFrames, wait());
    // Frames that a bad link lost say nothing about the firmware.
    for (int k = 1; k < kSelfTests && test && test->frames != kSelfTestFrames; ++k) {
      test = device_->self_test(kSelfTestFrames, wait());
    }
    if (!test) {
      return fail(test.error().code, "its self test failed: " + test.error().what, test.error().remedy);
    }
    if (test->frames != kSelfTestFrames || test->wrong_pixels != 0) {
      return fail(ErrorCode::kInternal,
                  "its self test gave " + std::to_string(test->frames) + " whole frames of " +
                      std::to_string(kSelfTestFrames) + " and " + std::to_string(test->wrong_pixels) +
                      " wrong pixels",
                  "report this to the maker of the firmware");
    }
    return {};
  }

  /// The new firmware is not well: back to the old one.
  Result<UpdateReport> give_up() {
    show(UpdateStage::kReverting);
    if (const Status restarted = restart(); !restarted) {
      return fail(restarted.error().code, unwell_ + "; then " + restarted.error().what,
                  restarted.error().remedy);
    }
    if (const Status looked = look_after(); !looked) {
      return std::unexpected(looked.error());
    }
    report_.outcome = UpdateOutcome::kReverted;
    report_.why = unwell_;
    return report_;
  }

  const OpenDevice& open_;
  const Package& package_;
  const UpdateOptions& options_;
  std::optional<Device> device_;
  protocol::UpdateState state_;
  UpdateReport report_;
  FaultCode fault_before_ = FaultCode::kNone;
  std::string unwell_;  ///< What speaks against the new firmware.
  bool begun_ = false;
  std::uint32_t received_ = 0;  ///< Most that the device is known to have had.
  std::uint32_t written_ = 0;
};

}  // namespace

Result<UpdateReport> update_firmware(const OpenDevice& open, const Package& package,
                                     const UpdateOptions& options) {
  return Update(open, package, options).run();
}

}  // namespace scatter::device
