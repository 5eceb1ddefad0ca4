// A carrier that changes, drops, repeats or adds frames on their way: makes a good device break one rule.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "host_sdk/device/transport.h"
#include "protocol/frame.h"
#include "protocol/link_decoder.h"

namespace scatter::conformance_test {

using Bytes = std::vector<std::byte>;

/// A frame on its way, open to change; it gets good checksums again.
struct Passing {
  protocol::FrameHeader header;
  Bytes payload;

  [[nodiscard]] protocol::MessageId id() const noexcept { return header.id(); }
  /// Changes the payload as message M; false when it is another.
  template <protocol::Message M, typename Change>
  bool change(Change&& how) {
    if (id() != M::kId) {
      return false;
    }
    auto message = protocol::decode<M>(std::span<const std::byte>(payload));
    if (!message) {
      return false;
    }
    how(*message);
    Bytes out(protocol::encoded_size(*message));
    (void)protocol::encode(*message, std::span(out));
    payload = std::move(out);
    return true;
  }
  [[nodiscard]] Bytes bytes() const;
};

/// What happens to one frame: the frames that take its place, in order (none: it is dropped).
using Tamper = std::function<std::vector<Passing>(Passing)>;

struct Tampering {
  Tamper to_host;    ///< Empty: unchanged.
  Tamper to_device;  ///< Empty: unchanged. Bytes that are no frame pass as they are.
};

[[nodiscard]] std::unique_ptr<device::Transport> tampered(std::unique_ptr<device::Transport> inner,
                                                          const Tampering& tampering);

}  // namespace scatter::conformance_test
