// Takes a firmware image over the wire into the slot that does not run: begin, write by offset, finish,
// confirm, status. Used by the dispatcher and by the bootloader's rescue mode; knows no session.
//
// Everything about an update that must survive a power cut lies in the slot itself (protocol/image_header.h
// and firmware/image/marks.h); this object only remembers where it is.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "firmware/core/text.h"
#include "firmware/image/body_check.h"
#include "firmware/image/slot_view.h"
#include "firmware/ports/ports.h"
#include "protocol/frame.h"

namespace scatter::firmware {

/// What an update request led to. kPending: poll() gives the end of it.
struct UpdateAnswer {
  protocol::StatusCode status = protocol::StatusCode::kOk;
  Text text;
  bool with_state = false;  ///< Reply with state() instead of a status.
};

/// RAM: about 2 KiB, no heap. Threads: one.
class UpdateReceiver {
 public:
  /// A pending request is answered, or promised anew, within this time [ms].
  static constexpr std::uint32_t kPendingMs = 5000;
  /// Promise anew after this time [us].
  static constexpr std::uint64_t kPromiseAgainUs = 2'000'000;
  static constexpr std::uint32_t kMaxChunk = 4096;  ///< Largest chunk_bytes.

  /// `product` must outlive the receiver, as the others must.
  UpdateReceiver(ImageSlots& slots, Verifier& verifier, std::string_view product) noexcept;

  /// Serves any update message; `max_payload` of the session bounds chunk_bytes. A request while another one
  /// is pending gets UNAVAILABLE. Worst case: kMaxChunk bytes programmed and read back, or one signature
  /// check.
  [[nodiscard]] UpdateAnswer request(const protocol::Frame& frame, std::uint32_t max_payload) noexcept;
  /// The same one by one, for who has no frames; not while busy().
  [[nodiscard]] UpdateAnswer begin(const protocol::UpdateBegin& message) noexcept;
  [[nodiscard]] UpdateAnswer write(const protocol::UpdateWrite& message) noexcept;
  [[nodiscard]] UpdateAnswer finish() noexcept;
  [[nodiscard]] UpdateAnswer confirm() noexcept;
  [[nodiscard]] UpdateAnswer status(std::uint32_t max_payload) noexcept;

  /// One bounded piece of a pending request: one unit read or erased, or one piece hashed. The answer, when
  /// that was the last one.
  [[nodiscard]] std::optional<UpdateAnswer> poll() noexcept;
  /// Something is pending.
  [[nodiscard]] bool busy() const noexcept { return job_ != Job::kNone; }
  /// The host is gone: what is pending stops where it is; the same UpdateBegin resumes.
  void cancel() noexcept {
    if (busy() && job_ != Job::kInspect) {
      target_ = ImageSlots::kCount;
    }
    job_ = Job::kNone;
  }

  /// For UpdateStatus, after an answer with_state.
  [[nodiscard]] const protocol::UpdateState& state() const noexcept { return state_; }

 private:
  enum class Job : std::uint8_t { kNone, kFindEnd, kErase, kFinish, kInspect };
  enum class Content : std::uint8_t { kErased, kProgrammed, kUnreadable };
  using Answer = UpdateAnswer;
  static constexpr std::uint32_t kReadBytes = 512;

  [[nodiscard]] Answer refusal(HeaderFault fault, const protocol::ImageHeader& header,
                               const SlotIdentity& slot) const noexcept;
  void look() noexcept;
  [[nodiscard]] std::uint8_t other() const noexcept;
  void find_end_step() noexcept;
  void start_erase(std::uint32_t first_unit, std::uint32_t end_unit) noexcept;
  [[nodiscard]] std::optional<Answer> erase_step() noexcept;
  [[nodiscard]] std::optional<Answer> write_header() noexcept;
  [[nodiscard]] std::optional<Answer> finish_step() noexcept;
  [[nodiscard]] std::optional<Answer> inspect_step() noexcept;
  [[nodiscard]] Content content_of(Flash& flash, std::uint32_t unit, std::uint32_t unit_bytes) noexcept;
  [[nodiscard]] static bool program(Flash& flash, std::uint32_t offset,
                                    std::span<const std::byte> bytes) noexcept;
  [[nodiscard]] bool same_bytes(Flash& flash, std::uint32_t offset,
                                std::span<const std::byte> bytes) noexcept;
  void fill_state(std::uint32_t max_payload) noexcept;

  ImageSlots& slots_;
  Verifier& verifier_;
  std::string_view product_;

  std::array<SlotView, ImageSlots::kCount> views_{};
  bool looked_ = false;                                  // views_ are up to date.
  std::array<bool, ImageSlots::kCount> body_checked_{};  // The verdict includes the body's hash.

  Job job_ = Job::kNone;
  std::uint8_t target_ = ImageSlots::kCount;  // Slot that receives; kCount: none.
  std::array<std::byte, protocol::kImageHeaderBytes> header_{};
  std::uint32_t body_bytes_ = 0;
  std::uint32_t received_ = 0;   // Of the body, from its start.
  std::uint32_t next_unit_ = 0;  // kFindEnd, kErase: counts down, to keep_units_ when erasing.
  std::uint32_t keep_units_ = 0;
  std::uint32_t end_unit_ = 0;  // kFindEnd: behind all that may be half-done; 0 = nothing found yet.
  bool marks_erased_ = false;
  std::uint32_t max_payload_ = protocol::kMaxPayload;
  BodyCheck body_;
  std::array<std::byte, kReadBytes> buffer_{};
  protocol::UpdateState state_;
};

}  // namespace scatter::firmware
