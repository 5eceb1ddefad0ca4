#include "host_sdk/device/usb/context.h"

#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "host_sdk/device/usb/bulk_link.h"
#include "host_sdk/device/usb/event_loop.h"
#include "host_sdk/device/usb/notifier.h"
#include "host_sdk/device/usb/selection.h"
#include "host_sdk/device/usb/usb_transport.h"

namespace scatter::device::usb {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// A device that has just come is in the system's tables before libusb knows it and udev has opened its node.
constexpr auto kArrivesWithin = 500ms;
/// One that is just leaving may be in them in part.
constexpr auto kLeavesWithin = 60ms;
constexpr auto kBetweenTries = 20ms;

bool fresh(const BusEntry& entry) {
  struct stat node{};
  if (::stat(entry.node().c_str(), &node) != 0) {
    return true;  // Not made yet.
  }
  const auto changed = std::chrono::system_clock::from_time_t(node.st_ctim.tv_sec);
  return std::chrono::system_clock::now() - changed < 2s;
}

/// How long after the first try an error may be one of the moment.
Clock::duration settling_time(ErrorCode code, const Result<BusEntry>& entry) {
  switch (code) {
    case ErrorCode::kDisconnected:
      return kArrivesWithin;
    case ErrorCode::kPermissionDenied:
      return entry && fresh(*entry) ? Clock::duration(kArrivesWithin) : Clock::duration();
    case ErrorCode::kUnavailable:
    case ErrorCode::kFailedPrecondition:
      return kLeavesWithin;
    default:
      return {};
  }
}

}  // namespace

struct Context::State {
  State(std::shared_ptr<EventLoop> events, const ContextOptions& wanted)
      : loop(std::move(events)), options(wanted) {}
  ~State() { end(); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  /// Lets go of everything that was opened; idempotent.
  void end() {
    std::vector<std::weak_ptr<BulkLink>> opened;
    {
      const std::lock_guard lock(mutex);
      if (std::exchange(ended, true)) {
        return;
      }
      opened.swap(links);
    }
    for (const std::weak_ptr<BulkLink>& link : opened) {
      if (const auto alive = link.lock()) {
        alive->abandon();
      }
    }
    notifier->stop();
  }

  [[nodiscard]] Result<std::unique_ptr<Transport>> open(const Uri& uri, const Wait& wait);

  const std::shared_ptr<EventLoop> loop;
  const std::shared_ptr<Notifier> notifier = std::make_shared<Notifier>();
  const ContextOptions options;
  std::mutex mutex;
  bool ended = false;
  std::vector<std::weak_ptr<BulkLink>> links;
};

Result<std::unique_ptr<Transport>> Context::State::open(const Uri& uri, const Wait& wait) {
  const Result<Selector> wanted = read_selector(uri);
  if (!wanted) {
    return std::unexpected(wanted.error());
  }
  const auto begin = Clock::now();
  const auto deadline = begin + std::chrono::duration_cast<Clock::duration>(wait.timeout);
  for (;;) {
    if (wait.stop.stop_requested()) {
      return fail(ErrorCode::kAborted, uri.text() + ": opening was stopped", "start again when ready");
    }
    const Result<BusEntry> entry = select(scan_bus(), *wanted);
    Result<std::shared_ptr<BulkLink>> link =
        entry ? BulkLink::open(loop, *entry, options.transfers, deadline, wait.stop)
              : Result<std::shared_ptr<BulkLink>>(std::unexpected(entry.error()));
    if (link) {
      const std::lock_guard lock(mutex);
      if (ended) {
        (*link)->abandon();
      }
      std::erase_if(links, [](const auto& one) { return one.expired(); });
      links.push_back(*link);
      return std::make_unique<UsbTransport>(std::move(*link));
    }
    if (Clock::now() >= std::min(deadline, begin + settling_time(link.error().code, entry))) {
      return std::unexpected(std::move(link.error()));
    }
    std::this_thread::sleep_for(kBetweenTries);
  }
}

Result<Context> Context::make(const ContextOptions& options) {
  if (options.transfers < 16 || options.transfers > 64) {
    return fail(ErrorCode::kInvalidArgument,
                "usb: " + std::to_string(options.transfers) + " transfers under way, allowed are 16 to 64",
                "choose a number in between");
  }
  Result<std::shared_ptr<EventLoop>> loop = EventLoop::make();
  if (!loop) {
    return std::unexpected(std::move(loop.error()));
  }
  return Context(std::make_shared<State>(std::move(*loop), options));
}

Context::Context(std::shared_ptr<State> state) noexcept : state_(std::move(state)) {}
Context::Context(Context&&) noexcept = default;
Context& Context::operator=(Context&& other) noexcept {
  if (this != &other) {
    if (state_ != nullptr) {
      state_->end();
    }
    state_ = std::move(other.state_);
  }
  return *this;
}
Context::~Context() {
  if (state_ != nullptr) {
    state_->end();
  }
}

Result<std::unique_ptr<Transport>> Context::open(const Uri& uri, const Wait& wait) const {
  return state_->open(uri, wait);
}

void Context::add_scheme(TransportRegistry& registry) const {
  registry.add(
      {.name = "usb",
       .example = "usb: or usb:serial=SC42",
       .summary = "instrument on this computer's USB",
       .open = [state = state_](const Uri& uri, const Wait& wait) -> Result<std::unique_ptr<Transport>> {
         {
           const std::lock_guard lock(state->mutex);
           if (state->ended) {
             return fail(ErrorCode::kFailedPrecondition, uri.text() + ": the program's USB context is gone",
                         "keep the context as long as instruments are opened");
           }
         }
         return state->open(uri, wait);
       }});
}

Watch Context::watch(std::function<void(const Change&)> changed, bool present) const {
  auto entry = std::make_shared<Subscription>();
  entry->changed = std::move(changed);
  if (!present) {
    entry->known = scan_bus();
    std::erase_if(entry->known, [](const BusEntry& one) { return !one.ours; });
  }
  // The hint may come from the event thread after this context is gone.
  (void)state_->loop->hint_changes([weak = std::weak_ptr(state_->notifier)] {
    if (const auto notifier = weak.lock()) {
      notifier->hint();
    }
  });
  (void)state_->notifier->add(entry);
  return Watch(std::move(entry));
}

void add_usb_scheme(TransportRegistry& registry, const ContextOptions& options) {
  struct Lazy {
    std::mutex mutex;
    std::unique_ptr<Context> context;
  };
  registry.add({.name = "usb",
                .example = "usb: or usb:serial=SC42",
                .summary = "instrument on this computer's USB",
                .open = [lazy = std::make_shared<Lazy>(), options](
                            const Uri& uri, const Wait& wait) -> Result<std::unique_ptr<Transport>> {
                  {
                    const std::lock_guard lock(lazy->mutex);
                    if (lazy->context == nullptr) {
                      Result<Context> made = Context::make(options);
                      if (!made) {
                        return std::unexpected(std::move(made.error()));
                      }
                      lazy->context = std::make_unique<Context>(std::move(*made));
                    }
                  }
                  return lazy->context->open(uri, wait);
                }});
}

}  // namespace scatter::device::usb
