// The bootloader's own voice: answers the host when no image can be started, and takes an update.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "firmware/boot/boot_decision.h"
#include "firmware/core/link_output.h"
#include "firmware/core/request_reader.h"
#include "firmware/core/step.h"
#include "firmware/core/update_receiver.h"
#include "firmware/ports/ports.h"
#include "protocol/session.h"

namespace scatter::firmware {

/// What rescue mode needs of a board; all outlive the Rescue. ImageSlots::running() must be kCount.
struct RescuePorts {
  Clock& clock;
  Link& link;
  Watchdog& watchdog;
  Reset& reset;
  ImageSlots& slots;
  Verifier& verifier;
  std::string_view product;   ///< As in the descriptor.
  std::string_view serial;    ///< As in the descriptor.
  std::string_view build_id;  ///< Of the bootloader, at most 32 bytes.
};

/// Serves HELLO, the update messages, fault_record_read, get_status, clock_sync and reboot; any other request
/// gets FAILED_PRECONDITION that tells to flash a firmware image. No heap; RAM: about 38 KiB, in static
/// memory.
class Rescue {
 public:
  explicit Rescue(const RescuePorts& ports) noexcept;
  Rescue(const Rescue&) = delete;
  Rescue& operator=(const Rescue&) = delete;

  /// One turn of the main loop, to be called for ever like Instrument::poll. Worst case: one erase of a unit.
  [[nodiscard]] Step poll() noexcept;

 private:
  using Header = protocol::FrameHeader;
  using Frame = protocol::Frame;
  static constexpr std::size_t kReceiveBytes = 512;
  static constexpr std::size_t kCacheSlots = 4;
  static constexpr std::size_t kCacheSlotBytes = 512;

  void follow_link() noexcept;
  bool receive() noexcept;
  bool go_on() noexcept;
  void on_frame(const Frame& frame) noexcept;
  void execute(const Frame& frame) noexcept;
  void hello(const Frame& frame) noexcept;
  void get_status(const Header& request) noexcept;
  void answer(const Header& request, const UpdateAnswer& answer) noexcept;
  template <protocol::Message M>
  void reply(const Header& request, const M& message) noexcept;
  void reply_status(const Header& request, protocol::StatusCode status, std::string_view text,
                    std::uint32_t pending_ms = 0) noexcept;

  RescuePorts ports_;
  std::array<std::byte, protocol::kMaxFrameBytes> decoder_bytes_{};
  std::array<std::byte, kReceiveBytes> received_{};
  RequestReader reader_;
  bool session_open_ = false;
  std::uint64_t reboot_at_us_ = 0;  // 0 = no reboot asked for.
  bool rebooting_ = false;
  std::uint32_t stale_frames_ = 0;
  std::uint32_t duplicates_ = 0;

  LinkOutput output_;
  std::array<std::byte, kCacheSlots * kCacheSlotBytes> cache_bytes_{};
  protocol::ReplyCache cache_{cache_bytes_, kCacheSlots};
  UpdateReceiver update_;
  std::optional<Header> waiting_;  // Update request that has not got its last reply.
  std::uint64_t promised_us_ = 0;
  std::uint32_t max_payload_ = protocol::kMaxPayload;
};

}  // namespace scatter::firmware
