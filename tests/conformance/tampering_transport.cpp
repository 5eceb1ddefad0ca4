#include "tests/conformance/tampering_transport.h"

#include <algorithm>

namespace scatter::conformance_test {

namespace {

/// Frames of one direction, one after the other. Bytes that are no frame are handed on.
class Lane {
 public:
  explicit Lane(Tamper tamper) : tamper_(std::move(tamper)) {}

  Bytes pass(std::span<const std::byte> bytes) {
    if (!tamper_) {
      return {bytes.begin(), bytes.end()};
    }
    held_.insert(held_.end(), bytes.begin(), bytes.end());
    Bytes out;
    std::size_t at = 0;
    while (at < held_.size()) {
      const auto parsed = protocol::parse_frame(std::span<const std::byte>(held_).subspan(at));
      if (parsed.status == protocol::ParseStatus::kNeedMore) {
        break;
      }
      if (parsed.frame) {
        const auto payload = parsed.frame->payload();
        for (const Passing& frame :
             tamper_({.header = parsed.frame->header(), .payload = Bytes(payload.begin(), payload.end())})) {
          const Bytes whole = frame.bytes();
          out.insert(out.end(), whole.begin(), whole.end());
        }
      } else {
        out.insert(out.end(), held_.begin() + std::ptrdiff_t(at),
                   held_.begin() + std::ptrdiff_t(at + parsed.consumed));
      }
      at += parsed.consumed;
    }
    held_.erase(held_.begin(), held_.begin() + std::ptrdiff_t(at));
    return out;
  }

 private:
  Tamper tamper_;
  Bytes held_;
};

class TamperingTransport final : public device::Transport {
 public:
  TamperingTransport(std::unique_ptr<device::Transport> inner, const Tampering& tampering)
      : inner_(std::move(inner)), to_host_(tampering.to_host), to_device_(tampering.to_device) {}

  Result<std::span<const std::byte>> receive(device::TimePoint deadline,
                                             const std::stop_token& stop) override {
    do {
      const auto bytes = inner_->receive(deadline, stop);
      if (!bytes) {
        return bytes;
      }
      lent_ = to_host_.pass(*bytes);
    } while (lent_.empty());
    return lent_;
  }
  Status write(std::span<const std::byte> bytes, device::TimePoint deadline,
               const std::stop_token& stop) override {
    const Bytes passed = to_device_.pass(bytes);
    return passed.empty() ? Status() : inner_->write(passed, deadline, stop);
  }
  device::TimePoint now() const override { return inner_->now(); }
  std::uint64_t system_time_unix_ns() const override { return inner_->system_time_unix_ns(); }
  void close() noexcept override { inner_->close(); }

 private:
  std::unique_ptr<device::Transport> inner_;
  Lane to_host_;
  Lane to_device_;
  Bytes lent_;
};

}  // namespace

Bytes Passing::bytes() const {
  Bytes out(protocol::kFrameOverhead + payload.size());
  out.resize(protocol::write_frame(std::span(out), header, payload));
  return out;
}

std::unique_ptr<device::Transport> tampered(std::unique_ptr<device::Transport> inner,
                                            const Tampering& tampering) {
  return std::make_unique<TamperingTransport>(std::move(inner), tampering);
}

}  // namespace scatter::conformance_test
