// vm_throughput [FRAMES [SIDE [TURNS]]]: the SDK's stream against a bare libusb loop on the same instrument,
// in turns: bytes per second and processor time per megabyte of each. The bare loop keeps as many transfers
// under way and looks at nothing but sequence numbers; both must see every wire frame. Rates are printed, not
// promised; where the scheduler puts the threads moves a single turn by a fifth, so take many short ones.
#include <libusb.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <optional>
#include <vector>

#include "protocol/endian.h"
#include "protocol/frame.h"
#include "protocol/schema_description.h"
#include "protocol/session.h"
#include "protocol/usb_identity.h"
#include "tests/vm/host.h"

using namespace scatter;
namespace identity = protocol::usb;

namespace {

constexpr int kTransfers = 16;
constexpr unsigned kPatience_ms = 5000;

double processor_s() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

struct Sample {
  double bytes = 0;
  double wall_s = 0;
  double processor_s = 0;
  [[nodiscard]] double megabytes_per_s() const { return bytes * 1e-6 / wall_s; }
  [[nodiscard]] double ms_per_megabyte() const { return processor_s * 1e3 / (bytes * 1e-6); }
};

class Meter {
 public:
  [[nodiscard]] Sample read(double bytes) const {
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin_;
    return {.bytes = bytes, .wall_s = wall.count(), .processor_s = processor_s() - processor_begin_};
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  double processor_begin_ = processor_s();
};

protocol::Recipe recipe(std::uint16_t frames, std::uint16_t side) {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(100);
  recipe.repeats = frames;
  recipe.region_width = recipe.region_height = side;
  recipe.test_pattern = 1;
  return recipe;
}

/// Just enough of a host to make the instrument stream.
class Bare {
 public:
  Bare() = default;
  Bare(const Bare&) = delete;
  Bare& operator=(const Bare&) = delete;
  ~Bare() {
    if (handle_ != nullptr) {
      libusb_release_interface(handle_, identity::kStreamInterface);
      libusb_close(handle_);
    }
    if (context_ != nullptr) {
      libusb_exit(context_);
    }
  }

  [[nodiscard]] std::optional<Sample> run(std::uint16_t frames, std::uint16_t side) {
    if (libusb_init(&context_) != 0) {
      return complain("libusb does not start");
    }
    handle_ = libusb_open_device_with_vid_pid(context_, identity::kVendorId, identity::kProductId);
    if (handle_ == nullptr || libusb_claim_interface(handle_, identity::kStreamInterface) != 0 ||
        libusb_set_interface_alt_setting(handle_, identity::kStreamInterface, identity::kStreamOpenSetting) !=
            0) {
      return complain("the instrument does not open");
    }
    protocol::Hello hello;
    hello.schema_digest = protocol::schema_digest();
    if (!ask<protocol::HelloReply>(hello)) {
      return complain("no answer to HELLO");
    }
    const auto accepted =
        ask<protocol::ConfigurationAccepted>(protocol::SetConfiguration{.recipe = recipe(frames, side)});
    if (!accepted) {
      return complain("the recipe is refused");
    }
    frames_wanted_ = frames;
    const Meter meter;
    // All frames at once: nothing has to be sent while they come.
    if (!send(protocol::Start{.epoch = accepted->epoch, .may_send_until = frames})) {
      return complain("START is not taken");
    }
    stream();
    const Sample sample = meter.read(bytes_);
    if (frames_seen_ != frames_wanted_ || missing_.missing() != 0) {
      fmt::print("the bare loop saw {} of {} frames, {} wire frames missing\n", frames_seen_, frames_wanted_,
                 missing_.missing());
      return std::nullopt;
    }
    return sample;
  }

 private:
  static std::nullopt_t complain(const char* what) {
    fmt::print("bare loop: {}\n", what);
    return std::nullopt;
  }

  template <protocol::Message M>
  bool send(const M& message) {
    protocol::FrameHeader header;
    header.session = kSession;
    header.sequence = sequence_.next(header.channel);
    header.correlation = ++correlation_;
    std::vector<std::byte> out(protocol::kMaxFrameBytes);
    const auto size = static_cast<int>(protocol::write_message(std::span(out), header, message));
    int sent = 0;
    return libusb_bulk_transfer(handle_, identity::kBulkOut, reinterpret_cast<unsigned char*>(out.data()),
                                size, &sent, kPatience_ms) == 0 &&
           sent == size;
  }

  /// One wire frame to a transfer.
  template <protocol::Message Reply, protocol::Message Request>
  std::optional<Reply> ask(const Request& request) {
    if (!send(request)) {
      return std::nullopt;
    }
    std::vector<std::byte> in(identity::kTransferBytes);
    for (int k = 0; k < 100; ++k) {
      int size = 0;
      if (libusb_bulk_transfer(handle_, identity::kBulkIn, reinterpret_cast<unsigned char*>(in.data()),
                               static_cast<int>(in.size()), &size, kPatience_ms) != 0) {
        return std::nullopt;
      }
      const auto parsed = protocol::parse_frame(std::span(in).first(static_cast<std::size_t>(size)));
      if (parsed.frame && parsed.header.correlation == correlation_) {
        if (auto reply = parsed.frame->template as<Reply>()) {
          return reply;
        }
      }
    }
    return std::nullopt;
  }

  static void LIBUSB_CALL completed(libusb_transfer* transfer) {
    auto& self = *static_cast<Bare*>(transfer->user_data);
    if (transfer->status == LIBUSB_TRANSFER_COMPLETED && transfer->actual_length > 0) {
      self.arrived(reinterpret_cast<const std::byte*>(transfer->buffer), transfer->actual_length);
    } else if (transfer->status != LIBUSB_TRANSFER_COMPLETED) {
      self.over_ = true;
    }
    if (self.over_ || libusb_submit_transfer(transfer) != 0) {
      --self.under_way_;
    }
  }

  void arrived(const std::byte* at, int size) {
    bytes_ += size;
    protocol::FrameHeader header;
    header.channel = protocol::load_le<protocol::Channel>(at + 3);
    header.message = protocol::load_le<std::uint16_t>(at + 6);
    header.sequence = protocol::load_le<std::uint32_t>(at + 12);
    missing_.arrived(header);
    frames_seen_ += header.id() == protocol::MessageId::kFrameEnd ? 1 : 0;
    over_ = over_ || frames_seen_ == frames_wanted_;
  }

  void stream() {
    std::vector<std::vector<unsigned char>> buffers(kTransfers,
                                                    std::vector<unsigned char>(identity::kTransferBytes));
    std::vector<libusb_transfer*> transfers;
    for (auto& buffer : buffers) {
      libusb_transfer* transfer = libusb_alloc_transfer(0);
      libusb_fill_bulk_transfer(transfer, handle_, identity::kBulkIn, buffer.data(),
                                static_cast<int>(buffer.size()), completed, this, 0);
      transfers.push_back(transfer);
      under_way_ += libusb_submit_transfer(transfer) == 0 ? 1 : 0;
    }
    bool cancelled = false;
    while (under_way_ > 0) {
      if (over_ && !cancelled) {
        cancelled = true;
        for (auto* transfer : transfers) {
          libusb_cancel_transfer(transfer);
        }
      }
      timeval pause{.tv_sec = 0, .tv_usec = 100'000};
      libusb_handle_events_timeout_completed(context_, &pause, nullptr);
    }
    for (auto* transfer : transfers) {
      libusb_free_transfer(transfer);
    }
  }

  static constexpr std::uint16_t kSession = 0x5CA7;
  libusb_context* context_ = nullptr;
  libusb_device_handle* handle_ = nullptr;
  protocol::SequenceCounters sequence_;
  protocol::SequenceTracker missing_;
  std::uint16_t correlation_ = 0;
  int under_way_ = 0;
  bool over_ = false;
  double bytes_ = 0;
  int frames_seen_ = 0;
  int frames_wanted_ = 0;
};

std::optional<Sample> sdk_run(std::uint16_t frames, std::uint16_t side) {
  const auto host = vm::Host::make();
  if (!host) {
    (void)vm::report(host.error());
    return std::nullopt;
  }
  auto device = host->open("usb:");
  if (!device) {
    (void)vm::report(device.error());
    return std::nullopt;
  }
  if (const auto configured = device->configure(recipe(frames, side)); !configured) {
    (void)vm::report(configured.error());
    return std::nullopt;
  }
  const Meter meter;
  auto stream = device->start({.recorder = nullptr, .credit_window = 64});
  if (!stream) {
    (void)vm::report(stream.error());
    return std::nullopt;
  }
  std::optional<Sample> sample;
  for (int seen = 0;;) {
    const auto frame = stream->next();
    if (!frame) {
      (void)vm::report(frame.error());
      return std::nullopt;
    }
    if (!*frame) {
      break;
    }
    if (++seen == frames) {
      sample = meter.read(static_cast<double>(stream->summary().link.bytes));
    }
  }
  const auto summary = stream->summary();
  if (!summary.ledger.balances() || summary.ledger.delivered != frames) {
    fmt::print("the SDK's stream delivered {} of {} frames\n", summary.ledger.delivered, frames);
    return std::nullopt;
  }
  fmt::print("  bytes copied to put wire frames together: {} of {}; the device waited {} ms for credit\n",
             summary.link.copied_bytes, summary.link.bytes, summary.held_us / 1000);
  return sample;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

}  // namespace

int main(int count, char** words) {
  const auto frames = static_cast<std::uint16_t>(count > 1 ? std::atoi(words[1]) : 60);
  const auto side = static_cast<std::uint16_t>(count > 2 ? std::atoi(words[2]) : 512);
  const int turns = count > 3 ? std::atoi(words[3]) : 3;
  std::vector<double> ratios;
  std::vector<double> bare_rates;
  std::vector<double> bare_costs;
  std::vector<double> rates;
  std::vector<double> costs;
  for (int turn = 0; turn < turns; ++turn) {
    const auto bare = Bare().run(frames, side);
    const auto ours = sdk_run(frames, side);
    if (!bare || !ours) {
      return 1;
    }
    fmt::print("bare libusb {:.1f} MB/s, {:.2f} ms of processor per MB; SDK {:.1f} MB/s, {:.2f} ms per MB\n",
               bare->megabytes_per_s(), bare->ms_per_megabyte(), ours->megabytes_per_s(),
               ours->ms_per_megabyte());
    ratios.push_back(ours->megabytes_per_s() / bare->megabytes_per_s());
    bare_rates.push_back(bare->megabytes_per_s());
    bare_costs.push_back(bare->ms_per_megabyte());
    rates.push_back(ours->megabytes_per_s());
    costs.push_back(ours->ms_per_megabyte());
  }
  fmt::print(
      "@@NOTE the SDK's stream runs at {:.0f} % of a bare libusb loop (medians of {} turns of {} frames of "
      "{} x {}: {:.1f} and {:.1f} MB/s, {:.2f} and {:.2f} ms of processor per MB)\n",
      median(ratios) * 100, turns, frames, side, side, median(rates), median(bare_rates), median(costs),
      median(bare_costs));
  return 0;
}
