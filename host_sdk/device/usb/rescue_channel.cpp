#include "host_sdk/device/usb/rescue_channel.h"

#include <algorithm>
#include <atomic>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "host_sdk/device/usb/hid_thread.h"
#include "host_sdk/device/usb/rescue_target.h"
#include "protocol/codec.h"

namespace scatter::device::usb {
namespace {

using protocol::RescueAnswer;
using protocol::RescueCommand;
using std::chrono::milliseconds;

/// After this long a question is asked again, or another way is tried.
constexpr milliseconds kPatience{250};
/// A lost status report is made up for by the feature report this often.
constexpr milliseconds kButtonCheck{1000};
constexpr const char* kSameRelease =
    "bring both to one release: scatter flash for the firmware, your package manager for this program";

SteadyTime deadline_of(const Wait& wait) {
  // A caller may pass the largest duration there is.
  constexpr Duration kLongest = std::chrono::hours(24 * 365);
  return std::chrono::steady_clock::now() +
         std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::min(wait.timeout, kLongest));
}

const char* name_of(RescueCommand command) {
  switch (command) {
    case RescueCommand::kStatus:
      return "status";
    case RescueCommand::kAbort:
      return "abort";
    case RescueCommand::kReboot:
      return "reboot";
    case RescueCommand::kFaultRecord:
      return "fault record";
  }
  return "request";
}

const HeardAnswer* find_answer(const HidPort& port, RescueCommand command, std::uint8_t tag,
                               std::uint16_t offset) {
  const auto it = std::ranges::find_if(port.answers, [&](const HeardAnswer& each) {
    return each.answer.tag == tag && each.answer.command == command && each.answer.offset == offset;
  });
  return it == port.answers.end() ? nullptr : &*it;
}

Error answer_error(std::string_view who, RescueCommand command, protocol::StatusCode status) {
  const protocol::StatusInfo& row = protocol::info(status);
  const bool known = row.code == status;
  return {known ? static_cast<ErrorCode>(status) : ErrorCode::kInternal,
          std::string(who) + " answered " + name_of(command) + " with " +
              (known ? std::string(row.name) : std::to_string(static_cast<unsigned>(status))),
          known ? std::string(row.remedy) : "update the host's software"};
}

}  // namespace

struct RescueChannel::State {
  std::shared_ptr<HidThread> thread = HidThread::shared();
  std::shared_ptr<HidPort> port;
  std::string who;
  std::atomic<std::uint8_t> next_tag = 0;

  explicit State(std::string name) : who(std::move(name)) {
    // Every program that holds the node open sees every answer: tags must differ between them.
    next_tag = static_cast<std::uint8_t>(std::random_device()());
  }
  ~State() {
    if (port) {
      thread->close(port);
    }
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  [[nodiscard]] std::unexpected<Error> ended(Waited how, std::string_view doing) const {
    switch (how) {
      case Waited::kStopped:
        return fail(ErrorCode::kAborted, std::string(doing) + ": stopped", "start again when ready");
      case Waited::kGone:
        return fail(ErrorCode::kDisconnected, who + " was unplugged or restarted",
                    "plug it in, then open it again");
      case Waited::kDone:
      case Waited::kDeadline:
        break;
    }
    return fail(ErrorCode::kDeadlineExceeded, std::string(doing) + ": " + who + " did not answer in time",
                "unplug it and plug it in again");
  }

  [[nodiscard]] static Result<RescueChannel> open(std::string_view serial, std::string_view socket,
                                                  const Wait& wait);
  [[nodiscard]] Result<RescueAnswer> ask(RescueCommand command, std::uint16_t offset, SteadyTime deadline,
                                         const std::stop_token& stop);
  [[nodiscard]] Result<protocol::RescueStatus> feature_status(SteadyTime deadline,
                                                              const std::stop_token& stop);
  [[nodiscard]] Result<protocol::RescueStatus> status(SteadyTime deadline, const std::stop_token& stop);
};

Result<RescueChannel> RescueChannel::State::open(std::string_view serial, std::string_view socket,
                                                 const Wait& wait) {
  const SteadyTime deadline = deadline_of(wait);
  const auto entry = choose_rescue_target(serial, socket);
  if (!entry) {
    return std::unexpected(entry.error());
  }
  auto state = std::make_unique<State>(rescue_label(*entry));
  std::vector<std::string> nodes;
  for (const auto& node : entry->hidraw) {
    nodes.push_back(node.string());
  }
  std::string path;
  Waited waited = state->thread->find(entry->port, nodes, path, deadline, wait.stop);
  if (waited == Waited::kDone && path.empty()) {
    return rescue_without_node(*entry);
  }
  if (waited == Waited::kDone) {
    waited = state->thread->open(path, state->port, deadline, wait.stop);
  }
  if (waited != Waited::kDone) {
    return state->ended(waited, "opening the rescue channel");
  }
  if (!state->port) {
    return rescue_not_opened(*entry, path);
  }
  return RescueChannel(std::move(state));
}

/// Sends a request and waits for the answer with its tag.
Result<RescueAnswer> RescueChannel::State::ask(RescueCommand command, std::uint16_t offset,
                                               SteadyTime deadline, const std::stop_token& stop) {
  const bool question = command == RescueCommand::kStatus || command == RescueCommand::kFaultRecord;
  const std::uint8_t tag = next_tag++;
  protocol::Report report{};
  protocol::encode(protocol::RescueRequest{.command = command, .tag = tag, .offset = offset}, report);
  RescueAnswer answer;
  const auto arrived = [&](const HidPort& seen) {
    const HeardAnswer* const heard = find_answer(seen, command, tag, offset);
    if (heard != nullptr) {
      answer = heard->answer;
    }
    return heard != nullptr;
  };
  while (true) {
    bool sent = false;
    Waited waited = thread->send(port, report, sent, deadline, stop);
    if (waited == Waited::kDone && !sent) {
      return fail(ErrorCode::kUnavailable, who + " does not take reports on its HID interface",
                  "unplug it and plug it in again");
    }
    if (waited == Waited::kDone) {
      const SteadyTime until = std::chrono::steady_clock::now() + kPatience;
      waited = thread->listen(port, arrived, question ? std::min(until, deadline) : deadline, stop);
    }
    if (waited == Waited::kDone) {
      break;
    }
    if (waited != Waited::kDeadline || std::chrono::steady_clock::now() >= deadline) {
      return ended(waited, name_of(command));
    }
  }
  if (answer.status != protocol::StatusCode::kOk) {
    return std::unexpected(answer_error(who, command, answer.status));
  }
  return answer;
}

Result<protocol::RescueStatus> RescueChannel::State::feature_status(SteadyTime deadline,
                                                                    const std::stop_token& stop) {
  std::optional<protocol::Report> report;
  if (const Waited waited = thread->feature(port, report, deadline, stop); waited != Waited::kDone) {
    return ended(waited, "status");
  }
  const auto status = report ? protocol::decode_rescue_status(*report) : std::nullopt;
  if (!status) {
    return fail(ErrorCode::kUnavailable,
                report ? who + " gave a feature report that is no status of version " +
                             std::to_string(protocol::kRescueVersion)
                       : who + " answers neither on its interrupt pipe nor on its control pipe",
                report ? kSameRelease : "unplug it and plug it in again");
  }
  return *status;
}

Result<protocol::RescueStatus> RescueChannel::State::status(SteadyTime deadline,
                                                            const std::stop_token& stop) {
  const std::uint8_t tag = next_tag++;
  protocol::Report request{};
  protocol::encode(protocol::RescueRequest{.command = RescueCommand::kStatus, .tag = tag, .offset = 0},
                   request);
  bool sent = false;
  Waited waited = thread->send(port, request, sent, deadline, stop);
  if (waited == Waited::kDone && sent) {
    protocol::RescueStatus status;
    const SteadyTime until = std::chrono::steady_clock::now() + kPatience;
    waited = thread->listen(
        port,
        [&](const HidPort& seen) {
          // One that comes before the answer may have waited in the instrument since before the request.
          const HeardAnswer* const heard = find_answer(seen, RescueCommand::kStatus, tag, 0);
          if (heard == nullptr || seen.statuses <= heard->statuses) {
            return false;
          }
          status = *seen.newest;
          return true;
        },
        std::min(until, deadline), stop);
    if (waited == Waited::kDone) {
      return status;
    }
  }
  if (waited == Waited::kStopped || waited == Waited::kGone) {
    return ended(waited, "status");
  }
  return feature_status(deadline, stop);
}

RescueChannel::RescueChannel(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
RescueChannel::RescueChannel(RescueChannel&&) noexcept = default;
RescueChannel& RescueChannel::operator=(RescueChannel&&) noexcept = default;
RescueChannel::~RescueChannel() = default;

Result<RescueChannel> RescueChannel::open(std::string_view serial, const Wait& wait) {
  return State::open(serial, "", wait);
}

Result<RescueChannel> RescueChannel::open_at(std::string_view port, const Wait& wait) {
  return State::open("", port, wait);
}

Result<protocol::RescueStatus> RescueChannel::status(const Wait& wait) {
  return state_->status(deadline_of(wait), wait.stop);
}

Status RescueChannel::abort(const Wait& wait) {
  const auto answer = state_->ask(RescueCommand::kAbort, 0, deadline_of(wait), wait.stop);
  return answer ? Status() : std::unexpected(answer.error());
}

Status RescueChannel::reboot(const Wait& wait) {
  const auto answer = state_->ask(RescueCommand::kReboot, 0, deadline_of(wait), wait.stop);
  if (!answer && answer.error().code != ErrorCode::kDisconnected) {
    return std::unexpected(answer.error());
  }
  return {};
}

Result<protocol::FaultRecord> RescueChannel::fault_record(const Wait& wait) {
  const SteadyTime deadline = deadline_of(wait);
  std::vector<std::byte> bytes;
  std::uint16_t total = 0;
  while (true) {
    const auto part = state_->ask(RescueCommand::kFaultRecord, static_cast<std::uint16_t>(bytes.size()),
                                  deadline, wait.stop);
    if (!part) {
      return std::unexpected(part.error());
    }
    if (part->total == 0) {
      return protocol::FaultRecord{};
    }
    if (!bytes.empty() && part->total != total) {
      bytes.clear();  // Another record than the one begun.
      continue;
    }
    total = part->total;
    const std::size_t size = std::min<std::size_t>(part->size, part->bytes.size());
    bytes.insert(bytes.end(), part->bytes.begin(), part->bytes.begin() + size);
    if (bytes.size() >= total) {
      break;
    }
    if (size == 0) {
      return fail(ErrorCode::kDataLoss,
                  state_->who + ": the fault record ends after " + std::to_string(bytes.size()) + " of " +
                      std::to_string(total) + " bytes",
                  "ask again; if it stays so, update the firmware");
    }
  }
  const auto record = protocol::decode<protocol::FaultRecord>(std::span<const std::byte>(bytes));
  if (!record) {
    return fail(
        ErrorCode::kDataLoss,
        state_->who + ": the fault record of " + std::to_string(bytes.size()) + " bytes cannot be read",
        kSameRelease);
  }
  return *record;
}

Status RescueChannel::wait_for_button(const Wait& wait) {
  const SteadyTime deadline = deadline_of(wait);
  const auto now = state_->status(deadline, wait.stop);
  if (!now) {
    return std::unexpected(now.error());
  }
  const auto left = std::chrono::duration_cast<Duration>(deadline - std::chrono::steady_clock::now());
  return wait_for_button(*now, {.timeout = std::max(left, Duration()), .stop = wait.stop});
}

Status RescueChannel::wait_for_button(const protocol::RescueStatus& since, const Wait& wait) {
  const SteadyTime deadline = deadline_of(wait);
  const auto pressed = [&](const protocol::RescueStatus& now) {
    // The newest report kept may be older than `since`: counts only grow.
    return static_cast<std::int32_t>(now.boot_count - since.boot_count) > 0 ||
           (now.boot_count == since.boot_count &&
            static_cast<std::int32_t>(now.button_presses - since.button_presses) > 0);
  };
  std::optional<protocol::RescueStatus> last;
  while (!last || !pressed(*last)) {
    const SteadyTime until = std::min(deadline, std::chrono::steady_clock::now() + kButtonCheck);
    const Waited waited = state_->thread->listen(
        state_->port,
        [&](const HidPort& seen) {
          last = seen.newest;
          return last && pressed(*last);
        },
        until, wait.stop);
    if (waited == Waited::kDone) {
      break;
    }
    if (waited != Waited::kDeadline) {
      return state_->ended(waited, "waiting for the button");
    }
    if (std::chrono::steady_clock::now() >= deadline) {
      return fail(ErrorCode::kDeadlineExceeded, "nobody pressed the button of " + state_->who + " in time",
                  "press the measure button on the instrument, or wait longer");
    }
    const auto asked = state_->feature_status(deadline, wait.stop);
    if (!asked) {
      return std::unexpected(asked.error());
    }
    last = *asked;
  }
  if (last->boot_count != since.boot_count) {
    return fail(ErrorCode::kDisconnected, state_->who + " restarted", "open it again, then press the button");
  }
  return {};
}

}  // namespace scatter::device::usb
