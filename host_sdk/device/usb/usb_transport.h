// usb: as a Transport. Internal to this folder.
#pragma once

#include <memory>

#include "host_sdk/device/transport.h"
#include "host_sdk/device/usb/bulk_link.h"

namespace scatter::device::usb {

/// Real time; threads and waits as Transport.
class UsbTransport final : public Transport {
 public:
  explicit UsbTransport(std::shared_ptr<BulkLink> link) noexcept : link_(std::move(link)) {}
  ~UsbTransport() override { close(); }

  [[nodiscard]] Result<std::span<const std::byte>> receive(TimePoint deadline,
                                                           const std::stop_token& stop) override;
  [[nodiscard]] Status write(std::span<const std::byte> bytes, TimePoint deadline,
                             const std::stop_token& stop) override;
  [[nodiscard]] TimePoint now() const override;
  [[nodiscard]] std::uint64_t system_time_unix_ns() const override;
  void close() noexcept override { link_->close(); }
  [[nodiscard]] std::vector<Notice> notices() const override { return link_->notices(); }
  [[nodiscard]] CarrierStatistics statistics() const override { return link_->statistics(); }

 private:
  std::shared_ptr<BulkLink> link_;
};

}  // namespace scatter::device::usb
