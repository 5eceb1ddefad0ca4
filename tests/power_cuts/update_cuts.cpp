// Cuts in a firmware update: at every flash operation of the download, of its verification, of the start of
// the trial, of the confirmation, of the way back, and of the bootloader's own repairs. Promises after each:
// - the device starts an image at every power-on, never rescue mode;
// - what it starts is the old or the new image, bit for bit;
// - it never goes back from an image whose confirmation it has acted on, nor to one that it has given up;
// - an image that nobody confirmed is reverted at the next power-on;
// - the update can then be completed and confirmed, and stays;
// - no cell is programmed that is not erased.
#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "firmware/boot/boot_decision.h"
#include "firmware/core/update_receiver.h"
#include "tests/power_cuts/scenario.h"
#include "tests/unit/firmware/test_images.h"

namespace scatter::power_cuts {
namespace {

using firmware::BootDecision;
using firmware::Flash;
using firmware::ImageSlots;
using firmware::MarkKind;
using firmware::UpdateAnswer;
using firmware::UpdateReceiver;
using firmware::fake::Image;
using firmware::fake::TestSlots;
using protocol::ResetReason;
using protocol::StatusCode;

constexpr std::string_view kProduct = "HS-1 test";

/// Images and geometry that all trials of a scenario share.
struct Cast {
  Flash::Geometry geometry;
  std::uint32_t chunk = 0;  ///< Bytes per write.
  Image old_image;          ///< In slot 0, confirmed.
  Image spare;              ///< In slot 1 when the scenario begins with one.
  Image new_image;          ///< For slot 1.
};

enum class Act : std::uint8_t {
  kDownload,  ///< Begin, write, finish.
  kResume,    ///< The same after a download that was broken off.
  kTrial,     ///< From a ready image: boot, confirm, boot.
  kRevert,    ///< From a ready image: boot, not confirmed, boot.
  kWhole,     ///< Download, trial, confirm.
};

class UpdateTrial final : public Trial {
 public:
  UpdateTrial(const Cast& cast, Act act) : cast_(&cast), act_(act), slots_(cast.geometry) {}
  UpdateTrial(const UpdateTrial&) = default;

  [[nodiscard]] std::unique_ptr<Trial> clone() const override { return std::make_unique<UpdateTrial>(*this); }
  [[nodiscard]] simulator::Supply& supply() override { return slots_.supply; }

  /// Brings the device into the scenario's starting state.
  void prepare(bool with_spare) {
    slots_.supply.power_on();
    slots_.install(cast_->old_image, {{MarkKind::kConfirmed, 2}});
    if (with_spare) {
      slots_.install(cast_->spare, {{MarkKind::kReady, 0}, {MarkKind::kTried, 0}, {MarkKind::kConfirmed, 1}});
    }
    if (act_ == Act::kResume) {
      (void)boot();
      (void)download(cast_->new_image.header.body_bytes * 2 / 3);
    } else if (act_ == Act::kTrial || act_ == Act::kRevert) {
      slots_.install(cast_->new_image, {{MarkKind::kReady, 0}});
    }
    problem_.clear();
    given_up_ = false;
  }

  void act() override {
    switch (act_) {
      case Act::kDownload:
      case Act::kResume:
        (void)(boot() && download());
        return;
      case Act::kTrial:
        (void)(boot() && confirm() && boot());
        return;
      case Act::kRevert:
        (void)(boot() && boot());
        return;
      case Act::kWhole:
        (void)(boot() && download() && boot() && confirm() && boot());
        return;
    }
  }

  /// The next power-on: whatever runs, the host tries to complete the update, up to the confirmation.
  void recover() override {
    if (boot() && runs_new()) {
      (void)confirm();
    } else if (!supply().lost() && runs_old()) {
      (void)(download() && boot());
    }
  }

  [[nodiscard]] std::string judge() override {
    if (!boot()) {
      return problem_;
    }
    // Several power-ons in a row: unstable cells are drawn again each time.
    for (int i = 0; i < 3; ++i) {
      const bool was_new = runs_new();
      const bool was_trial = decision_.trial;
      slots_.supply.power_on();
      if (!boot()) {
        return problem_;
      }
      if (was_new && !was_trial && !runs_new()) {
        return "went back from a confirmed image";
      }
      if (was_trial && decision_.slot == 1 && was_new) {
        return "an image that nobody confirmed was not reverted";
      }
    }
    if (runs_new() && decision_.trial && !confirm()) {
      return problem_;
    }
    if (runs_old() && !complete()) {
      return problem_.empty() ? "the update could not be completed" : problem_;
    }
    for (int i = 0; i < 2; ++i) {
      slots_.supply.power_on();
      if (!boot()) {
        return problem_;
      }
      if (!runs_new() || decision_.trial) {
        return "the confirmed new image does not stay";
      }
    }
    return slots_.violations() == 0 ? problem_ : violation();
  }

 private:
  [[nodiscard]] bool runs_new() const { return decision_.slot == cast_->new_image.header.slot; }
  [[nodiscard]] bool runs_old() const { return decision_.slot == cast_->old_image.header.slot; }
  [[nodiscard]] std::string violation() const {
    return "flash was misused: " +
           (slots_.parts[0].violations() > 0 ? slots_.parts[0].violation() : slots_.parts[1].violation());
  }
  /// Keeps the first broken promise; false.
  bool broken(std::string promise) {
    if (problem_.empty() && !supply().lost()) {
      problem_ = std::move(promise);
    }
    return false;
  }

  /// The bootloader. False: the power went, or a promise broke.
  bool boot() {
    slots_.runs = ImageSlots::kCount;
    decision_ = firmware::decide(slots_, verifier_, kProduct, ResetReason::kPowerOn);
    if (supply().lost()) {
      return false;
    }
    if (decision_.action != BootDecision::Action::kRun) {
      return broken(fmt::format("the device fell into rescue mode (slots: {}, {})",
                                static_cast<int>(decision_.verdicts[0]),
                                static_cast<int>(decision_.verdicts[1])));
    }
    slots_.runs = decision_.slot;
    const Image& started = runs_old() ? cast_->old_image : cast_->new_image;
    if (!same(started) && !(decision_.slot == 1 && same(cast_->spare))) {
      return broken("what was started is neither the old image nor the new one");
    }
    if (slots_.violations() != 0) {
      return broken(violation());
    }
    if (decision_.slot == 1 && same(cast_->new_image) && given_up_) {
      return broken("started an image that it had given up");
    }
    given_up_ = given_up_ || (runs_old() && decision_.verdicts[1] == protocol::SlotVerdict::kReverted);
    return true;
  }

  [[nodiscard]] bool same(const Image& image) {
    std::vector<std::byte> bytes(image.body.size());
    return slots_.slot(decision_.slot).read(protocol::kImageBodyOffset, bytes) && bytes == image.body;
  }

  /// Runs a request to its end.
  StatusCode end_of(UpdateReceiver& receiver, const UpdateAnswer& first) {
    std::optional<UpdateAnswer> answer = first;
    while (answer->status == StatusCode::kPending) {
      do {
        answer = receiver.poll();
      } while (!answer);
    }
    text_ = answer->text.str();
    return answer->status;
  }

  /// Begin, write up to `end`, and finish when that is everything.
  bool download(std::uint32_t end = 0xFFFF'FFFF) {
    given_up_ = false;
    UpdateReceiver receiver(slots_, verifier_, kProduct);
    const Image& image = cast_->new_image;
    const std::uint32_t stop = std::min(end, image.header.body_bytes);
    protocol::UpdateBegin begin;
    std::ranges::transform(image.header_bytes, begin.header.begin(),
                           [](std::byte b) { return static_cast<std::uint8_t>(b); });
    if (end_of(receiver, receiver.begin(begin)) != StatusCode::kOk ||
        end_of(receiver, receiver.status(protocol::kMaxPayload)) != StatusCode::kOk) {
      return broken("update_begin failed: " + text_);
    }
    for (std::uint32_t at = receiver.state().received; at < stop;) {
      protocol::UpdateWrite write;
      const std::uint32_t size = std::min(cast_->chunk, stop - at);
      write.offset = at;
      write.data = std::span(image.body).subspan(at, size);
      if (end_of(receiver, receiver.write(write)) != StatusCode::kOk) {
        return broken("update_write failed: " + text_);
      }
      at += size;
    }
    if (stop == image.header.body_bytes && end_of(receiver, receiver.finish()) != StatusCode::kOk) {
      return broken("update_finish failed: " + text_);
    }
    return !supply().lost();
  }

  bool confirm() {
    UpdateReceiver receiver(slots_, verifier_, kProduct);
    if (end_of(receiver, receiver.confirm()) != StatusCode::kOk) {
      return broken("update_confirm failed: " + text_);
    }
    return !supply().lost();
  }

  /// As a patient user does: send again whatever was reverted, until it runs and is confirmed.
  bool complete() {
    for (int attempt = 0; attempt < 3; ++attempt) {
      if (!download() || !boot()) {
        return false;
      }
      if (runs_new()) {
        return confirm();
      }
    }
    return broken("the new image is never tried");
  }

  const Cast* cast_;
  Act act_;
  TestSlots slots_;
  firmware::fake::RememberingVerifier verifier_;
  BootDecision decision_;
  bool given_up_ = false;  ///< The bootloader has said that the new image is reverted.
  std::string problem_;
  std::string text_;
};

class UpdateScenario final : public Scenario {
 public:
  UpdateScenario(std::shared_ptr<const Cast> cast, std::string name, Act act, bool with_spare)
      : cast_(std::move(cast)), name_(std::move(name)), act_(act), with_spare_(with_spare) {}

  [[nodiscard]] std::string name() const override {
    const Flash::Geometry& g = cast_->geometry;
    return fmt::format("update:{}x{}/{}:{}", g.unit_bytes, g.units, g.program_bytes, name_);
  }
  [[nodiscard]] std::unique_ptr<Trial> begin() const override {
    auto trial = std::make_unique<UpdateTrial>(*cast_, act_);
    trial->prepare(with_spare_);
    return trial;
  }
  [[nodiscard]] Thoroughness thoroughness(bool quick) const override {
    return quick ? Thoroughness{.details = 1, .double_share = 97}
                 : Thoroughness{.details = 4, .double_share = 7};
  }

 private:
  std::shared_ptr<const Cast> cast_;
  std::string name_;
  Act act_;
  bool with_spare_;
};

}  // namespace

void add_update_cuts(Scenarios& scenarios) {
  struct Variant {
    Flash::Geometry geometry;
    std::uint32_t chunk;
    std::uint32_t body_bytes;
  };
  // Chunks of a serial line (960 B) and of a fast one; bodies that end inside a granule and at a unit's end.
  constexpr std::array kVariants{
      Variant{{.unit_bytes = 4096, .units = 5, .program_bytes = 8}, 960, 11'003},
      Variant{{.unit_bytes = 4096, .units = 4, .program_bytes = 32}, 4096, 3 * 4096 - 1024},
      Variant{{.unit_bytes = 8192, .units = 3, .program_bytes = 64}, 4096, 12'345},
      Variant{{.unit_bytes = 16'384, .units = 3, .program_bytes = 16}, 2048, 20'001},
  };
  for (const Variant& v : kVariants) {
    const std::uint32_t slot_bytes = v.geometry.unit_bytes * v.geometry.units;
    const auto image = [&](std::string version, std::uint8_t slot, std::uint32_t body_bytes) {
      return firmware::fake::make_image({.version = std::move(version),
                                         .counter = 1,
                                         .slot = slot,
                                         .slot_bytes = slot_bytes,
                                         .body_bytes = body_bytes});
    };
    auto cast = std::make_shared<Cast>(Cast{.geometry = v.geometry,
                                            .chunk = v.chunk,
                                            .old_image = image("1.0.0", 0, v.body_bytes - 700),
                                            .spare = image("0.9.0", 1, v.body_bytes - 99),
                                            .new_image = image("2.0.0", 1, v.body_bytes)});
    const auto add = [&](std::string name, Act act, bool with_spare) {
      scenarios.push_back(std::make_unique<UpdateScenario>(cast, std::move(name), act, with_spare));
    };
    add("download", Act::kDownload, false);
    add("download-over-old", Act::kDownload, true);
    add("resume", Act::kResume, false);
    add("trial", Act::kTrial, false);
    add("revert", Act::kRevert, false);
    add("whole", Act::kWhole, true);
  }
}

}  // namespace scatter::power_cuts
