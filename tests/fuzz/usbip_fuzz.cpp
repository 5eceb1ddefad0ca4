// Any bytes from a USB/IP client. Promises: the requests do not depend on the cutting, and a reader keeps no
// more than what has arrived; every transfer ends once, by RET_SUBMIT or by RET_UNLINK with ECONNRESET, and
// every unlink once; a RET_UNLINK with 0 comes behind the RET_SUBMIT; data is as long as announced and as the
// buffer allows.
#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <map>
#include <span>
#include <variant>
#include <vector>

#include "simulator/usbip/exported_device.h"
#include "simulator/usbip/usbip_protocol.h"
#include "tests/fuzz/require.h"
#include "tests/unit/simulator_usbip/scripted_port.h"

using scatter::fuzz::require;

using namespace scatter::simulator;
using namespace scatter::simulator::usbip;

namespace {

struct Seen {
  std::vector<Request> requests;
  std::string problem;
  friend bool operator==(const Seen&, const Seen&) = default;
};

Seen read(std::span<const std::byte> bytes, bool transfers, std::size_t piece) {
  RequestReader reader;
  if (transfers) {
    reader.start_transfers();
  }
  Seen seen;
  std::size_t given = 0;
  std::size_t got = 0;
  while (!bytes.empty() && !reader.broken()) {
    auto part = bytes.first(std::min(bytes.size(), piece));
    bytes = bytes.subspan(part.size());
    given += part.size();
    while (auto request = reader.next(part)) {
      if (const auto* urb = std::get_if<SubmitUrb>(&*request)) {
        got += urb->data.size();
        require((urb->endpoint & 0x80U) != 0 ? urb->data.empty() : urb->data.size() == urb->length);
        require(urb->length <= kMostTransferBytes);
      }
      seen.requests.push_back(std::move(*request));
      require(seen.requests.size() * 8 + got <= given);  // Nothing comes from nothing.
    }
    require(part.empty() || reader.broken());
  }
  seen.problem = reader.problem();
  return seen;
}

std::uint32_t field(const Reply& reply, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    value = value << 8U | std::to_integer<std::uint32_t>(reply.header[at + k]);
  }
  return value;
}

/// The client's book of what it is owed.
class Ledger {
 public:
  void submitted(const SubmitUrb& urb) { transfers_.insert_or_assign(urb.sequence, urb.length); }
  void unlinked(const UnlinkUrb& urb) {
    ++unlinks_[urb.sequence], victims_[urb.sequence].push_back(urb.victim);
  }
  [[nodiscard]] bool under_way(std::uint32_t sequence) const { return transfers_.contains(sequence); }

  void said(const Reply& reply) {
    const std::uint32_t sequence = field(reply, 4);
    const auto status = static_cast<std::int32_t>(field(reply, 20));
    if (field(reply, 0) == 3) {
      const auto transfer = transfers_.find(sequence);
      require(transfer != transfers_.end());
      require(field(reply, 24) <= transfer->second || transfer->second == 0);
      require(reply.data.empty() || reply.data.size() == field(reply, 24));
      transfers_.erase(transfer);
      return;
    }
    require(field(reply, 0) == 4 && reply.data.empty());
    require(unlinks_[sequence]-- > 0);
    const std::uint32_t victim = victims_[sequence].front();
    victims_[sequence].erase(victims_[sequence].begin());
    if (status == 0) {
      require(!under_way(victim));
    } else {
      require(status == -ECONNRESET && transfers_.erase(victim) == 1);
    }
  }
  void balance() const {
    require(transfers_.empty());
    for (const auto& [sequence, count] : unlinks_) {
      require(count == 0);
    }
  }

 private:
  std::map<std::uint32_t, std::size_t> transfers_;
  std::map<std::uint32_t, int> unlinks_;
  std::map<std::uint32_t, std::vector<std::uint32_t>> victims_;
};

void converse(const std::vector<Request>& requests) {
  ScriptedPort port;
  ExportedDevice device(port, UsbBusSpeed::kHigh);
  do {
    port.enumerate();
  } while (device.poll());
  require(device.import("1-1") == OpStatus::kOk);
  Ledger ledger;
  const auto hear = [&] {
    device.poll();
    while (const auto reply = device.next_reply()) {
      ledger.said(*reply);
    }
  };
  for (const Request& each : requests) {
    // Device ids are rarely guessed; here all are right, so that the conversation goes on.
    if (const auto* urb = std::get_if<SubmitUrb>(&each)) {
      SubmitUrb mine = *urb;
      mine.device = 0x10002;
      hear();
      const bool twice = ledger.under_way(mine.sequence);
      const std::uint8_t deed = mine.setup[7];
      const std::size_t length = mine.length;
      const bool to_host = (mine.endpoint & 0x80U) != 0;
      if (!twice) {
        ledger.submitted(mine);
      }
      require(device.submit(std::move(mine)).empty() != twice);
      if (twice) {
        break;  // The connection ends here; what was under way is settled below.
      }
      port.moved_before_cancel = to_host ? std::min<std::size_t>(length, deed >> 4U) : 0;
      if (!port.transfers.empty() && (deed & 3U) != 0) {
        const auto outcome = (deed & 3U) == 1   ? UsbOutcome::kDone
                             : (deed & 3U) == 2 ? UsbOutcome::kStalled
                                                : UsbOutcome::kBabble;
        const bool data = outcome == UsbOutcome::kDone && (port.transfers.back().endpoint & 0x80U) != 0;
        port.complete(
            port.transfers.back().id, outcome,
            std::vector<std::byte>(data ? std::min<std::size_t>(port.transfers.back().length, deed) : 0));
      }
    } else if (const auto* unlink = std::get_if<UnlinkUrb>(&each)) {
      UnlinkUrb mine = *unlink;
      mine.device = 0x10002;
      port.moved_before_cancel = 0;
      ledger.unlinked(mine);
      require(device.unlink(mine).empty());
    }
  }
  while (!port.transfers.empty()) {
    port.complete(port.transfers.front().id, UsbOutcome::kDone);
  }
  hear();
  ledger.balance();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  for (const bool transfers : {false, true}) {
    const Seen whole = read(bytes, transfers, size + 1);
    require(whole == read(bytes, transfers, 1));
    require(whole == read(bytes, transfers, 1 + size % 61));
    if (transfers) {
      converse(whole.requests);
    }
  }
  return 0;
}
