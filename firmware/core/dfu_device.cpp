// The comments name the tables of DFU 1.1, appendix A.2.
#include "firmware/core/dfu_device.h"

#include <algorithm>

namespace scatter::firmware {

namespace {

DfuStatus status_of(PackageFault fault) noexcept {
  switch (fault) {
    case PackageFault::kNone:
      return DfuStatus::kOk;
    case PackageFault::kProduct:
      return DfuStatus::kErrTarget;
    case PackageFault::kFormat:
    case PackageFault::kRefused:
      return DfuStatus::kErrFile;
    case PackageFault::kNotNow:
      return DfuStatus::kErrVendor;
    case PackageFault::kErase:
      return DfuStatus::kErrErase;
    case PackageFault::kProgram:
      return DfuStatus::kErrProg;
    case PackageFault::kVerify:
      return DfuStatus::kErrVerify;
    case PackageFault::kIncomplete:
      return DfuStatus::kErrNotDone;
    case PackageFault::kUnknown:
      return DfuStatus::kErrUnknown;
  }
  return DfuStatus::kErrUnknown;
}

}  // namespace

DfuDevice::DfuDevice(Clock& clock, ImageSlots& slots, UpdateReceiver& receiver, std::string_view product,
                     std::uint16_t interface_number) noexcept
    : clock_(clock), slots_(slots), stream_(receiver, product), interface_(interface_number) {
  if (slots_.running() >= ImageSlots::kCount) {
    state_ = DfuState::kError;
    status_ = DfuStatus::kErrFirmware;
  }
}

void DfuDevice::poll() noexcept {
  if (stream_.busy()) {
    stream_.step();
  }
  advance();
}

/// What happens without a request: faults of the work in the background, and timers.
void DfuDevice::advance() noexcept {
  if (state_ == DfuState::kDnloadSync || state_ == DfuState::kDnbusy || state_ == DfuState::kManifestSync ||
      state_ == DfuState::kManifest) {
    if (stream_.fault() != PackageFault::kNone) {
      fail(status_of(stream_.fault()));
      return;
    }
  }
  const bool due = clock_.now_us() >= until_us_;
  if (state_ == DfuState::kAppDetach && due) {
    state_ = DfuState::kAppIdle;
  } else if (state_ == DfuState::kDnbusy && (due || !stream_.busy())) {
    state_ = DfuState::kDnloadSync;
  } else if (state_ == DfuState::kManifest && (due || !stream_.busy())) {
    state_ = DfuState::kManifestSync;
  }
}

void DfuDevice::fail(DfuStatus status) noexcept {
  stream_.cancel();
  state_ = DfuState::kError;
  status_ = status;
}

void DfuDevice::wait(DfuState state, std::uint32_t poll_ms) noexcept {
  state_ = state;
  poll_ms_ = poll_ms;
  until_us_ = clock_.now_us() + std::uint64_t{poll_ms} * 1000 / 2;
}

/// STALL and dfuERROR; the first reason stays until CLRSTATUS.
DfuReply DfuDevice::refuse(DfuStatus status) noexcept {
  if (state_ != DfuState::kError) {
    fail(status);
  }
  return {.stall = true};
}

DfuReply DfuDevice::give_status(std::uint16_t length) const noexcept {
  const bool waiting = state_ == DfuState::kDnbusy || state_ == DfuState::kManifest;
  const std::uint32_t wait_ms = waiting ? poll_ms_ : 0;
  DfuReply reply;
  reply.bytes = {static_cast<std::byte>(status_),
                 static_cast<std::byte>(wait_ms & 0xFFU),
                 static_cast<std::byte>((wait_ms >> 8U) & 0xFFU),
                 static_cast<std::byte>((wait_ms >> 16U) & 0xFFU),
                 static_cast<std::byte>(state_),
                 std::byte{0}};  // iString: none.
  reply.size = static_cast<std::uint8_t>(std::min<std::size_t>(length, reply.bytes.size()));
  return reply;
}

DfuReply DfuDevice::give_state(std::uint16_t length) const noexcept {
  DfuReply reply;
  reply.bytes[0] = static_cast<std::byte>(state_);
  reply.size = static_cast<std::uint8_t>(std::min<std::size_t>(length, 1));
  return reply;
}

DfuReply DfuDevice::request(const DfuRequest& request) noexcept {
  if (request.index != interface_) {
    return {.stall = true};
  }
  advance();  // Timers first: the main loop may not have turned since.
  if (state_ == DfuState::kAppIdle || state_ == DfuState::kAppDetach) {
    return in_application(request);
  }
  served_ = true;
  if (state_ == DfuState::kDnbusy || state_ == DfuState::kManifest) {
    return refuse();  // A.2.5 and A.2.8: any request.
  }
  switch (static_cast<DfuRequestCode>(request.request)) {
    case DfuRequestCode::kGetStatus:
      return get_status(request);
    case DfuRequestCode::kGetState:
      return give_state(request.length);
    case DfuRequestCode::kDnload:
      if (state_ == DfuState::kIdle || state_ == DfuState::kDnloadIdle) {
        return download(request);
      }
      return refuse();
    case DfuRequestCode::kAbort:
      if (state_ == DfuState::kIdle || state_ == DfuState::kDnloadIdle) {
        stream_.cancel();
        state_ = DfuState::kIdle;
        return {};
      }
      return refuse();
    case DfuRequestCode::kClrStatus:
      if (state_ == DfuState::kError) {
        state_ = DfuState::kIdle;
        status_ = DfuStatus::kOk;
        return {};
      }
      return refuse();
    default:
      return refuse();
  }
}

/// A.2.1 and A.2.2.
DfuReply DfuDevice::in_application(const DfuRequest& request) noexcept {
  switch (static_cast<DfuRequestCode>(request.request)) {
    case DfuRequestCode::kGetStatus:
      return give_status(request.length);
    case DfuRequestCode::kGetState:
      return give_state(request.length);
    case DfuRequestCode::kDetach:
      if (state_ == DfuState::kAppIdle) {
        state_ = DfuState::kAppDetach;
        until_us_ = clock_.now_us() + std::uint64_t{std::min(request.value, kDfuDetachTimeoutMs)} * 1000;
        return {.detach = true};
      }
      break;
    default:
      break;
  }
  state_ = DfuState::kAppIdle;
  return {.stall = true};
}

/// A.2.4 and A.2.7; elsewhere it changes nothing.
DfuReply DfuDevice::get_status(const DfuRequest& request) noexcept {
  if (state_ == DfuState::kDnloadSync) {
    if (stream_.busy()) {
      wait(DfuState::kDnbusy, kBlockPollMs);
    } else {
      state_ = DfuState::kDnloadIdle;
    }
  } else if (state_ == DfuState::kManifestSync) {
    if (stream_.busy()) {
      wait(DfuState::kManifest, kManifestPollMs);
    } else if (stream_.complete() && !manifested_) {
      manifested_ = true;
      stream_.finish();
      wait(DfuState::kManifest, kManifestPollMs);
    } else {
      stream_.cancel();
      state_ = DfuState::kIdle;
    }
  }
  return give_status(request.length);
}

/// A.2.3 and A.2.6.
DfuReply DfuDevice::download(const DfuRequest& request) noexcept {
  if (request.length == 0) {
    if (state_ == DfuState::kIdle) {
      return refuse();
    }
    if (!stream_.complete()) {
      return refuse(DfuStatus::kErrNotDone);
    }
    manifested_ = false;
    state_ = DfuState::kManifestSync;
    return {};
  }
  if (request.length > kDfuTransferBytes || request.data.size() != request.length) {
    return refuse();
  }
  if (state_ == DfuState::kIdle) {
    stream_.start();
  } else if (request.value != next_block_) {
    return refuse(DfuStatus::kErrAddress);
  }
  next_block_ = static_cast<std::uint16_t>(request.value + 1);
  stream_.take(request.data);
  state_ = DfuState::kDnloadSync;
  return {};
}

/// A.2, "USB reset signaling detected". An unfinished download never makes the firmware that runs corrupt.
DfuAfterReset DfuDevice::bus_reset() noexcept {
  advance();
  if (state_ == DfuState::kAppDetach) {
    state_ = DfuState::kIdle;
    status_ = DfuStatus::kOk;
    served_ = false;
    return DfuAfterReset::kDfuMode;
  }
  if (state_ == DfuState::kAppIdle) {
    return DfuAfterReset::kRunTime;
  }
  if (stream_.ready()) {
    return DfuAfterReset::kRestart;
  }
  if (!served_) {
    return DfuAfterReset::kDfuMode;
  }
  stream_.cancel();
  if (slots_.running() >= ImageSlots::kCount) {
    state_ = DfuState::kError;
    status_ = DfuStatus::kErrFirmware;
    return DfuAfterReset::kDfuMode;
  }
  state_ = DfuState::kAppIdle;
  status_ = DfuStatus::kOk;
  return DfuAfterReset::kRunTime;
}

}  // namespace scatter::firmware
