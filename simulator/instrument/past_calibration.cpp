#include "simulator/instrument/past_calibration.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "protocol/frame.h"
#include "protocol/link_decoder.h"
#include "protocol/messages.h"
#include "protocol/usb_identity.h"
#include "simulator/instrument/virtual_board.h"
#include "simulator/instrument/virtual_instrument.h"
#include "simulator/usb/usb_port.h"

namespace scatter::simulator {
namespace {

using namespace protocol;  // NOLINT(google-build-using-namespace): this file speaks nothing but protocol.

/// The earlier host's end of the carrier, whichever it is.
class EarlierCable {
 public:
  explicit EarlierCable(VirtualInstrument& instrument) : instrument_(instrument), usb_(instrument.usb()) {
    if (usb_ == nullptr) {
      instrument_.attach();
      return;
    }
    usb_->plug(UsbBusSpeed::kHigh);
    instrument_.run_ready();                       // It was switched on this very moment: let it join.
    constexpr std::uint8_t kSetConfiguration = 9;  // USB 2.0, table 9-4.
    constexpr std::uint8_t kSetInterface = 11;
    constexpr std::uint8_t kToInterface = 1;
    request({0, kSetConfiguration, 1, 0, 0, 0, 0, 0});
    request({kToInterface, kSetInterface, usb::kStreamOpenSetting, 0, usb::kStreamInterface, 0, 0, 0});
  }
  EarlierCable(const EarlierCable&) = delete;
  EarlierCable& operator=(const EarlierCable&) = delete;
  ~EarlierCable() {
    if (usb_ == nullptr) {
      instrument_.detach();
    } else {
      usb_->unplug();
      while (usb_->next_completion()) {
      }
      instrument_.run_ready();
    }
  }

  [[nodiscard]] bool write(const std::vector<std::byte>& bytes) {
    if (usb_ == nullptr) {
      return instrument_.host_write(bytes) == bytes.size();
    }
    const std::uint64_t id = ++last_id_;
    usb_->submit({.id = id, .endpoint = usb::kBulkOut, .data = bytes});
    instrument_.run_ready();
    const auto completion = usb_->next_completion();
    return completion && completion->id == id && completion->outcome == UsbOutcome::kDone;
  }

  /// Waits until `deadline_us` for bytes; maybe none.
  [[nodiscard]] std::vector<std::byte> read(std::uint64_t deadline_us) {
    std::vector<std::byte> received;
    if (usb_ == nullptr) {
      instrument_.run_until(deadline_us);
      received.resize(4096);
      received.resize(instrument_.host_read(received));
      return received;
    }
    usb_->submit({.id = ++last_id_, .endpoint = usb::kBulkIn, .length = usb::kTransferBytes});
    while (true) {
      const std::uint64_t wake = instrument_.run_ready();
      if (auto completion = usb_->next_completion()) {
        return std::move(completion->data);
      }
      if (instrument_.now_us() >= deadline_us) {
        (void)usb_->cancel(last_id_);
        (void)usb_->next_completion();
        return received;
      }
      instrument_.advance_to(std::min(wake, deadline_us));
    }
  }

 private:
  void request(const std::array<std::uint8_t, 8>& setup) {
    usb_->submit({.id = ++last_id_, .endpoint = 0, .setup = setup});
    instrument_.run_ready();
    (void)usb_->next_completion();
  }

  VirtualInstrument& instrument_;
  UsbPort* usb_;
  std::uint64_t last_id_ = 0;
};

/// The few requests of an earlier host, over the instrument's own carrier.
class EarlierHost {
 public:
  explicit EarlierHost(VirtualInstrument& instrument) : instrument_(instrument), cable_(instrument) {}

  /// Sends a request and waits for its reply of type R.
  template <typename R, typename M>
  Result<R> ask(const M& message) {
    std::vector<std::byte> bytes(kMaxFrameBytes);
    const FrameHeader header{.channel = Channel::kControl,
                             .sequence = correlation_,
                             .session = kNonce,
                             .correlation = static_cast<std::uint16_t>(correlation_ + 1)};
    ++correlation_;
    bytes.resize(write_message(bytes, header, message));
    if (!cable_.write(bytes)) {
      return refused(M::kName, "the link is full");
    }
    const std::uint64_t deadline = instrument_.now_us() + kPatienceUs;
    std::optional<R> reply;
    std::string refusal = "no answer";
    while (!reply && instrument_.now_us() < deadline) {
      decoder_.push(cable_.read(deadline), [&](const Frame& frame) {
        if (frame.header().correlation != header.correlation) {
          return;
        }
        if (const auto right = frame.as<R>()) {
          reply = *right;
        }
        if (const auto status = frame.as<StatusReply>()) {
          refusal = fmt::format("{}: {}", info(status->status).name, status->text.str());
        }
      });
    }
    if (!reply) {
      return refused(M::kName, refusal);
    }
    return *reply;
  }

 private:
  static constexpr std::uint16_t kNonce = 0x0001;
  static constexpr std::uint64_t kPatienceUs = 5'000'000;

  static std::unexpected<Error> refused(std::string_view request, const std::string& why) {
    return fail(ErrorCode::kInternal, fmt::format("simulated past calibration: {}: {}", request, why),
                "report this; it is a defect of ours");
  }

  VirtualInstrument& instrument_;
  EarlierCable cable_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(kMaxFrameBytes);
  LinkDecoder decoder_{buffer_};
  std::uint32_t correlation_ = 0;
};

Status done(const Result<StatusReply>& reply, std::string_view what) {
  if (!reply) {
    return std::unexpected(reply.error());
  }
  if (reply->status != StatusCode::kOk) {
    return fail(ErrorCode::kInternal,
                fmt::format("simulated past calibration: {}: {}", what, reply->text.str()),
                "report this; it is a defect of ours");
  }
  return {};
}

/// An id that no set of frames has: it does not come from a SHA-256.
CalibrationId past_id(Target kind) {
  CalibrationId id;
  id.fill(0x0D);
  id[0] = static_cast<std::uint8_t>(kind);
  return id;
}

Status commit_all(VirtualInstrument& instrument) {
  const Descriptor& descriptor = instrument.board().descriptor();
  EarlierHost host(instrument);
  if (const auto hello = host.ask<HelloReply>(Hello{.build_id = "past", .host_name = "earlier host"});
      !hello) {
    return std::unexpected(hello.error());
  }
  const auto begun = host.ask<CalibrationBegun>(CalibrationBegin{});
  if (!begun) {
    return std::unexpected(begun.error());
  }
  CalibrationManifest manifest;
  manifest.unix_time_s = instrument.unix_time_us() / 1'000'000;
  std::vector<CalibrationManifest> manifests;
  manifest.kind = Target::kDarkCap;
  manifest.id = past_id(manifest.kind);
  manifests.push_back(manifest);
  for (const ReferenceCertificate& certificate : descriptor.certificates) {
    if (certificate.kind == Target::kTranslucentReference && descriptor.transmission_module == 0) {
      continue;
    }
    manifest.kind = certificate.kind;
    manifest.id = past_id(certificate.kind);
    manifest.certificate_id = certificate.id;
    manifests.push_back(manifest);
  }
  for (const CalibrationManifest& each : manifests) {
    const CalibrationCommit commit{.session = begun->session, .manifest = each};
    if (Status committed = done(host.ask<StatusReply>(commit), "calibration_commit"); !committed) {
      return committed;
    }
  }
  const CalibrationEnd end{.session = begun->session};
  return done(host.ask<StatusReply>(end), "calibration_end");
}

}  // namespace

std::uint64_t past_life_us(const Descriptor& descriptor) noexcept {
  const std::uint64_t life_s = std::max(descriptor.reference_lifetime_s, descriptor.dark_lifetime_s);
  return (life_s + 3600) * 1'000'000;
}

Status hold_past_calibration(VirtualInstrument& instrument) {
  if (Status committed = commit_all(instrument); !committed) {
    return committed;
  }
  instrument.board().clock().skip(past_life_us(instrument.board().descriptor()));
  return {};
}

}  // namespace scatter::simulator
