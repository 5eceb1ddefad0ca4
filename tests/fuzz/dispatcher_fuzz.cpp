// Drives the whole firmware by arbitrary bytes: requests with any id and payload, damaged and raw bytes,
// time, a host that does not read, unplugging, new sessions, sensor faults. After every poll:
// - the ledger of the run adds up: exposed = lost + sent + at most one frame in hand;
// - an idle instrument is dark and its sensor released;
// - flash is never programmed over what was written, and the slot of the running image is not touched.
// What the device sends is always whole frames. No request gets a second final reply; where nothing
// disturbed the session each one gets exactly one.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <vector>

#include "firmware/core/instrument.h"
#include "tests/fuzz/input.h"
#include "tests/unit/firmware/fake_board.h"
#include "tests/unit/firmware/test_images.h"

using scatter::fuzz::Input;

namespace {

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

void require(bool good, const char* promise) {
  if (!good) {
    std::fprintf(stderr, "broken promise: %s\n", promise);
    std::abort();
  }
}

class Session {
 public:
  Session() : ports_(board_.ports()) {
    board_.link.capacity = 6'000;
    slots_.supply.power_on();
    slots_.install(running_image(), {{MarkKind::kConfirmed, 1}});
    slots_.runs = 0;
    ports_.image_slots = &slots_;
    ports_.verifier = &verifier_;
    instrument_ = std::make_unique<Instrument>(ports_);
  }
  static const Image& running_image() {
    static const Image image = make_image({.version = "1.0.0", .slot = 0, .body_bytes = 700});
    return image;
  }
  static const Image& new_image() {
    static const Image image = make_image({.version = "2.0.0", .slot = 1, .body_bytes = 5000});
    return image;
  }
  explicit Session(bool with_stage) : Session() {
    board_.with_stage = with_stage;
    ports_.reference_stage = with_stage ? &board_.stage : nullptr;
    instrument_ = std::make_unique<Instrument>(ports_);
  }

  void raw(std::span<const std::byte> bytes) {
    board_.link.to_device.insert(board_.link.to_device.end(), bytes.begin(), bytes.end());
    disturbed_ = disturbed_ || !bytes.empty();
  }
  void request(std::uint16_t id, std::span<const std::byte> payload, Channel channel = Channel::kControl) {
    FrameHeader header;
    header.channel = channel;
    header.message = id;
    header.session = nonce_;
    if (channel == Channel::kControl) {
      header.correlation = ++correlation_;
      if (id < 0x8000) {
        finals_[{nonce_, correlation_}] = 0;
      }
    }
    disturbed_ = disturbed_ || id == static_cast<std::uint16_t>(MessageId::kReboot);
    if (id == static_cast<std::uint16_t>(MessageId::kHello)) {
      disturbed_ = true;
    }
    std::vector<std::byte> bytes(payload.size() + kFrameOverhead);
    (void)write_frame(bytes, header, payload);
    board_.link.to_device.insert(board_.link.to_device.end(), bytes.begin(), bytes.end());
  }
  template <scatter::protocol::Message M>
  void request(const M& message) {
    std::vector<std::byte> payload(encoded_size(message));
    (void)encode(message, payload);
    request(static_cast<std::uint16_t>(M::kId), payload);
  }
  /// HELLO with a new nonce.
  void hello() {
    ++nonce_;
    const bool before = disturbed_;
    request(Hello{});
    disturbed_ = before || nonce_ > 1;
  }
  void poll(int times) {
    for (int i = 0; i < times; ++i) {
      step_ = instrument_->poll();
      check();
      take();
    }
  }
  void advance(std::uint64_t us) {
    const std::uint64_t end = board_.clock.time_us + us;
    for (int i = 0; i < 3'000; ++i) {
      step_ = instrument_->poll();
      check();
      const bool took = take();
      if (step_.did_work || took) {
        continue;
      }
      if (board_.clock.time_us >= end) {
        return;
      }
      board_.clock.time_us = std::min(end, std::max(step_.wake_at_us, board_.clock.time_us + 1));
    }
  }
  void finish() {
    reading_ = true;
    board_.link.attached = true;
    request(Abort{});  // A run may be long; its requests must be answered all the same.
    for (int i = 0; i < 5; ++i) {
      advance(3'000'000);
    }
    require(decoder_.counters().skipped_bytes == 0, "the device sends nothing but whole frames");
    for (const auto& [key, count] : finals_) {
      require(count <= 1, "no request gets a second final reply");
      require(disturbed_ || count == 1, "every request gets its reply");
    }
  }

  FakeBoard& board() { return board_; }
  void unplug() {
    board_.link.attached = false;
    poll(2);
    board_.link.to_host.clear();
    decoder_.reset();
    board_.link.attached = true;
    disturbed_ = true;
  }
  bool reading_ = true;

 private:
  void check() {
    const RunReport& r = instrument_->run_report();
    const std::uint64_t known = r.ledger.lost_sensor + r.ledger.lost_firmware + r.frames_sent;
    const bool idle = instrument_->run_state() == RunState::kIdle;
    require(r.ledger.exposed >= known && r.ledger.exposed - known <= (idle ? 0U : 1U), "the ledger adds up");
    require(!idle || (board_.optics.lit == Illuminator::kNone && !board_.optics.busy), "idle is dark");
    require(board_.flash.violations == 0, "flash is programmed once");
    require(slots_.violations() == 0, "slots are programmed once");
    require(slots_.parts[0].erases(0) == 1, "the running image is not erased");
    require(step_.did_work || step_.wake_at_us <= board_.clock.time_us + kLongestSleepUs, "wakes in time");
  }
  bool take() {
    if (!reading_ || board_.link.to_host.empty()) {
      return false;
    }
    decoder_.push(board_.link.to_host, [this](const Frame& frame) {
      const FrameHeader& h = frame.header();
      if (h.channel != Channel::kControl) {
        return;
      }
      const auto status = frame.as<StatusReply>();
      const auto found = finals_.find({h.session, h.correlation});
      if (found != finals_.end() && !(status && status->status == StatusCode::kPending)) {
        ++found->second;
      }
    });
    board_.link.to_host.clear();
    return true;
  }

  FakeBoard board_;
  TestSlots slots_;
  RememberingVerifier verifier_;
  Ports ports_;
  std::unique_ptr<Instrument> instrument_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(kMaxFrameBytes);
  LinkDecoder decoder_{buffer_};
  Step step_;
  std::uint16_t nonce_ = 0;
  std::uint16_t correlation_ = 0;
  bool disturbed_ = false;
  std::map<std::pair<std::uint16_t, std::uint16_t>, int> finals_;
};

/// A recipe that is often valid, so that runs happen.
Recipe recipe_from(Input& input) {
  Recipe recipe;
  for (int i = input.byte() % 4; i >= 0; --i) {
    recipe.illuminations.push_back(input.byte() % 13);
  }
  recipe.exposures_us.push_back(10U + input.word());
  recipe.exposure_mode = static_cast<ExposureMode>(input.byte() % 2);
  recipe.repeats = input.byte() % 4;
  recipe.off_frames = input.byte() % 3;
  recipe.time_budget_us = 1'000'000U * (input.byte() % 8);
  recipe.region_width = input.byte() % 66;
  recipe.region_height = input.byte() % 50;
  recipe.pixel_format = static_cast<PixelFormat>(input.byte() % 4);
  recipe.live_preview = input.byte() % 2;
  recipe.test_pattern = input.byte() % 2;
  return recipe;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 4096) {
    return 0;
  }
  Input input(data, size);
  Session session((input.byte() & 1U) != 0);
  session.hello();
  session.poll(4);
  while (!input.empty()) {
    switch (input.byte() % 15) {
      case 0:
        session.raw(input.some(input.byte()));
        break;
      case 1: {
        const std::uint16_t id = input.byte() % 32;  // Update and fault record requests among them.
        session.request(id, input.some(input.byte()));
        break;
      }
      case 2:
        session.request(input.word(), input.some(input.byte()), static_cast<Channel>(input.byte() % 4));
        break;
      case 3:
        session.request(SetConfiguration{.recipe = recipe_from(input)});
        break;
      case 4: {
        const std::uint8_t epoch = input.byte() % 4;
        session.request(Start{.epoch = epoch, .may_send_until = input.byte()});
        break;
      }
      case 5:
        session.advance(std::uint64_t{input.word()} * 16);
        break;
      case 6:
        session.poll(input.byte() % 16);
        break;
      case 7:
        session.reading_ = !session.reading_;
        break;
      case 8:
        input.byte() < 64 ? session.unplug() : session.request(Stop{});
        break;
      case 9:
        session.request(Abort{});
        break;
      case 10:
        session.hello();
        break;
      case 12: {
        UpdateBegin begin;
        for (std::size_t i = 0; i < begin.header.size(); ++i) {
          begin.header[i] = static_cast<std::uint8_t>(Session::new_image().header_bytes[i]);
        }
        if (input.byte() % 4 == 0) {
          begin.header[input.byte()] ^= input.byte();
        }
        session.request(begin);
        session.poll(input.byte() % 8);
        break;
      }
      case 13: {
        UpdateWrite write;
        const std::uint32_t chunks = input.byte() % 8;
        write.offset = input.byte() % 8 * 960;
        const std::span<const std::byte> body(Session::new_image().body);
        const std::uint32_t left = write.offset < 5000 ? 5000 - write.offset : 0;
        write.data = left > 0 ? body.subspan(write.offset, std::min(left, chunks * 960)) : body.first(7);
        session.request(write);
        break;
      }
      case 14:
        input.byte() % 2 == 0 ? session.request(UpdateFinish{}) : session.request(UpdateStatus{});
        break;
      case 11:
        session.board().optics.fail_reads = input.byte() % 5;
        session.board().optics.broken = input.byte() % 8 == 0;
        break;
    }
    session.poll(1);
  }
  session.finish();
  return 0;
}
